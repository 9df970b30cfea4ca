"""Whether simulations stay stable: random settings, shocks, NaN and Inf in inputs, laws of physics, long runs."""
