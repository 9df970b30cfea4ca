"""Backends that step a compiled scene."""
