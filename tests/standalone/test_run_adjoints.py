"""Slopes of objectives by the adjoint method: beside those along directions, and beside closed forms."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.methods import Loops
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene, load_model, with_loops
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp
from tests.standalone.test_run_derivatives import CART, CHAIN, FALL, PENDULUM
from tests.standalone.test_step_derivatives import loaded

pytestmark = needs_cpp


def backwards(text: str, name: str, method: str = "recursive", integrator: str = "trapezoidal") -> cutjoint.Simulation:
    model = read_model_text(text, f"{name}.yaml")
    return load_scene(model, find_scene(model, None), method=method, integrator=integrator, adjoint=True)


def compare(sim: cutjoint.Simulation, share: float, steps: int = 100, every: int = 5) -> None:
    """Two objectives of all outputs with weights at random, by all."""
    start, by = sim.snapshot(), [*sim.states, *sim.parameters, *sim.inputs]
    along = sim.forward_sensitivities(steps, list(sim.outputs), by, every=every)
    end = sim.states.array
    sim.restore(start)
    sizes = np.maximum(np.abs(along.values).max(axis=0), 1e-3)
    weights = np.random.default_rng(1).normal(size=(2, *along.values.shape)) / sizes
    back = sim.adjoint_sensitivities(steps, list(sim.outputs), by, weights, every=every)
    assert (sim.states.array == end).all()
    assert (back.values == along.values).all()
    wanted = np.tensordot(weights, along.derivatives, 2)
    error = np.abs(back.derivatives - wanted).max(axis=0) / np.abs(wanted).max(axis=0)
    assert error.max() < share, dict(zip(by, error, strict=True))


@pytest.mark.parametrize(("text", "name", "method", "integrator", "settings", "share"), [
    (CART, "cart", "recursive", "trapezoidal", {"iterations": 40}, 2e-11), (CART, "cart", "recursive", "rk4", {}, 1e-12),
    (CHAIN, "chain", "recursive", "trapezoidal", {"iterations": 40}, 2e-9),
    (CHAIN, "chain", "recursive", "dormand-prince", {"tolerance": 1e-10}, 1e-12),
    (CHAIN, "chain", "recursive-newton", "trapezoidal", {}, 2e-9),
])  # fmt: skip
def test_chains_states_and_controllers(
    text: str, name: str, method: str, integrator: str, settings: dict[str, float], share: float
) -> None:
    sim = backwards(text, name, method, integrator).reset(dt=5e-3, **settings)
    sim.choose_independent()
    compare(sim, share)


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_loops(integrator: str) -> None:
    outputs = "reactions: {foot: {joint: elbow, axes_of: ground}}\noutputs: [pin.angle, slider.x, foot.Fx]"
    text = re.sub(r"outputs: .*", outputs, (MODELS / "press.yaml").read_text(encoding="utf-8"))
    sim = backwards(text, "press", integrator=integrator).reset(dt=1e-3)
    sim.choose_independent(["pin.angle_rate"])
    compare(sim, 1e-11)


@pytest.mark.heavy
def test_loops_by_explicit_steps_near_a_dead_centre() -> None:
    sim = backwards(FALL, "fall", integrator="rk4").reset(dt=0.02)
    sim.choose_independent()
    compare(sim, 1e-9, steps=40)


def test_a_hardpoint_of_loops_that_functions_close() -> None:
    model, scene = load_model(MODELS / "press.yaml", None, ["A.z"])
    chosen = with_loops(scene, Loops.EMBEDDED)
    sim = load_scene(replace(model, scenes={scene.name: chosen}), chosen, integrator="rk4", adjoint=True).reset(dt=1e-3)
    sim.choose_independent(["pin.angle_rate"])
    compare(sim, 1e-9)


def test_a_pendulum_by_gravity() -> None:
    """Small swings: the angle is a0 cos(w t), w^2 = g/l, and so its slope by g is -a0 t sin(w t)/(2 w l)."""
    sim = backwards(PENDULUM, "pendulum", integrator="rk4").reset(dt=1e-3, coordinates={"pin.angle": np.pi / 2 + 1e-5})
    sim.choose_independent()
    run = sim.adjoint_sensitivities(1000, ["pin.angle"], ["g", "pin.angle"], "end", every=1000)
    rate = np.sqrt(9.81)
    assert run.derivatives[0] == pytest.approx([-1e-5 * np.sin(rate) / (2 * rate), np.cos(rate)], rel=1e-7)
    assert run.objectives[0] == run.values[-1, 0]


def test_objectives_by_names_and_functions() -> None:
    sim = backwards(PENDULUM, "pendulum", integrator="rk4").reset(dt=1e-2, coordinates={"pin.angle": 1.0})
    sim.choose_independent()
    start, outputs, by = sim.snapshot(), list(sim.outputs), ["g", "pin.angle_rate"]
    along = sim.forward_sensitivities(200, outputs, by, every=10)
    for objective in ("end", "integral", "mean", "rms", "maximum", "minimum"):
        sim.restore(start)
        back = sim.adjoint_sensitivities(200, outputs, by, objective, every=10)
        value, derivatives = getattr(along, objective)
        assert back.objectives == pytest.approx(value, rel=1e-12)
        assert back.derivatives == pytest.approx(derivatives, rel=1e-10)
    sim.restore(start)
    cubes = sim.adjoint_sensitivities(200, outputs, by, lambda times, values: 3 * values[None] ** 2, every=10)
    assert cubes.derivatives[0] == pytest.approx((3 * along.values[:, :, None] ** 2 * along.derivatives).sum(axis=(0, 1)), rel=1e-10)


def test_what_cannot_be() -> None:
    sim = backwards(PENDULUM, "pendulum", integrator="rk4").reset(dt=1e-2, coordinates={"pin.angle": 1.0})
    with pytest.raises(ValueError, match=re.escape("weights are (1, 3, 1), not (objectives, 2, 1)")):
        sim.adjoint_sensitivities(10, ["pin.angle"], ["g"], np.ones((1, 3, 1)), every=10)
    with pytest.raises(KeyError, match="no 'gg'; did you mean 'g'"):
        sim.adjoint_sensitivities(10, ["pin.angle"], ["gg"], "end")
    with pytest.raises(ValueError, match="no objective 'max'; there is end, integral, mean, rms, maximum, minimum"):
        sim.adjoint_sensitivities(10, ["pin.angle"], ["g"], "max")
    for steps, every, error, reported in ((10, 0, ValueError, "every: 0 is below 1"), (-1, 1, ValueError, "steps: -1 is below 0"),
                                      (10, 2.5, TypeError, "every: 2.5 is no whole number")):  # fmt: skip
        with pytest.raises(error, match=reported):
            sim.adjoint_sensitivities(steps, ["pin.angle"], ["g"], "end", every=every)  # type: ignore[arg-type]
    still = backwards(PENDULUM, "pendulum", integrator="rk4").reset(dt=1e-2, coordinates={"pin.angle": np.pi / 2})
    still.parameters["g"] = 0.0
    with pytest.raises(ValueError, match=re.escape("'pin.angle' is the same 1.5708 at 0 s and 0.01 s, with other derivatives")):
        still.reset(dt=1e-2, coordinates={"pin.angle": np.pi / 2}).adjoint_sensitivities(10, ["pin.angle"], ["g"], "maximum")
    with pytest.raises(TypeError, match="load the model with adjoint=True"):
        loaded(PENDULUM, "pendulum", "recursive", "rk4").reset().adjoint_sensitivities(1, ["pin.angle"], ["g"], "end")


def test_the_command_goes_backwards_for_many_numbers(tmp_path: Path) -> None:
    (tmp_path / "chain.yaml").write_text(CHAIN)
    options = ["--integrator", "rk4", "--dt", "1e-3", "--end", "0.2", "--output", "lower.z", "--objective", "rms"]
    call = ["gradient", str(tmp_path / "chain.yaml"), *options]
    back = CliRunner().invoke(main, [*call, "--check"])
    assert back.exit_code == 0, back.output
    assert float(re.search(r"largest deviation from finite differences: (\S+) of", back.output)[1]) < 1e-7  # type: ignore[index]
    forth = CliRunner().invoke(main, [*call, "--by", "g"])
    derivatives = [re.search(r"^ *g +(\S+)", said.output, re.MULTILINE)[1] for said in (back, forth)]  # type: ignore[index]
    assert derivatives[0] == derivatives[1]


#: A mass on a spring under its weight.
HUNG = """
cutjoint: 1
name: hung
gravity: [0, 0, -9.81]
parameters:
  k: {value: 400, unit: N/m, binding: param}
  load: {value: 3, unit: kg, binding: param}
  push: {value: 0, unit: N, binding: input}
