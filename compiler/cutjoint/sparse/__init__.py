"""The sparse stage: static factorisation of a matrix whose pattern is known when the compiler runs.  Knows no mechanics."""
