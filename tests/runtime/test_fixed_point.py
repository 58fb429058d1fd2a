"""The trapezoidal rule's fixed point: where its search begins and how iterations are mixed, beside the rule as linear equations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.results import Array
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS
from tests.physics.simulation import completed

#: Two masses of 2 kg on springs of their own, with dampers, m off their rest.
MASSES = """\
cutjoint: 1
name: masses
gravity: [0, 0, 0]
bodies:
  a: {{mass: 2, centre_of_mass: [0, 0, 0]}}
  b: {{mass: 2, centre_of_mass: [0, 0, 0]}}
joints:
  first: {{kind: prismatic, bodies: [ground, a], at: [0, 0, 0], axis: [1, 0, 0], spring: {{stiffness: {k[0]}, damping: {c[0]}}}}}
  second: {{kind: prismatic, bodies: [ground, b], at: [0, 0, 0], axis: [1, 0, 0], spring: {{stiffness: {k[1]}, damping: {c[1]}}}}}
outputs: [first.displacement, second.displacement]
scenes: {{swing: {{end: 0.1, output_step: 0.001, positions: {{first.displacement: 1, second.displacement: 1}}, numerics: {{dt: 0.001}}}}}}
"""


def by_trapezoids(k: float, c: float, rows: int) -> Array:
    """Places by the rule, one linear equation a step: (1 - dt/2 A) y+ = (1 + dt/2 A) y."""
    rate = 1e-3 / 2 * np.array([[0, 1], [-k / 2, -c / 2]])
    step = np.linalg.solve(np.eye(2) - rate, np.eye(2) + rate)
    return np.array([(np.linalg.matrix_power(step, n) @ [1.0, 0.0])[0] for n in range(rows)])


@pytest.mark.parametrize(("k", "c"), [((2e4, 5e5), (0, 0)), ((2e5, 4e4), (40, 800)), ((1.2e7, 3e5), (0, 10)), ((0, 8e6), (9e3, 0))])
def test_two_masses(k: tuple[float, float], c: tuple[float, float], tmp_path: Path) -> None:
    """Five evaluations a step find it, also where dt^2/4 k/m or dt/2 c/m is above one, so that plain iterations never would."""
    (tmp_path / "model.yaml").write_text(MASSES.format(k=k, c=c), encoding="utf-8")
    run = completed(simulate(compile_model(tmp_path / "model.yaml"), tolerance=1e-9, error=False))
    for name, stiffness, damping in zip(("first.displacement", "second.displacement"), k, c, strict=True):
        assert np.abs(run[name] - by_trapezoids(stiffness, damping, 101)).max() < 1e-9, name
    assert run.evaluations <= 5 * run.steps


def test_smooth_motion_takes_little_more_than_an_evaluation_a_step() -> None:
    artifact = compile_model(MODELS / "pendulum.yaml")
    run, tight = (completed(simulate(artifact, tolerance=tolerance, error=False)) for tolerance in (1e-6, 1e-12))
    assert run.evaluations < 1.1 * run.steps
    assert np.abs(run["bob.x"] - tight["bob.x"]).max() < 1e-9
