"""Forces on joints' coordinates: by name, and as springs and limits that are written in a joint; stops in other forces."""

from __future__ import annotations

import json

import pytest

from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointForce

from .pendulum import PENDULUM, check, read

AXIS = "axis: [0, 1, 0]"
HINGE = f"kind: revolute, bodies: [ground, arm], at: [0, 0, 0], {AXIS}"
PLATE = HINGE.replace("revolute", "planar")
LENGTH, TRAVEL, POSITION, RATE = (variable(name) for name in ("length", "travel", "position", "rate"))


def joint_force(old: str, new: str, name: str) -> JointForce:
    return next(force for force in read(old, new).forces if force.name == name)


def value(force, position: float, rate: float) -> float:
    return evaluate(force.law, {LENGTH: position, TRAVEL: position, POSITION: position, RATE: rate})


def test_a_joint_with_one_coordinate_needs_no_name() -> None:
    assert read().forces[0].coordinate == "angle"


@pytest.mark.parametrize(("coordinate", "unit"), [("displacement_2", "N"), ("angle", "N*m")])
def test_coordinates_by_name(coordinate: str, unit: str) -> None:
    text = PENDULUM.replace(HINGE, PLATE).replace("joint: hinge, law", f"joint: hinge, coordinate: {coordinate}, law")
    (force,) = read_model_text(text, "m.yaml").forces
    assert force.coordinate == coordinate
    assert quantities(force)["force"] == unit


def test_a_joints_own_spring() -> None:
    spring = joint_force(AXIS, f"{AXIS}, spring: {{stiffness: 5 N*m, damping: 2, free_position: 30 deg}}", "hinge_spring")
    assert (spring.joint, spring.coordinate, spring.active) == ("hinge", "angle", True)
    assert value(spring, 1.5235987755982988, 3.0) == pytest.approx(-5 - 6)
    assert str(spring.span) == "m.yaml:13:82"
    assert value(joint_force(AXIS, f"{AXIS}, spring: {{stiffness: 5}}", "hinge_spring"), 2.0, 1.0) == -10


