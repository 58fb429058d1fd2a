"""The equations of a program, element by element in the order of its sweeps; elements of one form are explained once."""

import re
from collections.abc import Iterable, Iterator, Sequence

from cutjoint.formulate.inputs import discrete_state_name
from cutjoint.formulate.records import SAMPLE, Equations
from cutjoint.report.explain.formulas import Formulas, words
from cutjoint.report.explain.views import Counterparts, Entry, code

#: The functions whose equations are printed; the others solve, check and report with the same blocks.
_FUNCTIONS = ("evaluate", "dynamic_residual", "constraint_residual", "guard", "scene_inputs", "sample")

#: What differs between elements of one form: names, numbers of unnamed blocks, numbers.
_OWN = re.compile(r"\\text\{ [^}]* \}|x_\{\d+|\d+(?:\.\d+)?")

_ROW = r" \cr "

#: The lines of one element in a sweep.
Lines = tuple[str, list[str]]


def printed(equations: Equations) -> Formulas:
    """The formulas of what a step computes."""
    return Formulas(equations, (block for f in equations.functions if f.name in _FUNCTIONS for block in f.results.values()))


def explain_equations(equations: Equations, counterparts: Sequence[Sequence[Counterparts]]) -> dict[str, list[Entry]]:
    """The entries of each sweep; of elements that play the same part in isomorphic subtrees, or have one form, the first is printed."""
    formulas, sections = printed(equations), equations.builder.sections
    by_section: dict[int, list[str]] = {}
    for block in formulas.defined:
        by_section.setdefault(block.section, []).append(f"{formulas.names[block]} &= {formulas.define(block)}")
    part = {name: row[0] for rows in counterparts for row in rows for name in row}
    stages: dict[str, dict[tuple[str, ...], list[Lines]]] = {}
    for number, lines in sorted(by_section.items(), key=lambda item: (not item[0], item[0])):  # section 0 has sums of all others
        section = sections[number]
        key = part.get(section.element, _form(lines))
        stages.setdefault(section.stage, {}).setdefault((section.equation, section.turn, key), []).append((section.element, lines))
    entries = {stage: list(_entries(forms)) for stage, forms in stages.items()}
    held = equations.topology.model.discrete_states
    if held:
        (sample,) = (f.results.values() for f in equations.functions if f.name == SAMPLE)
        names = (words(discrete_state_name(value).partition(":")[0]) for value in held)
        updates = dict.fromkeys(rf"{name} &\leftarrow {formulas.show(block)}" for name, block in zip(names, sample, strict=True))
        entries.setdefault("controller", []).append(Entry(title="Held from a sample on", formula=_aligned(updates)))
    return entries


def _form(lines: list[str]) -> str:
    """Formulas without the names and the numbers of their elements."""
    order: dict[str, int] = {}
    return _OWN.sub(lambda own: "#" if own[0][0].isdigit() else f"<{order.setdefault(own[0], len(order))}>", "\n".join(lines))


def _entries(forms: dict[tuple[str, ...], list[Lines]]) -> Iterator[Entry]:
    for (equation, turn, _), members in forms.items():
        first, *others = dict.fromkeys(name for name, _ in members)
        notes = [f"`{equation}`"] if equation else []
        if others:
            notes.append(f"Of the same form, with other names, numbers or signs: {code(others)}.")
        title = (code(first) if first else "All together") + (f", {turn}" if turn else "")
        yield Entry(title=title, notes=tuple(notes), formula=_aligned(members[0][1]))


def _aligned(lines: Iterable[str]) -> str:
    return rf"\begin{{aligned}} {_ROW.join(lines)} \end{{aligned}}"
