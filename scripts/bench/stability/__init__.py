"""Whether simulations stay stable: random settings, shocks, poisoned inputs, laws of physics, long runs, escapes."""
