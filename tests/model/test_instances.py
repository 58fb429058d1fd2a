"""Submodels and instances: names, connections, arguments, mirror images, and their problems."""

from __future__ import annotations

import pytest
import sympy

from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.read import read_model_text
from cutjoint.model.records import AxialForce, Body, BodyLoad, Joint, JointFriction, JointKind, Model, PointSpring, Tyre

from .pendulum import check, problems

WING = """\
cutjoint: 1
name: bird
gravity: [0, 0, -9.81]
parameters:
  span: {value: 2, unit: m, binding: param}
  gust: {value: 0, unit: N, binding: input}
bodies:
  trunk: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  flight: {kind: free, bodies: [ground, trunk], at: [0, 0, 0]}
submodels:
  wing:
    connectors: [body]
    parameters: [length_1]
    points:
      root: [0.1, 0.2, 0.3]
      tip: [0.1, length_1, 0.3]
    bodies:
      arm: {mass: 1, centre_of_mass: {midpoint: [root, tip]}, inertia: [2, 3, 4, 0.1, 0.2, 0.3]}
      hand: {massless: true}
    joints:
      shoulder: {kind: universal, bodies: [body, arm], at: root, axis: [1, 2, 0], axis_2: [0, 0, 1]}
      wrist: {kind: screw, bodies: [arm, hand], at: tip, axis: [1, 2, 2], pitch: 0.5}
      slide: {kind: prismatic, bodies: [body, arm], at: root, axis: [1, 2, 2], cut: true}
      line: {kind: point_on_line, bodies: [body, arm], at: root, axis: [1, 2, 2], cut: true}
      rod: {kind: distance, bodies: [body, arm], at: root, to: tip, cut: true}
    forces:
      spring: {kind: point_spring, bodies: [body, arm], from: root, to: tip, law: length*rate}
      stop: {kind: axial_force, bodies: [body, arm], origin: root, point: tip, axis: [1, 2, 2], law: travel}
      mount: {kind: bushing, bodies: [body, arm], at: root, laws: [position + 1, position + 2, position + 3, rate + 4, rate + 5, rate + 6]}
      lift: {kind: load, body: arm, at: tip, force: [x + y, "y*vy + gust", vz]}
      twist: {kind: load, body: arm, torque: [1 - wx, t*wy, 3 + wz], axes: body}
      wheel:
        {kind: tyre, body: hand, centre: tip, axis: [0, 1, 0], radius: 1, stiffness: 1,
         calspan: {A0: 1, A1: 1, A2: 1, A3: 1, A4: 1, B1: 1, B3: 1, B4: 1, SN: 1, AF1: 1, AF2: 1}}
      rolling:
        {kind: wheel, body: hand, centre: tip, axis: [0, 1, 0], radius: 1, force: [-vx, camber - vy, deflection], moment: [turn, -spin, vy]}
      foot:
        {kind: contact, bodies: [body, hand], at: root, axis: y, cylinder: 2, centre: tip, radius: 1, force: [-vx, turn - vy, deflection]}
      rub: {kind: joint_friction, joint: wrist, coefficient: 0.2, static: 0.3, stribeck_speed: 0.1, radius: 0.1}
    reactions:
      pull: {joint: slide, axes_of: body, direction: [1, 2, 2]}
    markers: {end: {body: hand, at: tip}}
    outputs: [lift.Fy, end.z]
instances:
  left: {use: wing, connect: {body: trunk}, with: {length_1: span/2}}
  right: {use: wing, connect: {body: trunk}, with: {length_1: span/2}, mirror: y}
scenes:
  glide: {end: 1}
"""


@pytest.fixture(scope="module")
def bird() -> Model:
    return read_model_text(WING, "m.yaml")


def pair(model: Model, name: str):
    """The left and the right element of a name."""
    groups = (model.bodies, model.joints, model.forces, model.reactions, model.markers)
    known = {part.name: part for group in groups for part in group}
    return known[f"left.{name}"], known[f"right.{name}"]


def vector(*components: float) -> tuple:
    return tuple(pytest.approx(component, abs=1e-15) for component in components)


def floats(v: tuple) -> tuple:
    return tuple(float(component) for component in v)


def test_names_and_connections(bird: Model) -> None:
    left, right = pair(bird, "shoulder")
    assert (left.base, left.follower) == ("trunk", "left.arm")
    assert (right.base, right.follower) == ("trunk", "right.arm")
    assert pair(bird, "pull")[1].body == "trunk"
    assert pair(bird, "pull")[1].joint == "right.slide"


