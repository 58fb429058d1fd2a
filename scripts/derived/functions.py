"""The functions of one number as a list of C++, with the derivatives that their rows have."""

from __future__ import annotations

from cutjoint.ops import OPERATIONS
from cutjoint.program.differentiate import Calculus


class Text:
    """Scalars as expressions of C++ in an algebra of such."""

    def number(self, value: float) -> str:
        """A constant."""
        return repr(value)

    def add(self, a: str, b: str) -> str:
        """a + b."""
        return f"({a} + {b})"

    def sub(self, a: str, b: str) -> str:
        """a - b."""
        return f"({a} - {b})"

    def neg(self, a: str) -> str:
        """-a."""
        return f"-{a}"

    def mul(self, a: str, b: str) -> str:
        """a b."""
        return f"{a} * {b}"

    def call(self, function: str, *args: str) -> str:
        """A function's value."""
        return f"({args[0]} / {args[1]})" if function == "div" else f"{function}({args[0].removeprefix('(').removesuffix(')')})"


def header() -> str:
    """The header with all of them."""
    rows = [row for row in OPERATIONS.values() if row.smooth and row.arity == 1]
    lines = []
    for row in rows:
        assert row.partials is not None
        (derivative,) = row.partials(Calculus(Text()), "y", "x")  # type: ignore[type-var]
        lines.append(f"  X({row.name}, {derivative})")
    return """// Functions of one number x with value y: `make regenerate` writes this file from the rows of compiler/cutjoint/ops.py.
#pragma once

/// X(name, derivative) of those that namespace std has by the same name.
#define CUTJOINT_FUNCTIONS(X) \\
""" + " \\\n".join(lines) + "\n"
