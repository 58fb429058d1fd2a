"""Trims and starts of loops that cannot be: what the messages name, and the nearest that can."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint import find_equilibrium, find_initial_state, find_trim, read_model_text
from cutjoint.analysis.trim_equations import TrimEquations
from cutjoint.model.errors import ModelError
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.run.simulation import simulate
from tests.mechanisms.trims import FIVE_BAR, MOTOR, SLED, SPRING
from tests.physics.simulation import compile_model
from tests.physics.test_trims import run

RUBBED = """
cutjoint: 1
name: rubbed
gravity: [0, 0, -9.81]
parameters: {push: {value: 1, unit: kN, binding: input}}
bodies: {block: {mass: 30, centre_of_mass: [0, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: z}}
forces:
  lift: {kind: joint_force, joint: slide, law: push}
  rub: {kind: joint_friction, joint: slide, coefficient: 0.1, preload: 50 N, carried: false}
scenes: {held: {end: 1, positions: {slide.displacement: 0.1}, trim: {find: []}}}
"""


def refused(text: str, old: str, new: str) -> str:
    assert old in text
    with pytest.raises((RunError, ModelError)) as error:
        run(text.replace(old, new))
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "old", "new", "said"),
    [
        (FIVE_BAR, ", spring.length: 0.69 m", "", "m.yaml:24:32: scene 'held': trim: too many unknowns: 'preload', "),
        (FIVE_BAR, "[preload, moment]", "[moment]", "trim: too few unknowns, or conditions that contradict each other: no start meets all "
         "conditions; the nearest has "),
        (FIVE_BAR, "[preload, moment]", "[moment, gain]", "'gain' is none that a start can have; write one of: a.angle, "),
        (MOTOR, "[voltage, current]", "[voltage, length]", "too many unknowns: 'length', 'voltage' and 'current' can change together"),
        (SLED, "[throttle]", "[throttle, way.displacement]", "m.yaml:20:29: scene 'steady': trim: no condition depends on "
         "'way.displacement'; remove it from 'find', or add a condition on what it changes"),
        (MOTOR, "positions: {hinge.angle: 30 deg}, trim: {", "trim: {hold: {bob.z: 0.8 m}, ", "m.yaml:17:18: scene 'held': trim: no start "
         "meets all conditions; the nearest has 'bob.z' = 0.5 in place of 0.8 m; write other values, or begin nearer"),
        (FIVE_BAR, "a.angle: 5 deg", "a.angle: 5 deg, 2*a.angle: 11 deg", "the nearest has 'a.angle' = 5.2"),
        (MOTOR, "[voltage, current]}", "[voltage], hold: {hinge.angle: 20 deg}}", "none of them changes "
         "'hinge.angle' = 30 in place of 20 deg"),
        (SLED, "[0, 1]", "[0, 0.1]", "with 'throttle' = 0.1 at the bound"),
        (SLED, "unsteady: [far], ", "", "'far' changing by "),
        (SPRING, ", binding: param", "", "the parameter 'preload' has binding const; give it 'binding: param'"),
        (SLED, "    end: 1\n", "    end: 1\n    inputs: {throttle: 0.1*t}\n", "the scene's law of the input 'throttle' is no number"),
        (SLED, "    end: 1\n", "    end: 1\n    pose: equilibrium\n", "a trim finds the pose of rest itself; remove 'pose: equilibrium'"),
        (SLED, "{throttle: [0, 1]}", "{target: [0, 1]}", "trim: bounds: 'target' is not to be found; list it under 'find' too"),
        (SLED, "{start: 0 m,", "{start: 0 m, bounds: [2 m, 1 m],", "its bounds do not ascend; write [least, "),
        (SLED, "{start: 0 m,", "{start: 0 m, bounds: [0, 1 s],", "state 'far': "),
        (SLED, "[0, 1]", "[1, 0]", "trim: bounds: those of 'throttle' do not ascend; write [least, largest]"),
    ],
)  # fmt: skip
def test_wrong_requests(text: str, old: str, new: str, said: str) -> None:
    assert said in refused(text, old, new)


def test_states_outside_of_their_bounds_are_not_found() -> None:
    """The voltage of a current of -2.55 A, which the bounds of the current exclude."""
    assert "no start meets all conditions" in refused(MOTOR, "start: 0 A,", "start: 0 A, bounds: [-2.5 A, 2.5 A],")


@pytest.mark.parametrize(("trim", "said"), [
    ("{find: [push]}", "too many unknowns: 'push' and 'rub_bristle' can change together"),
    ("{find: [push], bounds: {push: [0 N, 200 N]}}", "'push' = 200 at the bound; the nearest has 89.3 N missing along 'slide."),
])  # fmt: skip
def test_friction_at_rest_holds_up_to_its_limit(trim: str, said: str) -> None:
    """30 kg and friction of at most 5 N: found forces lie within it, also where the search begins far off."""
    assert said in refused(RUBBED, "{find: []}", trim)


def test_values_of_what_is_found(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SLED)
    with pytest.raises(RunError, match="'throttle' is to be found; leave out its value, or take it out of 'find'"):
        simulate(compile_model(tmp_path / "m.yaml"), parameters={"throttle": 0.5})


def test_scenes_without_a_trim() -> None:
    with pytest.raises(RunError, match="scene 'held' has no 'trim'; write one, or use find_equilibrium"):
        find_trim(read_model_text(MOTOR.replace(", trim: {find: [voltage, current]}", ""), "m.yaml"))


FOUR_BAR = """
cutjoint: 1
name: bars
gravity: [0, 0, -9.81]
parameters: {wish: {value: 2, unit: m, binding: param}}
points: {A: [0, 0, 0], B: [0, 0, 0.3], C: [0.8, 0, 0.6], D: [0.7, 0, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: B, inertia: [0.01, 0.01, 0.01]}
  coupler: {mass: 1, centre_of_mass: C, inertia: [0.01, 0.01, 0.01]}
  rocker: {mass: 1, centre_of_mass: {midpoint: [C, D]}, inertia: [0.01, 0.01, 0.01]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: A, axis: y}
  b: {kind: revolute, bodies: [crank, coupler], at: B, axis: y}
  c: {kind: revolute, bodies: [coupler, rocker], at: C, axis: y, cut: true}
  d: {kind: revolute, bodies: [rocker, ground], at: D, axis: y}
scenes:
  s: {end: 1, SCENE}
"""


def four_bar_by_hand(crank: float) -> tuple[float, float]:
    """The rocker's angle of the joint d, and the height of C, by the intersection of two circles."""
    B, D = 0.3 * np.array([np.sin(crank), np.cos(crank)]), np.array([0.7, 0.0])
    coupler, rocker, along = np.hypot(0.8, 0.3), np.hypot(0.1, 0.6), D - B
    length = np.linalg.norm(along)
    part = (coupler**2 - rocker**2 + length**2) / (2 * length)
    C = B + part * along / length + np.sqrt(coupler**2 - part**2) * np.array([-along[1], along[0]]) / length
    return float(np.arctan2(0.1, 0.6) - np.arctan2(*(C - D))), float(C[1])


def nearest_rates(crank: float, rocker: float) -> tuple[float, float]:
    """The rates that follow from each other next to wanted ones, with the ratio by differences."""
    ratio = (four_bar_by_hand(1e-5)[0] - four_bar_by_hand(-1e-5)[0]) / 2e-5
    rate = (crank + ratio * rocker) / (1 + ratio**2)
    return rate, ratio * rate


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("positions: {a.angle: 20 deg, b.angle: 40 deg}", "m.yaml:17:27: scene 's': the loop cannot close from the given coordinates"),
        ("rates: {a.angle_rate: 1, d.angle_rate: 2}", f"the nearest motion has a.angle_rate = {nearest_rates(1, 2)[0]:.6g} in place of 1 "
         f"rad/s and d.angle_rate = {nearest_rates(1, 2)[1]:.6g} in place of 2 rad/s"),
        ("positions: {a.angl: 1}", "m.yaml:17:27: scene 's': positions: the revolute joint 'a' has no 'angl'; did you mean 'angle'?"),
        ("positions: {c.angle: 1}", "m.yaml:17:27: scene 's': positions: the cut joint 'c' has no 'angle'; a cut joint has no positions"),
        ("assemble: {coupler.z: 2 m}", f"m.yaml:17:26: scene 's': assemble: no pose that closes the loops was found with these values; the "
         f"nearest has coupler.z = {np.hypot(0.1, 0.6):.6g} in place of 2 m"),
        ("positions: {a.angle: 0.2}, assemble: {coupler.z: 0.5 m}", f"the nearest has coupler.z = {four_bar_by_hand(0.2)[1]:.6g} in place "
         "of 0.5 m; values wanted: 1, 0 can be chosen there"),
        ("assemble: {crank.x: wish}", "in place of 2 m; write others, or fewer"),
        ("positions: {a.angle: 0.1}, assemble: {2*a.angle: 1}", "m.yaml:17:53: scene 's': assemble: no pose that closes the loops was "
         "found with these values; the nearest has 2*a.angle = 0.2 in place of 1"),
        ("trim: {hold: {a.angle: 20 deg, coupler.z: 0.7 m}}", "m.yaml:17:15: scene 's': trim: too few unknowns, or conditions that "
         "contradict each other: no start meets all conditions; the nearest has 'coupler.z' = "),
        ("trim: {hold: {a.angle: 20 deg, coupler.z: 0.7 m}}", "; with the others met, 'coupler.z' = "
         f"{four_bar_by_hand(np.pi / 9)[1]:.6g} m is possible"),
        ("trim: {hold: {a.angle: 1, d.angle: 1}}", f"; with the others met, 'd.angle' = {four_bar_by_hand(1.0)[0]:.6g} is possible"),
        ("positions: {a.angle: 1}, trim: {hold: {d.angle: 50 deg}}", f"; with the others met, 'd.angle' = "
         f"{np.degrees(four_bar_by_hand(1.0)[0]):.6g} deg is possible"),
        ("trim: {hold: {coupler.z: 2 m}}", " in place of 2 m, the loop of 'c.x' open"),
        ("trim: {find: [d.angle], bounds: {d.angle: [3, 3.1]}}", "with 'd.angle' = 3.1 at the bound; the nearest has "),
    ],
)  # fmt: skip
def test_wrong_starts_of_a_loop(scene: str, said: str) -> None:
    with pytest.raises(CutjointError) as error:
        find_initial_state(read_model_text(FOUR_BAR.replace("SCENE", scene), "m.yaml"))
    assert said in str(error.value)


