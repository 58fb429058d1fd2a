"""Controllers of model files: names, units, the order of signals, delays, submodels, problems."""

from __future__ import annotations

from functools import partial

import pytest
import sympy

from cutjoint.model.expressions.parse import quantity_symbol, sample_symbol
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.read import read_model_text

from .pendulum import problems_with, read_with

TEXT = """
cutjoint: 1
name: sampled
gravity: [0, 0, -9.81]
parameters:
  gain: {value: 3, binding: param}
bodies:
  arm: {mass: 1.5, centre_of_mass: [0.2, 0, 0], inertia: [0.01, 0.02, 0.02]}
joints:
  pivot: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  motor: {kind: joint_force, joint: pivot, law: pd.torque + drift.sum}
reactions:
  push: {joint: pivot, axes_of: ground}
states:
  lag: {start: 0 m, rate: pd.height - 1*lag}
controllers:
  pd:
    every: 10 ms
    offset: 5 ms
    signals:
      torque: gain*error - rest
      error: 1 - pivot.angle
      height: {value: arm.z, start: 2 cm}
    memory:
      rest: {start: gain, next: rest/2 + pd.torque}
  drift: {every: 2e-2, delay: 60 ms, signals: {load: push.Fz + 1*arm.az}, memory: {sum: {start: 0, next: sum + pd.error}}}
outputs: [pd.torque, pd.rest, drift.load]
scenes:
  run: {end: 1.0}
"""


read, problems = partial(read_with, TEXT), partial(problems_with, TEXT)


def test_what_is_computed_and_what_is_held() -> None:
    """A name alone is what is computed now, or the memory from before; one with the controller's is what is held."""
    pd, _ = read().controllers
    computed = {signal.symbol: signal.value for signal in pd.signals}
    held = {value.name: value for value in pd.discrete_states}
    gain, angle = sympy.Symbol("p_gain", real=True), quantity_symbol("pivot", "angle")
    torque, error, height = (sample_symbol("pd", name) for name in ("torque", "error", "height"))
    assert computed == {torque: gain * error - quantity_symbol("pd", "rest"), error: 1 - angle, height: quantity_symbol("arm", "z")}
    assert list(computed).index(error) < list(computed).index(torque)
    assert {name: value.next for name, value in held.items()} == {
        "torque": torque, "error": error, "height": height,
        "rest": quantity_symbol("pd", "rest") / 2 + quantity_symbol("pd", "torque"),
    }  # fmt: skip
    assert [held[name].start for name in ("torque", "height", "rest")] == [0, 0.02, gain]
    assert pd.quantities == {"torque": "", "error": "", "height": "m", "rest": ""}
    assert (pd.every, pd.offset) == (0.01, 0.005)


def test_a_delay_is_a_row_of_values_that_move_on() -> None:
    drift = read().controllers[1]
    load, total, *waiting = drift.discrete_states
    assert [load.name, total.name, *(value.name for value in waiting)] == ["load", "sum", "", "", ""]
    assert load.next == waiting[2].symbol
    assert [value.next for value in waiting] == [sample_symbol("drift", "load"), waiting[0].symbol, waiting[1].symbol]
    assert drift.quantities == {"load": "", "sum": ""}


def test_what_they_read_counts_as_read() -> None:
    assert [r.column for r in readings_of(read())] == ["pivot.angle", "arm.z", "arm.az", "push.Fz"]


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
    forces: {motor: {kind: joint_force, joint: hinge, law: hold.u}}
    controllers: {hold: {every: 1 ms, signals: {u: "wish + 1*fin.ay + i"}, memory: {i: {start: 0, next: i + hold.u}}}}
instances:
  left: {use: side, connect: {hull: hull}, with: {wish: 1}}
  right: {use: side, connect: {hull: hull}, with: {wish: left.hold.u}, mirror: y}
