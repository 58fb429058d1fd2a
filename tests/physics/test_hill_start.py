"""A car that stands on a slope by its brakes, from the pose at rest that is found there, and drives off: the car of a recipe."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cutjoint.model.read import read_model_text
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, ROOT
from tests.physics.simulation import compile_scene, completed

#: 20 % upwards, from level ground at rest: nothing is held, and the brakes let go while the engine pulls.
HILL = """scenes:
  hill:
    end: 4
    output_step: 0.01
    pose: equilibrium
    road: {start: -20, profile: [{step: -4}, {ramp: 200, rise: 40}]}
    inputs:
      brake: {table: {t: [0, 2, 2.3, 99], value: [1500, 1500, 0, 0]}, interpolation: linear}
      drive: {table: {t: [0, 1.5, 2, 99], value: [0, 0, PULL, PULL]}, interpolation: linear}
    outputs: [chassis.x, chassis.pitch, WHEELS]
"""
WHEELS = ", ".join(f"{corner}.w.rolling.contact.{force}" for corner in ("fl", "fr", "rl", "rr") for force in ("Fx", "Fz"))


def climb(pull: float, **choices: object) -> Trajectory:
    found = re.search(r'```yaml title="driven.yaml"\n(.*?)```', (ROOT / "docs/how-to/simple-car.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    text = found[1].partition("scenes:")[0] + HILL.replace("PULL", str(pull)).replace("WHEELS", WHEELS)
    model = read_model_text(text, "m.yaml", folder=MODELS)
    return completed(simulate(compile_scene(model, model.scenes["hill"]), **choices))  # type: ignore[arg-type]


@pytest.mark.parametrize("choices", [{}, {"integrator": "trapezoidal", "dt": 1e-3}], ids=["adaptive", "1 ms"])
def test_a_car_starts_uphill_from_its_rest_on_the_slope(choices: dict[str, object]) -> None:
    """Brakes and treads bear the slope's share of the weight from the first instant on; it does not creep, and does not roll back."""
    run = climb(650, **choices)
    x, stands = run["chassis.x"], run.t <= 1.5
    weight = (1260 + 4 * (15 + 15 + 20)) * 9.81
    along, up = (sum(run[f"{corner}.w.rolling.contact.{force}"][0] for corner in ("fl", "fr", "rl", "rr")) for force in ("Fx", "Fz"))
    assert (along, up) == pytest.approx((weight * 0.2 / np.hypot(1, 0.2), weight / np.hypot(1, 0.2)), rel=1e-9)
    assert abs(run["chassis.pitch"][0] + np.arctan(0.2)) < 0.02
    assert np.ptp(x[stands]) < 1e-9
    assert (x - x[0]).min() > -1e-9
    assert x[-1] - x[0] > 0.5
    assert run.energy is not None
    assert run.energy.share < 1e-6


def test_a_car_that_is_not_driven_rolls_back() -> None:
    run = climb(0, error=False)
    assert run["chassis.x"][-1] - run["chassis.x"][0] < -0.5
