"""Designs × conditions → rows, that survive anything."""
