"""Work and energy beside the motion: as good as the steps, they see what errors of steps do not, and end a motion that runs away."""

from __future__ import annotations

import json
import random
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import EnergyBalance, Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.fuzz import poses
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

#: A crank that is driven to and fro turns a rod with a slider, which a spring and a damper hold: guide, loop, weight, law and damping.
DRIVEN = """
cutjoint: 1
name: driven
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.05], inertia: [0.001, 0.001, 0.0005]}
  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.001, 0.008, 0.008]}
  slider: {mass: 1, centre_of_mass: [0.3, 0, 0]}
  ball: {mass: 0.5, centre_of_mass: [0.3, 0, -0.2], inertia: [0.001, 0.001, 0.001]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0], GUIDE}
  elbow: {kind: revolute, bodies: [crank, rod], at: [0, 0, 0.1], axis: [0, 1, 0]}
  wrist: {kind: revolute, bodies: [rod, slider], at: [0.3, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0]}
  eye: {kind: spherical, bodies: [slider, ball], at: [0.3, 0, 0]}
forces:
  spring: {kind: joint_force, joint: rail, law: "-200*position - 5*rate"}
outputs: [slider.x, ball.x, ball.z]
scenes: {turn: {end: 1, output_step: 10 ms NUMERICS}}
"""
GUIDE = 'guide: "0.6*sin(8*t)"'
#: A slider-crank that friction by the load of its rail brakes; a closed loop whose multipliers load the rail.
BRAKED = """
cutjoint: 1
name: braked
gravity: [0, 0, 0]
bodies:
  crank: {mass: 2, centre_of_mass: [0, 0, 0.05], inertia: [0.002, 0.002, 0.002]}
  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.009, 0.009, 0.009]}
  slider: {mass: 3, centre_of_mass: [0.3, 0, 0], inertia: [0.01, 0.01, 0.01]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, -1, 0]}
  elbow: {kind: cylindrical, bodies: [crank, rod], at: [0, 0, 0.1], axis: [0, -1, 0], cut: CUT}
  wrist: {kind: spherical, bodies: [rod, slider], at: [0.3, 0, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0]}
forces: {rub: {kind: joint_friction, joint: rail, coefficient: 0.2}}
outputs: [crank.wy, slider.x]
scenes: {run: {end: 0.5, output_step: 0.05, rates: {pin.angle_rate: 10}}}
"""
#: A penalty that lets loops give way.
SOFT = ", numerics: {closure: penalty, penalty: 5, multiplier_updates: 0, frequency: 1}"
#: A cart with a light pole whose joint feeds the pole.
CART = """
cutjoint: 1
name: cartpole
gravity: [0, 0, -9.81]
bodies:
  cart: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
  pole: {mass: 0.001, centre_of_mass: [0, 0, 0.5], inertia: [1e-05, 1e-05, 1e-08]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}
  pin: {kind: revolute, bodies: [cart, pole], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  push: {kind: joint_force, joint: rail, law: "-20*position - 5*rate"}
  hold: {kind: joint_force, joint: pin, law: "0.5*position + 0.02*rate"}
outputs: [cart.x, pin.angle, pin.angle_rate, pole.x]
scenes: {swing: {end: 5, output_step: 10 ms, positions: {pin.angle: 0.2}}}
"""


@cache
def compiled(text: str, method: str = "recursive") -> Artifact:
    model = read_model_text(text, "model.yaml")
    (scene,) = model.scenes.values()
    return compile_scene(model, scene, CompileOptions(method=method))


def driven(method: str = "recursive", numerics: str = "", guide: str = GUIDE) -> Artifact:
    return compiled(DRIVEN.replace("GUIDE", guide).replace("NUMERICS", numerics), method)


def balance(run: Trajectory) -> EnergyBalance:
    assert run.failure is None
    assert run.energy is not None
    return run.energy


