"""Generators of the files that follow from others: `scripts/regenerate` writes them all."""
