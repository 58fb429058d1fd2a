"""Sweeps: studies, objectives, tables, clusters and pages."""
