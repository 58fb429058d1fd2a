"""Objectives that take results of other tasks than runs: closed forms, and the task alone at the same numbers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint import find_kinematics, sweep
from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError
from tests.conftest import MODELS, ROOT
from tests.mechanisms.trims import SLED

_POST = """
cutjoint: 1
name: post
gravity: [0, 0, -9.81]
parameters:
  post: {value: 0, unit: m, binding: input}
  stiffness: {value: 2.0e+4, unit: N/m, binding: param}
bodies: {pad: {massless: true}, block: {mass: 50, centre_of_mass: [0, 0, 1]}}
joints:
  lift: {kind: prismatic, bodies: [ground, pad], at: [0, 0, 0], axis: z, guide: post}
  heave: {kind: prismatic, bodies: [ground, block], at: [0, 0, 1], axis: z}
forces:
  spring:
    {kind: axial_force, bodies: [pad, block], origin: [0, 0, 0], point: [0, 0, 1], axis: z, law: "stiffness*(1 - travel) - 200*rate"}
outputs: [block.z]
scenes: {stand: {end: 1}}
"""
_LIFT = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
parameters: {load: {value: 10, unit: kg, binding: param}}
bodies: {block: {mass: load, centre_of_mass: [0, 0, 0]}}
joints: {hoist: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: z}}
scenes: {raise: {end: 1, output_step: 0.01, drive: {hoist: "0.5*t**2"}, outputs: [block.z]}}
"""


def _study(folder: Path, model: str, name: str, values: list[float], objectives: dict[str, Any]) -> Any:
    (folder / "model.yaml").write_text(model, encoding="utf-8")
    study = {"cutjoint_study": 1, "model": str(folder / "model.yaml"), "parameters": {name: values}, "objectives": objectives}
    return sweep(study, folder / "table.parquet")


def test_modes(tmp_path: Path) -> None:
    k = np.array([1e4, 2e4, 4e4])
    done = _study(tmp_path, _POST, "stiffness", list(k), {
        "f": {"value": "lowest.frequency", "of": "modes"}, "d": {"value": "least.damping", "of": "modes"},
        "slowest": {"value": "largest.real", "of": "modes", "unit": "1/min", "goal": "larger"},
    })  # fmt: skip
    assert done.failures == [None] * 3
    assert np.allclose(done["f"], np.sqrt(k / 50 - 2.0**2) / (2 * np.pi), rtol=1e-9)
    assert np.allclose(done["d"], 2.0 / np.sqrt(k / 50), rtol=1e-9)
    assert np.allclose(done["slowest"], -120.0, rtol=1e-9)
    assert done.units == {"stiffness": "N/m", "failure_time": "s", "f": "Hz", "slowest": "1/min"}


def test_modes_over_the_speed_of_a_rotor(tmp_path: Path) -> None:
    """A Campbell diagram: forward and backward whirl of a disc in an anisotropic bearing, and translations that it crosses."""
    page = (ROOT / "docs/how-to/rotating-machines.md").read_text(encoding="utf-8")
    model, _, _ = page.partition('title="rotor.yaml"\n')[2].partition("```")
    (tmp_path / "rotor.yaml").write_text(model, encoding="utf-8")
    speeds = [0.0, 150.0, 400.0]
    objectives = {f"{name}_{i}": {"value": f"{i}.{name}", "of": "modes"} for i in range(1, 5) for name in ("frequency", "real")}
    study = {"cutjoint_study": 1, "model": str(tmp_path / "rotor.yaml"), "scenes": ["steady"], "parameters": {"speed": speeds}}
    done = sweep({**study, "objectives": objectives}, tmp_path / "table.parquet")
    for row, speed in enumerate(speeds):
        damping = np.array([[2.0, 0.7 * speed], [-0.7 * speed, 2.0]])
        stiffness = np.diag([4e4, 6e4])
        whirl = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness / 0.4, -damping / 0.4]])
        slow, fast = sorted((e for e in np.linalg.eigvals(whirl) if e.imag > 0), key=lambda e: e.imag)
        along, across = (complex(-5.0, np.sqrt(k / 20 - 25.0)) for k in (1e6, 2e6))
        for mode, expected in enumerate((along, slow, across, fast), 1):
            assert done[f"frequency_{mode}"][row] == pytest.approx(expected.imag / (2 * np.pi), rel=1e-9)
            assert done[f"real_{mode}"][row] == pytest.approx(expected.real, rel=1e-7)

