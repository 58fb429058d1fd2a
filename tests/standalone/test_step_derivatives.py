"""Derivatives of steps: closed forms of linear motions, loops beside differences, samples within steps, calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp
from tests.fmu.slaves import text_of
from tests.mechanisms.switching import TABLE

pytestmark = needs_cpp

STIFFNESS, DAMPING, MASS, H = 200.0, 6.0, 2.0, 0.02

OSCILLATOR = f"""
cutjoint: 1
name: oscillator
gravity: [0, 0, 0]
parameters:
  stiffness: {{value: {STIFFNESS}, unit: N/m, binding: param}}
  push: {{value: 0, unit: N, binding: input}}
bodies: {{mass: {{mass: {MASS}, centre_of_mass: [0, 0, 0]}}}}
joints: {{slide: {{kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}}}}
forces: {{all: {{kind: joint_force, joint: slide, law: -stiffness*position - {DAMPING}*rate + push}}}}
outputs: [mass.x]
scenes: {{swing: {{end: 1, positions: {{slide.displacement: 0.3}}}}}}
"""

POLE = """
cutjoint: 1
name: pole
gravity: [0, 0, 0]
parameters: {k: {value: 3, binding: param}}
bodies: {rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}}
joints: {shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}}
states: {level: {start: 1, rate: -2*level + 1.5*loop.u}}
controllers: {loop: {every: 100 ms, signals: {u: -k*level}}}
outputs: [level.value]
scenes: {run: {end: 1, output_step: 0.1}}
"""


@cache
def loaded(text: str, name: str, method: str = "recursive", integrator: str = "trapezoidal") -> cutjoint.Simulation:
    model = read_model_text(text, f"{name}.yaml")
    return load_scene(model, find_scene(model, None), method=method, integrator=integrator, linearise=True)


def oscillator(stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array([[0, 1], [-stiffness / MASS, -DAMPING / MASS]]), np.array([[0], [1 / MASS]])


def by_trapezoids(stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    A, B = oscillator(stiffness)
    left = np.eye(2) - H / 2 * A
    return np.linalg.solve(left, np.eye(2) + H / 2 * A), np.linalg.solve(left, H * B)


def by_rk4(stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    A, B = oscillator(stiffness)
    powers = [np.linalg.matrix_power(H * A, k) for k in range(5)]
    factorials = (1, 1, 2, 6, 24)
    ends = sum(power / k for power, k in zip(powers, factorials, strict=True))
    return ends, H * sum(power / k for power, k in zip(powers[:4], factorials[1:], strict=True)) @ B


@pytest.mark.parametrize(
    ("method", "integrator", "known"),
    [("recursive", "trapezoidal", by_trapezoids), ("recursive-newton", "trapezoidal", by_trapezoids), ("recursive", "rk4", by_rk4)],
)
def test_a_linear_motion(method: str, integrator: str, known: object) -> None:
    sim = loaded(OSCILLATOR, "oscillator", method, integrator).reset(dt=H)
    assert sim.settings.step == sim.copy().settings.step == H
    sim.inputs["push"] = 0.7
    sim.step()
    before, other = sim.states.array.copy(), sim.copy()
    found = sim.step_derivatives()
    by_state, by_input = known(STIFFNESS)
    assert found.by_state == pytest.approx(by_state, rel=1e-12)
    assert found.by_input == pytest.approx(by_input, rel=1e-12)
    end = [known(k)[0] @ before + known(k)[1][:, 0] * 0.7 for k in (STIFFNESS + 1e-3, STIFFNESS - 1e-3)]
    assert found.by_parameter[:, 0] == pytest.approx((end[0] - end[1]) / 2e-3, rel=1e-8)  # rounding of the difference
    assert found.end == pytest.approx(by_state @ before + by_input[:, 0] * 0.7, rel=1e-7)  # the iteration's tolerance
    assert (found.start.tolist(), found.parameters, found.inputs) == (before.tolist(), ("stiffness",), ("push",))
    other.step()
    assert other.snapshot() == sim.snapshot()


def test_a_controller_holds_within_a_step_that_its_sample_divides() -> None:
    """The level alone has x' = -2 x, whose steps multiply by (1 - h)/(1 + h)."""
    sim = loaded(POLE, "pole").reset(dt=0.16)
    found = sim.step_derivatives()
    assert found.states[2] == "level.value"
    assert found.by_state[2, 2] == pytest.approx((1 - 0.1) / (1 + 0.1) * (1 - 0.06) / (1 + 0.06), rel=1e-12)
    assert found.by_parameter[2].tolist() == [0.0]


