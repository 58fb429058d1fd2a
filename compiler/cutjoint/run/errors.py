"""The error of runs."""

from cutjoint.package.errors import CutjointError


class RunError(CutjointError, ValueError):
    """A run was asked for that the model, the scene or the method cannot do."""
