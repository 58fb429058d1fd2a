"""Studies and batches of a controlled motor: states that start where parameters say, signals in objectives, runs side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

TEXT = """
cutjoint: 1
name: motor
gravity: [0, 0, 0]
parameters:
  gain: {value: 2, binding: param}
  reset: {value: 9, binding: param}
bodies: {rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}}
joints: {shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {motor: {kind: joint_force, joint: shaft, law: 0.5*current - 0.01*rate}}
states:
  integral: {start: 0.1*gain, rate: error}
  current: {start: gain, rate: (voltage - 0.4*current - 0.5*shaft.angle_rate)/0.02}
signals:
  error: 12 - shaft.angle_rate
  voltage: max(-30, min(30, gain*error + reset*integral))
outputs: [shaft.angle_rate, current.value, voltage.value]
scenes: {run: {end: 0.3, output_step: 0.01, numerics: {dt: 1.0e-3}}}
"""

GAINS, RESETS = (1.5, 2.0, 3.0), (5.0, 9.0)
CASES = [{"gain": gain, "reset": reset} for gain in GAINS for reset in RESETS]


def motor() -> Model:
    return read_model_text(TEXT, "motor.yaml")


def singles() -> list[dict[str, np.ndarray]]:
    artifact = compile_scene(motor(), motor().scenes["run"])
    return [dict(simulate(artifact, parameters=case, integrator="trapezoidal", error=False).columns) for case in CASES]


def test_batches() -> None:
    batch = simulate_batch(compile_scene_batch(motor(), motor().scenes["run"]), CASES, threads=1)
    for i, single in enumerate(singles()):
        for name, column in single.items():
            assert batch.end[name][i] == pytest.approx(column[-1], abs=1e-9), name


def test_studies(tmp_path: Path) -> None:
    file = tmp_path / "motor.yaml"
    file.write_text(TEXT, encoding="utf-8")
    study = {
        "cutjoint_study": 1, "model": str(file), "parameters": {"gain": list(GAINS), "reset": list(RESETS)}, "design": "grid",
        "objectives": {"peak": {"maximum": "voltage"}, "last": {"end": "current.value*gain"}}, "integrator": "trapezoidal",
    }  # fmt: skip
    done = cutjoint.sweep(study, tmp_path / "out.parquet")
    for i, (case, single) in enumerate(zip(CASES, singles(), strict=True)):
        assert done["peak"][i] == pytest.approx(single["voltage.value"].max(), abs=1e-9)
        assert done["last"][i] == pytest.approx(single["current.value"][-1] * case["gain"], abs=1e-9)
