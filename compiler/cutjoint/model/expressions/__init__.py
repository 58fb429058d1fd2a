"""Expressions of a model file: names, units, laws and parameters, as SymPy and as numbers."""
