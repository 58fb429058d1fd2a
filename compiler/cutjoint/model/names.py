"""The names that a model may give its elements.  They become parts of names in generated code, so words of C++ are names like others."""

import re
from collections.abc import Collection
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


def name_problem(name: str, reserved: Collection[str] = ()) -> tuple[str, str] | None:
    """The fault in the name of an element, or of what must not hide a ``reserved`` name, and its remedy, or None."""
    if name in reserved:
        return f"the name '{name}' has a meaning of its own in expressions", f"write for example '{name}_0'"
    if not _NAME.fullmatch(name):
        return f"'{name[:70]}' is not a name", "use letters, digits and underscores, starting with a letter"
    if len(name) > MAX_NAME_LENGTH:
        return f"the name '{name[:20]}...' is longer than {MAX_NAME_LENGTH} characters", "shorten it"
    if "__" in name:
        return f"the name '{name}' has a double underscore", f"write '{re.sub('__+', '_', name)}'"
    if name == "ground":
        return "the name 'ground' belongs to the fixed world", "choose another name"
    return None
