"""Finite-element reference of a tread pressed on tissue by a strut: the source of the stored force tables."""