@pytest.mark.parametrize(
    ("method", "integrator", "coarse", "order"),
    [
        ("recursive", "trapezoidal", 2e-3, 2), ("recursive", "rk4", 4e-3, 4),
        ("recursive-newton", "trapezoidal", 2e-3, 2), ("augmented", "trapezoidal", 2e-3, 2), ("classical", "trapezoidal", 2e-3, 2),
    ],
)  # fmt: skip
def test_the_defect_falls_with_the_order(method: str, integrator: str, coarse: float, order: int) -> None:
    """Of a driven mechanism, guide, spring, damper and ball included: half the step leaves 2^-order of it."""
    runs = [simulate(driven(method), integrator=integrator, dt=dt) for dt in (coarse, coarse / 2)]
    first, second = (balance(run) for run in runs)
    assert first.share < 1e-3
    assert np.log2(first.defect / second.defect) == pytest.approx(order, abs=0.5)
    assert first.exchanged == pytest.approx(second.exchanged, rel=1e-2)


@pytest.mark.parametrize(("method", "integrator"), [
    ("recursive", "dormand-prince"), ("recursive-newton", "radau5"),
])  # fmt: skip
def test_the_defect_falls_with_the_tolerance(method: str, integrator: str) -> None:
    loose, tight = (balance(simulate(driven(method), integrator=integrator, tolerance=x)) for x in (1e-5, 1e-7))
    assert loose.share < 1e-3
    assert tight.defect < loose.defect / 10


@pytest.mark.parametrize("cut", ["true", "false"])
@pytest.mark.parametrize(("method", "integrator"), [("recursive", "dormand-prince"), ("recursive-newton", "radau5")])
def test_friction_does_the_work_of_the_loads_in_each_step(method: str, integrator: str, cut: str) -> None:
    """Loads follow from accelerations and multipliers, which are those of the places inside steps at which power is measured."""
    run = simulate(compiled(BRAKED.replace("CUT", cut), method), integrator=integrator, tolerance=1e-9)
    assert balance(run).share < 1e-6
    assert balance(run).exchanged > 0.2  # J, of 2.35


def test_all_methods_find_the_same_work() -> None:
    """Energy and exchanged work are the mechanism's, not the method's."""
    exact = balance(simulate(driven(), integrator="dormand-prince", tolerance=1e-8))
    for method in ("recursive-newton", "augmented", "classical"):
        found = balance(simulate(driven(method), integrator="trapezoidal", dt=1e-3))
        assert found.kinetic == pytest.approx(exact.kinetic, rel=1e-3)
        assert found.exchanged == pytest.approx(exact.exchanged, rel=1e-3)


def test_a_balance_changes_nothing_and_is_left_out_on_request() -> None:
    for integrator in ("trapezoidal", "dormand-prince"):
        with_it, without = (simulate(driven(), integrator=integrator, error=error, **given(integrator)) for error in (True, False))
        assert without.energy is None
        assert with_it.energy is not None
        for column in with_it.columns:
            assert np.array_equal(with_it[column], without[column])


def given(integrator: str) -> dict[str, float]:
    return {"dt": 1e-3} if integrator == "trapezoidal" else {"tolerance": 1e-6}


def test_a_penalty_far_too_small_is_a_warning() -> None:
    """Loops that give way take up work; all steps agree on that to 1e-5, and beside closed loops the errors are larger."""
    run, finer = (simulate(driven(numerics=SOFT), integrator="trapezoidal", dt=dt) for dt in (1e-3, 5e-4))
    assert max(float(np.max(np.abs(run[name] - finer[name]))) for name in run.columns) < 1e-5
    error = run.error
    assert max(error.max_error.values()) > 1e-4
    assert "constraint violation of loops" in error.warnings[1]
    assert "work and energy differ by" in error.warnings[0]


def test_the_warning_is_in_the_terminal_and_beside_the_table(tmp_path: Path) -> None:
    model, out = tmp_path / "driven.yaml", tmp_path / "run.csv"
    model.write_text(DRIVEN.replace("GUIDE", GUIDE).replace("NUMERICS", SOFT), encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(model), "--integrator", "trapezoidal", "--dt", "1e-3", "--out", str(out)])
    assert done.exit_code == 0
    assert "work and energy differ by" in " ".join(done.output.split())
    assert "work and energy differ by" in json.loads((tmp_path / "run.error.json").read_text())["warnings"][0]


