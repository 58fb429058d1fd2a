"""Neutral coordinates of an equilibrium: it is one at other values of them too. No other coordinate is named, and none is missed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import fsolve

from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.tasks.states import find_scene_equilibrium
from tests.conftest import needs_cpp

pytestmark = needs_cpp

_HEAD = "cutjoint: 1\nname: m\ngravity: [0, 0, {g}]\n"
_WHEEL = """\
bodies: {wheel: {mass: 2, centre_of_mass: [{x}, 0, 0], inertia: [0.1, 0.2, 0.1]}}
joints: {bearing: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: y}}
forces: {drag: {kind: joint_force, joint: bearing, law: -0.3*rate + {law}}}
scenes: {rest: {end: 1{start}}}
"""
_CART = """\
bodies: {cart: {mass: 3, centre_of_mass: [0, 0, 0]}, bob: {mass: 1, centre_of_mass: [0.1, 0, -0.5], inertia: [0.01, 0.01, 0.01]},
  anvil: {mass: 5, centre_of_mass: [1, 0, 0]}}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: x}
  swing: {kind: revolute, bodies: [cart, bob], at: [0, 0, 0], axis: y}
  slide: {kind: prismatic, bodies: [ground, anvil], at: [1, 0, 0], axis: z}
forces: {stiff: {kind: joint_force, joint: slide, law: -1e9*position}, soft: {kind: joint_force, joint: rail, law: {law}}}
scenes: {rest: {end: 1{start}}}
"""
_STRINGS = """\
bodies: {bead: {mass: 0.1, centre_of_mass: [0, 0, 0]}}
joints: {cross: {kind: prismatic, bodies: [ground, bead], at: [0, 0, 0], axis: y}}
forces:
  left: {kind: point_spring, bodies: [ground, bead], from: [-1, 0, 0], to: [0, 0, 0], law: {stiffness: 100, free_length: {free}}}
  right: {kind: point_spring, bodies: [ground, bead], from: [1, 0, 0], to: [0, 0, 0], law: {stiffness: 100, free_length: {free}}}
