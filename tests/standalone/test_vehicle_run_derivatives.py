"""Derivatives of 10 s of the Iltis over a ramp and steps, beside differences of runs whose steps follow from their own errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.methods import Loops
from cutjoint.run.scenes import load_model, with_loops
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS

#: Numbers of the front left wheel and of the vehicle (spring, damper, mass, hardpoint, speed), and the largest step of a difference.
OPENED = {"shock.law.sum.0.polynomial.1": 2000.0, "shock.law.sum.1.piecewise.1.polynomial.1": 300.0, "carrier.mass": 2.0, "D1.z": 1e-3}
BY = {**{f"front_left.{name}": h for name, h in OPENED.items()}, "tyre_stiffness": 4e3, "chassis_mass": 20.0, "chassis_free.vx": 0.1}
OUTPUTS = ["chassis.z", "chassis.pitch", "chassis.vx", "chassis.vz", "chassis.az"]
DT, STEPS, HALVINGS = 0.0075, 1333, 16


def differences(course: Callable[[float], NDArray[np.float64]], h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of fourth order, those of the step that differ least from those of twice that one, and by how much as a share, of each output."""
    central = [(course(h / 2**k) - course(-h / 2**k)) / (h / 2 ** (k - 1)) for k in range(HALVINGS)]
    fourth = [(4 * fine - coarse) / 3 for coarse, fine in pairwise(central)]
    changes = np.array([np.abs(fine - coarse).max(axis=0) for coarse, fine in pairwise(fourth)])
    best = changes.argmin(axis=0)
    found = np.stack([fourth[k + 1][:, i] for i, k in enumerate(best)], axis=1)
    return found, changes.min(axis=0) / np.abs(found).max(axis=0)


@pytest.mark.heavy
@pytest.mark.parametrize(("loops", "share"), [(Loops.EMBEDDED, 1e-7), (Loops.EXACT, 5e-6)])
def test_ten_seconds(loops: Loops, share: float) -> None:
    """Equations of loops know masses to 1e-16 of their penalty: differences of runs tell 1e-6 at 1e6, and 1e-4 at the scene's 1e9."""
    model, scene = load_model(MODELS / "iltis.yaml", "simul1", [name for name in BY if name.startswith("front_left")])
    chosen = with_loops(scene, loops)
    if loops is Loops.EXACT:
        chosen = replace(chosen, numerics=replace(chosen.numerics, penalty=1e6, multiplier_updates=40))
    sim = load_scene(replace(model, scenes={scene.name: chosen}), chosen, linearise=True).reset(dt=DT, iterations=60)
    start, begun, places = sim.snapshot(), dict(sim.states), [sim.outputs.place(name) for name in OUTPUTS]

    def course(name: str, change: float) -> NDArray[np.float64]:
        sim.restore(start)
        states = {**begun}
        numbers = states if name in states else sim.parameters
        value = numbers[name]
        numbers[name] = value + change
        sim.set_states(np.array([*states.values()]))
        rows = sim.run(STEPS)[:, places]
        if name not in states:
            sim.parameters[name] = value
        return rows

    sim.set_states(np.array([*begun.values()]))
    run = sim.forward_sensitivities(STEPS, OUTPUTS, list(BY))
    for i, (name, h) in enumerate(BY.items()):
        found, off = differences(lambda change, name=name: course(name, change), h)  # type: ignore[misc]
        error = np.abs(run.derivatives[1:, :, i] - found).max(axis=0) / np.abs(found).max(axis=0)
        assert off.max() < share, (name, off)
        assert error.max() < share, (name, error, off)
