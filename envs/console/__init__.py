"""Hands on: devices driven live by persons, drivers and policies, recorded, shown in a browser and replayed."""
