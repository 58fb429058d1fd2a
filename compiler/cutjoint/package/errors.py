"""The errors that are reported to users: one class of all, and beneath it a class for each stage.

Errors that several folders raise stand here, every other class in the folder that raises it.
"""


class CutjointError(Exception):
    """An error that its user can mend; the text says where and how."""


class RunError(CutjointError, ValueError):
    """A run was asked for that the model, the scene or the method cannot do."""


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


class ToolchainError(CutjointError, RuntimeError):
    """The C++ side is missing something or refused the code, or the cache cannot be written."""


class MissingToolsError(ToolchainError):
    """A tool that makes code is not installed."""


def plural(count: int, noun: str, many: str = "") -> str:
    """A number and its noun."""
    return f"{count} {noun if count == 1 else many or noun + 's'}"
