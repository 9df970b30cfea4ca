"""Engines that step a compiled scene."""
