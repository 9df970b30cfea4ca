"""Gas in the colon: the law that opens it, and how gas moves through it."""
