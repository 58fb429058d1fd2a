"""The names that a model may give its elements.  They become parts of names in generated code, so words of C++ are names like others."""

from __future__ import annotations

import re
from keyword import kwlist

from cutjoint.model.operations import FUNCTIONS

MAX_NAME_LENGTH = 64

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

#: Names that mean something else in every expression or in the laws, and so cannot be a parameter's.
VARIABLES = ("length", "rate", "travel", "position", "x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "t")
RESERVED_IN_EXPRESSIONS = frozenset({"pi", *FUNCTIONS, *VARIABLES, *kwlist})


def name_problem(name: str) -> tuple[str, str] | None:
    """The fault in an element's name and its remedy, or None."""
    if not _NAME.fullmatch(name):
        return f"'{name[:70]}' is not a name", "use letters, digits and underscores, starting with a letter"
    if len(name) > MAX_NAME_LENGTH:
        return f"the name '{name[:20]}...' is longer than {MAX_NAME_LENGTH} characters", "shorten it"
    if "__" in name:
        return f"the name '{name}' has a double underscore", f"write '{re.sub('__+', '_', name)}'"
    if name == "ground":
        return "the name 'ground' belongs to the fixed world", "choose another name"
    return None


def parameter_name_problem(name: str) -> tuple[str, str] | None:
    """The fault in a parameter's name and its remedy, or None; it must not hide a function or a variable of laws either."""
    if name in RESERVED_IN_EXPRESSIONS:
        return f"the name '{name}' has a meaning of its own in expressions", f"write for example '{name}_0'"
    return name_problem(name)
