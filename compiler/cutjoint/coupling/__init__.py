"""A model coupled with a controller that is an FMU: its description and instances by FMPy, what is connected, the run of both."""
