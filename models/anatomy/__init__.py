"""CT, mesh, points or recipe in; a `Colon` out."""
