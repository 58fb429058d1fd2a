"""Derivatives of whole runs: beside closed forms, and beside differences of runs of fourth order."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

import cutjoint
from cutjoint.cli import main
from cutjoint.commands import gradient
from cutjoint.methods import Loops
from cutjoint.run.scenes import load_model, with_loops
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.standalone.test_step_derivatives import MASS, OSCILLATOR, PUSHER, SHARP, STIFFNESS, H, by_rk4, by_trapezoids, loaded, oscillator

pytestmark = needs_cpp

#: A pole on a cart with a filter; the controller reads what it held.
CART = """
cutjoint: 1
name: cart
gravity: [0, 0, -9.81]
parameters:
  k: {value: 30, binding: param}
  c: {value: 4, binding: param}
  load: {value: 0.5, unit: kg, binding: param}
  push: {value: 0.2, unit: N, binding: input}
bodies:
  cart: {mass: 2, centre_of_mass: [0, 0, 0]}
  bob: {mass: load, centre_of_mass: [0, 0, 0.5], inertia: [0.001, 0.001, 0.001]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}
  pin: {kind: revolute, bodies: [cart, bob], at: [0, 0, 0], axis: [0, 1, 0]}
states: {filtered: {start: 0, rate: (pin.angle - filtered)/0.05}}
controllers: {loop: {every: 20 ms, signals: {u: k*filtered + c*pin.angle_rate + 0.3*loop.u}}}
forces: {motor: {kind: joint_force, joint: rail, law: loop.u + push + 2*sin(pin.angle)*rail.displacement}}
outputs: [pin.angle, rail.displacement, loop.u]
scenes: {run: {end: 1, output_step: 0.01, positions: {pin.angle: 0.1, rail.displacement: 0.2}}}
"""

#: Two bars that hang from the ground.
CHAIN = """
cutjoint: 1
name: chain
gravity: [0, 0, -g]
parameters: {g: {value: 9.81, binding: param}, load: {value: 0.7, unit: kg, binding: param}, knee: {value: 1.1, unit: m, binding: param}}
bodies:
  upper: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}
  lower: {mass: load, centre_of_mass: [1.5, 0, 0], inertia: [0.01, 0.08, 0.08]}
joints:
  hip: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 1, 0]}
  mid: {kind: spherical, bodies: [upper, lower], at: [knee, 0, 0]}
forces: {bush: {kind: bushing, bodies: [upper, lower], at: [1.1, 0, 0], stiffness: [0, 0, 0, 2, 2, 2], damping: [0, 0, 0, 0.1, 0.1, 0.1]}}
outputs: [lower.x, lower.y, lower.z, hip.angle, hip.angle_rate]
scenes: {fall: {end: 1, output_step: 0.01, rates: {mid.wz: 1}}}
"""

PENDULUM = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -g]
parameters: {g: {value: 9.81, binding: param}}
bodies: {bob: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
outputs: [pin.angle, pin.angle_rate]
scenes: {swing: {end: 2, output_step: 0.1}}
"""

#: Settings with which the fixed point of the trapezoidal rule is found to rounding, so that differences of runs are exact.
_TO_THE_END: dict[str, dict[str, float]] = {"trapezoidal": {"iterations": 40}, "rk4": {}, "dormand-prince": {"tolerance": 1e-10}}


def fourth_order(course: Callable[[float], NDArray[np.float64]], h: float) -> NDArray[np.float64]:
    ends = [course(way * h) for way in (-2, -1, 1, 2)]
    return (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)


def from_start(sim: cutjoint.Simulation, name: str, independent: list[str] | None, steps: int,
    outputs: list[str]) -> Callable:  # type: ignore[type-arg]
    """The course of outputs from the scene's start by a change of a number."""
    places = [sim.outputs.place(output) for output in outputs]
    numbers = sim.parameters if name in sim.parameters else sim.inputs
    value = numbers[name] if name in sim.parameters else sim.get_input(name)

    def course(change: float) -> NDArray[np.float64]:
        numbers[name] = value + change
        sim.reset()
        if independent:
            sim.choose_independent(independent)
        rows = sim.run(steps)[:, places]
        numbers[name] = value
        return rows

    return course


