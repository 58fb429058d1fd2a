"""Joint kernels, derived by SymPy: the motions of tree joints, the conditions of cut joints, and the directions of both."""
