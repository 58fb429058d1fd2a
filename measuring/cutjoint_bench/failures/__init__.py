"""Failures of methods: outcomes over a grid, and situations that are known to be hard."""