scenes: {rest: {end: 1}}
"""
_FOUR_BAR = """\
points: {A: [0, 0, 0], B: [0.1, 0.3, 0], C: [0.7, 0.5, 0], D: [0.8, 0, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: {midpoint: [A, B]}, inertia: [0.1, 0.1, 0.1]}
  coupler: {mass: 1, centre_of_mass: {midpoint: [B, C]}, inertia: [0.1, 0.1, 0.1]}
  rocker: {mass: 1, centre_of_mass: {midpoint: [C, D]}, inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: A, axis: {axis}}
  b: {kind: revolute, bodies: [crank, coupler], at: B, axis: {axis}}
  c: {kind: revolute, bodies: [coupler, rocker], at: C, axis: {axis}}
  d: {kind: revolute, bodies: [ground, rocker], at: D, axis: {axis}}
forces: {spring: {kind: joint_force, joint: a, law: {law}}}
scenes: {rest: {end: 1}}
"""
_FREE = """\
bodies: {stone: {mass: 2, centre_of_mass: [0.1, 0, 0], inertia: [0.1, 0.2, 0.15]}}
joints: {moves: {kind: free, bodies: [ground, stone], at: [0, 0, 0]}}
forces: {hang: {kind: point_spring, active: {on}, bodies: [ground, stone], from: [0, 0, 1], to: [0, 0, 0], law: {stiffness: 500, damping: 5,
  free_length: 0.8}}}
scenes: {rest: {end: 1}}
"""
_LIFT = """\
bodies: {cabin: {mass: 300, centre_of_mass: [0, 0, 0]}, weight: {mass: {m}, centre_of_mass: [1, 0, 0]}}
joints:
  up: {kind: prismatic, bodies: [ground, cabin], at: [0, 0, 0], axis: z}
  down: {kind: prismatic, bodies: [ground, weight], at: [1, 0, 0], axis: z}
gears: {rope: {joints: [up, down], ratio: {ratio}}}
scenes: {rest: {end: 1{start}}}
"""
_BALL = """\
bodies: {bob: {mass: 1, centre_of_mass: [0, 0, -0.4], inertia: [0.01, 0.01, 0.004]}}
joints: {socket: {kind: spherical, bodies: [ground, bob], at: [0, 0, 0]}}
scenes: {rest: {end: 1{start}}}
"""
_STANDING = """\
bodies: {carrier: {mass: 350, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}}
joints: {heave: {kind: prismatic, bodies: [ground, carrier], at: [0, 0, 0.3], axis: [0, 0.2, 1]}}
forces: {damper: {kind: joint_force, joint: heave, law: -2000*rate}}
submodels: {wheel: {include: library/wheel_brush}}
instances: {w: {use: wheel, connect: {carrier: carrier}, with: {x: 0, y: 0, z: 0.3, radius: 0.3, mass: 15, spin_inertia: 1,
  cross_inertia: 0.6, stiffness: 2e5, slip_stiffness: 60000, cornering_stiffness: 40000}}}
scenes: {rest: {end: 1}}
"""
_INTEGRAL = """\
bodies: {arm: {mass: 1, centre_of_mass: [0, 0, -0.5]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
states: {counted: {start: 0.3, rate: pin.angle_rate{leak}}}
scenes: {rest: {end: 1}}
"""
_CAR = """\
bodies: {chassis: {mass: 1100, centre_of_mass: [0, 0, 0.55], inertia: [400, 1500, 1650]}}
joints: {moves: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.55]}}
submodels:
  wheel: {include: library/wheel_brush}
  corner:
    connectors: [chassis]
    parameters: [x]
    bodies: {arm: {mass: 15, centre_of_mass: [x, 0.55, 0.3], inertia: [0.5, 0.4, 0.5]}}
    joints: {travel: {bodies: [chassis, arm], at: [x, 0.3, 0.35], JOINT}}
    forces: {strut: {kind: point_spring, bodies: [chassis, arm], from: [x, 0.55, 0.7], to: [x, 0.55, 0.3],
      law: {stiffness: 30000, free_length: 0.55}}}
    instances: {w: {use: wheel, connect: {carrier: arm}, with: {x: x, y: 0.75, z: 0.3, radius: 0.31, mass: 15, spin_inertia: 1,
      cross_inertia: 0.6, stiffness: 2e5, slip_stiffness: 60000, cornering_stiffness: 40000}}}
instances:
  fl: &front {use: corner, connect: {chassis: chassis}, with: {x: 1.25}}
  fr: {<<: *front, mirror: y}
  rl: &rear {use: corner, connect: {chassis: chassis}, with: {x: -1.25}}
  rr: {<<: *rear, mirror: y}
scenes: {rest: {end: 1}}
"""
_CASES: dict[str, tuple[str, dict[str, str], set[str]]] = {
    "a balanced wheel": (_WHEEL, {}, {"bearing.angle"}),
    "an unbalanced wheel": (_WHEEL, {"x": "0.01"}, set()),
    "a hardly unbalanced wheel": (_WHEEL, {"x": "1e-3"}, set()),
    "a wheel whose place is given": (_WHEEL, {"start": ", positions: {bearing.angle: 0.7}"}, set()),
    "a wheel whose place is preferred": (_WHEEL, {"start": ", positions: {bearing.angle: 0.7}, near: [bearing.angle]"}, {"bearing.angle"}),
    "a wheel that is held": (_WHEEL, {"law": "5", "start": ", positions: {bearing.angle: 0.7}"}, set()),
    "a wheel with a hard spring of the third order": (_WHEEL, {"law": "-1e3*position**3"}, set()),
    "a cart": (_CART, {}, {"rail.displacement"}),
    "a soft spring beside a stiff one": (_CART, {"law": "-0.02*position"}, set()),
    "a held cart with a loose pendulum": (_CART, {"law": "7", "start": ", positions: {rail.displacement: 0}"}, set()),
    "a cart without gravity": (_CART, {"g": "0"}, {"rail.displacement", "swing.angle"}),
    "a cart without gravity that is held": (_CART, {"g": "0", "law": "7", "start": ", positions: {rail.displacement: 0}"}, {"swing.angle"}),
    "slack strings across": (_STRINGS, {"free": "1"}, set()),
    "strings under tension": (_STRINGS, {"free": "0.9"}, set()),
    "a loop in the level plane": (_FOUR_BAR, {"axis": "z"}, {"d.angle"}),
    "a loop in the level plane with a spring": (_FOUR_BAR, {"axis": "z", "law": "-3*position"}, set()),
    "a body in space": (_FREE, {"g": "0", "on": "false"}, {*(f"moves.{x}" for x in ("x", "y", "z", "wx", "wy", "wz"))}),
    "a body on a spring": (_FREE, {}, {"moves.wz"}),
    "weights on a tackle": (_LIFT, {"m": "150", "ratio": "-0.5"}, {"down.displacement"}),
    "weights on another tackle": (_LIFT, {"m": "600", "ratio": "-2"}, {"up.displacement"}),
    "a lift that is too heavy": (_LIFT, {"m": "200", "start": ", positions: {up.displacement: 0}"}, set()),
    "a ball joint": (_BALL, {}, {"socket.wz"}),
    "a ball joint that is given": (_BALL, {"start": ", positions: {socket.attitude: {rotation_vector: [0, 0, 0.2]}}"}, set()),
    "a standing wheel": (_STANDING, {}, {"w.rolling.bearing.angle"}),
    "a counter": (_INTEGRAL, {}, {"counted.value"}),
    "a counter that leaks": (_INTEGRAL, {"leak": " - 0.1*counted"}, set()),
}  # fmt: skip
_USUAL = {"g": "-9.81", "x": "0", "law": "0", "start": "", "free": "1", "axis": "y", "on": "true", "m": "300", "ratio": "-1", "leak": ""}


def _text(case: str) -> str:
    template, given, _ = _CASES[case]
    text = _HEAD + template
    for name, value in (_USUAL | given).items():
        text = text.replace("{" + name + "}", value)
    return text


@pytest.mark.parametrize("case", _CASES)
def test_neutral_coordinates(case: str) -> None:
    model = read_model_text(_text(case), "m.yaml")
    found = find_scene_equilibrium(model, find_scene(model, None), neutral=True).neutral
    assert {name for name in found if not name.startswith("w.") or not name.endswith(".value")} == _CASES[case][2]


@pytest.mark.parametrize("case", ["a standing wheel", "a wheel whose place is given", "a counter", "a body in space"])
def test_one_line_says_it(tmp_path: Path, case: str) -> None:
    """States of the library are left out, as in the table."""
    model = tmp_path / "m.yaml"
    model.write_text(_text(case), encoding="utf-8")
    done = CliRunner().invoke(main, ["equilibrium", str(model)])
    assert done.exit_code == 0, done.output
    lines = [line for line in done.output.splitlines() if line.startswith("neutral")]
    names = sorted(_CASES[case][2])
    assert [sorted(line.partition(": ")[2].split(", ")) for line in lines] == ([names] if names else [])


def _car(gravity: str, joint: str = "kind: revolute, axis: x", scene: str = "", brake: str = "") -> str:
    car = _CAR.replace("JOINT", joint).replace("{end: 1}", f"{{end: 1{scene}}}").replace("spin_inertia: 1,", f"spin_inertia: 1,{brake}")
    return _HEAD.replace("[0, 0, {g}]", gravity) + car


@pytest.mark.parametrize("joint", ["kind: revolute, axis: x", "kind: prismatic, axis: z"])
@pytest.mark.parametrize("across", [0.0, 0.5])
def test_a_line_names_the_largest_side_force_of_standing_tyres(tmp_path: Path, joint: str, across: float) -> None:
    """Tyres hold a car on a banked road; on a level one they hold nothing, also where swing axles scrub on the way to rest."""
    model = tmp_path / "m.yaml"
    model.write_text(_car(f"[0, {across}, -9.81]", joint), encoding="utf-8")
    done = CliRunner().invoke(main, ["equilibrium", str(model)])
    assert done.exit_code == 0, done.output
    lines = [line for line in done.output.splitlines() if line.startswith("standing tyres")]
    assert len(lines) == (across > 0)
    if across > 0:
        side = {word[0]: float(word[2]) for line in done.output.splitlines() if len(word := line.split()) == 4 and word[1] == "Fy"}
        (found,) = re.findall(r"the largest (\S+) N at (\S+):", lines[0])
        assert found[1] in side
        assert float(found[0]) == pytest.approx(side[found[1]], rel=1e-3)
        assert abs(side[found[1]]) == max(map(abs, side.values())) > 100


def _height_without_friction() -> float:
    """Height of the chassis above a level road that pushes its wheels upwards alone: balance of the car and of one arm about its hinge."""

    def unbalanced(unknown: tuple[float, float]) -> tuple[float, float]:
        sunk, angle = unknown
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        hinge, top = np.array([0.3, 0.35 - sunk]), np.array([0.55, 0.7 - sunk])
        foot, centre, down = hinge + turn @ [0.25, -0.05], hinge + turn @ [0.45, -0.05], turn @ [0, -1]
        loaded = -centre[1] / down[1]
        load, spring = 2e5 * (0.31 - loaded), top - foot
        push = -30000 * (0.55 / np.hypot(*spring) - 1) * spring
        moments = ((foot, push - [0, 15 * 9.81]), (centre, np.array([0, -15 * 9.81])), (centre + loaded * down, np.array([0, load])))
        return 4 * load - 1220 * 9.81, sum((at - hinge)[0] * force[1] - (at - hinge)[1] * force[0] for at, force in moments)

    return 0.55 - float(fsolve(unbalanced, (0.05, 0.1), xtol=1e-13)[0])


def test_a_standing_car_has_the_height_of_one_without_friction() -> None:
    """Whatever the way from the drawn position, along which its swing axles scrub; all drawn positions have this rest."""
    model = read_model_text(_car("[0, 0, -9.81]"), "m.yaml")
    found = find_scene_equilibrium(model, find_scene(model, None)).values
    assert found["chassis.z"] == pytest.approx(_height_without_friction(), abs=1e-9)
    assert max(abs(value) for name, value in found.items() if name.endswith((".Fx", ".Fy"))) < 1e-5


@pytest.mark.parametrize("given", ["", ", positions: {moves.x: 0, moves.y: 0}"], ids=["", "place given"])
def test_tyres_of_a_car_on_a_slope_hold_its_share_of_the_weight(given: str) -> None:
    """A slope of 5 % by gravity, with brakes on: equal shares, nothing across, no forces at the given place."""
    model = read_model_text(_car("[-0.49, 0, -9.79]", "kind: prismatic, axis: z", given, " brake: 2000,"), "m.yaml")
    state = find_scene_equilibrium(model, find_scene(model, None))
    along = [state.values[f"{corner}.w.rolling.contact.Fx"] for corner in ("fl", "fr", "rl", "rr")]
    assert sum(along) == pytest.approx(1220 * 0.49, rel=1e-8)
    assert max(along) - min(along) < 0.01 * max(along)
    assert max(abs(value) for name, value in state.values.items() if name.endswith(".Fy")) < 1e-5
    assert not state.locking_forces


_HELD = """\
bodies: {arm: {mass: 1, centre_of_mass: [0, 0, -0.5]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
forces: {dry: {kind: joint_friction, joint: pin, coefficient: 1, radius: 20 mm, preload: 500, carried: false}}
scenes: {rest: {end: 1, positions: {pin.angle: {angle}}, near: {near}}}
"""


@pytest.mark.parametrize(
    ("angle", "near", "bounds"),
    [(0.3, "[pin.angle]", (0.0, 0.0)), (0.8, "[pin.angle]", (0.5, 0.8)), (0.3, "[]", (0.3, 0.3)), (0.8, "[]", (0.8, 0.8))],
    ids=["guessed within 0.5 rad", "guessed beyond 0.5 rad", "given within 0.5 rad", "given beyond 0.5 rad"],
)
def test_friction_holds_a_pendulum_where_it_is_given_or_far_from_0(angle: float, near: str, bounds: tuple[float, float]) -> None:
    model = read_model_text(_HEAD.replace("{g}", "-9.81") + _HELD.replace("{angle}", str(angle)).replace("{near}", near), "m.yaml")
    state = find_scene_equilibrium(model, find_scene(model, None))
    pitch = state.values["arm.pitch"]
    assert bounds[0] - 1e-8 <= pitch <= bounds[1] + 1e-8
    assert state.values["dry.force"] == pytest.approx(9.81 * 0.5 * np.sin(pitch), abs=1e-6)
    assert not state.locking_forces


def test_the_order_of_states_does_not_change_the_rest() -> None:
    """The rate of the one depends on the other, which sticks: the one does not."""
    states = ["turned: {start: 0, rate: pin.angle_rate}", "wound: {start: 0, rate: turned}"]
    angles = []
    for order in (states, states[::-1]):
        text = _INTEGRAL.replace("counted: {start: 0.3, rate: pin.angle_rate{leak}}", ", ".join(order))
        text += "forces: {spring: {kind: joint_force, joint: pin, law: 3*wound + 0.9}}\n"
        model = read_model_text(_HEAD.replace("{g}", "-9.81") + text, "m.yaml")
        angles.append(find_scene_equilibrium(model, find_scene(model, None)).values["arm.pitch"])
    assert angles[0] == pytest.approx(angles[1], abs=1e-9)
    assert angles[0] > 0.01
