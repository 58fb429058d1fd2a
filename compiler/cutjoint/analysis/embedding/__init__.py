"""Closed loops as explicit functions of an independent coordinate: which loops can be, and the functions."""
