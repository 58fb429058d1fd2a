"""Runs side by side beside the same runs one by one, and beside other neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cutjoint
from cutjoint.compile import c_export as standalone
from cutjoint.compile.c_export import lanes_break_even
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.reduce.guards import guard_forces
from cutjoint.run.scenes import with_closure
from cutjoint.sweeps import code
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.kernel import Kernel, KernelResults
from cutjoint.sweeps.reading import read_study, read_study_text
from cutjoint.sweeps.records import Array, Study
from cutjoint.sweeps.work import Work
from tests.conftest import MODELS, needs_cpp
from tests.run.test_batch import TEXT

from .studies import PRESS, study

pytestmark = needs_cpp


def _kernels(asked: Study) -> tuple[Kernel, Kernel]:
    """The library of a study whose runs go one by one, and the one with lanes."""
    (one,), (many,) = (build_kernels(asked, lanes=lanes) for lanes in (False, True))
    assert (one.lanes, many.lanes) == (1, 8)
    return one, many


def _check_near(one: KernelResults, many: KernelResults, share: float) -> None:
    """Check that rows agree up to a share of the largest value of each series, and failures are equal."""
    assert one.failures == many.failures
    assert np.array_equal(one.reached, many.reached)
    assert np.array_equal(one.times, many.times, equal_nan=True)
    size = np.abs(one.series[one.reached == one.reached.max()]).max(axis=(0, 2))[:, np.newaxis]
    for run, rows in enumerate(one.reached):
        assert (np.abs(one.series[run, :, :rows] - many.series[run, :, :rows]) <= share * size).all(), run


def _check_alone(kernel: Kernel, values: Array, whole: KernelResults) -> None:
    """Each run is the same bit by bit whatever runs beside it, and whichever lane it has."""
    order = np.random.default_rng(4).permutation(len(values))
    mixed = kernel.run(values[order])
    single = [kernel.run(values[i : i + 1]) for i in range(len(values))]
    for place, run in enumerate(order):
        rows = whole.reached[run]
        for left, i in ((mixed, place), (single[run], 0)):
            assert left.reached[i] == rows
            assert left.failures.get(i) == whole.failures.get(run)
            assert np.array_equal(left.series[i, :, :rows], whole.series[run, :, :rows])


@pytest.mark.parametrize("closure", ["proximal", "penalty"])
def test_runs_of_a_press(closure: str, tmp_path: Path) -> None:
    asked = read_study(study(tmp_path, design={"sobol": 21, "seed": 3}, tolerance=1e-12))
    asked = replace(asked, scenes=(with_closure(asked.scenes[0], closure),))
    one, many = _kernels(asked)
    rows = many.run(asked.values)
    assert not rows.failures
    _check_near(one.run(asked.values), rows, 1e-11)
    _check_alone(many, asked.values, rows)


def test_a_run_that_fails_leaves_the_others_alone(tmp_path: Path) -> None:
    """Speeds at the start with steps that find no end, or with sines beyond a register's arithmetic."""
    rates = [10, 1e9, 5, 1e12, 7, 8, 9, 6, 5.5, 1e9]
    asked = read_study(
        study(tmp_path, parameters=None, rates=None, design={"list": [{"pin.angle_rate": x} for x in rates]}, output_step=0.01, dt=0.01)
    )
    one, many = _kernels(asked)
    rows = many.run(asked.values)
    assert set(rows.failures) == {1, 3, 9}
    alone = one.run(asked.values)
    assert rows.failures.keys() == alone.failures.keys()
    assert all("press.yaml" in text or ";" in text for text in rows.failures.values())
    _check_alone(many, asked.values, rows)


@pytest.mark.heavy
def test_runs_through_singular_poses() -> None:
    """Four-bars that come to their singular poses at other times: there the projection of one takes more than that of the others."""
    rows = [{f"crank_{i}.pin.angle_rate": -0.6 - 0.1 * k for i in range(3)} for k in range(9)]
    text = {"cutjoint_study": 1, "model": f"{MODELS}/four_bar.yaml", "end": 2.0, "design": {"list": rows}}
    asked = read_study_text(str({**text, "objectives": {"last": {"end": "tip.x"}}}), "study")
    one, many = _kernels(asked)
    found = many.run(asked.values)
    _check_near(one.run(asked.values), found, 1e-6)
    _check_alone(many, asked.values, found)


@cache
def _quarter() -> Model:
    return read_model_text(TEXT, "quarter.yaml")