def test_a_guide_that_jumps_unseen_is_a_warning() -> None:
    """A speed that changes at once takes a work that no power has: steps know it of a law, not of a table that is linear."""
    jumping = driven(guide='guide: "where(t < 0.5, 0, 3*(t - 0.5))"')
    for events in ("crossed", "located"):
        assert simulate(jumping, integrator="rk4", dt=1e-3, events=events).error.warnings == ()
    text = DRIVEN.replace("bodies:", "parameters: {turn: {value: 0, unit: rad, binding: input}}\nbodies:", 1)
    sampled = compiled(text.replace("GUIDE", "guide: turn").replace("NUMERICS", ""), "recursive")
    table = {"t": [0.0, 0.5, 1.0], "value": [0.0, 0.0, 1.5], "interpolation": "linear"}
    error = simulate(sampled, integrator="rk4", dt=1e-3, inputs={"turn": table}).error
    assert "a guide that jumps" in error.warnings[0]


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented"])
def test_runs_that_are_right_have_no_warning(method: str) -> None:
    for dt in (1e-3, 5e-3):
        assert simulate(driven(method), integrator="trapezoidal", dt=dt).error.warnings == ()


@pytest.mark.parametrize("seed", [8, 9, 11, 12, 31, 43, 515, 560])
def test_rest_is_no_imbalance(seed: int) -> None:
    """Planar mechanisms at rest: they move by the remainder of the search for rest and by rounding alone, of which the steps keep no
    balance."""
    case = {**json.loads(poses.make(random.Random(seed))), "held": []}
    model = json.loads(poses.model_text(case, guided=False))
    model["scenes"]["run"] = {"end": 0.5, "output_step": 0.1, "pose": "equilibrium"}
    read = read_model_text(json.dumps(model), "resting.yaml")
    run = simulate(compile_interpreted(read, read.scenes["run"]))
    assert balance(run).share > 1e-3
    assert run.error.warnings == ()


def test_what_a_guide_holds_against_a_large_force_is_no_imbalance() -> None:
    """Rounding of a guide's force at 1e-16 m/s is all the work that there is."""
    text = DRIVEN.replace("GUIDE", "guide: 0").replace(" NUMERICS", ", pose: equilibrium").replace('"-200*position - 5*rate"', "1e9")
    model = read_model_text(text, "held.yaml")
    run = simulate(compile_interpreted(model, model.scenes["turn"]))
    assert balance(run).share > 0.5
    assert balance(run).exchanged > 10e-12 * balance(run).of_unit_speed
    assert run.error.warnings == ()


@pytest.mark.parametrize("dt", [0.05, 0.01])
@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_coarse_steps_do_not_run_away(integrator: str, dt: float) -> None:
    """A fall from rest, and impacts that take a step or two."""
    run = simulate(compiled(bouncing_text(0.0, 0.5)), integrator=integrator, dt=dt, check=False)
    assert run.failure is None or "runs away" not in run.failure.message


@pytest.mark.parametrize(
    ("method", "integrator", "dt"),
    [
        ("recursive", "rk4", 1e-2), ("recursive", "rk4", 1e-3),
        ("recursive-newton", "trapezoidal", 1e-2), ("recursive-newton", "trapezoidal", 1e-3),
    ],
)  # fmt: skip
def test_a_motion_that_runs_away_ends_the_run(method: str, integrator: str, dt: float, tmp_path: Path) -> None:
    """With the last row before its energy came from nowhere, in the file too."""
    run = simulate(compiled(CART, method), integrator=integrator, dt=dt, out=tmp_path / "run.csv", check=False)
    assert run.failure is not None
    assert "the motion runs away: since t = 0." in run.failure.message
    assert run.failure.time < 0.2
    assert run.t[-1] < 0.11
    assert np.abs(run["pole.x"]).max() < 100
    assert run.table is not None
    assert len(run.table.read_text().splitlines()) == run.t.size + 1
