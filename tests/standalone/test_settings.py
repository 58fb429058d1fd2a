"""Settings of a folder that stands alone follow its steps as those of a run do."""

from __future__ import annotations

import cutjoint
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp


def test_expressions_of_the_step_follow_it() -> None:
    path = MODELS / "four_bar.yaml"
    run = cutjoint.simulate(cutjoint.compile_model(path), integrator="trapezoidal", events="crossed", error=False, dt=0.005, end=1)
    sim = cutjoint.load(path).reset(dt=0.005)
    sim.advance(run.t[-1])
    assert sim.outputs["tip.x"] == run["tip.x"][-1]


def test_a_moment_after_steps_changed_goes_on_the_same() -> None:
    sim = cutjoint.load(MODELS / "four_bar.yaml").reset(dt=0.002)
    sim.play(10)
    sim.library.set_step(sim.address, 0.001)
    sim.step()
    other = sim.copy()
    assert (sim.play(50) == other.play(50)).all()
