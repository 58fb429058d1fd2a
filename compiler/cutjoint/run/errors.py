"""The error of runs."""


class RunError(ValueError):
    """A run was asked for that the model, the scene or the method cannot do."""
