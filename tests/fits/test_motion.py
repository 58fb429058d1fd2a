"""Equation error: forces of drives along measured motions, beside equations by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cutjoint
from cutjoint.fits.motion import smooth
from cutjoint.fits.reading import read_fit

_ARM = """cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {viscous: {value: 0.1, unit: N*m*s}, dry: {value: 0.2, unit: N*m}, drive: {value: 0, unit: N*m, binding: input}}
bodies:
  arm: {mass: 2, centre_of_mass: [0.3, 0, 0], inertia: [0.04, 0.05, 0.05]}
joints:
  pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0], armature: 0.02}
forces:
  motor: {kind: joint_force, joint: pin, law: drive}
  bearing: {kind: joint_force, joint: pin, law: -viscous*rate - dry*tanh(rate/0.1)}
"""


def _measure(path: Path, gain: float) -> None:
    """A swing at 100 Hz and the motor's current in A, without names; other numbers than the model's."""
    t = np.arange(0.0, 4.0, 0.01)
    q, v = 0.8 * np.sin(2 * t) + 0.3 * np.cos(5 * t), 1.6 * np.cos(2 * t) - 1.5 * np.sin(5 * t)
    a = -3.2 * np.sin(2 * t) - 7.5 * np.cos(5 * t)
    torque = (0.07 + 0.02 + 1.5 * 0.09) * a - 1.5 * 9.81 * 0.3 * np.cos(q) + 0.25 * v + 0.4 * np.tanh(v / 0.1)
    np.savetxt(path, np.column_stack([10 + t, np.degrees(q), np.degrees(v), torque / gain]), fmt="%.12g")


def _study(tmp_path: Path, **parameters: Any) -> dict[str, Any]:
    (tmp_path / "arm.yaml").write_text(_ARM)
    _measure(tmp_path / "d.txt", 12.0)
    motion = {"pin": {"column": 2, "rate": 3, "unit": "deg"}}
    run = {"data": str(tmp_path / "d.txt"), "time": 1, "motion": motion, "bandwidth": "25 Hz"}
    signals = {"pin.drive": {"column": 4, "unit": "A", "gain": "1/k"}}
    return {
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"),
        "parameters": {"arm.mass": {}, "arm.inertia.1": {}, "viscous": {}, "dry": {}, **parameters},
        "experiments": {"swing": {**run, "from": 10.1, "to": 13.9, "signals": signals}},
    }  # fmt: skip


def test_masses_and_friction_from_a_measured_motion_and_current(tmp_path: Path) -> None:
    said: list[str] = []
    study = _study(tmp_path, k={"start": "12 N*m/A", "prior": {"mean": "12 N*m/A", "deviation": "1e-6 N*m/A"}})
    found = cutjoint.fit(study, note=said.append)
    assert any(line.startswith("swing: motion of pin: splines of 25 Hz leave") for line in said)
    for name, value in {"arm.mass": 1.5, "arm.inertia.1": 0.07, "viscous": 0.25, "dry": 0.4}.items():
        assert found[name] == pytest.approx(value, rel=2e-3), name  # of the spline between samples
    assert found.signals[0].explained > 0.99999
    # without knowledge of the gain all numbers are known but for a factor; the armature, which is known, has a share in the inertia
    free = cutjoint.fit(_study(tmp_path, k={"start": "10 N*m/A"}))
    (combination,) = free.after.open
    assert set(combination) == {"k", "arm.mass", "arm.inertia.1", "viscous", "dry"}
    assert free["arm.mass"] / free["k"] == pytest.approx(1.5 / 12, rel=2e-3)


def test_a_bandwidth_in_radians_is_refused(tmp_path: Path) -> None:
    study = _study(tmp_path)
    study["experiments"]["swing"]["bandwidth"] = "10 rad/s"
    with pytest.raises(cutjoint.CutjointError, match="'10 rad/s' counts angles; write Hz"):
        read_fit(study)


def test_a_slide_follows_the_column_of_its_coordinate(tmp_path: Path) -> None:
    model = _ARM[: _ARM.index("joints:")] + "joints: {rail: {kind: prismatic, bodies: [ground, arm], at: [0, 0, 0], axis: x}}\n"
    (tmp_path / "cart.yaml").write_text(model)
    t = np.arange(0.0, 1.0, 0.01)
    columns, header = np.column_stack([t, np.sin(3 * t), -18 * np.sin(3 * t)]), "t,rail.displacement,f"
    np.savetxt(tmp_path / "d.csv", columns, delimiter=",", header=header, comments="")
    run = {"data": str(tmp_path / "d.csv"), "motion": {"rail": {}}, "signals": {"rail.drive": {"column": "f"}}}
    model_file = str(tmp_path / "cart.yaml")
    study = read_fit({"cutjoint_fit": 1, "model": model_file, "parameters": {"arm.mass": {}}, "experiments": {"swing": run}})
    (table,) = study.experiments[0].inputs.values()
    sampled = table["t"] < t[-1]
    assert sampled.sum() > 15
    assert table["value"][sampled] == pytest.approx(np.sin(3 * table["t"][sampled]), abs=1e-4)


def test_a_spline_weighs_values_and_rates_by_their_noise() -> None:
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0, 5, 2000))
    exact, rate = np.sin(3 * t), 3 * np.cos(3 * t)
    values, rates = exact + 1e-2 * rng.normal(size=len(t)), rate + 1e-3 * rng.normal(size=len(t))
    values[5], rates[t > 4] = np.nan, np.nan
    spline, noise = smooth(t, values, rates, 0.05)
    assert noise == pytest.approx([1e-2, 1e-3], rel=0.1)
    early = t < 3.9
    assert np.abs(spline(t[early], 2) + 9 * exact[early]).max() < 0.25  # of 9; from the values alone about 10
    alone, _ = smooth(t, values, None, 0.05)
    assert np.abs(alone(t[early], 2) + 9 * exact[early]).max() > 2
