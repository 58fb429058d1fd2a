"""States and signals of model files: the names that expressions may have, units, loops, submodels and their mirror images."""

from __future__ import annotations

from functools import partial

import pytest
import sympy

from cutjoint.model.expressions.parse import quantity_symbol, variable
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.read import read_model_text

from .pendulum import check, problems_with, read_with, varied

TEXT = """
cutjoint: 1
name: controlled
gravity: [0, 0, -9.81]
parameters:
  lag: {value: 0.2, unit: s, binding: param}
  target: {value: 0.5, unit: rad, binding: input}
bodies:
  arm: {mass: 1.5, centre_of_mass: [0.2, 0, 0], inertia: [0.01, 0.02, 0.02]}
  tip: {mass: 0.5, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.02, 0.02]}
joints:
  pivot: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [arm, tip], at: [0.4, 0, 0], axis: [0, 1, 0]}
forces:
  motor: {kind: joint_force, joint: pivot, law: command - 2*rate}
  spring: {kind: joint_force, joint: elbow, law: -3*position}
  rod: {kind: point_spring, bodies: [ground, tip], from: [0, 0, 1], to: [0.5, 0, 0], law: 5*stretch}
reactions:
  push: {joint: pivot, axes_of: arm}
states:
  integral: {start: 0 rad, rate: error/lag}
  filter: {start: 0 m, rate: (height - filter)/lag}
signals:
  error: target - pivot.angle
  command: 30*error + 20*integral
  height: tip.z
  stretch: rod.length - 0.9
outputs: [integral.value, height.value]
scenes:
  run: {end: 1.0}
"""


read, problems = partial(read_with, TEXT), partial(problems_with, TEXT)


def test_names_are_those_of_outputs() -> None:
    model = read()
    error = quantity_symbol("error", "value")
    assert error == next(s.symbol for s in model.signals if s.name == "error")
    assert next(s.value for s in model.signals if s.name == "command") == 30 * error + 20 * quantity_symbol("integral", "value")
    assert [r.column for r in readings_of(model)] == ["pivot.angle", "tip.z", "rod.length"]
    assert {s.name: s.unit for s in (*model.states, *model.signals)} == {
        "integral": "", "filter": "m", "error": "", "command": "", "height": "m", "stretch": ""
    }  # fmt: skip


NO_START = "m.yaml:21:3: state 'integral': the field 'start' is missing; write its value where a run begins, such as start: 0 rad"
LOOP = "a state breaks it: one whose rate reads"

