"""A model coupled with controllers that are FMUs: their descriptions and instances by FMPy, the connections, the run."""
