"""Files that nobody should have to read, made at random from a seed, and read in child processes with limits."""
