"""Joint kernels, derived by SymPy: what tree joints free, what cut joints hold, and the directions that these need."""