def test_arguments_are_expressions(bird: Model) -> None:
    span = sympy.Symbol("p_span", real=True)
    left, right = pair(bird, "end")
    assert left.point[1] == span / 2
    assert right.point[1] == -span / 2


def test_bodies_mirror(bird: Model) -> None:
    left, right = pair(bird, "arm")
    assert isinstance(right, Body)
    assert right.centre_of_mass == (left.centre_of_mass[0], -left.centre_of_mass[1], left.centre_of_mass[2])
    assert floats(right.inertia) == (2, 3, 4, -0.1, 0.2, -0.3)


def test_rotation_axes_mirror_as_pseudo_vectors(bird: Model) -> None:
    _, shoulder = pair(bird, "shoulder")
    root = 5**0.5
    assert floats(shoulder.axes[0]) == vector(-1 / root, 2 / root, 0)
    assert floats(shoulder.axes[1]) == vector(0, 0, -1)
    _, wrist = pair(bird, "wrist")
    assert floats(wrist.axes[0]) == vector(-1 / 3, 2 / 3, -2 / 3)
    _, wheel = pair(bird, "wheel")
    assert isinstance(wheel, Tyre)
    assert floats(wheel.axis) == (0, 1, 0)


def test_a_screw_mirrors_its_motion(bird: Model) -> None:
    """The image of a displacement is the displacement of the image."""
    left, right = pair(bird, "wrist")
    assert isinstance(right, Joint)
    move = floats(tuple(left.pitch * c for c in left.axes[0]))
    assert floats(tuple(right.pitch * c for c in right.axes[0])) == vector(move[0], -move[1], move[2])


@pytest.mark.parametrize("name", ["slide", "line"])
def test_translation_axes_mirror_as_vectors(bird: Model, name: str) -> None:
    _, joint = pair(bird, name)
    assert joint.kind in (JointKind.PRISMATIC, JointKind.POINT_ON_LINE)
    assert floats(joint.axes[0]) == vector(1 / 3, -2 / 3, 2 / 3)


def test_points_and_directions_mirror(bird: Model) -> None:
    _, rod = pair(bird, "rod")
    assert floats(rod.at) == (0.1, -0.2, 0.3)
    assert rod.to[1] == -sympy.Symbol("p_span", real=True) / 2
    left, spring = pair(bird, "spring")
    assert isinstance(spring, PointSpring)
    assert floats(spring.start) == (0.1, -0.2, 0.3)
    assert spring.law == left.law
    _, stop = pair(bird, "stop")
    assert isinstance(stop, AxialForce)
    assert floats(stop.axis) == vector(1 / 3, -2 / 3, 2 / 3)
    _, pull = pair(bird, "pull")
    assert floats(pull.direction) == vector(1 / 3, -2 / 3, 2 / 3)


def test_loads_mirror_with_their_variables(bird: Model) -> None:
    _, lift = pair(bird, "lift")
    assert isinstance(lift, BodyLoad)
    x, y, vy, vz = (variable(name) for name in ("x", "y", "vy", "vz"))
    gust = sympy.Symbol("p_gust", real=True)
    assert lift.components == (x - y, -(y * vy + gust), vz)
    _, twist = pair(bird, "twist")
    wx, wy, wz = (variable(name) for name in ("wx", "wy", "wz"))
    assert twist.components == (-1 - wx, variable("t") * wy, -3 + wz)
    assert (twist.axes, twist.point) == ("body", None)


def test_friction_is_its_own_image(bird: Model) -> None:
    left, right = pair(bird, "rub")
    assert isinstance(right, JointFriction)
    swap = {left.bristle.symbol: right.bristle.symbol}
    assert right.joint == "right.wrist"
    assert right.law == left.law.xreplace(swap)
    assert right.bristle.rate == left.bristle.rate.xreplace(swap)


def test_bushings_mirror_in_the_mirrored_frame(bird: Model) -> None:
    """Global axes stay global: sideways displacements and turns about the other axes change their sign."""
    left, right = pair(bird, "mount")
    assert left.axes == right.axes == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert floats(right.point) == (0.1, -0.2, 0.3)
    p, r = variable("position"), variable("rate")
    assert left.laws == (p + 1, p + 2, p + 3, r + 4, r + 5, r + 6)
    assert right.laws == (p + 1, p - 2, p + 3, r - 4, r + 5, r - 6)


