"""Simulations that a program holds: stepping, linearising and many at once from Python, on the C interface of a compiled model."""