def compare(
    sim: cutjoint.Simulation, independent: list[str] | None, outputs: list[str], by: dict[str, float], share: float, steps: int = 100
) -> None:  # fmt: skip
    sim.reset()
    if independent:
        sim.choose_independent(independent)
    run = sim.forward_sensitivities(steps, outputs, list(by))
    for i, (name, h) in enumerate(by.items()):
        differences = fourth_order(from_start(sim, name, independent, steps, outputs), h)
        error = np.abs(run.derivatives[1:, :, i] - differences).max(axis=0) / np.abs(differences).max(axis=0)
        assert error.max() < share, (name, error)


@pytest.mark.parametrize(("integrator", "known"), [("trapezoidal", by_trapezoids), ("rk4", by_rk4)])
def test_a_linear_motion(integrator: str, known: Callable) -> None:  # type: ignore[type-arg]
    """States by those at the start are powers; the derivative by the stiffness is that of analytic matrices along a complex step."""
    sim = loaded(OSCILLATOR, "oscillator", "recursive", integrator).reset(dt=H, **_TO_THE_END[integrator])
    sim.inputs["push"] = 0.7
    sim.step()
    start = sim.states.array.copy()
    run = sim.forward_sensitivities(50, ["mass.x"], ["stiffness", "push", *sim.states], every=25)
    A, B = known(STIFFNESS)
    state, by_state, by_input = start, np.eye(2), np.zeros((2, 1))
    complex_A, complex_B = known_complex(known, STIFFNESS + 1e-30j)
    along = start.astype(complex)
    for _ in range(50):
        state, by_state, by_input = A @ state + B[:, 0] * 0.7, A @ by_state, A @ by_input + B
        along = complex_A @ along + complex_B[:, 0] * 0.7
    assert run.times == pytest.approx([H, 26 * H, 51 * H], rel=1e-12)
    assert run.derivatives[0].tolist() == [[0.0, 0.0, 1.0, 0.0]]
    assert run.end[0][0] == pytest.approx(state[0], rel=1e-11)
    assert run.end[1][0] == pytest.approx([along[0].imag / 1e-30, by_input[0, 0], *by_state[0]], rel=1e-11)


def known_complex(known: Callable, stiffness: complex) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:  # type: ignore[type-arg]
    """The matrices of a step for a complex stiffness, by its own formulas."""
    A = np.array([[0, 1], [-stiffness / MASS, oscillator(STIFFNESS)[0][1, 1]]])
    B = np.array([[0], [1 / MASS]])
    if known is by_trapezoids:
        left = np.eye(2) - H / 2 * A
        return np.linalg.solve(left, np.eye(2) + H / 2 * A), np.linalg.solve(left, H * B)
    powers = [np.linalg.matrix_power(H * A, k) for k in range(5)]
    factorials = (1, 1, 2, 6, 24)
    return (
        sum(power / k for power, k in zip(powers, factorials, strict=True)),
        H * sum(power / k for power, k in zip(powers[:4], factorials[1:], strict=True)) @ B,
    )


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4", "dormand-prince"])
def test_states_and_controllers_that_take_samples(integrator: str) -> None:
    sim = loaded(CART, "cart", integrator=integrator).reset(dt=0.005, **_TO_THE_END[integrator])
    compare(sim, None, ["pin.angle", "rail.displacement", "loop.u"], {"k": 1e-2, "c": 1e-3, "load": 1e-3, "push": 1e-3}, 1e-9)