def test_methods_have_the_same_without_loops() -> None:
    first, second = (loaded(text_of("flyball"), "flyball", method).reset() for method in ("recursive", "recursive-newton"))
    for _ in range(20):
        first.step()
    second.choose_independent(list(first.states)[len(first.states) // 2 :])
    second.set_state(first.time, first.coordinates.array, first.speeds.array)
    a, b = first.step_derivatives(), second.step_derivatives()
    assert a.states == b.states
    assert a.by_state == pytest.approx(b.by_state, rel=1e-7, abs=1e-7 * np.abs(b.by_state).max())  # tolerances of both iterations


@pytest.mark.parametrize("integrator", ["rk4", "dormand-prince"])
def test_a_step_that_ends_at_an_event_has_none(integrator: str) -> None:
    sim = loaded(TABLE, "knots", integrator=integrator).reset(dt=0.02)
    crossed: list[bool] = []
    for _ in range(40):
        other, position = sim.copy(), sim.coordinates["slide.displacement"]
        other.step()
        ends = sorted((position, other.coordinates["slide.displacement"]))
        crossed.append(any(ends[0] <= knot <= ends[1] for knot in (-0.4, 0.1, 0.3)))
        if crossed[-1]:
            with pytest.raises(cutjoint.SimulationError, match=r"no derivative: it ended at an event.*take this step without") as reported:
                sim.step_derivatives()
            assert reported.value.status == 33
            sim.step()
        else:
            sim.step_derivatives()
        assert sim.coordinates.array.tolist() == other.coordinates.array.tolist()
    assert 1 < sum(crossed) < 20


PUSHER = """
cutjoint: 1
name: pusher
gravity: [0, 0, -9.81]
parameters:
  torque: {value: 0.3, unit: N*m, binding: input}
  drag: {value: 0.2, unit: N*s/m, binding: param}
bodies:
  crank: {mass: 0.5, centre_of_mass: [0.05, 0, 0.05], inertia: [0.001, 0.001, 0.001]}
  rod: {mass: 0.5, centre_of_mass: [0.2, 0, 0.05], inertia: [0.004, 0.004, 0.004]}
  cart: {mass: 1, centre_of_mass: [0.3, 0, 0]}
  pole: {mass: 0.2, centre_of_mass: [0.3, 0, 0.25], inertia: [0.004, 0.004, 0.0001]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  wrist: {kind: revolute, bodies: [crank, rod], at: [0.0, 0, 0.1], axis: [0, 1, 0]}
  end: {kind: revolute, bodies: [rod, cart], at: [0.3, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, cart], at: [0.3, 0, 0], axis: [1, 0, 0]}
  hinge: {kind: revolute, bodies: [cart, pole], at: [0.3, 0, 0], axis: [0, 1, 0]}
forces:
  drive: {kind: joint_force, joint: pin, law: torque}
  air: {kind: joint_force, joint: rail, law: -drag*rate}
outputs: [cart.x]
scenes: {run: {end: 1, numerics: {NUMERICS}}}
"""
SHARP = "dt: 1 ms, tolerance: 1e-12, iterations: 200"


def differences(sim: cutjoint.Simulation, change: Callable[[float], None], snapshot: bytes, by: float) -> np.ndarray:
    """Of the states at the end of a step that begins where a snapshot is, by what changes there."""
    ends = []
    for share in (by, -by):
        sim.restore(snapshot)
        change(share)
        sim.step()
        ends.append(sim.states.array)
    return (ends[0] - ends[1]) / (2 * by)


def errors_of(sim: cutjoint.Simulation, h: float, *, settled: bool = True) -> list[float]:
    """The errors of columns by states, the torque and the drag of a step of length h, as shares of the largest entries; ``settled`` finds
    accelerations anew for each difference."""
    sim.reset(dt=h)
    sim.advance(0.1)
    sim.choose_independent()
    snapshot, start = sim.snapshot(), sim.states.array

    def settle() -> None:
        if settled:
            sim.set_state(sim.time, sim.coordinates.array.copy(), sim.speeds.array.copy())

    def push(by: float) -> None:
        sim.inputs["torque"] = 0.3 + by
        settle()

    def slow(by: float) -> None:
        sim.parameters["drag"] += by
        settle()

    settle()
    found = sim.step_derivatives()
    known = [differences(sim, lambda by, i=i: sim.set_states(start + by * np.eye(4)[i]), snapshot, 1e-4) for i in range(4)]
    pairs = [(np.array(known).T, found.by_state)]
    pairs += [(differences(sim, change, snapshot, 1e-2), x[:, 0]) for change, x in ((push, found.by_input), (slow, found.by_parameter))]
    return [np.abs(x - y).max() / np.abs(x).max() for x, y in pairs]


def test_loops_by_the_fixed_point_with_and_without_a_jump_of_an_input() -> None:
    """A held input that jumps begins the next step with accelerations of converged multipliers."""
    sim = loaded(PUSHER.replace("NUMERICS", SHARP), "pusher")
    assert max(errors_of(sim, 0.02)) < 1e-7  # of differences
    assert max(errors_of(sim, h, settled=False)[1] for h in (0.02, 0.01)) < 1e-6  # above 1e-6 by the multipliers before the jump


def test_loops_by_newtons_iteration_come_nearer_with_shorter_steps() -> None:
    """The norm in which it closes rates is taken for that of the masses."""
    sim = loaded(PUSHER.replace("NUMERICS", SHARP), "pusher", "recursive-newton")
    long, short = (max(errors_of(sim, h)) for h in (0.008, 0.002))
    assert long < 1e-3
    assert short < min(long / 4, 1e-5)


@pytest.mark.parametrize("integrator", ["dormand-prince", "dop853"])
def test_adaptive_steps_have_the_derivatives_of_the_motion(integrator: str) -> None:
    """Beside differences of steps that are chosen anew, and so off by what the tolerance lets steps err."""
    sim = loaded(PUSHER.replace("NUMERICS", "tolerance: 1e-9"), "pusher", integrator=integrator)
    assert max(errors_of(sim, 0.02)) < 1e-6


def test_states_are_gone_to() -> None:
    sim = loaded(PUSHER.replace("NUMERICS", SHARP), "pusher").reset(dt=0.002)
    sim.advance(0.05)
    there, q, v = sim.states.array, sim.coordinates.array.copy(), sim.speeds.array.copy()
    sim.advance(0.1)
    sim.set_states(there, time=0.05)
    assert sim.time == 0.05
    assert sim.coordinates.array == pytest.approx(q, abs=1e-12)
    assert sim.speeds.array == pytest.approx(v, abs=1e-11)
    moved = there + 0.01 * np.eye(4)[0]
    sim.set_states(moved)
    assert sim.states.array == pytest.approx(moved, abs=1e-13)
    assert sim.constraint_violation[0] < 1e-12
    with pytest.raises(ValueError, match="there are 4 states"):
        sim.set_states(there[:3])
    with pytest.raises(cutjoint.SimulationError):
        sim.set_states(there * np.nan)


FILTER = """
cutjoint: 1
name: filtered
gravity: [0, 0, -9.81]
parameters: {k: {value: 2, binding: param}}
bodies: {wheel: {mass: 1, centre_of_mass: [0.1, 0, 0], inertia: [1, 1, 1]}}
joints: {drive: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 1, 0], guide: "sin(3*t)"}}
states: {level: {start: 0, rate: "k*(drive.angle - level)"}}
outputs: [level.value]
scenes: {run: {end: 1, output_step: 0.1}}
"""


def test_a_state_that_follows_a_prescribed_motion() -> None:
    """Nothing moves freely, so that the state's rate alone is a residual of forces."""
    model = read_model_text(FILTER, "filtered.yaml")
    sim = load_scene(model, find_scene(model, None), integrator="trapezoidal", adjoint=True).reset(dt=0.1)
    step = sim.step_derivatives()
    assert step.by_state == pytest.approx(np.array([[(1 - 0.1) / (1 + 0.1)]]), rel=1e-12)
    by_k = 0.05 * np.sin(0.3) / 1.1 - 0.05 * (0.1 * np.sin(0.3) / 1.1) / 1.1
    assert step.by_parameter == pytest.approx(np.array([[by_k]]), rel=1e-11)
    assert sim.linearise().A[0, 0] == pytest.approx(-2, rel=1e-12)
    back = sim.reset(dt=0.1).adjoint_sensitivities(1, ["level.value"], ["k"], "end", every=1)
    assert back.derivatives == pytest.approx(np.array([[by_k]]), rel=1e-11)


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_a_motion_that_is_wholly_prescribed_has_no_states(integrator: str) -> None:
    text = "".join(line for line in FILTER.splitlines(keepends=True) if not line.startswith("states")).replace("level.value", "wheel.z")
    model = read_model_text(text, "prescribed.yaml")
    sim = load_scene(model, find_scene(model, None), integrator=integrator, adjoint=True).reset(dt=0.1)
    assert sim.step_derivatives().by_state.shape == (0, 0)
    assert sim.linearise().A.shape == (0, 0)
    assert sim.adjoint_sensitivities(1, ["wheel.z"], [], "end").derivatives.shape == (1, 0)


def test_a_model_without_derivatives_is_reported() -> None:
    with pytest.raises(TypeError, match="load the model with linearise=True"):
        cutjoint.load(MODELS / "press.yaml").reset().step_derivatives()
