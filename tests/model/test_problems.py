"""References, values, joints, laws and scenes of the model file, by the text of their problems."""

from __future__ import annotations

import pytest

from cutjoint.model.errors import MAX_PROBLEMS, ModelError, Problem
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Span

from .pendulum import PENDULUM, check, problem, problems, varied

ARM = "arm: {mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]}"
HINGE = "hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}"
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'

REFERENCES = [
    ("[ground, arm]", "[ground, §amr]", "@: joint 'hinge': unknown body 'amr'; did you mean 'arm'?"),
    ("[ground, arm]", "§[arm, arm]", "@: joint 'hinge': joins the body 'arm' to itself; name two bodies"),
    ("at: tip", "at: §top", "@: marker 'end': unknown point 'top'; did you mean 'tip'?"),
    ("body: arm, at", "body: §leg, at", "@: marker 'end': unknown body 'leg'; bodies here: arm, ground"),
    ("joint: hinge", "joint: §hing", "@: force 'drag': unknown joint 'hing'; did you mean 'hinge'?"),
    (
        "mass: arm_mass",
        "mass: §arm_mas",
        "@: body 'arm': mass: unknown symbol 'arm_mas'; did you mean 'arm_mass'?",
    ),
    (
        "mass: arm_mass",
        "mass: §swing",
        "@: body 'arm': mass: the input 'swing' cannot be used here, it may change with time; use binding: param",
    ),
    (
        '"-0.1*rate"',
        '§"-0.1*length"',
        "@: force 'drag': law: unknown symbol 'length'; did you mean 'arm_length'?",
    ),
    (
        "outputs: [end.x]",
        "outputs: [end.x, §ende.x]",
        "@: outputs: output 'ende.x': unknown element 'ende'; did you mean 'end'?",
    ),
    (
        "outputs: [end.x]",
        "outputs: [§end.w]",
        "@: outputs: output 'end.w': 'end' has no quantity 'w'; quantities: ax, ay, az, vx, vy, vz, x, y, z",
    ),
    (
        "outputs: [end.x]",
        "outputs: [§end]",
        "@: outputs: output 'end': unknown element 'end'; write element.quantity, such as end.x",
    ),
    (
        "outputs: [end.x]",
        "outputs: [end.x, §end.x]",
        "@: outputs: the output 'end.x' stands twice; remove one",
    ),
    (
        "outputs: [end.x]",
        "outputs: [§hinge.angel]",
        "@: outputs: output 'hinge.angel': 'hinge' has no quantity 'angel'; did you mean 'angle'?",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), REFERENCES)
