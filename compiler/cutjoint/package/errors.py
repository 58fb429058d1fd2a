"""The errors that are told to users: one class of all, and beneath it a class for each stage.

`EquationsError` stands here, since several folders raise it; every other class stands in the folder that raises it.
"""


class CutjointError(Exception):
    """An error that its user can mend; the text says where and how."""


class EquationsError(CutjointError):
    """The equations of a model have no solution, or not in floating-point numbers."""


class MissingPartialsError(EquationsError):
    """A derivative is needed that the code of a function does not have.  ``function`` is its name."""

    def __init__(self, function: str, *, second: bool = False) -> None:
        remedy = "write them into its code and 'partials: true' into the model, or use the method recursive"
        first = f"has no partial derivatives, which are needed here; {remedy}"
        last = "has no second derivatives, which are needed here; use the method recursive"
        super().__init__(f"function '{function}': {last if second else first}")
        self.function = function
