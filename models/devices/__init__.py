"""Devices that can be put into a scene."""