def test_a_chain() -> None:
    sim = loaded(CHAIN, "chain", integrator="rk4").reset(dt=2e-3)
    compare(sim, None, list(sim.outputs)[:3], {"g": 1e-2, "load": 1e-3, "knee": 1e-3}, 1e-9)


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4", "dormand-prince"])
def test_a_slope_that_is_no_number_beside_others(integrator: str) -> None:
    """A mass at rest, whose friction is infinitely steep by its speed, changes nothing of the motion beside it."""
    still = OSCILLATOR.replace("bodies: {", "bodies: {block: {mass: 1, centre_of_mass: [0, 1, 0]}, ").replace(
        "joints: {", "joints: {rest: {kind: prismatic, bodies: [ground, block], at: [0, 1, 0], axis: [1, 0, 0]}, "
    ).replace("forces: {", "forces: {rub: {kind: joint_force, joint: rest, law: -sqrt(abs(rate))}, ")
    sims = [loaded(text, "oscillator", integrator=integrator).reset(dt=H, **_TO_THE_END[integrator]) for text in (OSCILLATOR, still)]
    runs = [sim.forward_sensitivities(50, ["mass.x"], ["stiffness"]) for sim in sims]
    assert np.abs(runs[0].derivatives).max() > 0
    assert runs[1].derivatives == pytest.approx(runs[0].derivatives, rel=1e-12, abs=1e-15)


def test_a_pendulum_by_gravity() -> None:
    """An angle that starts at rest is a function of t sqrt(g), so that its derivative by g is t angle'/(2 g)."""
    sim = loaded(PENDULUM, "pendulum", integrator="rk4").reset(dt=1e-3)
    run = sim.forward_sensitivities(2000, ["pin.angle", "pin.angle_rate"], ["g"], every=100)
    assert run.derivatives[1:, 0, 0] == pytest.approx(run.times[1:] * run.values[1:, 1] / (2 * 9.81), rel=1e-9)


def test_the_command_prints_them_and_checks(tmp_path: Path) -> None:
    """As above, of the angle's end."""
    (tmp_path / "pendulum.yaml").write_text(PENDULUM, encoding="utf-8")
    call = ["gradient", str(tmp_path / "pendulum.yaml"), "--integrator", "rk4", "--dt", "1e-3", "--by", "g", "--by", "pin.angle", "--check"]
    done = CliRunner().invoke(main, call)
    assert done.exit_code == 0, done.output
    rows = {line.split()[0]: line.split() for line in done.output.splitlines() if line.strip()}
    values = [float(x) for line in done.output.splitlines() if " rad " in line for x in re.findall(r"-?[\d.]+(?= rad)", line)]
    assert float(rows["g"][1]) == pytest.approx(2 * values[1] / (2 * 9.81), rel=1e-4)  # six printed digits
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", done.output)[0]) < 1e-8
    wrong = CliRunner().invoke(main, [*call, "--by", "h"])
    assert (wrong.exit_code, "no parameter or input 'h'" in wrong.output) == (1, True)


@pytest.mark.parametrize("loops", [Loops.EXACT, Loops.EMBEDDED])
def test_a_loop_by_a_hardpoint(loops: Loops) -> None:
    model, scene = load_model(MODELS / "press.yaml", None, ["A.z"])
    chosen = with_loops(scene, loops)
    sim = load_scene(replace(model, scenes={scene.name: chosen}), chosen, integrator="rk4", linearise=True).reset(dt=2e-3)
    compare(sim, ["pin.angle_rate"], ["slider.x", "spring.force"], {"stiffness": 3.0, "A.z": 1e-5}, 1e-7)


