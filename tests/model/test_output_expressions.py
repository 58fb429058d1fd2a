"""Outputs by expressions: their quantities, their units, and their problems."""

from __future__ import annotations

import math

import pytest

from cutjoint.analysis.redundancy import find_indeterminate
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import readings_of, unit_of
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Span
from cutjoint.sweeps.code import Reader
from cutjoint.topology.build import build_topology

from .pendulum import PENDULUM, check, problems, varied
from .test_instances import WING

OUTPUTS = """\
outputs:
  - end.x
  - tilt: {value: -hinge.angle + 0.5*late, unit: deg}
  - push: {value: foot.Fz - arm_mass*arm.az, unit: kN}
  - share: hinge.angle/(1 rad)
signals: {late: hinge.angle}
reactions: {foot: {joint: hinge, axes_of: ground}}
"""
TEXT = varied("outputs: [end.x]\n", OUTPUTS.replace("hinge.angle/(1 rad)", "2*hinge.angle"))


def test_an_expression_is_a_column_of_its_name_and_unit() -> None:
    model = read_model_text(TEXT, "m.yaml")
    outputs = model.scenes["fall"].outputs
    assert [(o.column, unit_of(model, o)) for o in outputs] == [("end.x", "m"), ("tilt", "deg"), ("push", "kN"), ("share", "")]
    assert [o.factor for o in outputs] == [1.0, pytest.approx(180 / math.pi, rel=1e-15), 1e-3, 1.0]
    values = {signal.name: signal.value for signal in model.signals if signal.reported}
    assert values["tilt"] == -quantity_symbol("hinge", "angle") + 0.5 * quantity_symbol("late", "value")
    assert ("arm", "az") in {(o.element, o.quantity) for o in readings_of(model)}
    assert all(o.span.line > 18 for o in outputs[1:])


def test_images_have_what_the_original_would() -> None:
    """Forces and turns of reactions too: along the mirror's axis a force turns over, about it a turn does not."""
    outputs = "[{all: pull.force + 2*pull.moment + 3*spring.force}, {side: whole.Fy + 2*whole.My + 3*hand.ay}]"
    text = varied("    outputs: [lift.Fy, end.z]", f"    outputs: {outputs}", WING)
    text = text.replace("      pull: {joint: slide,", "      whole: {joint: shoulder, axes_of: body}\n      pull: {joint: slide,")
    model = read_model_text(text, "m.yaml")
    assert [o.column for o in model.scenes["glide"].outputs] == ["left.all", "left.side", "right.all", "right.side"]
    value = {signal.name: signal.value for signal in model.signals}
    q = quantity_symbol
    assert value["right.all"] == q("right.pull", "force") - 2 * q("right.pull", "moment") + 3 * q("right.spring", "force")
    assert value["left.side"] == q("left.whole", "Fy") + 2 * q("left.whole", "My") + 3 * q("left.hand", "ay")
    assert value["right.side"] == -q("right.whole", "Fy") + 2 * q("right.whole", "My") - 3 * q("right.hand", "ay")


def test_lists_take_outputs_of_instances() -> None:
    """A model's list has them once, where it names them; a scene's has them alone."""
    text = varied("    outputs: [lift.Fy, end.z]", "    outputs: [{side: hand.ay}, end.z]", WING)
    text = text.replace("scenes:", "outputs: [right.side]\nscenes:")
    text = text.replace("glide: {", "other: {end: 1, outputs: [left.side, right.end.z]}\n  glide: {")
    model = read_model_text(text, "m.yaml")
    assert [o.column for o in model.scenes["glide"].outputs] == ["right.side", "left.side", "left.end.z", "right.end.z"]
    assert [o.column for o in model.scenes["other"].outputs] == ["left.side", "right.end.z"]
    assert {s.name for s in model.signals if s.reported} == {"left.side", "right.side"}
    twice = problems(text.replace("[right.side]", "[right.side, right.side]"))
    assert any("the output 'right.side' stands twice; remove one" in problem for problem in twice)


def test_scenes_may_share_an_output() -> None:
    scene = "outputs: [{tilt: {value: hinge.angle, unit: deg}}]"
    model = read_model_text(varied("fall: {end: 2}", f"fall: {{end: 2, {scene}}}\n  other: {{end: 1, {scene}}}"), "m.yaml")
    assert [s.name for s in model.signals] == ["tilt"]
    assert {tuple(o.column for o in s.outputs) for s in model.scenes.values()} == {("tilt",)}


def test_objectives_of_a_study_read_outputs_by_their_names() -> None:
    reader = Reader(read_model_text(TEXT, "m.yaml"))
    expression, *_ = reader.read("2*tilt", Span(file="s.yaml", line=1, column=1))
    assert expression == 2 * quantity_symbol("tilt", "value")


