"""The description of a system in natural coordinates for its generic twin, part by part."""