def test_mirrors_along_the_other_axes() -> None:
    for axis, signs in (("x", (-1, 1, 1)), ("z", (1, 1, -1))):
        _, arm = pair(read_model_text(WING.replace("mirror: y", f"mirror: {axis}"), "m.yaml"), "arm")
        products = (0.1 * signs[0] * signs[1], 0.2 * signs[0] * signs[2], 0.3 * signs[1] * signs[2])
        assert floats(arm.inertia) == (2, 3, 4, *products)


def test_outputs_of_instances(bird: Model) -> None:
    columns = [output.column for output in bird.scenes["glide"].outputs]
    assert columns == ["left.lift.Fy", "left.end.z", "right.lift.Fy", "right.end.z"]


LEFT = "left: {use: wing, connect: {body: trunk}, with: {length_1: span/2}}"
ALL = "the submodel 'wing' needs all its"

PROBLEMS = [
    (LEFT, "left: {use: §wig}", "@: instance 'left': unknown submodel 'wig'; did you mean 'wing'?"),
    (LEFT, LEFT.replace("length_1: span/2", "§length_2: 3, length_1: 1"),
     "@: instance 'left': the submodel 'wing' has no parameter 'length_2'; did you mean 'length_1'?"),
    (LEFT, "§left: {use: wing, connect: {body: trunk}}",
     f"@: instance 'left': with lacks length_1; {ALL} parameters"),
    (LEFT, "§left: {use: wing, with: {length_1: 1}}",
     f"@: instance 'left': connect lacks body; {ALL} connectors"),
    (LEFT, LEFT.replace("trunk", "§trunc"),
     "@: instance 'left': unknown body 'trunc'; did you mean 'trunk'?"),
    (LEFT, LEFT.replace("span/2", "§2*spam"),
     "@: instance 'left': with.length_1: unknown symbol 'spam'; did you mean 'span'?"),
    (LEFT, LEFT.replace("span/2", "§0.1*sin(t)"),
     "@: instance 'left': with.length_1: unknown symbol 't'; give the name of an input (binding: input), whose law over t a scene has"),
    (LEFT, LEFT.replace("span/2", "§gust"),
     "17:18: point 'left.tip': the input 'length_1' cannot be used here, it may change with time; "
     "use binding: param, or give the submodel a value that does not change with time"),
    (LEFT, "§trunk" + LEFT.removeprefix("left"),
     "@: instance 'trunk': duplicate name 'trunk', first defined at line 8; rename one of them"),
    ("mirror: y", "mirror: §w", "@: instance 'right': mirror: must be 'x', 'y' or 'z', not 'w'"),
    ("connectors: [body]", "instances: {feather: {use: §wing, connect: {body: arm}, with: {length_1: 1}}}\n    connectors: [body]",
     "@: instance 'left.feather': the submodel 'wing' stands inside itself; remove this instance, or use another submodel"),
    ("parameters: [length_1]", "parameters: [length_1, §t]",
     "@: submodel 'wing': parameters: the name 't' has a meaning of its own in expressions; "
     "write for example 't_0'"),
    ("parameters: [length_1]", "parameters: [length_1, §length_2]",
     ["@: submodel 'wing': nothing in it uses the parameter 'length_2'; remove it here and in its instances, or use it",
      f"46:3: instance 'left': with lacks length_2; {ALL} parameters",
      f"47:3: instance 'right': with lacks length_2; {ALL} parameters"]),
    ("hand: {massless: true}", "hand: {massless: true, §mas: 1}",
     "@: body 'hand' of submodel 'wing': unknown field 'mas'; did you mean 'mass'?"),
    ("hand: {massless: true}", "hand: {massless: §1}",
     "@: body 'hand' of submodel 'wing': massless needs true or false"),
    ("at: root, axis: [1, 2, 0]", "at: §roof, axis: [1, 2, 0]",
     "@: joint 'left.shoulder': unknown point 'roof'; did you mean 'root'?"),
    ("slide: {kind: prismatic, bodies: [body,", "slide: {kind: prismatic, bodies: [§trunk,",
     "@: joint 'left.slide': the body 'trunk' is outside the submodel; name a connector of the submodel, and connect it in each instance"),
    ("outputs: [lift.Fy, end.z]", "outputs: [§lift.Mz]",
     "@: instance 'left': output 'lift.Mz': 'lift' has no quantity 'Mz'; quantities: Fx, Fy, Fz"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), PROBLEMS)
def test_problems_come_once_and_name_an_instance(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected, WING)