def test_an_expression_is_indeterminate_with_the_reaction_that_it_reads() -> None:
    """Two hinges on one axis: which of them bears the push along it is not known."""
    text = varied("\nforces:", "\n  other: {kind: revolute, bodies: [ground, arm], at: [0, 1, 0], axis: [0, 1, 0], cut: true}\nforces:")
    text = varied("outputs: [end.x]", "outputs: [{along: foot.Fy}, {twice: 2*seen}, {lean: hinge.angle}]", text)
    text = varied("scenes:", "reactions: {foot: {joint: hinge, axes_of: ground}}\nsignals: {seen: hinge.angle_rate}\nscenes:", text)
    model = read_model_text(text, "m.yaml")
    assert find_indeterminate(build_topology(model), model.scenes["fall"], model.scenes["fall"].outputs) == ("along",)


PROBLEMS = [
    ("{tilt: §hinge.angel}", "@: output 'tilt': value: quantity 'hinge.angel': 'hinge' has no quantity 'angel'; did you mean 'angle'?"),
    ("{tilt: §hinges.angle}", "@: output 'tilt': value: quantity 'hinges.angle': unknown element 'hinges'; did you mean 'hinge'?"),
    ("{tilt: {value: §tip + 1}}", "@: output 'tilt': value: unknown symbol 'tip'; symbols here: arm_length, arm_mass, pi, swing, t"),
    ("{tilt: {value: hinge.angle, unit: §mm}}",
     "@: output 'tilt': unit mm does not fit: the expression is in an angle or a plain number; write a unit of that"),
    ("{tilt: {value: end.x, unit: §deg}}", "@: output 'tilt': unit deg does not fit: the expression is in m; write a unit of that"),
    ("{tilt: {value: end.x, unit: §ells}}", "@: output 'tilt': unknown unit 'ells'; write for example deg or N*s/m"),
    ("{tilt: {value: 20, unit: §degC}}", "@: output 'tilt': unit degC does not begin at zero; write one that does, such as K"),
    ("{tilt: {value: §end.x + hinge.angle}}", "@: output 'tilt': value: m and 1 cannot be added or compared"),
    ("{§hinge: end.x}", "@: output 'hinge': duplicate name 'hinge', which an element has; rename one of them"),
    ("{§t: end.x}", "@: output 't': the column 't' is the time; choose another name"),
    ("{tilt: end.x}, §{tilt: end.x}", "@: outputs: the output 'tilt' stands twice; remove one"),
    ("{tilt: end.x}, §{tilt: end.z}", "@: outputs: the output 'tilt' stands twice; remove one"),
    ("§{a: end.x, b: end.z}", "@: model: outputs: an output has one name, not 2; write an item for each: - name: {value: ..., unit: ...}"),
    ("{tilt: {§unit: m}}", "18:12: model: outputs.tilt: the field 'value' is missing"),
    ("{tilt: {value: 1, §units: m}}", "@: model: outputs.tilt: unknown field 'units'; did you mean 'unit'?"),
    ("{tilt: §[1]}", "@: model: outputs.tilt needs a mapping"),
    ("§3", "@: model: outputs needs element.quantity, or name: {value: expression, unit: ...}"),
    ("{§my tilt: end.x}",
     "@: model: outputs.my tilt: 'my tilt' is not a name; use letters, digits and underscores, starting with a letter"),
]  # fmt: skip


def test_a_signal_alone_has_a_quantity() -> None:
    text = varied("scenes:", "signals: {seen: hinge.angle_rate}\nscenes:", varied("[end.x]", "[seen]"))
    with pytest.raises(ModelError, match=r"unknown element .seen.; write element.quantity, such as seen.value$"):
        read_model_text(text, "arm.yaml")


def test_an_output_is_the_same_in_all_scenes() -> None:
    scenes = "fall: {end: 2, outputs: [{tilt: hinge.angle}]}\n  other: {end: 1, outputs: [{§tilt: {value: hinge.angle, unit: deg}}]}"
    message = "duplicate name 'tilt', first defined at line 20 with another value or unit; rename one of them"
    check("fall: {end: 2}", scenes, f"@: output 'tilt': {message}")


@pytest.mark.parametrize(("output", "expected"), PROBLEMS)
def test_what_is_wrong_with_an_output(output: str, expected: str | list[str]) -> None:
    check("[end.x]", f"[{output}]", expected)


def test_no_law_reads_an_output() -> None:
    text = varied('"-0.1*rate"', "tilt*rate", varied("[end.x]", "[{tilt: hinge.angle}]"))
    hint = "symbols here: arm_length, arm_mass, pi, position, rate, swing, t"
    assert problems(text) == [f"m.yaml:15:48: force 'drag': law: unknown symbol 'tilt'; {hint}"]


def test_a_deep_expression_is_refused() -> None:
    row = "".join(f"  s{i}: sin(cos(s{i - 1})) + 1\n" for i in range(1, 51))
    text = varied("[end.x]", "[{all: sin(cos(s50))}]", PENDULUM + f"signals:\n  s0: hinge.angle\n{row}")
    assert "levels deep with the signals and forces that it reads" in problems(text)[-1]
