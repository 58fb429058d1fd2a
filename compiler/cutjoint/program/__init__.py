"""The program stage: typed blocks, their lowering to scalars, and interpreters of both, independent of mechanics."""
