"""Reports: one HTML file that works offline."""
