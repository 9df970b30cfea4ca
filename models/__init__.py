"""What is simulated: files and numbers in, one MjSpec out. Nothing here steps physics."""
