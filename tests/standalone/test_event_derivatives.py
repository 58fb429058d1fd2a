"""Derivatives of runs over events that move: beside closed forms along a complex step, and beside differences of runs."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.switching import TABLE
from tests.standalone.test_run_adjoints import backwards
from tests.standalone.test_run_adjoints import compare as compare_backwards
from tests.standalone.test_run_derivatives import fourth_order, from_start
from tests.standalone.test_step_derivatives import loaded

pytestmark = needs_cpp

#: A mass on a slide that a force meets below its zero: one that jumps, or a spring.
BALL = """
cutjoint: 1
name: ball
gravity: [0, 0, -g]
parameters:
  g: {value: 9.81, binding: param}
  k: {value: 300, binding: param}
  floor: {value: 0, unit: m, binding: param}
bodies: {mass: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {stop: {kind: joint_force, joint: slide, law: "LAW"}}
outputs: [mass.z, mass.vz]
scenes: {drop: {end: 1, output_step: 0.01, positions: {slide.displacement: 0.3}}}
"""
THRUST = BALL.replace("LAW", "where(position < floor, k/10, 0)")
SPRING = BALL.replace("LAW", "where(position < floor, -k*(position - floor), 0)")

#: The numbers of both, as a start and parameters, and in which order slopes have them.
BY = ["slide.displacement", "g", "k", "floor"]
HEIGHT, GRAVITY, STIFFNESS, FLOOR = numbers = 0.3, 9.81, 300.0, 0.0


def thrown(t: float, height: complex, g: complex, k: complex, floor: complex) -> tuple[complex, ...]:
    """Place and speed at a time behind the bounce from a thrust k/10, and the times of contact and of leaving."""
    begun = np.sqrt(2 * (height - floor) / g)
    speed = g * begun
    left = begun + 2 * speed / (k / 10 - g)
    return floor + speed * (t - left) - g * (t - left) ** 2 / 2, speed - g * (t - left), begun, left


def sprung(t: float, height: complex, g: complex, k: complex, floor: complex) -> tuple[complex, ...]:
    """Place, speed and times with the spring: a harmonic motion about -g/k from contact to leaving."""
    begun, w = np.sqrt(2 * (height - floor) / g), np.sqrt(k)
    speed = g * begun
    left = begun + 2 * (np.pi - np.arctan(speed * w / g)) / w
    return floor + speed * (t - left) - g * (t - left) ** 2 / 2, speed - g * (t - left), begun, left


def along(known: Callable[..., tuple[complex, ...]], t: float) -> np.ndarray:
    """The slopes of all that a closed form has, (values, numbers)."""
    found = []
    for i in range(4):
        given = [x + (1e-30j if i == k else 0) for k, x in enumerate(numbers)]
        found.append([x.imag / 1e-30 for x in known(t, *given)])
    return np.transpose(found)


@pytest.mark.parametrize(("text", "known", "integrator", "settings", "share"), [
    (THRUST, thrown, "rk4", {}, 1e-9), (THRUST, thrown, "dormand-prince", {"tolerance": 1e-9}, 1e-9),
    (THRUST, thrown, "dop853", {"tolerance": 1e-9}, 1e-9),
    (SPRING, sprung, "rk4", {}, 1e-7), (SPRING, sprung, "dormand-prince", {"tolerance": 1e-11}, 1e-7),
    (SPRING, sprung, "dop853", {"tolerance": 1e-12}, 1e-7),
])  # fmt: skip
def test_a_ball_that_bounces(text: str, known: Callable, integrator: str, settings: dict[str, float],
    share: float) -> None:  # type: ignore[type-arg]
    """Behind the bounce, with the times of contact and of leaving, and the speeds there, which are those of the fall."""
    sim = loaded(text, "ball", integrator=integrator).reset(dt=1e-3, **settings)
    run = sim.forward_sensitivities(700, ["mass.z", "mass.vz"], [*BY, *BY, *BY], every=10, events=3)
    wanted, derivatives = along(known, 0.7), run.end[1]
    assert derivatives[:, :4] == pytest.approx(derivatives[:, 8:], rel=1e-13)  # the last row of directions side by side is not full
    assert np.abs(derivatives[:, :4] - wanted[:2]).max() < share * np.abs(wanted[:2]).max()
    events = run.events
    assert events is not None
    assert events.names == ("stop", "stop")
    assert events.times == pytest.approx([x.real for x in known(0.7, *numbers)[2:]], rel=1e-8)
    assert events.derivatives_of_times[:, :4] == pytest.approx(wanted[2:], rel=share, abs=share)
    speed = np.sqrt(2 * GRAVITY * HEIGHT)
    by = [GRAVITY / speed, HEIGHT / speed, 0.0, -GRAVITY / speed]
    assert events.derivatives[:, 1, :4] == pytest.approx(np.array([[-x for x in by], by]), rel=1e-7, abs=1e-7)
    assert events.derivatives[:, 0, :4] == pytest.approx(np.array([[0, 0, 0, 1]] * 2), abs=1e-9)


#: A push that ends at a time.
PUSHED = """
cutjoint: 1
name: pushed
gravity: [0, 0, 0]
parameters: {until: {value: 0.3137, unit: s, binding: param}, push: {value: 2, unit: N, binding: param}}
bodies: {mass: {mass: 4, centre_of_mass: [0, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {thrust: {kind: joint_force, joint: slide, law: "where(t < until, push, 0)"}}
outputs: [mass.z]
scenes: {run: {end: 1, output_step: 0.01}}
"""


@pytest.mark.parametrize("integrator", ["rk4", "dormand-prince"])
def test_a_force_that_ends_at_a_time(integrator: str) -> None:
    """z = F T (t - T/2) / m."""
    run = loaded(PUSHED, "pushed", integrator=integrator).reset(dt=0.01).forward_sensitivities(80, ["mass.z"], ["until", "push"],
        events=9)
    assert run.end[1][0] == pytest.approx([2 * (0.8 - 0.3137) / 4, 0.3137 * (0.8 - 0.3137 / 2) / 4], rel=1e-12)
    assert run.events is not None
    assert run.events.derivatives_of_times == pytest.approx(np.array([[1, 0]]), abs=1e-12)
    assert run.events.derivatives[0, 0] == pytest.approx([2 * 0.3137 / 4, 0.3137**2 / 8], rel=1e-12)


#: A mass that a plate throws, which a guide moves.
PLATE = """
cutjoint: 1
name: plate
gravity: [0, 0, -9.81]
parameters:
  swing: {value: 0.02, unit: m, binding: param}
  k: {value: 400, binding: param}
  damping: {value: 3, binding: param}
bodies: {plate: {massless: true}, mass: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints:
  lift: {kind: prismatic, bodies: [ground, plate], at: [0, 0, 0], axis: [0, 0, 1], guide: swing*sin(11*t)}
  gap: {kind: prismatic, bodies: [plate, mass], at: [0, 0, 0], axis: [0, 0, 1]}
forces: {stop: {kind: joint_force, joint: gap, law: {stop: {side: below, at: 0, stiffness: k, damping: damping}}}}
outputs: [mass.z, mass.vz]
scenes: {drop: {end: 1, output_step: 0.01, positions: {gap.displacement: 0.1}}}
"""

#: A four-bar whose rocker falls on a stop.
STOPPED = """
cutjoint: 1
name: stopped
gravity: [0, 0, -9.81]
parameters:
  heavy: {value: 1, unit: kg, binding: param}
  stop: {value: 0.3, unit: rad, binding: param}
  damping: {value: 0.5, binding: param}
  tip: {value: 0.5, unit: m, binding: param}
bodies:
  arm: {mass: heavy, centre_of_mass: [0.15, 0, 0], inertia: [0.001, 0.01, 0.01]}
  rod: {mass: 0.5, centre_of_mass: [0.4, 0, 0.15], inertia: [0.001, 0.01, 0.01]}
  rocker: {mass: 0.5, centre_of_mass: [0.5, 0, 0.15], inertia: [0.001, 0.005, 0.005]}
joints:
  crank: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}
  knee: {kind: revolute, bodies: [arm, rod], at: [0.3, 0, 0], axis: y}
  top: {kind: revolute, bodies: [rod, rocker], at: [tip, 0, 0.3], axis: y}
  foot: {kind: revolute, bodies: [ground, rocker], at: [0.5, 0, 0], axis: y}
forces: {block: {kind: joint_force, joint: crank, law: {stop: {side: above, at: stop, stiffness: 60, damping: damping}}}}
outputs: [crank.angle, rocker.x, crank.angle_rate]
scenes: {fall: {end: 1}}
"""


@pytest.mark.parametrize(("text", "name", "by", "independent"), [
    (PLATE, "plate", {"swing": 1e-5, "k": 0.1, "damping": 1e-3}, "gap.displacement_rate"),
    (STOPPED, "stopped", {"heavy": 1e-3, "stop": 1e-4, "damping": 1e-3, "tip": 1e-5}, "crank.angle_rate"),
])  # fmt: skip
@pytest.mark.parametrize("integrator", with_heavy(["rk4", "dormand-prince"], "dormand-prince"))
def test_guides_and_loops_at_forces_that_jump(text: str, name: str, by: dict[str, float], independent: str, integrator: str) -> None:
    """Behind a contact, by each number: beside differences of runs with steps so short that the lengths before an event, which a
    derivative takes for given, do not matter."""
    sim = loaded(text, name, integrator=integrator).reset(dt=5e-4, **({} if integrator == "rk4" else {"tolerance": 1e-11}))
    sim.choose_independent([independent])
    run = sim.forward_sensitivities(900, list(sim.outputs), list(by), events=9)
    assert run.events is not None
    assert len(run.events.names) > 1
    for derivatives, (number, h) in zip(run.end[1].T, by.items(), strict=True):
        course = from_start(sim, number, [independent], 900, list(sim.outputs))
        wanted = fourth_order(lambda change, course=course: course(change)[-1], h)  # type: ignore[misc]
        assert np.abs(derivatives - wanted).max() < 3e-8 * np.abs(wanted).max(), number


@pytest.mark.parametrize(("text", "name", "independent", "dt"), [
    (THRUST, "ball", "slide.displacement_rate", 1e-3),
    pytest.param(STOPPED, "stopped", "crank.angle_rate", 5e-4, marks=pytest.mark.heavy),
])  # fmt: skip
def test_adjoints_go_back_over_events(text: str, name: str, independent: str, dt: float) -> None:
    sim = backwards(text, name, integrator="rk4").reset(dt=dt)
    sim.choose_independent([independent])
    compare_backwards(sim, 1e-12 if text == THRUST else 5e-9, steps=900)  # loops: what closes them ends at 1e-9


def test_a_table_has_kinks_that_make_no_jump() -> None:
    """Forces and their slopes go on over knots: time and place of an event move, the motion has no jump of its derivative."""
    sim = loaded(TABLE, "knots", integrator="rk4").reset(dt=1e-3)
    run = sim.forward_sensitivities(600, ["mass.x", "mass.vx"], list(sim.states), events=9)
    assert run.events is not None
    assert len(run.events.names) > 2

    def course(change: float) -> np.ndarray:
        sim.reset()
        sim.set_states([0.9 + change, 0.0])
        return sim.run(600)

    differences = fourth_order(course, 2e-5)
    # the length of the step before an event
    assert np.abs(run.derivatives[1:, :, 0] - differences).max() < 1e-7 * np.abs(differences).max()


#: Two masses that fall side by side.
PAIR = """
cutjoint: 1
name: pair
gravity: [0, 0, -9.81]
parameters: {drop: {value: 0.3, unit: m, binding: param}, one: {value: 0, unit: m, binding: param}}
bodies: {left: {mass: 1, centre_of_mass: [0, 0, 0]}, right: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints:
  a: {kind: prismatic, bodies: [ground, left], at: [0, 0, 0], axis: z}
  b: {kind: prismatic, bodies: [ground, right], at: [1, 0, 0], axis: z}
forces:
  first: {kind: joint_force, joint: a, law: "where(position < one - drop, 30, 0)"}
  second: {kind: joint_force, joint: b, law: "where(position < -drop, 30, 0)"}
outputs: [left.z, right.z]
scenes: {fall: {end: 1}}
"""

#: A rod on a cart that a guide moves on at once.
JERKED = """
cutjoint: 1
name: jerked
gravity: [0, 0, 0]
parameters: {begin: {value: 0.2037, unit: s, binding: param}}
bodies:
  cart: {mass: 3, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  rod: {mass: 2, centre_of_mass: [0, 0, -0.5], inertia: [0.2, 0.3, 0.1]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: x, guide: "where(t < begin, 0, 2*(t - begin))"}
  pin: {kind: revolute, bodies: [cart, rod], at: [0, 0, 0], axis: y}
outputs: [pin.angle]
scenes: {run: {end: 1}}
"""


def test_what_has_no_derivative_is_reported_by_name() -> None:
    sim = loaded(PAIR, "pair", integrator="rk4").reset(dt=0.01)
    together = sim.copy().forward_sensitivities(40, ["left.z", "right.z"], ["drop"]).end[1][:, 0]
    assert together[0] == pytest.approx(together[1], rel=1e-12)
    with pytest.raises(cutjoint.SimulationError, match=r"other parameter values.*: 'first' \(pair.yaml:11\).*one-sided") as reported:
        sim.forward_sensitivities(40, ["left.z"], ["one"])
    assert reported.value.status == 34
    sim = loaded(JERKED, "jerked", integrator="rk4").reset(dt=0.01)
    with pytest.raises(cutjoint.SimulationError, match=r"velocities jump where a guide.*: 'rail' \(jerked.yaml:10\)") as reported:
        sim.forward_sensitivities(40, ["pin.angle"], ["begin"])
    assert reported.value.status == 35
    sim = loaded(PUSHED, "pushed", integrator="rk4").reset(dt=0.3137)
    with pytest.raises(cutjoint.SimulationError, match=r"exactly where a step ends.*: 'thrust'") as reported:
        sim.forward_sensitivities(2, ["mass.z"], ["until"])
    assert reported.value.status == 36
    assert loaded(PUSHED, "pushed", integrator="rk4").reset(dt=0.3137).forward_sensitivities(2, ["mass.z"], ["push"]).end[1][0,
        0] > 0.0
    with pytest.raises(cutjoint.SimulationError, match=r"no derivative: it ended at an event.*'thrust'.*or differentiate a run"):
        loaded(PUSHED, "pushed", integrator="rk4").reset(dt=0.5).step_derivatives()
    with pytest.raises(ValueError, match="needs at least one name in `by`"):
        sim.forward_sensitivities(1, [], [], events=1)
    with pytest.raises(TypeError, match="these steps do not end at events: load the model by method recursive with rk4"):
        loaded(THRUST, "ball").reset().forward_sensitivities(1, ["mass.z"], ["g"], events=1)


def test_the_command_has_the_first_event(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(SPRING, encoding="utf-8")
    call = ["gradient", str(tmp_path / "ball.yaml"), "--integrator", "rk4", "--dt", "1e-3"]
    done = CliRunner().invoke(main, [*call, "--objective", "event", "--check", *(f"--by={name}" for name in BY)])
    assert done.exit_code == 0, done.output
    assert "the first event, of 'stop'" in done.output
    lines = [line.split() for line in done.output.splitlines() if line.strip().startswith(tuple(f"{name} " for name in BY))]
    rows = {line[0]: [float(x) for x in line[1:]] for line in lines}
    assert [rows[name][0] for name in BY] == pytest.approx(along(sprung, 0.7)[2], rel=1e-4, abs=1e-9)  # six printed digits
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", done.output)[0]) < 1e-7
    many = CliRunner().invoke(main, [*call, "--output", "mass.z", "--end", "0.7", "--check"])
    assert many.exit_code == 0, many.output
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", many.output)[0]) < 1e-6
    none = CliRunner().invoke(main, [*call, "--objective", "event", "--end", "0.1"])
    assert (none.exit_code, "changes its formula until 0.1 s" in none.output) == (1, True)


def test_the_command_needs_numbers_by_which_an_event_changes(tmp_path: Path) -> None:
    text = """
cutjoint: 1
name: drop
gravity: [0, 0, -9.81]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 1]}}
joints: {fall: {kind: prismatic, bodies: [ground, ball], at: [0, 0, 1], axis: [0, 0, 1]}}
forces: {floor: {kind: joint_force, joint: fall, law: "where(fall.displacement < 0, -1000*fall.displacement, -9)"}}
outputs: [ball.z]
scenes: {run: {end: 1, output_step: 0.01}}
"""
    (tmp_path / "drop.yaml").write_text(text, encoding="utf-8")
    call = ["gradient", str(tmp_path / "drop.yaml"), "--integrator", "rk4", "--objective", "event"]
    done = CliRunner().invoke(main, call)
    assert (done.exit_code, "drop.yaml has no parameter or input that could change its event" in done.output) == (1, True)
    assert CliRunner().invoke(main, [*call, "--by", "fall.displacement_rate"]).exit_code == 0
