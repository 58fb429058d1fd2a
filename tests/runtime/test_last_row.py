"""The last row of a run that fails between two rows: a state with the guides and laws of its own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_model

#: A guide and a load over time, and a law that has no value after 0.355 s.
DRIVEN = """
cutjoint: 1
name: driven
gravity: [0, 0, 0]
bodies:
  slide: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  drive: {kind: prismatic, bodies: [ground, slide], at: [0, 0, 0], axis: [1, 0, 0], guide: t**2/2}
  rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  push: {kind: joint_force, joint: rail, law: 6*t}
  end: {kind: joint_force, joint: rail, law: 1e-9*sqrt(0.355 - t)}
outputs: [slide.x, slide.vx, block.y, push.force]
scenes:
  run: {end: 1, output_step: 0.1, numerics: {dt: 0.01}}
"""


@pytest.mark.parametrize(
    ("method", "integrator"),
    [
        ("recursive", "trapezoidal"), ("recursive", "rk4"), ("recursive", "dormand-prince"), ("augmented", "trapezoidal"),
        ("classical", "trapezoidal"), ("recursive-newton", "trapezoidal"), ("recursive-newton", "generalised-alpha"),
        ("recursive-newton", "radau5-fixed"), ("recursive-newton", "radau5"),
    ],
)  # fmt: skip
def test_the_last_row_of_a_failed_run_is_of_one_time(method: str, integrator: str, tmp_path: Path) -> None:
    path = tmp_path / "driven.yaml"
    path.write_text(DRIVEN, encoding="utf-8")
    run = simulate(compile_model(path, method=method), integrator=integrator, check=False)
    assert run.failure is not None
    t = run.t
    assert 0.3 <= t[-1] < 0.36
    assert run["slide.x"] == pytest.approx(t**2 / 2, abs=1e-9)
    assert run["slide.vx"] == pytest.approx(t, abs=1e-9)
    assert run["push.force"] == pytest.approx(6 * t, abs=1e-9)
    assert run["block.y"] == pytest.approx(t**3, abs=1e-4)
    if method != "recursive-newton" and integrator == "trapezoidal":
        assert t[-1] == pytest.approx(0.35)
    assert np.all(np.diff(t) > 0)


#: A law that grows from 0.352 s on: where events are located, what of a step lies before it counts.
BENT = DRIVEN.replace("law: 6*t}", 'law: "6*t + 0.1*max(0, t - 0.352)"}')


@pytest.mark.parametrize("output_step", [0.01, 0.1])
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_what_counts_of_a_failed_step_has_a_row(method: str, output_step: float, tmp_path: Path) -> None:
    path = tmp_path / "driven.yaml"
    path.write_text(BENT.replace("output_step: 0.1", f"output_step: {output_step}"), encoding="utf-8")
    run = simulate(compile_model(path, method=method), integrator="trapezoidal", events="located", check=False)
    assert run.failure is not None
    assert run.t[-1] == pytest.approx(0.352, abs=1e-9)
    assert run["slide.x"][-1] == pytest.approx(0.352**2 / 2, abs=1e-9)
    assert np.all(np.diff(run.t) > 1e-4)


@pytest.mark.parametrize("method", ["recursive", "augmented", "recursive-newton"])
def test_a_run_that_fails_right_after_a_row_has_no_row_twice(method: str, tmp_path: Path) -> None:
    path = tmp_path / "driven.yaml"
    path.write_text(DRIVEN.replace("output_step: 0.1", "output_step: 0.01"), encoding="utf-8")
    run = simulate(compile_model(path, method=method), integrator="trapezoidal", check=False)
    assert run.failure is not None
    assert run.t == pytest.approx(np.arange(36) * 0.01, abs=1e-9)
