"""Mechanisms on screen: poses over time as an animated scene, in glTF and as a self-contained page."""
