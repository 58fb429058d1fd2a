"""Bodies, joints, parameters and scenes: what the forms of the file become."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import sympy

from cutjoint.elements.joints import JOINTS
from cutjoint.model.document.model_file import json_schema
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions import quantities
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import COORDINATES, SPEEDS, Binding, BodyLoad, JointKind, Output, Road, RoadSegment, SegmentKind
from tests.mechanisms.joint_examples import EXAMPLES

from .pendulum import PENDULUM, check, read

MASS = "mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]"
HINGE = "hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}"
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'


def floats(values: tuple) -> list[float]:
    return [float(value) for value in values]


def test_bare_numbers_are_exact() -> None:
    body = read("[1, 0, 0]", "[0.1, 1/3, 3e-2]").bodies[0]
    assert float(body.centre_of_mass[0]) == 0.1
    assert body.centre_of_mass[1] == sympy.Rational(1, 3)
    assert float(body.centre_of_mass[2]) == 3e-2


def test_bodies() -> None:
    massless = read(MASS, "massless: true").bodies[0]
    assert (massless.mass, massless.centre_of_mass, massless.inertia) == (0, (0, 0, 0), (0,) * 6)
    point_mass = read(", inertia: [0.1, 0.2, 0.2]", "").bodies[0]
    assert point_mass.inertia == (0,) * 6
    full = read("[0.1, 0.2, 0.2]", "[1, 2, 2.5, 0.1, 0.2, 300 g*m^2]").bodies[0]
    assert floats(full.inertia) == pytest.approx([1, 2, 2.5, 0.1, 0.2, 0.3])


@pytest.mark.parametrize("given", [("x", "y"), ("x", "z"), ("y", "z"), ("z", "y")])
def test_principal_inertia_by_any_two_directions(given: tuple[str, str]) -> None:
    frame = np.array([[2, 2, 1], [-2, 1, 2], [1, -2, 2]]) / 3  # rows: x, y, z
    axes = dict(zip("xyz", frame.tolist(), strict=True))
    directions = ", ".join(f"{name}: {axes[name]}" for name in given)
    body = read("[0.1, 0.2, 0.2]", f"{{principal: [1, 2, 2.5], {directions}}}").bodies[0]
    expected = frame.T @ np.diag([1, 2, 2.5]) @ frame
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    assert floats(body.inertia) == pytest.approx(expected[rows, columns])


def test_symbolic_directions_are_normalised() -> None:
    model = read("axis: [0, 1, 0]", "axis: [0, arm_mass, 2*arm_mass]")
    symbol = sympy.Symbol("p_arm_mass", real=True)
    axis = [evaluate(component, {symbol: 2.0}) for component in model.joints[0].axes[0]]
    assert axis == pytest.approx([0, 1 / math.sqrt(5), 2 / math.sqrt(5)])


def test_unit_axes_stay_exact() -> None:
    assert read().joints[0].axes[0] == (0, 1, 0)
    assert floats(read("[0, 1, 0]", "[0, 0, -5]").joints[0].axes[0]) == [0, 0, -1]


def test_points_build_on_each_other() -> None:
    model = read("  tip: [arm_length, 0, 0]", "  foot: [1, 0, 0]\n  tip: {midpoint: [foot, foot]}")
    assert model.markers[0].point == (1, 0, 0)


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("{sum: [A, [0, 0, 1]]}", (1, 0, 1)),
        ("{sum: [A, {from: A, to: B}]}", (0, 2, 0)),
        ("{sum: [{midpoint: [A, B]}, {from: A, to: B, times: 1/2}, [0, 0, 50 cm]]}", (0, 2, 0.5)),
        ("{sum: [[1, 2, 3], {along: [0, 3, -4], by: -10 m}]}", (1, -4, 11)),
        ("{sum: [B, {along: {from: A, to: B}, by: sqrt(5)}]}", (-1, 4, 0)),
    ],
)
def test_points_are_sums_of_a_point_and_vectors(written: str, expected: tuple[float, ...]) -> None:
    model = read("  tip: [arm_length, 0, 0]", f"  A: [1, 0, 0]\n  B: [0, 2, 0]\n  tip: {written}")
    assert floats(model.markers[0].point) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("{sum: §[A]}", "sum needs at least 2 items, got 1"),
        ("{sum: [A, §B]}", "sum: only the first can be a point; write {from: P, to: Q} for a vector"),
        ("{sum: [§{from: A, to: B}, A]}", "sum begins with a vector; begin with a point"),
        ("{sum: [A, {from: A, to: §C}]}", "unknown point 'C'; points here: A, B"),
        ("{sum: [A, {along: §[0, 0, 0], by: 3}]}", "sum.along has no direction: its length is zero"),
        ("{sum: [A, {along: [0, 0, 1], by: §3 kg}]}", "sum.by needs m, got kg"),
        ("{sum: [A, §3]}", "sum needs a point or a vector: three numbers, a point's name, {from: P, to: Q} or "
                           "{along: direction, by: length}"),
    ],
)
def test_what_is_wrong_with_sums(written: str, expected: str) -> None:
    check("  tip: [arm_length, 0, 0]", f"  A: [1, 0, 0]\n  B: [0, 2, 0]\n  tip: {written}", f"@: point 'tip': {expected}")


def test_any_direction_across_the_axis_of_an_axisymmetric_body() -> None:
    for other in ("y: [0, 1, 0]", "z: [0, 0, 1]", "y: any", "z: any"):
        inertia = read("[0.1, 0.2, 0.2]", f"{{principal: [0.1, 0.2, 0.2], x: [1, 0, 0], {other}}}").bodies[0].inertia
        assert floats(inertia) == pytest.approx([0.1, 0.2, 0.2, 0, 0, 0])
    moments = "[arm_mass*arm_length**2, arm_length**2*arm_mass, 0.1*arm_mass*arm_length**2]"
    turned = read("[0.1, 0.2, 0.2]", f"{{principal: {moments}, y: any, z: [1, 1, 0]}}").bodies[0].inertia
    values = {sympy.Symbol("p_arm_mass", real=True): 2.0, sympy.Symbol("p_arm_length", real=True): 1.0}
    assert [evaluate(entry, values) for entry in turned] == pytest.approx([1.1, 1.1, 2, -0.9, 0, 0])


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("{principal: §[0.1, 0.2, 0.2], y: [1, 1, 0], x: any}",
         "inertia: any needs moments about x and z that are always equal, not 0.1 and 0.2; give two directions"),
        ("{principal: §[0.1*arm_mass*arm_length/1.5, 0.2, 0.3], z: [1, 1, 0], x: any}",
         "inertia: any needs moments about x and y that are always equal, not 0.2 and 0.2; give two directions"),
        ("§{principal: [0.1, 0.2, 0.2], x: any}",
         "inertia: any belongs to one direction beside it; write for example x: direction, y: any"),
        ("{principal: [0.1, 0.2, 0.2], x: §some, y: [0, 1, 0]}",
         "inertia.x needs three numbers, an axis such as x or -y, or {from: P, to: Q}, or any"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_any_direction(written: str, expected: str) -> None:
    check("[0.1, 0.2, 0.2]", written, f"@: body 'arm': {expected}")


@pytest.mark.parametrize("kind", EXAMPLES)
def test_every_kind_of_joint(kind: str) -> None:
    fields = EXAMPLES[kind]
    text = json.dumps({"kind": kind, "bodies": ["ground", "arm"], "at": [0, 0, 0], "cut": False, **fields})
    joint = read(HINGE, f"{HINGE}\n  bar: {text}").joints[1]
    assert joint.kind == kind
    assert len(joint.axes) == (1 if joint.element.axis_is_bisector else len(fields.keys() & {"axis", "axis_2"}))
    assert joint.cut is False
    assert (None if joint.to is None else list(floats(joint.to))) == fields.get("to")
    assert (None if joint.pitch is None else float(joint.pitch)) == fields.get("pitch")


def test_the_pitch_of_a_screw_has_a_unit() -> None:
    text = "bar: {kind: screw, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 0, 1], pitch: 5 mm}"
    assert float(read(HINGE, f"{HINGE}\n  {text}").joints[1].pitch) == 0.005


def test_the_axis_of_a_constant_velocity_joint_is_the_bisector_of_its_shafts() -> None:
    text = "knuckle: {kind: constant_velocity, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 2, 0], axis_2: [0.6, 0.8, 0], cut: true}"
    joint = read(HINGE, f"{HINGE}\n  {text}").joints[1]
    assert floats(joint.axes[0]) == pytest.approx([0.1**0.5, 0.9**0.5, 0], abs=1e-15)


def test_every_kind_of_joint_has_quantities() -> None:
    assert set(EXAMPLES) == set(JOINTS)
    for kind in JOINTS:
        names = [*COORDINATES[kind], *SPEEDS[kind]]
        assert list(quantities.JOINT_QUANTITIES[kind]) == names
    assert quantities.JOINT_QUANTITIES[JointKind.FREE]["vx"] == "m/s"
    assert quantities.JOINT_QUANTITIES[JointKind.FREE]["wx"] == "rad/s"
    assert quantities.JOINT_QUANTITIES[JointKind.CYLINDRICAL] == {
        "displacement": "m", "angle": "rad", "displacement_rate": "m/s", "angle_rate": "rad/s",
    }  # fmt: skip


def test_loads() -> None:
    force = read(DRAG, 'push: {kind: load, body: arm, at: tip, force: ["-vx", 0, 1], axes: body}').forces[0]
    assert isinstance(force, BodyLoad)
    assert (force.axes, force.moving_only) == ("body", False)
    assert set(quantities.quantities(force)) == {"Fx", "Fy", "Fz"}
    torque = read(DRAG, "push: {kind: load, body: arm, torque: [0, sin(t), 0], moving_only: true}").forces[0]
    assert torque.moving_only
    assert torque.point is None
    assert set(quantities.quantities(torque)) == {"Mx", "My", "Mz"}


def test_units_of_outputs() -> None:
    model = read()
    span = model.span
    for element, quantity, unit in (
        ("end", "x", "m"), ("hinge", "angle_rate", "rad/s"), ("drag", "force", "N*m"), ("arm", "roll", "rad"),
    ):  # fmt: skip
        assert quantities.unit_of(model, Output(element=element, quantity=quantity, span=span)) == unit


@pytest.mark.parametrize(
    ("written", "value", "unit"),
    [
        ("3", 3.0, ""),
        ("{value: 3}", 3.0, ""),
        ("{value: 3, unit: kg}", 3.0, "kg"),
        ("{value: 250, unit: g}", 0.25, "kg"),
        ("{value: 2, unit: kN/mm}", 2e6, "N/m"),
        ("{value: 2, unit: N*s/m}", 2.0, "N*s/m"),
        ("{value: 180, unit: deg}", math.pi, "rad"),
        ("{value: 60, unit: rpm}", 2 * math.pi, "1/s"),
        ("{value: 3, unit: 1}", 3.0, "1"),
        ("{value: 1/4, unit: m^2}", 0.25, "m^2"),
        ("5 ms", 0.005, "s"),
        ("{value: 72 km/h}", 20.0, "m/s"),
    ],
)
def test_parameters(written: str, value: float, unit: str) -> None:
    parameter = read("swing: {value: 0, binding: input}", f"swing: {written}").parameters[2]
    assert parameter.value == pytest.approx(value, rel=1e-15)
    assert (parameter.unit, parameter.binding) == (unit, Binding.CONST)


def test_scenes_have_defaults() -> None:
    scene = read().scenes["fall"]
    assert (scene.end, scene.output_step, scene.pose) == (2.0, 0.001, "design")
    assert scene.road == Road()
    assert (scene.inputs, scene.switches) == ({}, {})
    assert [output.column for output in scene.outputs] == ["end.x"]


def test_scenes_say_what_is_done() -> None:
    scene = read(
        "end: 2",
        "end: 2 s, output_step: 5 ms, positions: {hinge.angle: 30 deg}, rates: {hinge.angle_rate: 2*pi}, "
        "switches: {drag: true, 'd*': false}, outputs: [hinge.angle], numerics: {dt: 2 ms, iterations: 7}",
    ).scenes["fall"]
    assert float(scene.positions["hinge.angle"]) == pytest.approx(math.pi / 6)
    assert scene.rates == {"hinge.angle_rate": 2 * sympy.pi}
    assert scene.switches == {"drag": False}
    assert [output.column for output in scene.outputs] == ["hinge.angle"]
    assert (scene.output_step, scene.numerics.dt, scene.numerics.iterations) == (0.005, 0.002, 7)


def test_penalty_and_frequency_may_follow_the_step() -> None:
    figures = "numerics: {dt: 2 ms, penalty: 0.004/dt**2, frequency: 1/dt, methods: {classical: {dt: 4 ms}, augmented: {penalty: 7}}}"
    numerics = read("end: 2", f"end: 2, {figures}").scenes["fall"].numerics
    assert (numerics.penalty, numerics.frequency) == pytest.approx((1000.0, 500.0))
    of = {method: numerics.of_method(method) for method in ("recursive", "augmented", "classical")}
    assert [of[m].penalty for m in of] == pytest.approx([1000.0, 7.0, 250.0])
    assert [of[m].frequency for m in of] == pytest.approx([500.0, 500.0, 250.0])


@pytest.mark.parametrize(
    ("figures", "closure", "penalty"),
    [
        ("dt: 2 ms", None, None), ("penalty: 1e7", "penalty", 1e7), ("frequency: 5", "penalty", None),
        ("damping_ratio: 0.5", "penalty", None), ("closure: penalty", "penalty", None), ("closure: proximal", "proximal", None),
        ("closure: proximal, penalty: auto", "proximal", None), ("closure: penalty, penalty: auto", "penalty", None),
        ("closure: proximal, penalty: 1e6", "proximal", 1e6),
    ],
)  # fmt: skip
def test_the_penalty_follows_the_closure(figures: str, closure: str | None, penalty: float | None) -> None:
    numerics = read("end: 2", f"end: 2, numerics: {{{figures}}}").scenes["fall"].numerics
    assert (numerics.closure, numerics.penalty) == (closure, penalty)


@pytest.mark.parametrize(("figures", "events"), [("dt: 2 ms", None), ("events: located", "located"), ("events: crossed", "crossed")])
def test_scenes_say_what_becomes_of_events(figures: str, events: str | None) -> None:
    assert read("end: 2", f"end: 2, numerics: {{{figures}}}").scenes["fall"].numerics.events == events


def test_roads_have_two_tracks() -> None:
    road = "{contact: disc, start: 1, left: [{step: -10 cm}, {flat: 2}], right: [{ramp: 3, rise: 1}]}"
    read_road = read("end: 2", f"end: 2, road: {road}").scenes["fall"].road
    spans = {"span": read_road.left[0].span}
    assert read_road.left[0] == RoadSegment(kind=SegmentKind.STEP, length=0.0, rise=-0.1, **spans)
    assert (read_road.left[1].kind, read_road.left[1].length) == (SegmentKind.FLAT, 2.0)
    assert [(s.kind, s.length, s.rise) for s in read_road.right] == [(SegmentKind.RAMP, 3.0, 1.0)]


def test_a_tyre_without_its_constants_names_a_vertical_spring() -> None:
    tyre = "  t: {kind: tyre, body: arm, centre: [0, 0, 0], axis: y, radius: 0.3, stiffness: 2.0e+5}\n"
    with pytest.raises(ModelError, match=r"the field 'calspan' is missing; .* kind: wheel with force: \[0, 0, 2e5\*deflection\]"):
        read("forces:\n", f"forces:\n{tyre}")


def test_a_model_keeps_its_text_and_needs_no_scenes() -> None:
    model = read("scenes:\n  fall: {end: 2}\n", "")
    assert model.scenes == {}
    assert model.text == PENDULUM.replace("scenes:\n  fall: {end: 2}\n", "")


def test_the_json_schema_knows_the_version_of_the_format() -> None:
    assert json.loads(json_schema())["properties"]["cutjoint"]["const"] == 1