def test_arguments_hide_the_models_parameters() -> None:
    text = WING.replace("parameters: [length_1]", "parameters: [length_1, gust]")
    text = text.replace("length_1: span/2", "length_1: span/2, gust: 4").replace("root: [0.1,", "root: [gust,")
    left, right = pair(read_model_text(text, "m.yaml"), "lift")
    assert left.components[1] == variable("y") * variable("vy") + 4
    assert right.components[1] == -(variable("y") * variable("vy") + 4)


def test_connectors_share_the_names_of_elements() -> None:
    text = WING.replace("connectors: [body]", "connectors: [body, hand]")
    text = text.replace("connect: {body: trunk}", "connect: {body: trunk, hand: trunk}")
    found = "body 'hand': duplicate name 'hand', first defined at line 13; rename one of them"
    assert f"m.yaml:20:7: {found}" in problems(text)


def test_a_problem_of_one_instance_names_that_one() -> None:
    found = problems(WING.replace("span/2}, mirror", "0.2}, mirror"))
    assert {line.split("'")[1] for line in found} == {"right.rod", "right.spring"}


def test_the_number_of_elements_is_bounded() -> None:
    many = "".join(f"  n{i}: {{use: wing, connect: {{body: trunk}}, with: {{length_1: 1}}}}\n" for i in range(700))
    body_only = WING[: WING.index("    joints:\n      shoulder")]
    points = "".join(f"      q{i}: [0, 0, {i}]\n" for i in range(30))
    joint = "    joints:\n      ball: {kind: free, bodies: [ground, arm], at: root}\n"
    text = body_only.replace("      root:", points + "      root:") + joint + "instances:\n" + many
    text = text.replace("      hand: {massless: true}\n", "")
    found = problems(text)
    assert len(found) == 1
    assert found[0].endswith("the model has more than 20000 elements; use fewer instances")


MOVED = WING.replace("mirror: y}", "mirror: y, points: {tip: {sum: [nest, [0, 0, span]]}}}").replace(
    "bodies:\n  trunk", "points: {nest: [1, 2, 3]}\nbodies:\n  trunk", 1
)


def test_instances_give_points() -> None:
    """By the points around them, as of the original; what the submodel makes of a point goes along."""
    model = read_model_text(MOVED, "m.yaml", tunable=["nest.x"])
    left, right = pair(model, "arm")
    values = {parameter.symbol: parameter.value for parameter in model.parameters}
    for arm, place in ((left, (0.1, 0.6, 0.3)), (right, (0.55, -1.1, 2.65))):
        assert vector(*(evaluate(x, values) for x in arm.centre_of_mass)) == place
    (tunable,) = (parameter.symbol for parameter in model.parameters if parameter.name == "nest.x")
    assert right.centre_of_mass[0].has(tunable)


def test_a_submodel_does_not_see_the_points_of_the_model() -> None:
    text = WING.replace("parameters:\n  span", "points: {roof: [0, 0, 1]}\nparameters:\n  span")
    text = text.replace("at: root, axis: [1, 2, 0]", "at: roof, axis: [1, 2, 0]")
    line, row = next((i, row) for i, row in enumerate(text.splitlines(), 1) if "shoulder" in row)
    assert problems(text) == [
        f"m.yaml:{line}:{row.index('roof') + 1}: joint 'left.shoulder': 'roof' is a point of the model, and a submodel does not see it; "
        "define it under points of the submodel; points of an instance move it"
    ]


def test_problems_of_points_that_instances_give() -> None:
    text = MOVED.replace("points: {tip: {sum: [nest", "points: {top: nest, tip: {sum: [nets")
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "top: nest" in row)
    row = text.splitlines()[line - 1]
    assert problems(text) == [
        f"m.yaml:{line}:{row.index('top:') + 1}: instance 'right': the submodel 'wing' has no point 'top'; did you mean 'tip'?",
        f"m.yaml:{line}:{row.index('nets') + 1}: instance 'right': unknown point 'nets'; did you mean 'nest'?",
    ]


def test_a_signal_of_the_model_is_not_seen_by_a_submodel() -> None:
    text = """
cutjoint: 1
name: two
gravity: [0, 0, 0]
submodels:
  part: {connectors: [], parameters: [], signals: {twice: 2*speed}}
instances: {left: {use: part}}
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}}
signals: {speed: rail.displacement_rate}
outputs: [left.twice.value]
scenes: {run: {end: 1}}
"""
    with pytest.raises(ModelError) as caught:
        read_model_text(text, "two.yaml")
    (problem,) = caught.value.problems
    assert problem.message == "'speed' is the model's, and a submodel does not see it"
    assert problem.hint == "give it as a parameter: parameters: [..., speed]"
