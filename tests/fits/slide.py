"""A block on a spring whose motion has a closed form, and studies of its fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

_SLIDE = """cutjoint: 1
name: slide
gravity: [0, 0, 0]
parameters: {damping: {value: 3, unit: N*s/m}, stiffness: {value: 150, unit: N/m}}
bodies: {block: {mass: 2, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}}
forces: {law: {kind: joint_force, joint: rail, law: -stiffness*position - damping*rate}}
outputs: [rail.displacement]
scenes: {swing: {end: 2, rates: {rail.displacement_rate: 1}}}
"""


def study_of(folder: Path, noise: float = 0.0, **more: Any) -> dict[str, Any]:
    """Decaying oscillations of 2 x'' + 2 x' + 200 x = 0, whose closed form is known."""
    t = np.arange(0.0, 2.0001, 0.01)
    x = np.exp(-t / 2) * np.sin(np.sqrt(99.75) * t) / np.sqrt(99.75) + noise * np.random.default_rng(0).normal(size=len(t))
    np.savetxt(folder / "d.csv", np.column_stack([t, x]), delimiter=",", header="t,rail.displacement", comments="", fmt="%.17g")
    (folder / "slide.yaml").write_text(_SLIDE)
    return {
        "cutjoint_fit": 1, "model": str(folder / "slide.yaml"), "integrator": "rk4", "dt": "2 ms",
        "parameters": {"stiffness": {"from": 20, "to": 2000}, "damping": {"from": 0.1, "to": 50}},
        "experiments": {"run": {"data": str(folder / "d.csv"), "signals": {"rail.displacement": {}}}}, **more,
    }  # fmt: skip
