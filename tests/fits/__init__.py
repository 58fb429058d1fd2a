"""Fits of numbers of models to measurements."""
