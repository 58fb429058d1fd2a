"""The shape of a model file: its fields, their checks and the places of their values."""