def test_many_hardpoints_of_embedded_loops_side_by_side() -> None:
    """More than fit side by side, whose loops stay fitted, beside one after the other in a new simulation; also when points have moved."""
    model, scene = load_model(MODELS / "press.yaml", None, ["A.*", "B.*", "C.*"])
    chosen = with_loops(scene, Loops.EMBEDDED)
    sim, other = (load_scene(replace(model, scenes={scene.name: chosen}), chosen, integrator="rk4", linearise=True) for _ in range(2))
    by = [name for name in sim.parameters if re.fullmatch(r"[ABC]\.[xyz]", name)] * 3
    assert len(by) > 24
    for moved in (0.0, 1e-3):
        for each in (sim, other):
            each.parameters["A.z"] += moved
        found = sim.reset(dt=2e-3).forward_sensitivities(20, ["slider.x", "spring.force"], by, every=4).derivatives
        singly = (other.reset(dt=2e-3).forward_sensitivities(20, ["slider.x", "spring.force"], [name], every=4) for name in by[:9])
        apart = [run.derivatives for run in singly]
        largest = np.abs(found).max(axis=(0, 2), keepdims=True)
        assert np.abs(found).max() > 0.1
        assert (np.abs(found - np.concatenate(apart * 3, axis=2)) <= 1e-12 * largest).all()


@pytest.mark.heavy
def test_embedded_loops_have_the_derivatives_of_exact_loops() -> None:
    """By a hardpoint, a spring and the start; rk4 follows both motions to some 1e-11."""
    found = []
    for loops in (Loops.EXACT, Loops.EMBEDDED):
        model, scene = load_model(MODELS / "press.yaml", None, ["A.z"])
        chosen = with_loops(scene, loops)
        sim = load_scene(replace(model, scenes={scene.name: chosen}), chosen, integrator="rk4", linearise=True).reset(dt=5e-4)
        sim.choose_independent(["pin.angle_rate"])
        run = sim.forward_sensitivities(400, ["slider.x", "spring.force"], ["stiffness", "A.z", "pin.angle"], every=40)
        found.append(run.derivatives)
    assert (np.abs(found[1] - found[0]).max(axis=0) < 3e-10 * np.abs(found[0]).max(axis=0)).all()


def test_loops_by_the_trapezoidal_rule() -> None:
    """Its steps go on with accelerations that they had before loops were closed, and with how these change."""
    text = (MODELS / "press.yaml").read_text(encoding="utf-8").replace("rates: {", f"numerics: {{{SHARP}}}, rates: {{")
    sim = loaded(text, "press").reset(dt=2e-3)
    compare(sim, ["pin.angle_rate"], ["slider.x", "spring.force"], {"stiffness": 3.0}, 1e-9)
    sim = loaded(PUSHER.replace("NUMERICS", SHARP), "pusher").reset(dt=0.01)
    compare(sim, None, ["cart.x"], {"drag": 0.01, "torque": 0.001}, 1e-9, steps=20)


#: A four-bar with a pole that falls to its limit, where coupler and rocker are in line.
FALL = """
cutjoint: 1
name: fall
gravity: [0, 0, -9.81]
parameters: {heavy: {value: 1, unit: kg, binding: param}}
bodies:
  arm: {mass: heavy, centre_of_mass: [0.15, 0, 0], inertia: [0.001, 0.01, 0.01]}
  rod: {mass: 0.5, centre_of_mass: [0.4, 0, 0.15], inertia: [0.001, 0.01, 0.01]}
  rocker: {mass: 0.5, centre_of_mass: [0.5, 0, 0.15], inertia: [0.001, 0.005, 0.005]}
  pole: {mass: 0.2, centre_of_mass: [0.3, 0, 0.2], inertia: [0.001, 0.002, 0.001]}
joints:
  crank: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}
  knee: {kind: revolute, bodies: [arm, rod], at: [0.3, 0, 0], axis: y}
  top: {kind: revolute, bodies: [rod, rocker], at: [0.5, 0, 0.3], axis: y}
  foot: {kind: revolute, bodies: [ground, rocker], at: [0.5, 0, 0], axis: y}
  pin: {kind: revolute, bodies: [arm, pole], at: [0.3, 0, 0], axis: y}
outputs: [pin.angle, crank.angle]
scenes: {fall: {end: 1, rates: {pin.angle_rate: 0.5}}}
"""


