"""Makers of pages, figures and files that the project ships."""
