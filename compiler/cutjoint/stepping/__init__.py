"""Simulations driven from Python, one or many at once, by the C interface of a compiled model."""