def test_modes_that_cross(tmp_path: Path) -> None:
    second = (
        "  other: {mass: 50, centre_of_mass: [1, 0, 1]}\njoints:\n"
        "  own: {kind: prismatic, bodies: [ground, other], at: [1, 0, 1], axis: z}"
    )
    spring = (
        "forces:\n  hung: "
        "{kind: axial_force, bodies: [ground, other], origin: [1, 0, 0], point: [1, 0, 1], axis: z, law: 1e5*(1-travel)}"
    )
    bodies = "bodies:\n  pad: {massless: true}\n  block: {mass: 50, centre_of_mass: [0, 0, 1]}\n"
    model = _POST.replace("bodies: {pad: {massless: true}, block: {mass: 50, centre_of_mass: [0, 0, 1]}}\njoints:", bodies + second)
    k = np.array([2e4, 9e4, 2e5])
    done = _study(tmp_path, model.replace("forces:", spring), "stiffness", list(k), {
        "one": {"value": "1.frequency", "of": "modes"}, "two": {"value": "2.frequency", "of": "modes"},
        "lowest": {"value": "lowest.frequency", "of": "modes"},
    })  # fmt: skip
    own, other = np.sqrt(k / 50 - 4.0) / (2 * np.pi), np.sqrt(1e5 / 50) / (2 * np.pi)
    assert np.allclose(done["one"], own, rtol=1e-9)
    assert np.allclose(done["two"], other, rtol=1e-9)
    assert np.allclose(done["lowest"], np.minimum(own, other), rtol=1e-9)


@pytest.mark.cpp
def test_response(tmp_path: Path) -> None:
    k, f = np.array([1e4, 4e4]), np.geomspace(0.01, 100, 400_001)
    done = _study(tmp_path, _POST, "stiffness", list(k), {
        "peak": {"value": "block.z/post.peak", "of": "response"},
        "width": {"value": "block.z/post.bandwidth", "of": {"response": {"from": 1e-3, "input": "post"}}},
    })  # fmt: skip
    s = 2j * np.pi * f
    gains = [abs((c + 200 * s) / (50 * s**2 + 200 * s + c)) for c in k]
    assert np.allclose(done["peak"], [g.max() for g in gains], rtol=1e-8)
    assert np.allclose(done["width"], [np.interp(-(0.5**0.5), -g[g.argmax() :], f[g.argmax() :]) for g in gains], rtol=1e-5)


def test_inverse(tmp_path: Path) -> None:
    done = _study(tmp_path, _LIFT, "load", [5.0, 10.0], {"force": {"maximum": "hoist", "of": "inverse", "unit": "kN"}})
    assert np.allclose(done["force"], np.array([5.0, 10.0]) * 10.81e-3, rtol=1e-9)


def test_equilibrium_and_trim(tmp_path: Path) -> None:
    """The compression of a spring by a weight; the throttle against a drag 0.7 v|v|, found with another speed in each run."""
    k, speeds = np.array([1e4, 2e4]), np.array([10.0, 30.0])
    done = _study(tmp_path, _POST, "stiffness", list(k), {"z": {"value": "block.z", "of": "equilibrium", "unit": "mm"}})
    assert np.allclose(done["z"], 1e3 * (1 - 50 * 9.81 / k), rtol=1e-9)
    done = _study(tmp_path, SLED, "target", list(speeds), {
        "throttle": {"value": "throttle", "of": "equilibrium"}, "drag": {"value": "engine.force", "of": {"equilibrium": {}}},
    })  # fmt: skip
    assert np.allclose(done["throttle"], 0.7 * speeds**2 / 900, rtol=1e-9)
    assert np.allclose(done["drag"], 0.0, atol=1e-9)