def test_references(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


VALUES = [
    ("mass: arm_mass", "mass: §arm_length", "@: body 'arm': mass needs kg, got m"),
    ("mass: arm_mass", "mass: §2 m", "@: body 'arm': mass needs kg, got m"),
    (
        "mass: arm_mass",
        "mass: §2 smoots",
        "@: body 'arm': mass: unknown unit 'smoots'; write for example '30 deg' or '5 N*s/m'",
    ),
    (
        "centre_of_mass: [1, 0, 0]",
        "centre_of_mass: [1, §arm_mass*arm_length, 0]",
        "@: body 'arm': centre_of_mass needs m, got kg*m",
    ),
    ("[0.1, 0.2, 0.2]", "[0.1, 0.2, §0.2 kg]", "@: body 'arm': inertia needs kg*m^2, got kg"),
    ("[0, 0, -9.81]", "[0, 0, §arm_length]", "@: model: gravity needs m/s^2, got m"),
    ("mass: arm_mass", "mass: §1/(arm_mass - 2)", "@: body 'arm': mass has no finite value"),
    ("mass: arm_mass", "mass: §0.1 + sqrt(arm_mass - 9)", "@: body 'arm': mass has no finite value"),
    ("mass: arm_mass", "mass: §abs(sqrt(arm_mass - 9))", "@: body 'arm': mass has no finite value"),
    ("mass: arm_mass", "mass: -1", "11:3: body 'arm': the mass is negative: -1 kg"),
    (
        "[0.1, 0.2, 0.2]",
        "[0.1, -0.2, 0.2]",
        "11:3: body 'arm': a principal moment of inertia is negative: -0.2, 0.1, 0.2 kg m2",
    ),
    (
        "[0.1, 0.2, 0.2]",
        "[1, 1, 1, 2, 0, 0]",
        "11:3: body 'arm': a principal moment of inertia is negative: -1, 1, 3 kg m2",
    ),
    (
        "[0.1, 0.2, 0.2]",
        "[0.1, 0.2, 0.4]",
        "11:3: body 'arm': a principal moment of inertia is larger than the sum of the other two: 0.1, 0.2, 0.4 kg m2",
    ),
    (
        "[0.1, 0.2, 0.2]",
        "§{principal: [1, 1, 1], x: [1, 0, 0]}",
        "@: body 'arm': inertia needs two of the directions x, y, z",
    ),
    (
        "[0.1, 0.2, 0.2]",
        "{principal: [1, 1, 1], x: [1, 0, 0], z: §[1e-6, 0, 1]}",
        "@: body 'arm': the directions x and z are not perpendicular",
    ),
    (
        "mass: arm_mass",
        "mass: §2 kg^0",
        "@: body 'arm': mass: 'kg^0' is not a unit: a power of zero has none; write for example '30 deg' or '5 N*s/m'",
    ),
    ("mass: arm_mass", "mass: §1e300", "@: body 'arm': mass: is larger than 1e+50 in SI units; mind its unit"),
    (
        "centre_of_mass: [1, 0, 0]",
        "centre_of_mass: [1, §1e155, 0]",
        "@: body 'arm': centre_of_mass: is larger than 1e+50 in SI units; mind its unit",
    ),
    ("axis: [0, 1, 0]", "axis: §[0, 0, 0]", "@: joint 'hinge': axis has no direction: its length is zero"),
    (
        "axis: [0, 1, 0]",
        "axis: §{from: tip, to: tip}",
        "@: joint 'hinge': axis has no direction: its length is zero",
    ),
    (
        "value: 2, unit: kg, binding: param",
        "value: §arm_length, unit: kg",
        "@: parameter 'arm_mass': value needs kg, got m",
    ),
    (
        "value: 2, unit: kg",
        "value: 2 kg, unit: §kg",
        "@: parameter 'arm_mass': has two units; write the unit once",
    ),
    (
        "unit: kg",
        "unit: §kilo/grams/",
        "@: parameter 'arm_mass': 'kilo/grams/' is not a unit; write for example N*s/m",
    ),
    ("unit: kg", "unit: §smoots", "@: parameter 'arm_mass': unknown unit 'smoots'; write for example N*s/m"),
]


@pytest.mark.parametrize(("old", "new", "expected"), VALUES)
def test_values(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


JOINTS = [
    (
        ", axis: [0, 1, 0]}",
        ", axis: [0, 1, 0], cut: true, guide: §swing}",
        "@: joint 'hinge': a cut joint has no coordinate to guide; remove cut or guide",
    ),
    (
        "revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]",
        "universal, bodies: [ground, arm], at: tip, axis: [0, 1, 0], axis_2: §[0, 1, 1]",
        [
            "@: joint 'hinge': axis and axis_2 are not perpendicular",
            "15:36: force 'drag': the universal joint 'hinge' has 2 coordinates; write coordinate: angle_1 or angle_2",
        ],
    ),
    (
        "revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]",
        "distance, bodies: [ground, arm], at: tip, to: §[1.5, 0, 0]",
        [
            "@: joint 'hinge': at and to are the same point; a distance needs two",
            "15:36: force 'drag': the distance joint 'hinge' has 2 coordinates; write coordinate: angle_1 or angle_2",
        ],
    ),
    (
        DRAG,
        "spring: {kind: point_spring, bodies: [ground, arm], from: tip, to: §tip, law: 1}",
        "@: force 'spring': from and to are the same point; the line between them gives the direction",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), JOINTS)
def test_joints_and_forces(old: str, new: str, expected: str | list[str]) -> None:
    check(old, new, expected)


def test_unreachable_bodies() -> None:
    text = varied(ARM, f"{ARM}\n  one: {{massless: true}}\n  two: {{massless: true}}")
    text = text.replace(HINGE, f"{HINGE}\n  weld: {{kind: fixed, bodies: [one, two], at: tip}}")
    hint = "add a joint, for example one of kind: free"
    assert problems(text) == [
        f"m.yaml:12:3: body 'one': no joint connects it to the ground; {hint}",
        f"m.yaml:13:3: body 'two': no joint connects it to the ground; {hint}",
    ]


LAWS = [
    (
        "{polynomial: [0, 1], of: §travel}",
        "@: force 'drag': 'travel' is not a variable of this law; variables: position, rate, t",
    ),
    ("{polynomial: [0, §3 kg], of: rate}", "@: force 'drag': law.polynomial needs N*m*s, got kg"),
    (
        "{piecewise: [{below: 1, expression: 1}, §{below: 2, expression: 2}], of: rate}",
        "@: force 'drag': the last piece has no 'below'; it applies beyond the last limit",
    ),
    (
        "{piecewise: [§{expression: 1}, {expression: 2}], of: rate}",
        "@: force 'drag': only the last piece has no 'below'; it applies beyond the last limit",
    ),
    (
        "{piecewise: [{below: 1, expression: 1}, {below: §1, expression: 2}, {expression: 3}], of: rate}",
        "@: force 'drag': the limits of the pieces do not rise; sort the pieces by 'below'",
    ),
    (
        "{table: §{rate: [0, 1]}}",
        "@: force 'drag': a table has the list of a variable, or of two, and 'value'; for example {length: [0, 1], value: [0, 100]}",
    ),
    (
        "{table: {§travel: [0, 1], value: [0, 1]}}",
        "@: force 'drag': 'travel' is not a variable of this law; variables: position, rate, t",
    ),
    (
        "{table: §{rate: [0, 1, 2], value: [0, 1]}}",
        "@: force 'drag': the table has 3 of rate and 2 of value; give as many of both, two or more",
    ),
    (
        "{table: {rate: [0, 2, §1], value: [0, 1, 2]}}",
        "@: force 'drag': the table's rate does not rise; sort the table",
    ),
    (
        "{table: {rate: [0, §arm_mass], value: [0, 1]}}",
        "@: force 'drag': law.table.rate: the parameter 'arm_mass' cannot be used here; write a number",
    ),
    *((f"§{{stiffness: 3{more}}}", "@: force 'drag': a spring of this kind needs free_position; write free_position: drawn for what is "
       "drawn, or a preload") for more in ("", ", free_length: 1")),
    (
        "{sum: [{polynomial: [0, 1], of: rate}, §oops]}",
        "@: force 'drag': law.sum: unknown symbol 'oops'; symbols here: arm_length, arm_mass, pi, position, rate, swing, t",
    ),
]


@pytest.mark.parametrize(("law", "expected"), LAWS)
def test_laws(law: str, expected: str) -> None:
    check('"-0.1*rate"', law, expected)


SCENES = [
    ("end: §0", "@: scene 'fall': end must be greater than zero"),
    ("end: §2 m", "@: scene 'fall': end needs s, got m"),
    (
        "end: §arm_length",
        "@: scene 'fall': end: the parameter 'arm_length' cannot be used here; write a number",
    ),
    ("end: 1, output_step: §-1", "@: scene 'fall': output_step must be greater than zero"),
    ("end: 1, numerics: {dt: §0}", "@: scene 'fall': dt must be greater than zero"),
    ("end: 1, numerics: {damping_ratio: §-1}", "@: scene 'fall': damping_ratio must not be negative"),
    ("end: 1, numerics: {penalty: §-1/dt}", "@: scene 'fall': penalty must be greater than zero"),
    ("end: 1, numerics: {dt: 1, frequency: §1 - 2*dt}", "@: scene 'fall': frequency must not be negative"),
    (
        "end: 1, numerics: {multiplier_updates: §-1}",
        "@: scene 'fall': multiplier_updates must not be negative",
    ),
    ("end: 1, numerics: {events: §sometimes}", "@: scene 'fall': numerics.events: must be 'located' or 'crossed', not 'sometimes'"),
    ("end: 1, numerics: {iterations: §0}", "@: scene 'fall': iterations must be greater than zero"),
    (
        "end: 1, rates: {§hing.angle_rate: 1}",
        "@: scene 'fall': rates: unknown joint 'hing'; did you mean 'hinge'?",
    ),
    (
        "end: 1, rates: {§hinge.angle: 1}",
        "@: scene 'fall': rates: the revolute joint 'hinge' has no 'angle'; did you mean 'angle_rate'?",
    ),
    (
        "end: 1, positions: {§hinge: 1}",
        "@: scene 'fall': positions: 'hinge' names no component; write joint.component",
    ),
    (
        "end: 1, positions: {hinge.angle: §1 m}",
        "@: scene 'fall': positions.hinge.angle needs an angle or a plain number, got m",
    ),
    (
        "end: 1, positions: {hinge.angle: §swing}",
        "@: scene 'fall': positions.hinge.angle: the input 'swing' cannot be used here, it may change with time; use binding: param",
    ),
    ("end: 1, inputs: {§swin: 1}", "@: scene 'fall': unknown input 'swin'; did you mean 'swing'?"),
    (
        "end: 1, inputs: {swing: §sin(time)}",
        "@: scene 'fall': inputs.swing: unknown symbol 'time'; symbols here: arm_length, arm_mass, pi, t",
    ),
    (
        "end: 1, switches: {§'*.drag': true}",
        "@: scene 'fall': switches: no force is called '*.drag'; did you mean 'drag'?",
    ),
    (
        "end: 1, switches: {§'dra?': true}",
        "@: scene 'fall': switches: no force is called 'dra?'; did you mean 'drag'?",
    ),
    ("end: 1, road: {profile: [{flat: §0}]}", "@: scene 'fall': flat must be greater than zero"),
    (
        "end: 1, outputs: [end.x, §end.vv]",
        "@: scene 'fall': output 'end.vv': 'end' has no quantity 'vv'; quantities: ax, ay, az, vx, vy, vz, x, y, z",
    ),
]


@pytest.mark.parametrize(("scene", "expected"), SCENES)
def test_scenes(scene: str, expected: str) -> None:
    check("end: 2", scene, expected)


def test_guided_joints_have_no_initial_state() -> None:
    text = varied("axis: [0, 1, 0]", "axis: [0, 1, 0], guide: swing").replace("end: 2", "end: 2, rates: {hinge.angle_rate: 1}")
    assert problems(text) == ["m.yaml:20:26: scene 'fall': rates: the joint 'hinge' is guided; its guide gives its motion"]


def test_all_problems_come_at_once_in_the_files_order() -> None:
    text = varied("mass: arm_mass", "mass: arm_mas, colour: red")
    text = text.replace("axis: [0, 1, 0]", "axis: [0, 0, 0]").replace("end: 2", "end: -2")
    text = text.replace("end: {body", "lost: {bdy: arm, at: tip}\n  end: {body").replace("[end.x]", "[lost.x, end.q]")
    assert problems(text) == [
        "m.yaml:11:15: body 'arm': mass: unknown symbol 'arm_mas'; did you mean 'arm_mass'?",
        "m.yaml:11:24: body 'arm': unknown field 'colour'; fields: about, centre_of_mass, inertia, mass, massless, shapes, visual",
        "m.yaml:13:71: joint 'hinge': axis has no direction: its length is zero",
        "m.yaml:17:3: marker 'lost': the field 'body' is missing",
        "m.yaml:17:10: marker 'lost': unknown field 'bdy'; did you mean 'body'?",
        "m.yaml:19:19: outputs: output 'end.q': 'end' has no quantity 'q'; quantities: ax, ay, az, vx, vy, vz, x, y, z",
        "m.yaml:21:15: scene 'fall': end must be greater than zero",
    ]


def test_problems_are_records() -> None:
    with pytest.raises(ModelError) as caught:
        read_model_text(PENDULUM.replace("[ground, arm]", "[ground, amr]"), "m.yaml")
    assert caught.value.problems == (
        Problem(
            span=Span(file="m.yaml", line=13, column=44),
            element="joint 'hinge'",
            message="unknown body 'amr'",
            hint="did you mean 'arm'?",
        ),
    )


def test_messages_are_safe_to_print() -> None:
    found = problem("name: pendulum", 'name: "\\e[31m' + "x" * 5000 + '"')
    assert found.startswith("m.yaml:2:7: model: name: '\\x1b[31mxxx")
    assert len(found) < 700
    assert found.isprintable()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("1/(dt - 0.001)", "penalty has no finite value at dt = 0.001 s; write another expression"),
        ("exp(0.8/dt)", "penalty has no finite value at dt = 0.001 s; write another expression"),
        ("exp(0.5/dt)", "penalty must be at most 1e+100"),
        ("sqrt(dt - 0.002)", "penalty has no finite value at dt = 0.001 s; write another expression"),
        ("1/(dt - 0.004)**2", "penalty has no finite value at dt = 0.004 s; write another expression"),
        ("dt - 0.002", "penalty must be greater than zero"),
    ],
)
def test_numerics_that_follow_the_step_are_finite(law: str, message: str) -> None:
    numerics = f'numerics: {{penalty: §"{law}", methods: {{classical: {{dt: 0.004}}}}}}'
    check("fall: {end: 2}", f"fall: {{end: 2, {numerics}}}", f"@: scene 'fall': {message}")


