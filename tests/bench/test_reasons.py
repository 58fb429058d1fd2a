"""Why methods fail: conditions by closed forms, reasons by neighbours on the axes of an atlas, values that the user gives."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint_bench.exact.chain import Chain, singular_times, write_chain
from cutjoint_bench.failures import conditions
from cutjoint_bench.failures.atlas import Grid, map_case, suggest_grid
from cutjoint_bench.failures.conditions import find_conditions, passes
from cutjoint_bench.failures.outcomes import OUTCOMES
from cutjoint_bench.failures.reasons import find_reasons
from cutjoint_bench.records import Case
from cutjoint_bench.reference import Reference
from cutjoint_bench.report.atlas_tables import tabulate_conditions, tabulate_reasons
from cutjoint_bench.report.page import render_page
from cutjoint_bench.store import Store
from tests.bench.test_atlas import SPRING, case_of

CHAIN = Chain(windows=1)


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    def compile_scene(model: Model, scene: Scene, options: CompileOptions) -> Artifact:
        return compile_interpreted(model, scene, method=options.method, outputs=options.outputs)

    monkeypatch.setattr(conditions, "compile_scene", compile_scene)


@pytest.mark.usefixtures("interpreted")
def test_the_fastest_mode_of_a_mass_on_a_spring(tmp_path: Path) -> None:
    """sqrt(k / m); no loops, so no singular pose."""
    case = case_of(tmp_path, SPRING, 1.0)
    for stiffness in (1.0, 4e4):
        found = find_conditions(replace(case, parameters={"stiffness": stiffness}))
        assert found.rate == pytest.approx(sqrt(stiffness), rel=1e-6)
        assert (found.closeness, found.massless) == (None, ())


@pytest.mark.usefixtures("interpreted")
def test_the_pose_closest_to_a_singular_one(tmp_path: Path) -> None:
    """A four-bar of equal bars is singular when all are in line; rows are 20 ms apart, so the closest is at most 10 ms away."""
    found = find_conditions(case_of(tmp_path, write_chain(CHAIN), 1.0))
    assert found.closest_time == pytest.approx(singular_times(CHAIN)[0], abs=0.011)
    assert found.closeness is not None
    assert found.closeness < 0.02
    before = find_conditions(case_of(tmp_path, write_chain(CHAIN), 0.3))
    assert before.closeness is not None
    assert before.closeness > 0.2
    assert before.singular_times == ()
    assert found.singular_times == (found.closest_time,)


def test_all_passes_of_singular_poses_are_found() -> None:
    poses = [(0.5, 0.0), (0.02, 0.1), (0.01, 0.2), (0.02, 0.3), (0.2, 0.4), (0.029, 0.5), (0.3, 0.6), (0.1, 0.7), (0.3, 0.8), (0.001, 0.9)]
    assert passes(poses) == (0.2, 0.5, 0.9)


def cell(dt: float, outcome: str, *, penalty: float | None = None, value: float | None = None, **more: Any) -> dict[str, Any]:
    given = {"method": "recursive", "precision": "double", "message": "", "reached": 1.0, "since": None}
    return {**given, "dt": dt, "penalty": penalty, "value": value, "outcome": outcome, "position": None, **more}


def atlas_of(
    cells: list[dict[str, Any]], found: list[dict[str, Any]] | None = None, values: tuple[float | None, ...] = (None,)
) -> dict[str, Any]:  # fmt: skip
    steps, penalties = sorted({c["dt"] for c in cells}), list(dict.fromkeys(c["penalty"] for c in cells))
    axes = {"method": ["recursive"], "precision": ["single", "double"], "dt": steps, "penalty": penalties,
            "parameter": "" if values == (None,) else "stiffness", "value": list(values), "unit": "N/m"}  # fmt: skip
    return {"axes": axes, "cells": cells, "outcomes": dict(OUTCOMES), "end": 1.0, "name": "a/b", "conditions": found or [], "refused": {},
            "title": "a/b", "words": "", "own": {"recursive": {"dt": 1e-3, "value": None}}}  # fmt: skip


NOTHING = {"rate": None, "rate_time": None, "closeness": None, "closest_time": None, "singular_times": [], "massless": []}


@pytest.mark.parametrize(
    ("failing", "others", "found", "words"),
    [
        (cell(1e-2, "wrong"), [cell(1e-3, "converged")], {}, "the step is too long: shorter ones converge"),
        (cell(1e-5, "inaccurate"), [cell(1e-3, "converged")], {}, "the step is too short: longer ones converge, so what"),
        (cell(1e-3, "diverged", penalty=1e8), [cell(1e-3, "converged", penalty=1e4)], {}, "the penalty is too heavy for this step"),
        (cell(1e-3, "drifted", penalty=1e2), [cell(1e-3, "converged", penalty=1e4)], {}, "the penalty is too light: heavier ones"),
        (cell(1e-3, "drifted"), [cell(1e-3, "converged", penalty=1e4)], {}, "the penalty does not suit this step: another one does"),
        (cell(1e-2, "wrong"), [], {"rate": 1e3}, "stiffness: the step is longer than a sixth of the period of the fastest mode, 6.3 ms"),
        (cell(1e-4, "diverged", reached=0.71), [], {"singular_times": [0.2, 0.7]}, "a nearly singular pose at 0.7 s, where it"),
        (cell(1e-4, "wrong", since=0.72), [], {"singular_times": [0.7]}, "a nearly singular pose at 0.7 s, where it"),
        (cell(1e-4, "wrong", since=0.2), [], {"singular_times": [0.7]}, "no step and no penalty that was tried"),
        (cell(1e-4, "wrong", reached=0.7), [], {"singular_times": [0.7]}, "no step and no penalty that was tried"),
        (
            cell(1e-3, "diverged", message="the mass matrix is singular: an acceleration is not determined at t = 0 s"), [],
            {"massless": ["link"]}, "no mass resists a motion of link",
        ),
        (
            cell(1e-3, "inaccurate", precision="single"), [cell(1e-3, "converged")], {},
            "rounding: in double the same run converges",
        ),
    ],
)  # fmt: skip
def test_reasons_in_words(failing: dict[str, Any], others: list[dict[str, Any]], found: dict[str, Any], words: str) -> None:
    (reason,) = find_reasons(atlas_of([failing, *others], [{**NOTHING, **found}]))
    assert reason.words.startswith(words)
    assert (reason.outcome, reason.cells) == (failing["outcome"], (failing,))


def test_conditions_are_those_of_the_cells_value() -> None:
    """The step resolves the soft spring and not the stiff one."""
    cells = [cell(1e-2, "wrong", value=1.0), cell(1e-2, "wrong", value=1e6)]
    atlas = atlas_of(cells, [{**NOTHING, "rate": 1.0}, {**NOTHING, "rate": 1e3}], values=(1.0, 1e6))
    assert {r.cells[0]["value"]: r.words.startswith("stiffness") for r in find_reasons(atlas)} == {1.0: False, 1e6: True}


def test_tables_say_where_and_why() -> None:
    cells = [
        cell(1e-2, "diverged", value=1e6, message="it stopped <here>"), cell(2e-2, "diverged", value=1e6),
        cell(1e-3, "converged", value=1e6),
    ]  # fmt: skip
    found = {**NOTHING, "rate": 1e3, "rate_time": 0.25, "closeness": 0.02, "closest_time": 0.5, "massless": list("abcdef")}
    atlas = atlas_of(cells, [found], values=(1e6,))
    reasons, hard = tabulate_reasons(atlas), tabulate_conditions(atlas)
    assert reasons is not None
    assert hard is not None
    words = "stiffness: the step is longer than a sixth of the period of the fastest mode, 6.3 ms"
    assert reasons.rows == (("recursive, double", "diverged", words, "2", "10 to 20", "1e+06", "it stopped <here>"),)
    assert hard.rows == (("1e+06", "1e+03", "6.28", "0.25", "0.02", "0.5", "a, b, c, d and 2 more"),)
    data = {"machine": {"processor": "", "system": ""}, "cases": [], "drifts": [], "situations": [], "atlases": [atlas]}
    page = render_page({"bench": data})
    assert "Why runs do not converge" in page
    assert "it stopped &lt;here&gt;" in page


def test_all_that_converges_has_no_reasons() -> None:
    assert tabulate_reasons(atlas_of([cell(1e-3, "converged")])) is None
    assert tabulate_conditions(atlas_of([cell(1e-3, "converged")])) is None


def test_the_user_gives_the_values_of_a_parameter(tmp_path: Path) -> None:
    case = case_of(tmp_path, SPRING, 1.0)
    grid = suggest_grid(case, parameter="stiffness=1e6,2,50")
    assert (grid.parameter, grid.values, grid.penalties) == ("stiffness", (2.0, 50.0, 1e6), (None,))
    with pytest.raises(RunError, match="--vary stiffness=1,x: 'x' is not a plain decimal number; write values in SI units"):
        suggest_grid(case, parameter="stiffness=1,x")


def test_values_without_a_reference_are_left_out_and_named(tmp_path: Path) -> None:
    case = case_of(tmp_path, SPRING, 1.0)

    def refer(of: Case) -> Reference:
        raise RunError(f"no loop closes at {of.parameters['stiffness']:g}")

    grid = Grid(methods=(), precisions=(), steps=(1e-3,), parameter="stiffness", values=(1.0, 2.0))
    with pytest.raises(RunError, match="no loop closes at 1"):
        map_case(case, grid, Store(tmp_path / "store.jsonl"), refer=refer)

    def sometimes(of: Case) -> Reference:
        return refer(of) if of.parameters["stiffness"] < 2 else _straight(of)

    atlas = map_case(case, grid, Store(tmp_path / "store.jsonl"), refer=sometimes)
    assert (atlas["axes"]["value"], atlas["refused"]) == ([2.0], {"stiffness 1": "no loop closes at 1"})


def _straight(case: Case) -> Reference:
    import numpy as np

    t = np.arange(101) * 0.01
    columns = {o.column: t * (o.quantity == "x") for o in case.outputs}
    return Reference(t=t, columns=columns, position_apart=0.0, velocity_apart=0.0, provenance={})
