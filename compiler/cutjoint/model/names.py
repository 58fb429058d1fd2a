"""The names that a model may give its elements.  They become parts of names in generated code, so words of C++ are names like others."""

import re
from keyword import kwlist

from cutjoint.model.expressions.operations import FUNCTIONS

MAX_NAME_LENGTH = 64

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

#: The variables of laws.
VARIABLES = ("length", "rate", "travel", "position", "x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "t")
#: Names that mean something else in every expression, and so cannot be a parameter's.
RESERVED_EVERYWHERE = frozenset({"pi", "t", *FUNCTIONS, *kwlist})
#: Names that mean something else in every expression or in the laws, and so cannot be that of a part of a law, a state or a signal.
RESERVED_IN_EXPRESSIONS = frozenset({*RESERVED_EVERYWHERE, *VARIABLES})


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
    """The fault in a parameter's name and its remedy, or None; it must not hide a function or the time either."""
    return _reserved(name, RESERVED_EVERYWHERE) or name_problem(name)


def term_name_problem(name: str) -> tuple[str, str] | None:
    """The fault in the name of a law's part, state or signal, and its remedy, or None; it must not hide a law's variable."""
    return _reserved(name, RESERVED_IN_EXPRESSIONS) or name_problem(name)


def _reserved(name: str, reserved: frozenset[str]) -> tuple[str, str] | None:
    if name in reserved:
        return f"the name '{name}' has a meaning of its own in expressions", f"write for example '{name}_0'"
    return None