def test_kinematics_at_moved_hardpoints(tmp_path: Path) -> None:
    model, name, values = str(MODELS / "axle.yaml"), "left.TO.z", [0.15, 0.16]
    kinematics = {"kinematics": {"travel": "20 mm", "points": 5}}
    study = {
        "cutjoint_study": 1, "model": model, "scenes": ["bump"], "tunable": ["left.*"], "parameters": {name: values},
        "objectives": {
            "gradient": {"slope": "left.toe", "of": kinematics, "unit": "deg/m"}, "camber": {"range": "left.camber", "of": kinematics},
        },
    }  # fmt: skip
    done = sweep(study, tmp_path / "table.parquet")
    from cutjoint import read_model

    for i, value in enumerate(values):
        moved = find_kinematics(read_model(model, tunable=["left.*"]), travel=0.02, points=5, parameters={name: value}).sweeps["travel"]
        toe, travel = moved["left.toe"], moved["left.travel"]
        assert done["gradient"][i] == pytest.approx(np.degrees((toe[3] - toe[1]) / (travel[3] - travel[1])), rel=1e-9)
        assert done["camber"][i] == pytest.approx(np.ptp(moved["left.camber"]), rel=1e-9)
    assert abs(done["gradient"][1] - done["gradient"][0]) > 1.0


@pytest.mark.parametrize(
    ("objective", "message"),
    [
        ({"value": "lowest.frequencies", "of": "modes"}, "the task has no result 'lowest.frequencies'; did you mean 'lowest.frequency'?"),
        ({"maximum": "lowest.frequency", "of": "modes"}, "'maximum' is no reduction of a result of modes; of modes take one of value"),
        ({"value": "lowest.frequency", "of": "modes", "unit": "m"}, "unit m does not fit: it is in 1/s; write a unit of that"),
        ({"value": "block.z"}, "'value' belongs to the result of a task; name it: of: kinematics or modes or response or inverse "
         "or equilibrium"),
        ({"value": "lowest.frequency", "of": "modes", "from": 0, "to": 1}, "'to' has no effect on a result of modes"),
        ({"value": "a", "of": "drift"}, "drift"),
        ({"value": "a", "of": {"modes": {}, "inverse": {}}}, "'of' needs one task; write for example of: {kinematics: {axle: front}}"),
    ],
)
def test_wrong(tmp_path: Path, objective: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=re.escape(message)):
        _study(tmp_path, _POST, "stiffness", [1.0], {"a": objective})


@pytest.mark.parametrize("section", ["positions", "rates"])
def test_starts_that_tasks_do_not_take(tmp_path: Path, section: str) -> None:
    (tmp_path / "model.yaml").write_text(_POST, encoding="utf-8")
    name = "heave.displacement" if section == "positions" else "heave.rate"
    study = {
        "cutjoint_study": 1, "model": str(tmp_path / "model.yaml"), section: {name: [0.0, 0.1]},
        "objectives": {"f": {"value": "lowest.frequency", "of": "modes"}, "z": {"maximum": "block.z"}},
    }  # fmt: skip
    with pytest.raises(ModelError, match=f"a result of modes does not depend on the {section} that the study varies"):
        sweep(study, tmp_path / "table.parquet")


def test_failures_and_clusters(tmp_path: Path) -> None:
    done = _study(tmp_path, _POST, "stiffness", [2e4, 0.0], {"f": {"value": "lowest.frequency", "of": "modes"}})
    assert done.failures[0] is None
    assert "equilibrium" in str(done.failures[1])
    assert np.isnan(done["f"][1])
    study = {
        "cutjoint_study": 1, "model": str(tmp_path / "model.yaml"), "parameters": {"stiffness": [1.0]},
        "objectives": {"f": {"value": "lowest.frequency", "of": "modes"}},
    }  # fmt: skip
    with pytest.raises(RunError, match="leave out the scheduler"):
        sweep(study, tmp_path / "other.parquet", scheduler="tcp://127.0.0.1:1")
