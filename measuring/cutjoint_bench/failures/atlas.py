"""The failure atlas: where a method breaks over its step, its penalty, a parameter of the model and the precision of its numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.text import read_number
from cutjoint.package.errors import CutjointError, RunError, ToolchainError
from cutjoint.run.artifact import Artifact
from cutjoint.run.run_file import parameter_values
from cutjoint.run.simulator import SimulatorError
from cutjoint_bench.cutjoint_contenders import TOLERANCES, has_added, identity
from cutjoint_bench.failures.outcomes import OUTCOMES, Truth, identify, known_truth, try_run
from cutjoint_bench.progress import Say, silently
from cutjoint_bench.records import Case
from cutjoint_bench.reference import Reference, find_reference
from cutjoint_bench.steps import common_step
from cutjoint_bench.store import Record, Store

#: Methods that have a penalty.
PENALISED = frozenset({"recursive", "augmented"})

#: Besides the scene's own.
PENALTIES = tuple(10.0**k for k in range(2, 13))

#: Steps are between these (s), and these shares of the scene's own; a run of more than ``MOST_STEPS`` is not begun.
SHORTEST, LONGEST = 1e-5, 1e-1
FINER, COARSER = 0.01, 20.0
MOST_STEPS: Mapping[str, int] = {"single": 100_000, "double": 100_000, "extended": 20_000, "quad": 5_000}

#: A model of at most so many bodies is tried in these number types, others in double: long code takes minutes to compile in the others.
SMALL = 12
PRECISIONS = ("single", "double", "quad")

#: Shares of a parameter's own value.
SHARES = (0.01, 0.1, 1.0, 10.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class Grid:
    """The axes of an atlas: steps in s, penalties (N/m), values of a parameter (SI); None stands for the scene's and the model's own.

    Methods without a penalty are tried once for all of them.
    """

    methods: tuple[str, ...]
    precisions: tuple[str, ...]
    steps: tuple[float, ...]
    penalties: tuple[float | None, ...] = (None,)
    parameter: str = ""
    values: tuple[float | None, ...] = (None,)


def suggest_grid(case: Case, *, parameter: str = "") -> Grid:
    """Axes that suit a case: steps about its own and penalties; with a ``parameter`` its values and the scene's own penalty.

    ``parameter`` is a name, whose own value is multiplied by ``SHARES``, or a name and its values (SI) as in NAME=1,2,5.

    Raises:
        RunError: the model has no such parameter, or a value is no number.
    """
    parameter, _, given = parameter.partition("=")
    penalties: tuple[float | None, ...] = (None,) if parameter else (None, *PENALTIES)
    precisions = PRECISIONS if len(case.model.bodies) <= SMALL else ("double",)
    values = _values(case, parameter, given) if parameter else (None,)
    return Grid(methods=tuple(METHODS), precisions=precisions, steps=_steps(case), penalties=penalties, parameter=parameter, values=values)


def _steps(case: Case) -> tuple[float, ...]:
    """1, 2 and 5 of each decade, those that share rows with the case."""
    scene_steps = [case.scene.numerics.of_method(method).step for method in METHODS]
    shortest = max(SHORTEST, FINER * min(scene_steps), case.scene.end / max(MOST_STEPS.values()))
    longest = min(LONGEST, COARSER * max(scene_steps), case.scene.end / 8)
    steps = (float(f"{digit}e{power}") for power in range(-5, 0) for digit in (1, 2, 5))
    return tuple(s for s in steps if 0.999 * shortest <= s <= 1.001 * longest and _shares_rows(case, s))


def _shares_rows(case: Case, dt: float) -> bool:
    return common_step(dt, case.scene.output_step) <= case.scene.end / 4


def _values(case: Case, parameter: str, given: str) -> tuple[float, ...]:
    parameter_values(case.model, {parameter: 0.0})  # which refuses a name that cannot be set
    if given:
        try:
            return tuple(sorted({read_number(text.strip()) for text in given.split(",")}))
        except ValueError as error:
            raise RunError(f"--vary {parameter}={given}: {error}; write values in SI units with commas between") from None
    own = _own_value(case, parameter)
    return tuple(float(f"{share * own:.12g}") for share in SHARES if own is not None)


def _own_value(case: Case, parameter: str) -> float | None:
    return parameter_values(case.model, case.parameters).get(parameter)


def map_case(
    case: Case, grid: Grid, store: Store, say: Say = silently, *, refer: Callable[[Case], Reference] | None = None
) -> dict[str, Any]:  # fmt: skip
    """The outcome at every place of a grid, as plain data for JSON; what the store has is not run again.

    ``refer`` finds the reference of a case with a parameter changed, by default `find_reference`.

    Values without a reference, such as those with which no loop closes, are left out and refused with the reason.

    Raises:
        RunError: a step shares too few rows with the case; the model has no such parameter; there is no reference at all.
    """
    for dt in grid.steps:
        if not _shares_rows(case, dt):
            raise RunError(f"{case.name}: a step of {dt:g} s shares too few rows with rows of {case.scene.output_step:g} s")
    find = refer or partial(find_reference, say=say)
    refused: dict[str, str] = {}
    truths = dict(_truths(case, grid, find, refused))
    grid = replace(grid, values=tuple(truths))
    cells: list[Record] = []
    code: dict[str, Mapping[str, str]] = {}
    for method, precision in product(grid.methods, grid.precisions):
        say(f"{case.name}: compiling {method} in {precision}")
        try:
            artifact = compile_scene(case.model, case.scene, CompileOptions(method=method, outputs=case.outputs, precision=precision))
        except (RunError, ModelError, ToolchainError) as error:
            refused[f"{method}, {precision}"] = str(error)
            continue
        code[f"{method}, {precision}"] = identity(artifact.source, added=has_added(artifact))
        cells += _map_method(case, artifact, grid, truths, store, say)
    return {**_describe(case, grid, truths, cells, refused), "code": code}


def _truths(
    case: Case, grid: Grid, find: Callable[[Case], Reference], refused: dict[str, str]
) -> Iterator[tuple[float | None, Truth]]:  # fmt: skip
    """The values that have a reference, with it; the reasons of others go to ``refused``."""
    problems: list[CutjointError] = []
    for value in grid.values:
        try:
            yield value, known_truth(find(with_value(case, grid.parameter, value)))
        except (RunError, SimulatorError) as error:
            refused[f"{grid.parameter} {value:g}" if value is not None else case.name] = str(error)
            problems.append(error)
    if len(problems) == len(grid.values):
        raise problems[0]


def with_value(case: Case, parameter: str, value: float | None) -> Case:
    """The case with a parameter changed; None leaves it as it is."""
    return case if value is None else replace(case, parameters={**case.parameters, parameter: value})


def _map_method(
    case: Case, artifact: Artifact, grid: Grid, truths: Mapping[float | None, Truth], store: Store, say: Say
) -> Iterator[Record]:  # fmt: skip
    """The cells of a method in a precision."""
    penalties = grid.penalties if artifact.method in PENALISED else (None,)
    for value, penalty in product(grid.values, penalties):
        say(f"{case.name}: {artifact.method} in {artifact.precision}, {_place(penalty, grid.parameter, value)}")
        changed = with_value(case, grid.parameter, value)
        for dt in (s for s in grid.steps if changed.scene.end / s <= 1.001 * MOST_STEPS[artifact.precision]):
            place = {"method": artifact.method, "precision": artifact.precision, "dt": dt, "penalty": penalty, "value": value}
            of = {**identify(changed, artifact), "tolerance": _tolerance(artifact.precision), **place}
            yield {**place, **store.get(of, partial(_cell, changed, artifact, truths[value], dt, penalty))}


def _place(penalty: float | None, parameter: str, value: float | None) -> str:
    words = [f"penalty {penalty:g} N/m" if penalty is not None else "its own penalty"]
    return ", ".join([*words, *([f"{parameter} {value:g}"] if value is not None else [])])


def _tolerance(precision: str) -> float | None:
    """A relative change of accelerations that 24 bits can resolve; otherwise the scene's own."""
    return TOLERANCES["single"] if precision == "single" else None


