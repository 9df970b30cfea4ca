"""Equilibrium of a scope without stepping time: residual and stiffness of a serial chain, and Newton's method."""
