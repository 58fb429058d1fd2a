"""Runs whose parameters give a body a mass or an inertia that no body can have: rows with the reason, and no others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import make_run_file
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.designs import Masses
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.work import Chunk, Work
from tests.conftest import MODELS, needs_cpp

from .studies import study

pytestmark = needs_cpp

#: Changes of a press: a rod whose moments a study varies, and a mass that follows from a parameter.
_CHANGES = {
    "parameters: {": "parameters: {lean: {value: 0.001, unit: kg*m^2, binding: param}, tilt: {value: 0, unit: kg*m^2, binding: param}, "
                     "size: {value: 0.5, unit: '1', binding: param}, square: {value: 9, unit: kg^2, binding: param}, ",
    "inertia: [0.001, 0.008, 0.008]": "inertia: [lean, 'where(lean < 0.01, 0.008*exp(size - 0.5), 3*lean)', 0.008, 0, tilt, 0]",
    "slider: {mass: 3,": "slider: {mass: sqrt(square),",
}  # fmt: skip

_USUAL = {"lean": 0.001, "tilt": 0.0, "size": 0.5, "square": 9.0}

#: The values of each run, and the reason that it cannot be.
_RUNS: Sequence[tuple[Mapping[str, float], str]] = (
    ({}, ""),
    ({"lean": -0.002}, "a principal moment of inertia is negative: -0.002, 0.008, 0.008 kg m2; set other values"),
    ({"size": 0.7}, "a principal moment of inertia is larger than the sum of the other two: 0.001, 0.008, 0.00977122 kg m2"),
    ({"size": 0.6}, ""),
    ({"tilt": 0.0001}, ""),
    ({"tilt": 0.0035}, "a principal moment of inertia is negative: "),
    ({"lean": 0.02}, "a principal moment of inertia is larger than the sum of the other two: 0.008, 0.02, 0.06 kg m2"),
    ({"square": -1.0}, "body 'slider': its mass or inertia has no finite value with square = -1; set other values"),
    ({"square": 1e120}, "with these parameters its mass or inertia is larger than 1e+50 in SI units; set other values"),
    ({"size": 0.5 + 1e-9}, ""),
)  # fmt: skip


def _asked(folder: Path) -> Path:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    for old, new in _CHANGES.items():
        assert old in text
        text = text.replace(old, new)
    (folder / "press.yaml").write_text(text, encoding="utf-8")
    rows = [{**_USUAL, **changes} for changes, _ in _RUNS]
    return study(folder, model="press.yaml", parameters=None, rates=None, design={"list": rows}, tolerance=1e-12)


def test_impossible_runs_are_rows_with_the_reason(tmp_path: Path) -> None:
    path = _asked(tmp_path)
    done = cutjoint.sweep(path, tmp_path / "out.parquet")
    for failure, (_, reason) in zip(done.failures, _RUNS, strict=True):
        assert failure is None if not reason else str(failure).startswith("press.yaml:") and reason in str(failure)
    failed = np.array([bool(reason) for _, reason in _RUNS])
    assert np.array_equal(np.isnan(done["top"]), failed)
    assert np.array_equal(done["failure_time"][failed], np.zeros(failed.sum()))
    assert [len(values) > 0 for values in done["slider.x(t)"]] == list(~failed)


def test_single_runs_say_the_same(tmp_path: Path) -> None:
    asked = read_study(_asked(tmp_path))
    found, model = Masses(asked).faults(asked.values), asked.model
    for run, (_, reason) in enumerate(_RUNS):
        if not reason:
            make_run_file(model, asked.scenes[0], asked.settings_of(run), task="simulate")
            continue
        with pytest.raises(RunError) as raised:
            make_run_file(model, asked.scenes[0], asked.settings_of(run), task="simulate")
        assert found.pop(run) == str(raised.value)
    assert not found


def test_possible_runs_are_those_without_the_others(tmp_path: Path) -> None:
    """Bit by bit, one by one and side by side."""
    asked = read_study(_asked(tmp_path))
    faults = Masses(asked).faults(asked.values)
    able = [run for run in range(asked.runs) if run not in faults]
    for lanes in (False, True):
        work = Work(kernels=build_kernels(asked, lanes=lanes), has_scenes=False, objectives=asked.objectives, trajectories=(), every=1)
        mixed = work.perform(Chunk(first=0, values=asked.values, faults=faults)).objectives
        assert np.array_equal(mixed[able], work.perform(Chunk(first=0, values=asked.values[able])).objectives)