@pytest.mark.parametrize("law", ["exp(1/dt)", "1/(dt - 0.001)"])
def test_a_frequency_that_follows_the_step_is_finite(law: str) -> None:
    message = "@: scene 'fall': frequency has no finite value at dt = 0.001 s; write another expression"
    check("fall: {end: 2}", f'fall: {{end: 2, numerics: {{frequency: §"{law}"}}}}', message)


def test_problems_without_end_are_cut_short() -> None:
    names = [f"body_{i}" for i in range(3000)]
    bodies = ", ".join(f"{name}: {{massless: true}}" for name in names)
    joints = ", ".join(f"j{i}: {{kind: fixed, bodies: [x{name}, y{name}], at: [0, 0, 0]}}" for i, name in enumerate(names))
    found = problems(f"cutjoint: 1\nname: m\ngravity: [0, 0, 0]\nbodies: {{{bodies}}}\njoints: {{{joints}}}\n")
    assert len(found) == MAX_PROBLEMS + 1
    assert sum("there may be more problems than these; mend these first" in line for line in found) == 1


ALL_AT_ONCE = """
cutjoint: 1
name: two
gravity: [0, 0, -9.81]
points: {top: [0, 0]}
bodies:
  rod: {mass: [1], centre_of_mass: [0, 0, 0.5], inertia: [0.1, 0.1, 0.1], colour: red}
  bar: {mass: 1, centre_of_mass: [0, 0, 1.5], inertia: [0.1, 0.1, 0.1]}
joints:
  hinge: {kind: revolute, bodies: [ground, rodd], at: [0, 0, 0], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [rod, bar], at: topp, axis: 3}
forces:
  drag: {kind: joint_force, joint: elbw, law: {table: {file: none.csv}}}
outputs: [rodd.x, bar.xx]
scenes:
  run: {end: 1, output_step: 0.1, rates: {elbo.angle_rate: 1}, switches: {drg: true}}
"""


def test_problems_of_all_steps_come_at_once_and_name_what_could_not_be_read() -> None:
    """Of a file that is missing, of shapes, and of names, which may mean elements that are wrong themselves."""
    with pytest.raises(ModelError) as caught:
        read_model_text(ALL_AT_ONCE.replace("cutjoint: 1\n", ""), "model.yaml")
    found = "\n".join(map(str, caught.value.problems))
    for words in (
        "model: the field 'cutjoint' is missing", "point 'top': needs three numbers", "body 'rod': mass needs a number",
        "body 'rod': unknown field 'colour'", "unknown body 'rodd'; did you mean 'rod'?", "axis needs three numbers",
        "the file 'none.csv' cannot be found",
        "unknown element 'rodd'; did you mean 'rod'?", "'bar' has no quantity 'xx'", "unknown joint 'elbo'; did you mean 'elbow'?",
        "no force is called 'drg'; did you mean 'drag'?",
    ):  # fmt: skip
        assert words in found, found
