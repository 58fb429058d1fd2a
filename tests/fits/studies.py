"""Studies of fits of the press and of an arm, and tables of their data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.conftest import MODELS

PRESS = str(MODELS / "press.yaml")

ARM = """cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {friction: {value: 0.1, unit: N*m*s, binding: param}}  # of the bearing
bodies:
  arm: {mass: 2, centre_of_mass: [0.3, 0, 0], inertia: [0.04, 0.05, 0.05]}  # as drawn
joints:
  pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  bearing: {kind: joint_force, joint: pin, law: {stiffness: 0, damping: friction}}
outputs: [pin.angle]
scenes:
  drop: {end: 2, output_step: 10 ms}
"""


def write(path: Path, t: Any, **columns: Any) -> str:
    names = {name.replace("_", "."): column for name, column in columns.items()}
    np.savetxt(path, np.column_stack([t, *names.values()]), delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.17g")
    return str(path)


def press_study(data: str, names: Any, signals: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "cutjoint_fit": 1, "model": PRESS, "integrator": "rk4", "dt": 1e-3, "parameters": {name: {} for name in names},
        "experiments": {"run": {"data": data, "signals": signals}}, **more,
    }  # fmt: skip
