"""Equations of embedded loops: dependent coordinates by series, and the elimination of their bodies at once."""