@pytest.mark.parametrize("integrator", with_heavy(["rk4", "dormand-prince"], "dormand-prince"))
def test_loops_by_explicit_steps_near_a_dead_centre(integrator: str) -> None:
    """Steps begin with the accelerations that the one before had before its loops were closed, which projections move far there; those that
    follow errors are chosen anew for each difference."""
    sim = loaded(FALL, "fall", integrator=integrator).reset(dt=0.02, tolerance=None if integrator == "rk4" else 1e-11)
    compare(sim, None, ["pin.angle", "crank.angle"], {"heavy": 1e-3}, 1e-7, steps=39)


def test_coordinates_are_chosen_again_where_they_become_ill_conditioned() -> None:
    """The slider stands still at the dead centres, where it is no coordinate; the course does not depend on the choice."""
    sim = cutjoint.load(MODELS / "press.yaml", integrator="rk4", linearise=True)
    found, chosen = [], []
    for first in ("pin.angle_rate", "rail.displacement_rate"):
        sim.reset(dt=2e-3, speeds={"pin.angle_rate": 30.0}).choose_independent([first])
        begun = list(sim.states)
        run = sim.forward_sensitivities(93, ["slider.x"], ["stiffness"])  # to the second dead centre
        found.append(run.derivatives)
        chosen.append(list(sim.states) != begun)
    assert chosen == [False, True]
    assert found[0] == pytest.approx(found[1], rel=1e-8, abs=1e-8 * np.abs(found[0]).max())


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4", "dormand-prince"])
def test_steps_of_settings_that_have_just_changed(integrator: str) -> None:
    """A host sets the tolerance or the step length in C between steps; the next step is differentiated as all others are."""
    sim = loaded(OSCILLATOR, "oscillator", "recursive", integrator).reset(dt=H)
    change = (sim.library.set_tolerance, (1e-9, 1e-9)) if integrator == "dormand-prince" else (sim.library.set_step, (H / 2,))
    start, found = sim.snapshot(), []
    for settle in (lambda: None, lambda: sim.forward_sensitivities(0, [], [])):
        sim.restore(start)
        sim._call(change[0], *change[1])
        settle()
        found.append(sim.forward_sensitivities(1, ["mass.x"], list(sim.states)).derivatives)
    assert found[0][1] == pytest.approx(fresh_steps(sim, start, change), abs=1e-6)
    assert (found[0] == found[1]).all()


def fresh_steps(sim: cutjoint.Simulation, start: bytes, change: tuple) -> NDArray[np.float64]:  # type: ignore[type-arg]
    """The derivatives of the first output by the states before a step, from differences."""
    def course(along: NDArray[np.float64]) -> float:
        sim.restore(start)
        sim.set_states(sim.states.array + along)
        sim._call(change[0], *change[1])
        sim.step()
        return sim.outputs["mass.x"]

    h = 1e-5
    return np.array([[(course(h * unit) - course(-h * unit)) / (2 * h) for unit in np.eye(len(sim.states))]])


def test_objectives_have_the_derivatives_of_their_values() -> None:
    sim = loaded(CART, "cart", integrator="rk4").reset(dt=0.005)
    by, objectives = ["k"], ("end", "integral", "mean", "rms", "maximum", "minimum")
    run = sim.forward_sensitivities(150, ["pin.angle", "loop.u"], by)
    course = from_start(sim, "k", None, 150, list(run.outputs))
    for objective in objectives:

        def value(change: float, objective: str = objective) -> NDArray[np.float64]:
            sim.parameters["k"] = 30 + change
            start = np.array([[0.1, sim.reset().outputs["loop.u"]]])
            sim.parameters["k"] = 30
            return getattr(replace(run, values=np.vstack([start, course(change)])), objective)[0]  # type: ignore[no-any-return]

        assert value(0.0) == pytest.approx(getattr(run, objective)[0], rel=1e-12)
        assert getattr(run, objective)[1][:, 0] == pytest.approx(fourth_order(value, 1e-2), rel=1e-7, abs=1e-12)


