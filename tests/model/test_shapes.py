"""Shapes and names in the model file, by the text of their problems."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import pytest
import yaml

from cutjoint.model.document.checks import element_of

from .pendulum import PENDULUM, check, problems

ARM = "arm: {mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]}"
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'

SHAPES = [
    ("name: pendulum", "", "1:1: model: the field 'name' is missing"),
    ("cutjoint: 1", "cutjoint: §2", "@: model: cutjoint: must be 1, not '2'"),
    ("gravity: [0, 0, -9.81]", "gravity: §9.81", "@: model: gravity needs three numbers; write [x, y, z]"),
    ("mass: arm_mass", "§mas: arm_mass, mass: 1", "@: body 'arm': unknown field 'mas'; did you mean 'mass'?"),
    ("markers:", "§marker: {}\nmarkers:", "@: model: unknown field 'marker'; did you mean 'markers'?"),
    ("mass: arm_mass", "mass: §[1]", "@: body 'arm': mass needs a number or an expression"),
    ("mass: arm_mass", "mass: §true", "@: body 'arm': mass needs a number or an expression"),
    (
        "mass: arm_mass, ",
        "",
        "11:3: body 'arm': needs mass and centre_of_mass, or shapes; add them, or write massless: true",
    ),
    (
        "mass: arm_mass",
        "massless: true, mass: 1",
        "11:3: body 'arm': a massless body has no mass; remove it, or 'massless'",
    ),
    ("mass: arm_mass", "mass: 1, massless: §yes", "@: body 'arm': massless needs true or false"),
    (
        "[0.1, 0.2, 0.2]",
        "§[0.1, 0.2]",
        "@: body 'arm': inertia needs three or six numbers; write [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]",
    ),
    (
        "[0.1, 0.2, 0.2]",
        "§0.1",
        "@: body 'arm': inertia needs three or six numbers, {principal: [a, b, c], x: direction, y: direction} or "
        "{axial: J, axis: direction}",
    ),
    (
        "centre_of_mass: [1, 0, 0]",
        "centre_of_mass: §[1, 0]",
        "@: body 'arm': centre_of_mass needs three numbers; write [x, y, z]",
    ),
    (
        "centre_of_mass: [1, 0, 0]",
        "centre_of_mass: §1",
        "@: body 'arm': centre_of_mass needs three numbers, a point's name, {midpoint: [P, Q]} or {sum: [point, vector, ...]}",
    ),
    (
        "centre_of_mass: [1, 0, 0]",
        "centre_of_mass: {midpoint: §[tip]}",
        "@: body 'arm': centre_of_mass.midpoint needs two names; write [one, other]",
    ),
    (ARM, "§arm:", "@: body 'arm': needs a mapping"),
    (
        "kind: revolute",
        "kind: §revolut",
        "@: joint 'hinge': unknown joint kind 'revolut'; did you mean 'revolute'? kinds: "
        "constant_velocity, cylindrical, distance, fixed, free, parallel_axes, planar, point_on_line, point_on_plane, "
        "prismatic, revolute, screw, spherical, universal",
    ),
    (
        "kind: revolute",
        "kind: §sledge",
        "@: joint 'hinge': unknown joint kind 'sledge'; kinds: constant_velocity, cylindrical, distance, fixed, "
        "free, parallel_axes, planar, point_on_line, point_on_plane, prismatic, revolute, screw, spherical, universal",
    ),
    ("kind: revolute, ", "", "13:3: joint 'hinge': the field 'kind' is missing"),
    (
        "kind: revolute",
        "kind: spherical",
        [
            "13:66: joint 'hinge': unknown field 'axis'; fields: at, bodies, cut, kind, limits, spring",
            "15:36: force 'drag': the spherical joint 'hinge' has no coordinates; a force needs one to act on",
        ],
    ),
    (", axis: [0, 1, 0]", "", "13:3: joint 'hinge': the field 'axis' is missing"),
    ("axis: [0, 1, 0]", "axis: §tip", "@: joint 'hinge': axis needs three numbers, an axis such as x or -y, or {from: P, to: Q}"),
    ("axis: [0, 1, 0]", "axis: §+y", "@: joint 'hinge': axis needs three numbers, an axis such as x or -y, or {from: P, to: Q}"),
    ("axis: [0, 1, 0]", "§axis: {to: tip}", "@: joint 'hinge': axis: the field 'from' is missing"),
    ("[ground, arm]", "§ground", "@: joint 'hinge': bodies needs two names; write [one, other]"),
    ("axis: [0, 1, 0]", "axis: [0, 1, 0], cut: §1", "@: joint 'hinge': cut needs true or false"),
    (
        "kind: joint_force",
        "kind: §spring",
        "@: force 'drag': unknown force kind 'spring'; did you mean 'point_spring'? kinds: "
        "axial_force, bushing, contact, joint_force, joint_friction, load, point_spring, tyre, wheel",
    ),
    (
        'law: "-0.1*rate"',
        "law: §[1]",
        "@: force 'drag': law needs a number, an expression, or a mapping with polynomial, piecewise, sum, let, table, stop or stiffness",
    ),
    (
        'law: "-0.1*rate"',
        "law: §{of: rate}",
        "@: force 'drag': law needs a number, an expression, or a mapping with polynomial, piecewise, sum, let, table, stop or stiffness",
    ),
    (
        'law: "-0.1*rate"',
        "law: {polynomial: §[], of: rate}",
        "@: force 'drag': law.polynomial needs at least 1 item, got 0",
    ),
    (
        'law: "-0.1*rate"',
        "law: {polynomial: §[1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, ], of: rate}",
        "@: force 'drag': law.polynomial needs at most 20 items, got 21",
    ),
    (
        'law: "-0.1*rate"',
        "law: {piecewise: [§{below: 1}, {expression: 1}], of: rate}",
        "@: force 'drag': law.piecewise: a piece needs either polynomial or expression",
    ),
    (
        'law: "-0.1*rate"',
        "law: {piecewise: [§{below: 1}], of: rate}",
        "@: force 'drag': law.piecewise: a piece needs either polynomial or expression",
    ),
    ("value: 2, unit: kg", "unit: kg", "5:3: parameter 'arm_mass': the field 'value' is missing"),
    (
        "binding: param",
        "binding: §late",
        "@: parameter 'arm_mass': binding: must be 'const', 'param' or 'input', not 'late'",
    ),
    ("unit: kg", "unit: §[kg]", "@: parameter 'arm_mass': unit: this is not a unit; write for example N*s/m"),
    (
        "{value: 1.5, unit: m}",
        "[1.5]",
        "6:3: parameter 'arm_length': needs a number or {value: ..., unit: ..., binding: ...}",
    ),
    ("outputs: [end.x]", "outputs: §end.x", "@: model: outputs needs a list"),
    ("outputs: [end.x]", "outputs: [§1]", "@: model: outputs needs element.quantity, or name: {value: expression, unit: ...}"),
    (
        "fall: {end: 2}",
        "fall: {end: 2, pose: §standing}",
        "@: scene 'fall': pose: must be 'design' or 'equilibrium', not 'standing'",
    ),
    (
        "fall: {end: 2}",
        "fall: {end: 2, numerics: {iterations: §1.5}}",
        "@: scene 'fall': numerics.iterations needs a whole number",
    ),
    (
        "fall: {end: 2}",
        "fall: {end: 2, road: {profile: [§{hill: 1}]}}",
        "@: scene 'fall': road.profile needs {flat: length}, {ramp: length, rise: height}, "
        "{step: height} or {cosine: length, amplitude: height}",
    ),
    (
        "fall: {end: 2}",
        "fall: {end: 2, road: §{profile: [], left: []}}",
        "@: scene 'fall': road: 'profile' stands for both tracks; write either profile, or left and right",
    ),
    (
        "fall: {end: 2}",
        "fall: {end: 2, switches: {drag: §off}}",
        "@: scene 'fall': switches.drag needs true or false",
    ),
    (
        DRAG,
        "§push: {kind: load, body: arm}",
        "@: force 'push': needs either force or torque; write two loads for both",
    ),
    (
        DRAG,
        "§push: {kind: load, body: arm, force: [1, 0, 0]}",
        "@: force 'push': a force needs 'at', a torque has no point",
    ),
    (
        DRAG,
        "rope: {kind: point_spring, bodies: [ground, arm], from: [1, 0, 0], to: tip, law: 1, §preload: 3 kN}",
        "@: force 'rope': unknown field 'preload'; it belongs to the law: write law: {preload: ...}",
    ),
    (
        DRAG,
        "rope: {kind: point_spring, bodies: [ground, arm], from: [1, 0, 0], to: tip, law: {table: §[[0, 1], [0, 2]]}}",
        "@: force 'rope': law.table needs a mapping; write table: {t: [0, 1], value: [0, 2]}, with the law's variable in place of t",
    ),
    (
        DRAG,
        "drag: {kind: joint_force, joint: hinge, law: {table: {rate: [0, 1], value: [0, 2], interpolation: §linear}}}",
        "@: force 'drag': law.table.interpolation: belongs beside the table; "
        "write table: {t: [0, 1], value: [0, 2]}, interpolation: linear",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), SHAPES)
def test_shapes(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


NAMES = [
    (
        "arm_mass: {",
        "§t: {value: 2}\n  arm_mass: {",
        "@: parameter 't': the name 't' has a meaning of its own in expressions; write for example 't_0'",
    ),
    (
        DRAG,
        '§2_drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}',
        "@: force '2_drag': '2_drag' is not a name; use letters, digits and underscores, starting with a letter",
    ),
    (
        DRAG,
        '§my__drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}',
        "@: force 'my__drag': the name 'my__drag' has a double underscore; write 'my_drag'",
    ),
    (
        DRAG,
        '§ground: {kind: joint_force, joint: hinge, law: "-0.1*rate"}',
        "@: force 'ground': the name 'ground' belongs to the fixed world; choose another name",
    ),
    (
        DRAG,
        '§ddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd: {kind: joint_force, joint: hinge, law: "-0.1*rate"}',
        "@: force 'ddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd': the "
        "name 'dddddddddddddddddddd...' is longer than 64 characters; shorten it",
    ),
    (
        DRAG,
        '§arm: {kind: joint_force, joint: hinge, law: "-0.1*rate"}',
        "@: force 'arm': duplicate name 'arm', first defined at line 11; rename one of them",
    ),
    (
        "end: {body: arm, at: tip}",
        "end: {body: arm, at: tip}\n  §drag: {body: arm, at: tip}",
        "@: marker 'drag': duplicate name 'drag', first defined at line 15; rename one of them",
    ),
    (
        "name: pendulum",
        'name: §"../pendulum"',
        "@: model: name: '../pendulum' is not a name; use letters, digits and underscores, starting with a letter",
    ),
    (
        "fall: {end: 2}",
        '§"../fall": {end: 2}',
        "@: scene '../fall': '../fall' is not a name; use letters, digits and underscores, starting with a letter",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), NAMES)
def test_names(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


def test_a_document_that_is_no_mapping() -> None:
    assert problems("[1, 2]") == ["m.yaml:1:1: model: needs a mapping"]
    assert problems("cutjoint: 1\nname: a\ngravity: [0, 0, 0]\nbodies: [1]") == ["m.yaml:4:9: model: bodies needs a mapping"]


#: A model with an element of most kinds, one of which names a body that there is not.
FAULTY = PENDULUM.replace("markers:", "markers:\n  far: {body: leg, at: [1, 0, 0]}").replace(
    "{end: 2}", "{end: 2, rates: {hinge.angle_rate: 1}, inputs: {swing: t}, numerics: {dt: 1 ms}, output_step: 10 ms}"
) + """\
submodels:
  wing:
    connectors: [root]
    parameters: [weight]
    points: {P: [0, 1, 0]}
    bodies: {flap: {mass: weight, centre_of_mass: P}}
    joints: {pivot: {kind: revolute, bodies: [root, flap], at: P, axis: [0, 1, 0], spring: {stiffness: 1, damping: 0}}}
    outputs: [flap.x, pivot.angle, pivot_spring.force]