outputs: [left.hold.u, right.hold.i]
scenes: {run: {end: 1}}
"""


def test_submodels_have_their_own_and_an_image_reads_what_the_original_would() -> None:
    q, model = quantity_symbol, read_model_text(SUBMODEL, "m.yaml")
    values = {signal.name: signal.value for c in model.controllers for signal in c.signals}
    assert values == {
        "left.hold.u": 1 + q("left.fin", "ay") + q("left.hold", "i"),
        "right.hold.u": q("left.hold", "u") - q("right.fin", "ay") + q("right.hold", "i"),
    }
    assert [o.column for o in model.scenes["run"].outputs] == ["left.hold.u", "right.hold.i"]


WRONG = [
    (
        [("every: 10 ms", "every: 0")],
        ["m.yaml:19:12: controller 'pd': every must be greater than zero; write the time between two samples, such as every: 1 ms"],
    ),
    ([("every: 10 ms", "every: 10 mm")], ["m.yaml:19:12: controller 'pd': every needs s, got m"]),
    ([("every: 10 ms", "every: gain")], ["m.yaml:19:12: controller 'pd': every: the parameter 'gain' cannot be used here; write a number"]),
    ([("offset: 5 ms", "offset: -5 ms")], ["m.yaml:20:13: controller 'pd': offset must not be negative"]),
    ([("    every: 10 ms\n", "")], ["m.yaml:18:3: controller 'pd': the field 'every' is missing; "
                                    "write the time between two samples, such as every: 1 ms"]),
    ([("start: gain, next", "next")], ["m.yaml:26:7: controller 'pd': memory.rest: the field 'start' is missing; "
                                       "write its value before the first sample, such as start: 0"]),
    (
        [("delay: 60 ms", "delay: 65 ms")],
        ["m.yaml:27:31: controller 'drift': delay: 0.065 s is no multiple of every, 0.02 s; write 0.06 s or 0.08 s; there is no continuous "
         "delay, and a shorter every has finer ones"],
    ),
    (
        [("delay: 60 ms", "delay: 200 s")],
        ["m.yaml:27:31: controller 'drift': delay: it is 10000 samples long; all delayed signals together hold at most 1000 values"],
    ),
    (
        [("error: 1 - pivot.angle", "error: 1 - torque")],
        ["m.yaml:22:7: controller 'pd': signal 'torque' depends on itself at one sample: it reads 'error' (line 23), which reads "
         "'torque' (line 22); read 'pd.torque', which is its value of the sample before, or a memory"],
    ),
    (
        [("torque: gain*error", "torque: gain*eror")],
        ["m.yaml:22:15: controller 'pd': signals.torque: unknown symbol 'eror'; did you mean 'error'?"],
    ),
    (
        [("law: pd.torque", "law: pd.torqe")],
        ["m.yaml:12:49: force 'motor': law: quantity 'pd.torqe': 'pd' has no quantity 'torqe'; did you mean 'torque'?"],
    ),
    (
        [("law: pd.torque", "law: pe.torque")],
        ["m.yaml:12:49: force 'motor': law: quantity 'pe.torque': unknown element 'pe'; elements: arm, drift, lag, motor, pd, pivot, push"],
    ),
    (
        [("pd.torque, pd.rest", "pd.torque, pd.rst")],
        ["m.yaml:28:22: outputs: output 'pd.rst': 'pd' has no quantity 'rst'; did you mean 'rest'?"],
    ),
    (
        [("      height:", "      gain: 1\n      height:")],
        ["m.yaml:24:7: controller 'pd': 'gain' is a parameter already; choose another name"],
    ),
    (
        [("      height:", "      lag: 1\n      height:")],
        ["m.yaml:24:7: controller 'pd': 'lag' is a state or a signal already; choose another name"],
    ),
    (
        [("      rest:", "      height: {start: 0 m, next: 0 m}\n      rest:")],
        ["m.yaml:26:7: controller 'pd': 'height' is a signal of it already; choose another name"],
    ),
    (
        [("height: {value: arm.z, start: 2 cm}", "height: {value: arm.z, start: 2 s}")],
        ["m.yaml:24:37: controller 'pd': signals.height.start needs m, got s"],
    ),
    (
        [("start: 0 m, rate: pd.height - 1*lag", 'start: 0 m, rate: "delay(pd.height, 0.1)"')],
        ["m.yaml:16:27: state 'lag': rate: there is no continuous delay; a controller delays what it samples: "
         "{every: ..., delay: ..., signals: ...}"],
    ),
    (
        [("controllers:\n", "controllers:\n  idle: {every: 1 ms}\n")],
        ["m.yaml:18:3: controller 'idle': it computes nothing; give it signals or memory"],
    ),
    (
        [("kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]", "kind: revolute, bodies: [ground, arm], at: [0, 0, 0], "
          "axis: [0, 1, 0], guide: pd.height")],
        ["m.yaml:10:89: joint 'pivot': guide: the quantity 'pd.height' cannot be used here; laws of forces, signals, rates of states and "
         "controllers may have it"],
    ),
]


@pytest.mark.parametrize(("changes", "expected"), WRONG)
def test_problems(changes: list[tuple[str, str]], expected: list[str]) -> None:
    assert problems(*changes) == expected


def test_signals_that_read_each_other_in_a_long_row() -> None:
    row = "".join(f"      s{i}: s{i + 1}*0.9 + sin(s{i + 1})\n" for i in range(80)) + "      s80: arm.roll\n"
    (problem,) = problems(("      error:", f"{row}      error:"))
    assert problem.startswith("m.yaml:27:7: signal 'pd.s4': its expression is nested 152 levels deep")
