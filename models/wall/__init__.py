"""A `Colon` in; convex pieces with their measured error out."""
