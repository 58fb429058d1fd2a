"""Derivatives of steps and runs by Radau IIA: closed forms of linear motions, differences of runs, and by the adjoint method."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

import cutjoint
from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene, load_model
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.standalone.test_event_derivatives import BY, PUSHED, SPRING, STOPPED, THRUST, along, numbers, sprung, thrown
from tests.standalone.test_run_adjoints import backwards
from tests.standalone.test_run_adjoints import compare as compare_backwards
from tests.standalone.test_run_derivatives import CART, CHAIN, PENDULUM, compare, fourth_order, from_start
from tests.standalone.test_step_derivatives import DAMPING, MASS, OSCILLATOR, PUSHER, STIFFNESS, H

pytestmark = needs_cpp

#: Settings with which iterations of stages leave next to rounding, so that differences of runs are exact.
_EXACT = "numerics: {dt: 1 ms, solver_tolerance: 1e-13, absolute_tolerance: 1e-13}"


@cache
def by_radau(text: str, name: str, integrator: str = "radau5-fixed") -> cutjoint.Simulation:
    """A model whose derivatives go both ways, with exact iterations where its scene leaves room."""
    exact = re.sub(r"(scenes: {\w+: {)(?!numerics)", rf"\1{_EXACT}, ", text)
    return backwards(exact, name, "recursive-newton", integrator)


def known_step(stiffness: complex, h: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The matrices of a step of the oscillator, R(h A) with the Pade approximant (2, 3) of the exponential, and what a push adds."""
    A, one = np.array([[0, 1], [-stiffness / MASS, -DAMPING / MASS]], dtype=complex), np.eye(2)
    z = h * A
    R = np.linalg.solve(one - 3 * z / 5 + 3 * z @ z / 20 - z @ z @ z / 60, one + 2 * z / 5 + z @ z / 20).astype(complex)
    return R, np.linalg.solve(A, (R - one) @ np.array([[0j], [1 / MASS]]))


def test_a_step_of_a_linear_motion() -> None:
    sim = by_radau(OSCILLATOR, "oscillator").reset(dt=H)
    sim.inputs["push"] = 0.7
    sim.step()
    other, start = sim.copy(), sim.states.array.copy()
    found = sim.step_derivatives()
    R, by_push = known_step(STIFFNESS, H)
    shifted = known_step(STIFFNESS + 1e-30j, H)
    by_stiffness = (shifted[0] @ start + 0.7 * shifted[1][:, 0]).imag / 1e-30
    assert found.by_state == pytest.approx(R.real, rel=1e-13)
    assert found.by_input == pytest.approx(by_push.real, rel=1e-12)
    assert found.by_parameter[:, 0] == pytest.approx(by_stiffness, rel=1e-12)
    assert other.run(5)[1:].tolist() == sim.run(4).tolist()


@pytest.mark.parametrize(("stiffness", "steps"), [(STIFFNESS, 40), (1e9, 20)])
def test_a_run_of_a_linear_motion_however_stiff(stiffness: float, steps: int) -> None:
    """Along a complex step of the stiffness, with the powers of the closed form.

    A stiff step takes back 1e5 times what it leaves. The rounding of that adds up.
    """
    sim = by_radau(OSCILLATOR, "oscillator")
    sim.inputs["push"], sim.parameters["stiffness"] = 0.0, stiffness
    sim.reset(dt=H)
    run = sim.forward_sensitivities(steps, ["mass.x"], ["stiffness", *sim.states], every=steps)
    sim.parameters["stiffness"] = STIFFNESS
    R, along_stiffness = known_step(stiffness + 1e-30j, H)[0], np.array([0.3, 0.0], dtype=complex)
    for _ in range(steps):
        along_stiffness = R @ along_stiffness
    powers = np.linalg.matrix_power(R.real, steps)
    size = np.abs(powers[0]).max()
    assert run.end[0][0] == pytest.approx(along_stiffness[0].real, rel=1e-9)
    assert run.end[1][0, 0] == pytest.approx(along_stiffness[0].imag / 1e-30, rel=1e-9)
    assert run.end[1][0, 1:] == pytest.approx(powers[0], rel=1e-9, abs=1e-9 * size)


