"""The errors that are told to users: one class of all, and beneath it a class for each stage.

`EquationsError` stands here, since several folders raise it; every other class stands in the folder that raises it.
"""


class CutjointError(Exception):
    """An error that its user can mend; the text says where and how."""


class EquationsError(CutjointError):
    """The equations of a model have no solution, or not in floating-point numbers."""


def missing_partials(name: str, *, second: bool = False) -> str:
    """The message for a derivative that the code of a function does not have."""
    if second:
        return f"function '{name}': second derivatives are needed here, and a supplied function has none; use the method recursive"
    remedy = "write them into its code and 'partials: true' into the model, or use the method recursive"
    return f"function '{name}' has no partial derivatives, which are needed here; {remedy}"