LIMITS = [  # position, rate, torque: free inside; outside k times depth, with damping that never pulls inwards
    (0.0, 9.0, 0.0), (-0.5, -1.0, 0.0), (-0.6, 0.0, 10.0), (-0.6, -1.0, 12.0), (-0.6, 1.0, 8.0), (-0.6, 6.0, 0.0),
    (1.2, 0.0, -20.0), (1.2, 3.0, -26.0), (1.2, -11.0, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("position", "rate", "torque"), LIMITS)
def test_a_joints_own_limits(position: float, rate: float, torque: float) -> None:
    limits = f"{AXIS}, limits: {{lower: -0.5, upper: 1, stiffness: 100, damping: 2}}"
    assert value(joint_force(AXIS, limits, "hinge_stop"), position, rate) == pytest.approx(torque)


def test_limits_may_have_one_end() -> None:
    stop = joint_force(AXIS, f"{AXIS}, limits: {{upper: 1, stiffness: 100}}", "hinge_stop")
    assert [value(stop, x, -50.0) for x in (-9.0, 1.0, 1.5)] == [0.0, 0.0, -50.0]


def test_scenes_switch_a_joints_own_forces_and_outputs_name_them() -> None:
    text = PENDULUM.replace(AXIS, f"{AXIS}, spring: {{stiffness: 5}}")
    text = text.replace("end: 2", "end: 2, switches: {hinge_spring: false}, outputs: [hinge_spring.force]")
    scene = read_model_text(text, "m.yaml").scenes["fall"]
    assert scene.switches == {"hinge_spring": False}
    assert scene.outputs[0].column == "hinge_spring.force"


STOPS = [  # kind of force, side, position, rate, force: what pushes apart is tension below zero, or a push along the axis
    ("point_spring", "below", 0.4, 0.0, -10.0), ("point_spring", "below", 0.4, -1.0, -12.0), ("point_spring", "below", 0.4, 9.0, 0.0),
    ("point_spring", "below", 0.6, -9.0, 0.0), ("point_spring", "above", 0.6, 1.0, 12.0), ("point_spring", "above", 0.6, -9.0, 0.0),
    ("axial_force", "below", 0.4, -1.0, 12.0), ("axial_force", "above", 0.6, 1.0, -12.0), ("axial_force", "above", 0.4, 1.0, 0.0),
]  # fmt: skip
PLACES = {
    "point_spring": {"from": [0, 0, 1], "to": "tip"},
    "axial_force": {"origin": [0, 0, 1], "point": "tip", "axis": [0, 0, 1]},
}


@pytest.mark.parametrize(("kind", "side", "position", "rate", "expected"), STOPS)
def test_stops_push_back_on_one_side(kind: str, side: str, position: float, rate: float, expected: float) -> None:
    law = {"stop": {"at": 0.5, "side": side, "stiffness": 100, "damping": 2}}
    part = {"kind": kind, "bodies": ["ground", "arm"], **PLACES[kind], "law": law}
    (force,) = read('drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}', f"bumper: {json.dumps(part)}").forces
    assert value(force, position, rate) == pytest.approx(expected)


def test_stops_stand_in_sums() -> None:
    law = "{sum: ['-3*rate', {stop: {at: 0.5, side: above, stiffness: 100}}]}"
    (force,) = read('"-0.1*rate"', law).forces
    assert value(force, 0.7, 1.0) == pytest.approx(-3 - 20)


PROBLEMS = [
    (HINGE, HINGE.replace("revolute", "free").replace(f", {AXIS}", ""),
     "15:36: force 'drag': the free joint 'hinge' has 3 coordinates; write coordinate: x or y or z"),
    ("joint: hinge, law", "joint: hinge, coordinate: §angel, law",
     "@: force 'drag': the revolute joint 'hinge' has no coordinate 'angel'; did you mean 'angle'?"),
    (AXIS, f"{AXIS}, spring: {{stiffness: §5 N/m}}", "@: joint 'hinge': spring.stiffness needs N*m, got N/m"),
    (AXIS, f"{AXIS}, spring: {{stiff: 5}}",
     "13:91: joint 'hinge': spring: unknown field 'stiff'; did you mean 'stiffness'?"),
    (AXIS, f"{AXIS}, spring: {{stiffness: 5, coordinate: §x}}",
     "@: joint 'hinge': the revolute joint 'hinge' has no coordinate 'x'; coordinates: angle"),
    (AXIS, f"{AXIS}, limits: §{{stiffness: 5}}", "@: joint 'hinge': limits: limits need lower, upper or both"),
    (AXIS, f"{AXIS}, limits: §{{lower: 1, upper: 0, stiffness: 5}}", "@: joint 'hinge': limits: lower is not below upper"),
    (AXIS, f"{AXIS}, limits: {{lower: 1, stiffness: §0}}",
     "@: joint 'hinge': the stiffness of a stop must be greater than zero"),
    (AXIS, f"{AXIS}, limits: {{lower: 1, stiffness: 1, damping: §-1}}",
     "@: joint 'hinge': the damping of a stop must not be negative"),
    (f"revolute, bodies: [ground, arm], at: [0, 0, 0], {AXIS}",
     f"universal, bodies: [ground, arm], at: [0, 0, 0], {AXIS}, axis_2: [1, 0, 0], cut: true, limits: §{{lower: 1, stiffness: 5}}",
     ["@: joint 'hinge': the cut universal joint 'hinge' has no coordinates; a force needs one to act on",
      "15:36: force 'drag': the cut universal joint 'hinge' has no coordinates; a force needs one to act on"]),
    ("law: \"-0.1*rate\"", "law: {stop: {at: 0, side: §left, stiffness: 1}}",
     "@: force 'drag': law.stop.side: must be 'below' or 'above', not 'left'"),
    ("law: \"-0.1*rate\"", "law: {§stop: {at: 0, stiffness: 1}}",
     "@: force 'drag': law.stop: the field 'side' is missing; write on which side of it the stop acts: side: above, as of a rope, or "
     "side: below, as of a bumper"),
    ("law: \"-0.1*rate\"", "law: {stop: {at: §swing, side: above, stiffness: 1}}",
     "@: force 'drag': law.stop.at: the input 'swing' cannot be used here, it may change with time; use binding: param, or write the law "
     "as an expression over its variables, in which inputs may stand"),
    ("{end: 2}", "{end: 2, inputs: {swing: {stop: §{at: 0, side: below, stiffness: 1}}}}",
     "@: scene 'fall': a stop belongs to a force over length, travel or position; write an expression"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), PROBLEMS)
def test_problems(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


def test_the_names_of_a_joints_own_forces_are_names() -> None:
    model = PENDULUM.replace("hinge", "hinge_")
    expected = "@: joint 'hinge_': spring: the name 'hinge__spring' has a double underscore; rename the joint"
    check(AXIS, f"{AXIS}, §spring: {{stiffness: 5}}", expected, model)


def test_a_joints_own_forces_share_the_names_of_elements() -> None:
    model = PENDULUM.replace(AXIS, f"{AXIS}, spring: {{stiffness: 5}}")
    expected = "@: force 'hinge_spring': duplicate name 'hinge_spring', first defined at line 13; rename one of them"
    check("drag: {kind", "§hinge_spring: {kind", expected, model)
