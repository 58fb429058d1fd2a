"""The names that a model may give its elements.  Names reach generated code, so they are C++ identifiers."""

from __future__ import annotations

import re

from cutjoint.model.operations import FUNCTIONS

MAX_NAME_LENGTH = 64

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

# fmt: off
CPP_KEYWORDS = frozenset((
    "alignas", "alignof", "and", "and_eq", "asm", "auto", "bitand", "bitor", "bool", "break", "case",
    "catch", "char", "char8_t", "char16_t", "char32_t", "class", "compl", "concept", "const", "consteval",
    "constexpr", "constinit", "const_cast", "continue", "co_await", "co_return", "co_yield", "decltype",
    "default", "delete", "do", "double", "dynamic_cast", "else", "enum", "explicit", "export", "extern",
    "false", "float", "for", "friend", "goto", "if", "import", "inline", "int", "long", "module",
    "mutable", "namespace", "new", "noexcept", "not", "not_eq", "nullptr", "operator", "or", "or_eq",
    "private", "protected", "public", "register", "reinterpret_cast", "requires", "return", "short",
    "signed", "sizeof", "static", "static_assert", "static_cast", "struct", "switch", "template", "this",
    "thread_local", "throw", "true", "try", "typedef", "typeid", "typename", "union", "unsigned", "using",
    "virtual", "void", "volatile", "wchar_t", "while", "xor", "xor_eq",
))

#: Names that compilers and headers of C++ give a meaning of their own, often as macros.
CPP_MACROS = frozenset((
    "EOF", "INFINITY", "NAN", "NULL", "assert", "errno", "i386", "linux", "main", "std", "stderr",
    "stdin", "stdout", "unix",
))
# fmt: on

#: Names that mean something else in every expression or in the laws, and so cannot be a parameter's.
VARIABLES = ("length", "rate", "travel", "position", "x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "t")
RESERVED_IN_EXPRESSIONS = frozenset({"pi", *FUNCTIONS, *VARIABLES})


def name_problem(name: str) -> tuple[str, str] | None:
    """The fault in an element's name and its remedy, or None."""
    if not _NAME.fullmatch(name):
        return f"'{name[:70]}' is not a name", "use letters, digits and underscores, starting with a letter"
    if len(name) > MAX_NAME_LENGTH:
        return f"the name '{name[:20]}...' is longer than {MAX_NAME_LENGTH} characters", "shorten it"
    if "__" in name:
        return f"the name '{name}' has a double underscore", f"write '{re.sub('__+', '_', name)}'"
    if name in CPP_KEYWORDS or name in CPP_MACROS:
        return f"the name '{name}' has a meaning of its own in C++", f"write for example '{name}_1'"
    if name == "ground":
        return "the name 'ground' belongs to the fixed world", "choose another name"
    return None


def parameter_name_problem(name: str) -> tuple[str, str] | None:
    """The fault in a parameter's name and its remedy, or None; it must not hide a function or a variable of laws either."""
    if name in RESERVED_IN_EXPRESSIONS:
        return f"the name '{name}' has a meaning of its own in expressions", f"write for example '{name}_0'"
    return name_problem(name)