bodies: {mass: {mass: load, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {spring: {kind: joint_force, joint: rail, law: push - k*rail.displacement - 2*rail.displacement_rate}}
outputs: [rail.displacement, spring.force]
scenes: {rest: {end: 1, output_step: 0.01, pose: equilibrium}}
"""


def test_a_pose_at_rest_follows_its_closed_form() -> None:
    """x = (push - m g)/k, and a run that begins there stays, so that its end changes as its beginning does."""
    sim = backwards(HUNG, "hung", integrator="rk4").reset(dt=1e-2)
    by, x = ["k", "load", "push"], -3 * 9.81 / 400
    rest = sim.equilibrium_sensitivities(list(sim.outputs), by)
    assert rest.derivatives[0] == pytest.approx([-x / 400, -9.81 / 400, 1 / 400], rel=1e-9)
    assert rest.derivatives[1] == pytest.approx([0.0, 9.81, 0.0], abs=1e-9)
    start = sim.snapshot()
    along = sim.forward_sensitivities(50, list(sim.outputs), by, initial_sensitivities=rest.states)
    sim.restore(start)
    back = sim.adjoint_sensitivities(50, list(sim.outputs), by, "end", initial_sensitivities=rest.states)
    assert along.end[1] == pytest.approx(rest.derivatives, abs=1e-9)
    assert back.derivatives == pytest.approx(rest.derivatives, abs=1e-9)
    with pytest.raises(ValueError, match=re.escape("initial_sensitivities: it is (1, 3), not (2, 3), states and numbers")):
        sim.adjoint_sensitivities(1, ["rail.displacement"], by, "end", initial_sensitivities=rest.states[:1])
    sim.reset(dt=1e-2, coordinates={"rail.displacement": 0.1})
    with pytest.raises(ValueError, match="the mechanism moves: a state changes by"):
        sim.equilibrium_sensitivities(["rail.displacement"], by)


@pytest.mark.parametrize("options", [["--objective", "equilibrium"], ["--from-equilibrium", "--objective", "mean"]])
def test_the_command_lets_a_pose_at_rest_change(options: list[str], tmp_path: Path) -> None:
    (tmp_path / "hung.yaml").write_text(HUNG)
    call = ["gradient", str(tmp_path / "hung.yaml"), "--integrator", "rk4", "--dt", "1e-2", "--check", *options]
    said = CliRunner().invoke(main, call)
    assert said.exit_code == 0, said.output
    assert re.search(r"load +-0\.024525 ", said.output), said.output
    error = float(re.search(r"largest deviation from finite differences: (\S+) of", said.output)[1])  # type: ignore[index]
    assert error < 1e-6  # of poses at rest that are found to 1e-9