def _ride(folder: Path, **changes: Any) -> Study:
    """A quarter of a car on a road, a guide that an input moves, a spring that ends in no number."""
    (folder / "quarter.yaml").write_text(TEXT, encoding="utf-8")
    asked: Mapping[str, Any] = {
        **PRESS, "model": str(folder / "quarter.yaml"), "rates": None, "trajectories": None, "end": 0.4, "tolerance": 1e-10,
        "objectives": {"low": {"minimum": "chassis.z"}, "pressed": {"maximum": "tyre.Fz*load"}, "last": {"end": "hub.z"}}, **changes,
    }  # fmt: skip
    return read_study_text(str({key: value for key, value in asked.items() if value is not None}), "study")


def test_roads_and_inputs(tmp_path: Path) -> None:
    rows = [{"load": 200.0 + 20 * k, "stiffness": 1.5e4 + 1e3 * k, "slack": 10.0, "along": 0.1 * k} for k in range(11)]
    asked = _ride(tmp_path, parameters=None, design={"list": rows})
    one, many = _kernels(asked)
    found = many.run(asked.values)
    _check_near(one.run(asked.values), found, 1e-9)
    _check_alone(many, asked.values, found)
    assert len({round(x, 9) for x in found.series[:, 0, -1]}) == len(rows)


def test_laws_that_end_in_no_number(tmp_path: Path) -> None:
    rows = [{"slack": slack, "speed": 5.0} for slack in (10.0, 0.02, 10.0, -1.0)]
    asked = _ride(tmp_path, parameters=None, design={"list": rows})
    one, many = _kernels(asked)
    found = many.run(asked.values)
    assert set(found.failures) == {1, 3}
    assert found.reached[1] > 0 == found.reached[3]
    _check_near(one.run(asked.values), found, 1e-9)
    _check_alone(many, asked.values, found)


@pytest.mark.heavy
def test_guards_stop_the_runs_whose_forces_would_act(tmp_path: Path) -> None:
    asked = _ride(tmp_path, parameters=None, design={"list": [{"speed": speed} for speed in (0.5, 5.0, 4.0, 0.6)]})
    scene = replace(asked.scenes[0], switches={"rail": True}, pose="design")
    guarded = replace(asked, model=guard_forces(asked.model, scene, ("rail",)).model, scenes=(scene,))
    one, many = _kernels(guarded)
    found = many.run(asked.values)
    assert set(found.failures) == {1, 2}
    assert all("rail" in text for text in found.failures.values())
    _check_near(one.run(asked.values), found, 1e-9)


@pytest.mark.parametrize("how", [{"integrator": "rk4"}, {"method": "recursive-newton"}], ids=str)
def test_other_ways_to_run_have_no_lanes(how: Mapping[str, str], tmp_path: Path) -> None:
    kernel, = build_kernels(read_study(study(tmp_path, **how)), lanes=True)
    assert kernel.lanes == 1


def test_workers_do_not_matter_and_the_table_says_that_there_are_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    path, contents = study(tmp_path, design={"sobol": 101}), []
    for threads in (1, 3):
        out = tmp_path / f"{threads}.parquet"
        assert cutjoint.sweep(path, out, threads=threads).manifest["lanes"] == {"turn": 8}
        contents.append(out.read_bytes())
    assert contents[0] == contents[1]


def test_rows_in_memory_are_those_of_all_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = read_study(study(tmp_path, design={"sobol": 101}))
    one, many = _kernels(asked)
    work = Work(kernels=(many,), has_scenes=False, objectives=(), trajectories=(), every=1)
    for rows, held in ((1000, 4000), (10**5, 40), (3 * 10**5, 8), (10**6, 8)):  # of 4 million numbers
        assert work._runs_per_chunk(replace(many, rows=rows, series=1)) == held
        assert work._runs_per_chunk(replace(one, rows=rows, series=1)) == 4 * 10**6 // rows
    for most, lanes in ((8 * one.rows, 8), (8 * one.rows - 1, 1)):
        monkeypatch.setattr(code, "_MOST_ROWS", most)
        assert build_kernels(asked, lanes=True)[0].lanes == lanes


def test_lanes_pay_from_so_many_steps_on() -> None:
    """About 1400 runs of the press and 3000 of the Iltis, of 2000 and 1333 steps."""
    assert [lanes_break_even(194, 2000 * runs) for runs in (1000, 2000)] == [False, True]
    assert [lanes_break_even(11904, 1333 * runs) for runs in (2000, 4000)] == [False, True]
