"""The description of a system in natural coordinates for its generic solver, part by part."""
