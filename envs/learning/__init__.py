"""Learning to drive, and saying how well somebody drives."""
