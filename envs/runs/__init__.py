"""One run from start to end: drive, measure, score, outcome."""
