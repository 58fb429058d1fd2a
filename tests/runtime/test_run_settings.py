"""Settings that a simulator refuses to read: those out of their ranges, and keys and words that it does not know."""

from __future__ import annotations

import json
import subprocess
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.run.run_file import make_run_file
from tests.conftest import needs_cpp
from tests.run.test_settings import pendulum

pytestmark = needs_cpp

#: Stands for a key that is taken out.
MISSING = object()


@cache
def binary(method: str) -> Path:
    return compile_scene(pendulum(), pendulum().scenes["rest"], CompileOptions(method=method)).binary.path


def refused(method: str, changes: dict[str, Any], folder: Path) -> str:
    """The simulator's message about a run file with some values changed, by their keys joined by dots."""
    made = make_run_file(pendulum(), pendulum().scenes["rest"], {}, task="simulate", method=method, out=str(folder / "run.csv"))
    file = deepcopy(made.entries())
    for name, value in changes.items():
        *parents, key = name.split(".")
        place = file
        for parent in parents:
            place = place[parent]
        place[key] = value
        if value is MISSING:
            del place[key]
    path = folder / "run.json"
    path.write_text(json.dumps(file), encoding="utf-8")
    done = subprocess.run([binary(method), path], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2, done.stdout
    assert not (folder / "run.csv").exists()
    return done.stderr


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("end", 1e16, "is 1e+16 and more than 9.007199254740992e+15 steps away"),
        ("end", 1e300, "is 1e+300 and more than"),
        ("end", -1.0, "is -1.0 and not from 0.0 to"),
        ("end", None, "is null and not a number"),
        ("end", "1", 'is "1" and not a number'),
        ("output_step", 0.0, "is 0.0 and not above zero"),
        ("output_step", -1.0, "is -1.0 and not above zero"),
        ("numerics.dt", 1e-300, "is 1e-300, whose square has no value in the number type of the run"),
        ("numerics.dt", 1e300, "is 1e+300, whose square has no value in the number type of the run"),
        ("numerics.dt", 1.0, "is longer than the run, which has the end 0.02"),
        ("numerics.dt", 0.0, "is 0.0 and not above zero"),
        ("numerics.tolerance", 0.0, "is 0.0 and not above zero"),
        ("numerics.tolerance", True, "is true and not a number"),
        ("numerics.iterations", 4294967297, "is 4294967297 and not from 1 to 2147483647"),
        ("numerics.iterations", 18446744073709551617, "is 1.8446744073709552e+19 and not an integer"),
        ("numerics.iterations", 2**63, "is 9223372036854775808 and not from 1 to 2147483647"),
        ("numerics.iterations", 0, "is 0 and not from 1 to 2147483647"),
        ("numerics.iterations", 1.5, "is 1.5 and not an integer"),
        ("numerics.multiplier_updates", -1, "is -1 and not from 0 to 2147483647"),
        ("stabilisation.penalty", 0.0, "is 0.0 and not above zero"),
        ("stabilisation.penalty", -1e9, "is -1000000000.0 and not above zero"),
        ("stabilisation.frequency", -1.0, "is -1.0 and not from 0.0 to"),
        ("stabilisation.closure", "weld", 'is "weld" and not one of penalty, proximal'),
        ("parameters.gap", None, "is null and not a number"),
        ("positions", {"pin.angle": "0"}, 'is "0" and not a number'),
        ("positions", {"pin.angel": 0.1}, "is not one of pin.angle"),
        ("rates", {"pin.angle": 0.1}, "is not one of pin.angle_rate"),
        ("parameters.gab", 0.1, "is not one of gap"),
        ("roads", {"wheel": {}}, "is unknown"),
        ("surface", [], "is [] and not an object"),
        ("surface", {"patches": 1, "field": None}, "of a surface is not a list"),
        ("rates", [], "is [] and not an object"),
        ("integrator", "euler", 'is "euler" and not one of trapezoidal, '),
        ("integrator", 1, "is 1 and not one of trapezoidal, "),
        ("task", "\x1b[31m\x9b", 'is "\\u001b[31m\\x9b" and not one of simulate'),
        ("task", "simulat", 'is "simulat" and not one of simulate, realtime, equilibrium'),
        ("task", "batch", 'is "batch" and not one of simulate, realtime, equilibrium'),
        ("pose", "rest", 'is "rest" and not one of design, equilibrium'),
        ("numerics.fixed_cost", 1, "is 1 and neither true nor false"),
        ("numerics.events", "located", 'is "located" and neither true nor false'),
        ("numerics", 1, "is 1 and not an object"),
        ("stabilisation", [], "is [] and not an object"),
        ("solver", 1, "is 1 and not a name"),
        ("penalty", 1e6, "is not one of task, "),
        ("numerics.damping", 1.0, "is not one of dt, "),
        ("stabilisation.dt", 1e-3, "is not one of closure, penalty, damping_ratio, frequency"),
    ],
)  # fmt: skip
def test_a_simulator_names_what_it_refuses(method: str, key: str, value: object, message: str, tmp_path: Path) -> None:
    complaint = refused(method, {key: value}, tmp_path)
    last = next(iter(value)) if isinstance(value, dict) else key.rpartition(".")[2]
    assert complaint.startswith(f"error: run file: '{last}' {message}")


SETTINGS = (
    "task", "pose", "end", "output_step", "integrator", "solver", "numerics", "stabilisation", *(f"numerics.{name}" for name in (
        "dt", "penalty", "tolerance", "iterations", "multiplier_updates", "fixed_cost", "events", "absolute_tolerance", "spectral_radius")),
    *(f"stabilisation.{name}" for name in ("closure", "penalty", "damping_ratio", "frequency")),
)  # fmt: skip


@pytest.mark.parametrize("key", SETTINGS)
def test_no_setting_has_a_default(key: str, tmp_path: Path) -> None:
    complaint = refused("recursive", {key: MISSING}, tmp_path)
    assert complaint == f"error: run file: '{key.rpartition('.')[2]}' is missing\n"


@pytest.mark.parametrize(
    ("method", "changes", "message"),
    [
        ("recursive", {"integrator": "rk4"}, "'absolute_tolerance' is null"),
        ("recursive-newton", {"integrator": "generalised-alpha", "numerics.spectral_radius": 0.8, "stabilisation.closure": "proximal"},
         "'closure' is \"proximal\", which this integrator does not take"),
        ("recursive-newton", {"integrator": "radau5"}, "'absolute_tolerance' is null"),
        ("recursive-newton", {"integrator": "generalised-alpha"}, "'spectral_radius' is null"),
        ("recursive-newton", {"solver": None}, "'solver' is null"),
        ("recursive-newton", {"integrator": "rk4"}, "'integrator' is \"rk4\" and not one of trapezoidal, radau5"),
    ],
)  # fmt: skip
def test_settings_that_do_not_go_together(method: str, changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    assert f"error: run file: {message}" in refused(method, changes, tmp_path)


@pytest.mark.parametrize("radius", [-0.1, 1.1])
def test_the_damping_of_a_step_has_a_range(radius: float, tmp_path: Path) -> None:
    complaint = refused("recursive-newton", {"integrator": "generalised-alpha", "numerics.spectral_radius": radius}, tmp_path)
    assert f"'spectral_radius' is {radius} and not from 0.0 to 1.0" in complaint


def test_a_clock_has_as_many_rows_as_its_table(tmp_path: Path) -> None:
    complaint = refused("recursive", {"task": "realtime", "end": 1e7, "output_step": 1e6}, tmp_path)
    assert "'end' is 10000000.0 and more than 100000000.0 rows away" in complaint
