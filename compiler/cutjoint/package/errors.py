"""The errors that are told to users: one class of all, and beneath it a class for each stage.

`EquationsError` stands here, since several folders raise it; every other class stands in the folder that raises it.
"""


class CutjointError(Exception):
    """An error that its user can mend; the text says where and how."""


class EquationsError(CutjointError):
    """The equations of a model have no solution, or not in floating-point numbers."""
