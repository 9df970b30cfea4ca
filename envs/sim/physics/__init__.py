"""Laws of the scope that every backend shares: each one function of numpy or jax.numpy, for any number of worlds."""
