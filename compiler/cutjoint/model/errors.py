"""Problems in a model file: collected while reading and raised together, each with its place and a remedy."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cutjoint.elements.terms import Span
from cutjoint.model.text import printable
from cutjoint.package.errors import CutjointError

if TYPE_CHECKING:
    from cutjoint.model.records import Model

MAX_PROBLEMS = 1000  #: the number of noted problems before reading ends; those of several instances at one place count each
MAX_COMPARED = 500  #: options that a wrong name is compared with


@dataclass(frozen=True)
class Problem:
    """A problem in a model file: its place, its element, a message, and a hint at a remedy."""

    span: Span
    element: str
    message: str
    hint: str = ""

    def __str__(self) -> str:
        text = f"{self.span}: {self.element}: {self.message}"
        return f"{text}; {self.hint}" if self.hint else text


class ModelError(CutjointError):
    """A model file that cannot be used.

    ``problems`` are all problems, in the file's order. ``model`` is the part that could be read, if later stages can check its graph of
    bodies and joints, else None.
    """

    def __init__(self, problems: Iterable[Problem], model: "Model | None" = None) -> None:
        self.problems: tuple[Problem, ...] = tuple(sorted(problems, key=lambda problem: problem.span))
        self.model = model
        super().__init__("\n".join(map(str, self.problems)))


class Problems:
    """Collects problems.  The same message at the same place counts once, however many instances share it."""

    def __init__(self) -> None:
        self._found: dict[tuple[Span, str], Problem] = {}
        self._count = 0
        self.notes: dict[str, None] = {}

    def add(self, span: Span, element: str, message: str, hint: str = "") -> None:
        """Note one problem. Raises ModelError: there are more than MAX_PROBLEMS, each of which takes time."""
        self._count += 1
        if self._count > MAX_PROBLEMS:
            message, hint = "there may be more problems than these", "mend these first"
            self._found[span, message] = Problem(span=span, element="file", message=message, hint=hint)
            raise self.error()
        problem = Problem(span=span, element=printable(element), message=printable(message), hint=printable(hint))
        self._found.setdefault((span, message), problem)

    def note(self, span: Span, message: str) -> None:
        """Keep a warning."""
        self.notes[printable(f"{span}: {message}")] = None

    def __bool__(self) -> bool:
        return bool(self._found)

    def error(self, model: "Model | None" = None) -> ModelError:
        """All problems noted so far, to be raised, with the ``model`` whose graph can still be judged."""
        return ModelError(self._found.values(), model)


class IgnoredProblems(Problems):
    """Ignores problems that another reading reports."""

    def add(self, span: Span, element: str, message: str, hint: str = "") -> None:
        """Forget a problem."""


def worded(field: str, message: str) -> str:
    """A message about a field: "mass needs kg", or "mass: unknown symbol 'm'"."""
    if not field:
        return message
    return f"{field} {message}" if message.startswith(("needs ", "has ")) else f"{field}: {message}"


def nearest(word: str, options: Iterable[str], what: str = "choose from") -> str:
    """A hint: the option nearest to ``word``, or the list of options."""
    known = sorted({*options})
    matches = difflib.get_close_matches(word[:100], known[:MAX_COMPARED], n=1)
    if matches:
        return f"did you mean '{matches[0]}'?"
    shown = ", ".join(known[:20]) + (", ..." if len(known) > 20 else "")
    return f"{what}: {shown}" if known else ""
