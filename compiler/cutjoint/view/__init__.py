"""Mechanisms on screen: poses over time as an animated scene, in glTF and as a page that needs nothing else."""