instances:
  left: {use: wing, connect: {root: arm}, with: {weight: arm_mass}}
"""  # fmt: skip


def test_a_value_of_the_wrong_form_hides_no_other_problem_and_makes_none() -> None:
    """Each value in turn, but for whole sections: what is reported is about its element, besides the one body that there is not."""
    planted, whole = "marker 'far': unknown body 'leg'", yaml.safe_load(FAULTY)
    assert [planted in line for line in problems(FAULTY)] == [True]
    hidden = {("markers", "far"), ("markers", "far", "body"), ("markers", "far", "at"), *(("markers", "far", "at", i) for i in range(3))}
    for path in (path for path in _paths(whole) if path not in {("cutjoint",), *((key,) for key in whole if key != "gravity")}):
        found = problems(yaml.safe_dump(_with_nonsense(whole, path), sort_keys=False))
        assert path in hidden or any(planted in line for line in found), (path, found)
        label = element_of(path)[0].partition(" of ")[0]
        others = [line for line in found if planted not in line and f" {label}" not in line and " model:" not in line]
        assert path[:3] in _USED or not others, (path, others)


#: Whole sections of a submodel, whose names are then unknown.
_USED = {("submodels", "wing", key) for key in ("connectors", "parameters", "points", "bodies", "joints")}


def _paths(part: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from _paths(value, (*path, key))


def _with_nonsense(whole: Any, path: tuple[Any, ...]) -> Any:
    copy = deepcopy(whole)
    part = copy
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = {"nonsense": 1}
    return copy


def test_what_stands_in_a_section_of_a_wrong_name_is_not_missed() -> None:
    """Nor what lacks a field that has a wrong name."""
    for wrong in ("joint:", "parameter:", "instance:"):
        found = problems(FAULTY.replace(f"{wrong[:-1]}s:\n", f"{wrong}\n", 1).replace("leg", "arm"))
        assert len(found) == 1, found
        assert f"unknown field '{wrong[:-1]}'; did you mean '{wrong[:-1]}s'?" in found[0]
    found = problems(FAULTY.replace("mass: arm_mass, c", "mas: arm_mass, c"))
    reported = [line.split(": ", 1)[1].partition(";")[0] for line in found]
    assert reported == ["body 'arm': unknown field 'mas'", "marker 'far': unknown body 'leg'"]
