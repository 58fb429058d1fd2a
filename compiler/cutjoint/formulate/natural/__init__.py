"""The Lagrangian formulations in natural coordinates: points and unit vectors that bodies share (Garcia de Jalon, Bayo 1994)."""