WRONG = [
    # Loops, through the law of a force too
    (
        [("command: 30*error", "command: motor.force + 30*error")],
        ["m.yaml:15:3: force 'motor': an algebraic loop: it reads signal 'command' (line 25), which reads force 'motor' (line 15); "
         f"{LOOP} 'motor', and which 'command' reads instead of 'motor'; so does a controller that samples 'motor'"],
    ),
    (
        [("height: tip.z", "height: 0.1*command + tip.z"), ("error: target", "error: height + target")],
        ["m.yaml:24:3: signal 'error': an algebraic loop: it reads signal 'height' (line 26), which reads signal 'command' (line 25), "
         f"which reads signal 'error' (line 24); {LOOP} 'error', and which 'command' reads instead of 'error'; "
         "so does a controller that samples 'error'"],
    ),
    (
        [("law: command", "law: command - motor.damping")],
        [f"m.yaml:15:3: force 'motor': an algebraic loop: it reads force 'motor' (line 15); {LOOP} 'motor', and which 'motor' reads "
         "instead of 'motor'; so does a controller that samples 'motor'"],
    ),
    # Units
    ([("height: tip.z", "height: tip.z + tip.vz")], ["m.yaml:26:3: signal 'height': m and m/s cannot be added or compared"]),
    ([("rate: (height", "rate: (tip.vz")], ["m.yaml:22:30: state 'filter': rate: m/s and m cannot be added or compared"]),
    ([("(height - filter)/lag", "height - filter")], ["m.yaml:22:30: state 'filter': rate needs m/s, got m"]),
    ([("law: 5*stretch", "law: rod.length")], ["m.yaml:17:91: force 'rod': law needs N, got m"]),
    # Names
    ([("30*error", "30*eror")], ["m.yaml:25:3: signal 'command': unknown symbol 'eror'; did you mean 'error'?"]),
    ([("tip.z", "tpi.z")], ["m.yaml:26:3: signal 'height': quantity 'tpi.z': unknown element 'tpi'; did you mean 'tip'?"]),
    ([("tip.z", "tip.zz")], ["m.yaml:26:3: signal 'height': quantity 'tip.zz': 'tip' has no quantity 'zz'; did you mean 'z'?"]),
    (
        [("integral.value", "integral")],
        ["m.yaml:28:11: outputs: output 'integral': unknown element 'integral'; write element.quantity, such as integral.value"],
    ),
    ([("  integral:", "  lag:"), ("20*integral", "20*lag"), ("integral.value, ", "")],
     ["m.yaml:21:3: state 'lag': 'lag' is a parameter already; choose another name"]),
    ([("  height: tip.z", "  motor: tip.z"), ("height.value", "motor.value"), ("(height", "(motor")],
     ["m.yaml:26:3: signal 'motor': duplicate name 'motor', first defined at line 15; rename one of them"]),
    ([("  height: tip.z", "  rate: tip.z"), ("(height - filter)", "-filter"), (", height.value", "")],
     ["m.yaml:26:3: signal 'rate': the name 'rate' has a meaning of its own in expressions; write for example 'rate_0'"]),
    ([("  integral:", "  lambda:"), ("20*integral", "20"), ("integral.value, ", "")],
     ["m.yaml:21:3: state 'lambda': the name 'lambda' has a meaning of its own in expressions; write for example 'lambda_0'"]),
    # What a law cannot read, and what reads no quantities
    (
        [("tip.z", "tip.az")],
        ["m.yaml:26:3: signal 'height': the quantity 'tip.az' cannot be used here: accelerations and reactions follow from all forces, "
         "and so from what reads them; use positions and speeds, or let a controller sample it"],
    ),
    (
        [("law: -3*position", "law: -3*push.Fx")],
        ["m.yaml:16:50: force 'spring': law: the quantity 'push.Fx' cannot be used here: accelerations and reactions follow from all "
         "forces, and so from what reads them; use positions and speeds, or let a controller sample it"],
    ),
    (
        [("mass: 0.5", "mass: 0.5*filter")],
        ["m.yaml:10:15: body 'tip': mass: the quantity 'filter' cannot be used here; laws of forces, signals, rates of states and "
         "controllers may have it"],
    ),
    (
        [("axis: [0, 1, 0]}\nforces", "axis: [0, 1, 0], guide: tip.vz*t}\nforces")],
        ["m.yaml:13:88: joint 'elbow': guide: the quantity 'tip.vz' cannot be used here; laws of forces, signals, rates of states and "
         "controllers may have it"],
    ),
    (
        [("start: 0 rad", "start: error")],
        ["m.yaml:21:21: state 'integral': start: the quantity 'error' cannot be used here; laws of forces, signals, rates of states and "
         "controllers may have it"],
    ),
    (
        [("start: 0 rad", "start: 2 deg, bounds: [0, 1 deg]")],
        ["m.yaml:21:21: state 'integral': start: 0.0349066 is outside of its bounds, 0 to 0.0174533; write a number between them"],
    ),
    # Form
    ([("start: 0 rad, rate", "rate")], [NO_START]),
    ([("start: 0 rad, rate: error/lag", "start: 0 rad")],
     ["m.yaml:21:3: state 'integral': the field 'rate' is missing; write an expression for its rate of change, such as rate: "
      "speed - 2*level"]),
    ([("start: 0 rad", "begin: 0 rad")],
     [NO_START,
      "m.yaml:21:14: state 'integral': unknown field 'begin'; fields: bounds, nominal, rate, start"]),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "expected"), WRONG)
def test_problems(changes: list[tuple[str, str]], expected: list[str]) -> None:
    found = problems(*changes)
    assert sorted(found) == sorted(expected)


def test_a_state_breaks_a_loop_and_a_law_reads_its_own_length() -> None:
    read(("command: 30*error", "command: later + 30*error"), ("states:", "states:\n  later: {start: 0, rate: (motor.force - later)/lag}"))


@pytest.mark.parametrize(("word", "kind"), [("and", sympy.And), ("or", sympy.Or)])
def test_conditions_of_states_are_joined(word: str, kind: type[sympy.Basic]) -> None:
    law = read(("law: command - 2*rate", f'law: "where(integral < 0.1 {word} rate > 0, 3, -rate)"')).forces[0].law
    (joined,) = law.atoms(kind)
    assert {*joined.args} == {quantity_symbol("integral", "value") < sympy.Float(0.1), variable("rate") > 0}


def test_signals_that_read_each_other_in_a_long_row() -> None:
    row = "".join(f"  s{i}: s{i + 1}*0.9 + sin(s{i + 1})\n" for i in range(80)) + "  s80: tip.roll\n"
    assert problems(("  stretch:", f"{row}  stretch:")) == [
        "m.yaml:31:3: signal 's4': its expression is nested 152 levels deep with the signals and forces that it reads; "
        "at most 150: read fewer of them in a row"
    ]