def test_a_pendulum_by_gravity_in_steps_that_follow_errors() -> None:
    """An angle that starts at rest is a function of t sqrt(g), so that its derivative by g is t angle'/(2 g)."""
    sim = by_radau(PENDULUM, "pendulum", "radau5").reset(dt=0.1, tolerance=1e-11)
    run = sim.forward_sensitivities(20, ["pin.angle", "pin.angle_rate"], ["g"])
    assert run.derivatives[1:, 0, 0] == pytest.approx(run.times[1:] * run.values[1:, 1] / (2 * 9.81), rel=1e-8)


@pytest.mark.parametrize(("text", "name", "outputs", "by", "dt"), [
    (CART, "cart", 3, {"k": 1e-1, "c": 1e-2, "load": 2e-4, "push": 1e-2}, 5e-3),
    (CHAIN, "chain", 3, {"g": 1e-2, "load": 1e-3, "knee": 1e-3}, 2e-3),
])  # fmt: skip
def test_chains_balls_states_and_controllers(text: str, name: str, outputs: int, by: dict[str, float], dt: float) -> None:
    sim = by_radau(text, name).reset(dt=dt)
    compare(sim, None, list(sim.outputs)[:outputs], by, 2e-9)
    sim.reset()
    sim.choose_independent()
    compare_backwards(sim, 1e-12)


@cache
def press() -> cutjoint.Simulation:
    model, scene = load_model(MODELS / "press.yaml", None, ["A.z"])
    return load_scene(model, scene, method="recursive-newton", integrator="radau5-fixed", adjoint=True)


def test_no_number_is_read_before_it_is_written() -> None:
    """A free top beside a force that ends does not follow its end, wherever the memory of its steps begins as a pattern."""
    body = "bodies: {top: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 2, 3]}, mass:"
    joint = "joints: {tip: {kind: spherical, bodies: [ground, top], at: [0, 0, 0]}, slide:"
    text = PUSHED.replace("bodies: {mass:", body).replace("joints: {slide:", joint)
    text = text.replace("0.01}}", "0.01, rates: {tip.wx: 1, tip.wy: 2}}}")
    model = read_model_text(text.replace("[mass.z]", "[top.wx, top.wz]"), "top.yaml")
    flags = ("-O0", "-ftrivial-auto-var-init=pattern")
    sim = load_scene(model, find_scene(model, None), method="recursive-newton", integrator="radau5-fixed", linearise=True, flags=flags)
    run = sim.reset(dt=5e-3).forward_sensitivities(70, ["top.wx", "top.wz"], ["until"])
    assert run.end[0][1] != 0
    assert run.end[1].tolist() == pytest.approx(np.zeros((2, 1)), abs=1e-9)


def test_a_loop_and_its_hardpoint() -> None:
    """Beside differences, whose iterations end at the tolerance of the scene."""
    sim = press().reset(dt=2e-3)
    compare(sim, ["pin.angle_rate"], ["slider.x", "spring.force"], {"stiffness": 3.0, "A.z": 1e-5}, 1e-7)
    sim.reset()
    sim.choose_independent(["pin.angle_rate"])
    compare_backwards(sim, 1e-12)


def test_loops_near_a_dead_centre_come_nearer_with_shorter_steps() -> None:
    """The run closes its loops in the norm of a tangent that may be that of an earlier step; derivatives do in that of the masses.  The
    difference is below the error of the rule itself."""
    sim = by_radau(PUSHER.replace(", numerics: {NUMERICS}", ""), "pusher")
    derivatives = {}
    for dt in (1e-2, 5e-3, 2.5e-3, 6.25e-4):
        sim.reset(dt=dt)
        derivatives[dt] = sim.forward_sensitivities(round(1 / dt), ["cart.x"], ["drag", "torque"], every=round(0.1 / dt)).derivatives
    *errors, _ = (np.abs(found - derivatives[6.25e-4]).max() / np.abs(derivatives[6.25e-4]).max() for found in derivatives.values())
    assert errors[0] < 2e-2
    assert errors[2] < 1e-5
    sim.reset(dt=1e-2)
    compare(sim, None, ["cart.x"], {"drag": 0.01, "torque": 0.0005}, 1e-7, steps=20)


