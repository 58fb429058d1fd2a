"""What follows from the rows of integrators: a header of the runtime, and tables of docs."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from scripts.derived.element_tables import DOCS, table, written

from cutjoint.compile.c_export import linearised_methods
from cutjoint.methods import INTEGRATORS, METHODS, Integrator

ROOT = Path(__file__).resolve().parents[2]

#: The columns of the header: the drivers that have an integrator.
ASKED: Mapping[str, Callable[[Integrator], bool]] = {
    "recursive": lambda i: "recursive" in i.methods,
    "lagrangian": lambda i: any(METHODS[name].has_system for name in i.methods),
    "generic": lambda i: i.has_generic,
}


def pages() -> Mapping[Path, str]:
    """The files by their paths."""
    return {
        ROOT / "runtime/include/cutjoint/integrator_table.hpp": header(),
        DOCS / "reference/integrators.md": written("reference/integrators.md", rules()),
    }


def identifier(name: str) -> str:
    """The name of C++."""
    return name.replace("-", "_")


def of_class(name: str) -> str:
    """A macro over the integrators that are instances of a class of C++."""
    classes = {i.name: steps.name for i in INTEGRATORS.values() for steps in i.steps.values() if steps.name.startswith(f"{name}<")}
    return " ".join(f"X({identifier(name)}, {re.split(r'[ :]', of_core)[-1].removesuffix('>')})" for name, of_core in classes.items())


def header() -> str:
    """The header with a row an integrator."""
    row = ", ".join
    marks = {i.name: row(str(ask(i)).lower() for ask in ASKED.values()) for i in INTEGRATORS.values()}
    rows = "\n".join(f'    IntegratorRow{{"{name}", {of_row}}},' for name, of_row in marks.items())
    return f"""// Integrators, a row each: `make regenerate` writes this file from INTEGRATORS of compiler/cutjoint/methods.py.
#pragma once

#include <array>
#include <string_view>

/// X(name, table) of those that are `ExplicitSteps` of a table, and X(name, whether steps are as long as errors allow) of `RadauSteps`.
#define CUTJOINT_EXPLICIT_INTEGRATORS(X) {of_class("ExplicitSteps")}
#define CUTJOINT_RADAU_INTEGRATORS(X) {of_class("RadauSteps")}

namespace cutjoint {{

enum class Integrator {{ {row(map(identifier, INTEGRATORS))}, added }};

/// The name in run files, and which drivers have it.
struct IntegratorRow {{
  std::string_view name;
  bool {row(ASKED)};
}};

/// In the order of `Integrator`, without those that are added.
inline constexpr std::array integrator_rows{{
{rows}
}};

}}  // namespace cutjoint
"""


def rules() -> str:
    """The table of all integrators."""
    head = ("name", "methods", "steps", "order", "events by default", "derivatives", "several runs at once", "notes")
    return table(*head, rows=map(rule, INTEGRATORS.values()))


def rule(i: Integrator) -> tuple[str, ...]:
    """The row of an integrator."""
    derived = tuple(method for method in i.steps if method in linearised_methods())
    methods, derivatives = ("all" if len(names) == len(METHODS) else marked(names) for names in (i.methods, derived))
    return (
        f"`{i.name}`", methods, "adaptive" if i.adaptive else "`dt`", i.order, str(i.events),
        "no" if not derived else "yes" if derived == i.methods else derivatives, "yes" if i.batch else "no", i.about,
    )  # fmt: skip


def marked(names: Iterable[str]) -> str:
    """Names as code."""
    return ", ".join(f"`{name}`" for name in names)