RESTING = """
cutjoint: 1
name: rest
gravity: [0, 0, -9.81]
bodies:
  mass: {mass: 0.45, centre_of_mass: [0, 0, 1.3], inertia: [1, 1, 1]}
  bob: {mass: 80, centre_of_mass: [5, 0, 1.3], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 1], axis: z}
  arm: {kind: revolute, bodies: [ground, bob], at: [4, 0, 1.3], axis: y}
forces:
  foot: {kind: contact, bodies: [ground, mass], at: [0, 0, 0], normal: z, centre: [0, 0, 1.3], radius: 1, force: [0, 0, 1e5*deflection]}
  heel: {kind: contact, bodies: [ground, bob], at: [0, 0, 0], normal: z, centre: [5, 0, 1.3], radius: 1, force: [0, 0, 2e4*deflection]}
scenes: {run: {end: 1, trim: {find: [slide.displacement], hold: {mass.z: 2 m}}}}
"""


def test_a_target_that_the_other_conditions_determine_is_refused_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mass rests on the ground, wherever it is wanted: one search with the target, one without; further ones took 259 evaluations."""
    count, evaluated = [], TrimEquations.evaluated
    monkeypatch.setattr(TrimEquations, "evaluated", lambda self, y: count.append(y) or evaluated(self, y))
    model = read_model_text(RESTING, "m.yaml")
    with pytest.raises(RunError, match=r"no start meets all conditions; the nearest has 'mass\.z' = 1 in place of 2 m"):
        find_equilibrium(model)
    assert len(count) < 60
