"""Settings of a C export follow its steps as those of a run do."""

from __future__ import annotations

import pytest

import cutjoint
from tests.conftest import MODELS, needs_cpp

from .c_exports import ALONE

pytestmark = needs_cpp


@pytest.mark.parametrize("method", ALONE)
def test_expressions_of_the_step_follow_it(method: str) -> None:
    path = MODELS / "four_bar.yaml"
    artifact = cutjoint.compile_model(path, method=method)
    run = cutjoint.simulate(artifact, integrator="trapezoidal", events="crossed", error=False, dt=0.005, end=1)
    sim = cutjoint.load(path, method=method).reset(dt=0.005)
    sim.advance(run.t[-1])
    assert sim.outputs["tip.x"] == run["tip.x"][-1]


@pytest.mark.parametrize("method", ALONE)
def test_a_moment_after_steps_changed_goes_on_the_same(method: str) -> None:
    sim = cutjoint.load(MODELS / "four_bar.yaml", method=method).reset(dt=0.002)
    sim.run(10)
    sim.library.set_step(sim.address, 0.001)
    sim.step()
    other = sim.copy()
    assert (sim.run(50) == other.run(50)).all()
