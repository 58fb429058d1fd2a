"""Analyses of a formulated model without compiling it."""