SUBMODEL = """
cutjoint: 1
name: two
gravity: [0, 0, -9.81]
bodies: {hull: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {free: {kind: free, bodies: [ground, hull], at: [0, 0, 0]}}
submodels:
  side:
    connectors: [hull]
    parameters: [wish]
    bodies: {fin: {mass: 1, centre_of_mass: [0, 1, 0], inertia: [1, 1, 1]}}
    joints: {hinge: {kind: revolute, bodies: [hull, fin], at: [0, 1, 0], axis: [1, 0, 0]}}
    forces:
      motor: {kind: joint_force, joint: hinge, law: "wish + lean + 3*hinge.angle - rate"}
    states: {later: {start: 1, bounds: [-1, 2], rate: "1*fin.vy - 1*hull.wz - later"}}
    signals: {lean: "later + 1*fin.roll + 1*fin.y + 1*hull.z"}
instances:
  left: {use: side, connect: {hull: hull}, with: {wish: together}}
  right: {use: side, connect: {hull: hull}, with: {wish: -together}, mirror: y}
signals: {together: "left.later + right.lean + 1*hull.vx"}
outputs: [left.later.value, right.lean.value, together.value]
scenes: {run: {end: 1}}
"""


SCENE = "scenes: {run: {end: 1}}"


def test_scenes_begin_with_states_of_their_own() -> None:
    scene = "scenes: {run: {end: 1, states: {left.later: 0.25, right.later: 1/3}}, plain: {end: 1}}"
    model = read_model_text(varied(SCENE, scene, SUBMODEL), "m.yaml")
    starts = {name: float(value) for name, value in model.scenes["run"].starts.items()}
    assert starts == {"left.later.value": 0.25, "right.later.value": 1 / 3}
    assert model.scenes["plain"].starts == {}


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        ("states: {§late: 1}", "@: scene 'run': states: unknown state 'late'; states: left.later, right.later"),
        ("states: {§left: 1}", "@: scene 'run': states: unknown state 'left'; states: left.later, right.later"),
        (
            "states: {left.later: §2 + 1}",
            "@: scene 'run': states: 'left.later': 3 is outside of its bounds, -1 to 2; write a number between them",
        ),
        ("states: {left.later: §2*t}", "@: scene 'run': states.left.later: unknown symbol 't'; symbols here: pi"),
    ],
)
def test_what_is_wrong_with_starts_of_scenes(scene: str, expected: str) -> None:
    check(SCENE, f"scenes: {{run: {{end: 1, {scene}}}}}", expected, SUBMODEL)


def test_submodels_have_their_own_and_an_image_reads_what_the_original_would() -> None:
    """Vectors along y, and turns about x and z, count the other way in the image; states and signals are numbers."""
    model = read_model_text(SUBMODEL, "m.yaml")
    rates, signals = ({x.name: y for x, y in found} for found in (
        [(s, s.rate) for s in model.states], [(s, s.value) for s in model.signals],
    ))  # fmt: skip
    q = quantity_symbol
    assert rates["left.later"] == q("left.fin", "vy") - q("hull", "wz") - q("left.later", "value")
    assert rates["right.later"] == -q("right.fin", "vy") + q("hull", "wz") - q("right.later", "value")
    assert signals["left.lean"] == q("left.later", "value") + q("left.fin", "roll") + q("left.fin", "y") + q("hull", "z")
    assert signals["right.lean"] == q("right.later", "value") - q("right.fin", "roll") - q("right.fin", "y") + q("hull", "z")
    assert signals["together"] == q("left.later", "value") + q("right.lean", "value") + q("hull", "vx")
    laws = {force.name: force.expressions[0] for force in model.forces}
    assert q("together", "value") in laws["left.motor"].free_symbols & laws["right.motor"].free_symbols
    assert laws["right.motor"].coeff(q("right.hinge", "angle")) == laws["left.motor"].coeff(q("left.hinge", "angle"))


def test_names_of_a_submodel_hide_those_around_it() -> None:
    """Its signal is read in it, the model's parameter outside."""
    pull = "pull: {kind: load, body: body, at: [0, 0, 0], force: [0, 0, lag]}"
    inner = f"  part:\n    connectors: [body]\n    signals: {{lag: 7*body.z}}\n    forces: {{{pull}}}\n"
    text = TEXT.replace("outputs:", f"submodels:\n{inner}instances:\n  one: {{use: part, connect: {{body: arm}}}}\noutputs:")
    model = read_model_text(text, "m.yaml")
    force = next(force for force in model.forces if force.name == "one.pull")
    assert force.components[2] == quantity_symbol("one.lag", "value")
    assert quantity_symbol("one.lag", "value") not in next(state for state in model.states if state.name == "integral").rate.free_symbols