def test_the_run_is_the_same_and_goes_on() -> None:
    sim = cutjoint.load(MODELS / "press.yaml", integrator="rk4", linearise=True).reset(dt=2e-3)
    sim.choose_independent(["pin.angle_rate"])
    other = sim.copy()
    run = sim.forward_sensitivities(40, list(sim.outputs), ["stiffness"], every=4)
    assert run.values[1:].tolist() == other.run(40)[3::4].tolist()
    assert sim.snapshot() == other.snapshot()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pin.angl", "--by: no parameter, input or initial state 'pin.angl'; did you mean 'pin.angle'?"),
        ("stiffness,A.z", "--by takes one name and repeats: --by stiffness --by A.z"),
        ("stifness", "--by: no parameter or input 'stifness'; did you mean 'stiffness'?"),
        ("slider.mass", "--by: 'slider.mass' is a constant of the file; --tunable slider.mass makes a parameter of that name"),
    ],
)
def test_wrong_names_are_refused_before_compiling(name: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gradient, "load_scene", None)
    done = CliRunner().invoke(main, ["gradient", str(MODELS / "press.yaml"), "--by", name])
    assert (done.exit_code, done.output) == (1, f"{words}\n")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *((command, "model 'press' has no parameter 'q'; it has stiffness") for command in (
            ["gradient", "--set", "q=1"], ["modes", "--at", "1", "--set", "q=1"], ["realtime", "--set", "q=1"], ["reduce", "--set", "q=1"],
        )),
        (["gradient", "--output", "slidr.x"], "--output: 'slidr.x' is not among the scene's outputs; did you mean 'slider.x'?"),
    ],
)  # fmt: skip
def test_other_wrong_names_too(command: list[str], words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    done = CliRunner().invoke(main, [command[0], str(MODELS / "press.yaml"), *command[1:]])
    assert (done.exit_code, done.output) == (1, f"{words}\n")


def test_what_has_none_is_reported() -> None:
    with pytest.raises(TypeError, match="load the model with linearise=True"):
        cutjoint.load(MODELS / "press.yaml").reset().forward_sensitivities(1, [], [])
    sim = loaded(OSCILLATOR, "oscillator").reset()
    with pytest.raises(KeyError, match="did you mean 'stiffness'"):
        sim.forward_sensitivities(1, ["mass.x"], ["stifness"])
    with pytest.raises(KeyError, match=r"no 'mass\.y'; did you mean 'mass\.x'\? it is not among the scene's outputs"):
        sim.forward_sensitivities(1, ["mass.y"], ["stiffness"])
    with pytest.raises(KeyError, match=r"no 'mess\.x'; it is not among the scene's outputs: add it to 'outputs'"):
        sim.forward_sensitivities(1, ["mess.x"], ["stiffness"])
    with pytest.raises(ValueError, match="every: 2 does not divide the 7 steps"):
        sim.forward_sensitivities(7, ["mass.x"], ["stiffness"], every=2)
    with pytest.raises(ValueError, match="a run of no step has no mean"):
        _ = sim.forward_sensitivities(0, ["mass.x"], ["stiffness"]).mean
    run = cutjoint.ForwardSensitivities(
        times=np.array([0.0, 1.0, 2.0]), values=np.array([[1.0, 0.0], [0.5, 0.0], [1.0, 0.0]]),
        derivatives=np.array([[[1.0], [0.0]], [[3.0], [0.0]], [[2.0], [0.0]]]),
        outputs=("a", "b"), by=("p",),
    )  # fmt: skip
    with pytest.raises(ValueError, match="'a' is the same 1 at 0 s and 2 s, with other derivatives"):
        _ = run.maximum
    with pytest.raises(ValueError, match="'b' is 0 all the time"):
        _ = run.rms
    assert run.minimum[1].tolist() == [[3.0], [0.0]]
