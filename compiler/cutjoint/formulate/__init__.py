"""The formulation stage: symbolic mechanics.  SymPy derives the small kernels, the block IR holds the whole model."""
