"""cutjoint: a model compiler for multibody dynamics."""
