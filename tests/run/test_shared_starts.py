"""The runs of an error estimate share the start of the first, bit for bit, unless it follows from their steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model, read_model_text
from cutjoint.run import simulator_run
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.results import ErrorEstimate
from cutjoint.run.settings import Options
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import call_simulator
from cutjoint.run.simulator_run import SimulatorRun, start
from tests.conftest import MODELS, needs_cpp
from tests.physics.test_held_poses import hanging

pytestmark = needs_cpp

#: A cart rests against a contact, with a first-order state that follows the place.
CART = """
cutjoint: 1
name: cart
gravity: [0.5, 0, -9.81]
bodies: {cart: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {slide: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}}
states: {heat: {start: 0, rate: "10*(20*slide.displacement - heat)"}}
forces:
  stop: {kind: joint_force, joint: slide, law: "where(position > 0.1, -1e4*(position - 0.1) - 10*rate, 0)"}
outputs: [cart.x, cart.vx, heat.value]
scenes: {rest: {end: 0.1, output_step: 0.01, pose: equilibrium, positions: {slide.displacement: 0.2}, near: [slide.displacement]}}
"""


def compiled(name: str) -> Artifact:
    method = name.partition(" ")[2] or "recursive"
    if name == "cart":
        model = read_model_text(CART, "cart.yaml")
    else:
        model = hanging() if name == "hanging" else read_model(MODELS / f"{name.partition(' ')[0]}.yaml")
    return compile_interpreted(model, next(iter(model.scenes.values())), method=method)


def estimated(name: str, monkeypatch: pytest.MonkeyPatch, **how: Any) -> tuple[ErrorEstimate, list[tuple[dict[str, Any], dict[str, Any]]]]:
    """An error estimate, and the run files and summaries of its runs, without times."""
    runs: list[tuple[dict[str, Any], dict[str, Any]]] = []

    def logged(simulator: Path, run_file: dict[str, Any], *others: Any, **more: Any) -> dict[str, Any]:
        summary = call_simulator(simulator, run_file, *others, **more)
        runs.append((run_file, {key: value for key, value in summary.items() if key not in ("seconds", "bytes")}))
        return summary

    monkeypatch.setattr(simulator_run, "call_simulator", logged)
    return simulate(compiled(name), check=False, end=0.02, **how).error, runs


@pytest.mark.parametrize(("name", "how"), [
    ("hanging", {"integrator": "dormand-prince"}), ("cart", {"integrator": "dormand-prince"}),
    ("delta recursive-newton", {"integrator": "radau5"}), ("delta recursive-newton", {"integrator": "generalised-alpha", "dt": 1e-3}),
    *((name, {"integrator": "trapezoidal", "dt": 1e-3}) for name in ("hanging", "cart", "delta recursive-newton", "axle augmented")),
])  # fmt: skip
def test_further_runs_take_the_start_of_the_first(name: str, how: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Estimates, steps and starts are the same, digit for digit, as of runs that seek their starts themselves."""
    found, runs = estimated(name, monkeypatch, **how)
    assert len(runs) >= 3
    assert "start" not in runs[0][0]
    assert all(file["start"] == runs[0][1]["start"] for file, _ in runs[1:])
    monkeypatch.setattr(SimulatorRun, "begun_as", lambda plan, _: plan)
    anew, others = estimated(name, monkeypatch, **how)
    assert not any("start" in file for file, _ in others)
    assert found == anew
    assert [summary for _, summary in runs] == [summary for _, summary in others]


def moved(plan: SimulatorRun) -> SimulatorRun:
    """The run with another start than a search would find."""
    found = start(plan).start
    assert found is not None
    return replace(plan, run_file=replace(plan.run_file, start={**found, "q": [1e-3 + found["q"][0], *found["q"][1:]]}))


def test_a_start_is_not_sought_again() -> None:
    """A start with another coordinate is taken, though it is no equilibrium."""
    plan = make_simulator_run(compiled("hanging"), Options())
    there, here = start(moved(plan)), start(plan)
    assert abs(there["upper.pitch"][0] - here["upper.pitch"][0]) == pytest.approx(1e-3, rel=1e-9)


def test_a_start_that_follows_from_steps_is_sought_again() -> None:
    """Penalties limit the steps of a fixed point and follow the closure: with other ones a start is another."""
    artifact = compiled("delta")
    plan = moved(make_simulator_run(artifact, Options(dt=1e-3, end=0.01, integrator="trapezoidal")))
    again = replace(plan, run_file=plan.run_file.with_settings(dt=5e-4))
    anew = replace(again, run_file=replace(again.run_file, start=None))
    first, other, sought = start(plan), start(again), start(anew)
    assert other.start == sought.start != first.start
    assert all(np.array_equal(other[column], sought[column]) for column in other)