@pytest.mark.parametrize(("text", "known"), [(THRUST, thrown), (SPRING, sprung)])
@pytest.mark.parametrize(("integrator", "dt", "tolerance"), [("radau5-fixed", 1e-3, None), ("radau5", 1e-2, 1e-9)])
def test_a_ball_that_bounces(text: str, known: Callable, integrator: str, dt: float,
    tolerance: float | None) -> None:  # type: ignore[type-arg]
    """Behind the bounce, with the times of contact and of leaving."""
    sim = by_radau(text, "ball", integrator).reset(dt=dt, tolerance=tolerance)
    run = sim.forward_sensitivities(round(0.7 / dt), ["mass.z", "mass.vz"], BY, every=10, events=3)
    wanted, events = along(known, 0.7), run.events
    assert np.abs(run.end[1] - wanted[:2]).max() < 1e-9 * np.abs(wanted[:2]).max()
    assert events is not None
    assert events.names == ("stop", "stop")
    assert events.times == pytest.approx([x.real for x in known(0.7, *numbers)[2:]], rel=1e-9)
    assert events.derivatives_of_times == pytest.approx(wanted[2:], rel=1e-9, abs=1e-9)
    assert events.derivatives[:, 0] == pytest.approx(np.array([[0, 0, 0, 1]] * 2), abs=1e-9)


def test_a_force_that_ends_at_a_time() -> None:
    """z = F T (t - T/2) / m."""
    run = by_radau(PUSHED, "pushed").reset(dt=0.01).forward_sensitivities(80, ["mass.z"], ["until", "push"], events=9)
    assert run.end[1][0] == pytest.approx([2 * (0.8 - 0.3137) / 4, 0.3137 * (0.8 - 0.3137 / 2) / 4], rel=1e-12)
    assert run.events is not None
    assert run.events.derivatives_of_times == pytest.approx(np.array([[1, 0]]), abs=1e-12)


@pytest.mark.parametrize("integrator", with_heavy(["radau5-fixed", "radau5"], "radau5"))
def test_loops_at_a_force_that_jumps(integrator: str) -> None:
    """By each number behind a contact, and by the adjoint method; steps that follow errors are chosen anew for each difference."""
    sim = by_radau(STOPPED, "stopped", integrator).reset(dt=5e-4, tolerance=None if integrator == "radau5-fixed" else 1e-11)
    sim.choose_independent(["crank.angle_rate"])
    by, start = {"heavy": 1e-3, "stop": 1e-4, "damping": 1e-3, "tip": 1e-5}, sim.snapshot()
    run = sim.forward_sensitivities(900, list(sim.outputs), list(by), events=9)
    assert run.events is not None
    assert len(run.events.names) > 1
    for derivatives, (number, h) in zip(run.end[1].T, by.items(), strict=True):
        course = from_start(sim, number, ["crank.angle_rate"], 900, list(sim.outputs))
        wanted = fourth_order(lambda change, course=course: course(change)[-1], h)  # type: ignore[misc]
        assert np.abs(derivatives - wanted).max() < (1e-9 if integrator == "radau5-fixed" else 3e-8) * np.abs(wanted).max(), number
    sim.restore(start)
    compare_backwards(sim, 1e-12, steps=900)


def test_a_step_that_ends_at_an_event_has_none() -> None:
    sim = by_radau(PUSHED, "pushed").reset(dt=0.5)
    with pytest.raises(cutjoint.SimulationError, match=r"no derivative: it ended at an event.*'thrust'.*or differentiate a run"):
        sim.step_derivatives()
    assert sim.time == 0.0


def test_the_command_has_the_method() -> None:
    steps = ["--method", "recursive-newton", "--integrator", "radau5-fixed", "--dt", "2e-3", "--end", "0.1"]
    asked = ["--tunable", "A.z", "--by", "stiffness", "--by", "A.z", "--output", "slider.x", "--check"]
    call = ["gradient", str(MODELS / "press.yaml"), *steps, *asked]
    done = CliRunner().invoke(main, call)
    assert done.exit_code == 0, done.output
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", done.output)[0]) < 1e-6