def _cell(case: Case, artifact: Artifact, truth: Truth, dt: float, penalty: float | None) -> Record:
    settings = {"penalty": penalty, "tolerance": _tolerance(artifact.precision)}
    return try_run(
        case, artifact, truth, dt=dt, row=common_step(dt, case.scene.output_step),
        settings={name: x for name, x in settings.items() if x is not None},
    ).as_record()  # fmt: skip


def _describe(
    case: Case, grid: Grid, truths: Mapping[float | None, Truth], cells: Sequence[Record], refused: Mapping[str, str]
) -> dict[str, Any]:  # fmt: skip
    return {
        "title": f"Where methods fail: {case.name}", "words": describe_cells(cells), "name": case.name, "end": case.scene.end,
        "axes": {"method": list(grid.methods), "precision": list(grid.precisions), "dt": list(grid.steps),
                 "penalty": list(grid.penalties), "parameter": grid.parameter, "value": list(grid.values),
                 "unit": next((p.unit for p in case.model.parameters if p.name == grid.parameter), "")},
        "own": {m: {"dt": case.scene.numerics.of_method(m).step, "value": _own_value(case, grid.parameter)} for m in grid.methods},
        "extent": [truths[value].extent for value in grid.values], "outcomes": dict(OUTCOMES), "cells": list(cells),
        "refused": dict(refused),
    }  # fmt: skip


def describe_cells(cells: Sequence[Record]) -> str:
    """Outcomes of an atlas, a sentence a method."""
    methods = dict.fromkeys(c["method"] for c in cells)
    return " ".join(_describe_method(method, [c for c in cells if c["method"] == method]) for method in methods)


def _describe_method(method: str, cells: Sequence[Record]) -> str:
    count = Counter(c["outcome"] for c in cells)
    good = [c for c in cells if c["outcome"] == "converged"]
    sentence = f"{method} converges in {len(good)} of {len(cells)} runs"
    if good:
        best = max(good, key=lambda c: c["dt"])
        penalty = f" with a penalty of {best['penalty']:g} N/m" if best["penalty"] is not None else ""
        sentence += f", with steps up to {1e3 * best['dt']:g} ms{penalty} in {best['precision']}"
    silent = f"{count['wrong']} end wrong silently" if count["wrong"] else "none ends wrong silently"
    return f"{sentence}; {count['diverged']} stop with a message, {count['drifted']} drift, {silent}."
