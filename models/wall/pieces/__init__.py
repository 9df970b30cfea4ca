"""A wall of convex pieces: cut, decomposed, cleared, measured, stored."""
