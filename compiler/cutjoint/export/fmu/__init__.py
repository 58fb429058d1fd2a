"""Models as FMUs for co-simulation: variables and their dependencies, the description, the layer over the C interface, the archive."""
