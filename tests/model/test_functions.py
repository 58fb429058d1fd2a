"""Functions of users: declarations, calls and their problems."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.functions import SuppliedCall, require_code, supply
from cutjoint.model.expressions.parse import variable
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import CutjointError
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.differentiate import Differentiator
from cutjoint_bench.mechanics_alone import require_mechanics_alone

MODEL = """\
cutjoint: 1
name: slider
gravity: [0, 0, -9.81]
functions:
  pull: {arguments: [x, v], partials: true}
  push: {arguments: [x]}
bodies:
  block: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  spring: {kind: joint_force, joint: slide, law: "-pull(position, 2*rate) - 3*push(position)"}
scenes:
  run: {end: 1, positions: {slide.displacement: 0.1}, outputs: [slide.displacement, {twice: 2*push(slide.displacement)}]}
"""
CODE = """\
extern "C" void cutjoint_pull(const double* a, double* result, double* partials) {}
extern "C" void cutjoint_push(const double* a, double* result, double* partials) {}
"""


def read(text: str = MODEL) -> Model:
    return read_model_text(text, "m.yaml")


def supplied(tmp_path: Path, text: str = MODEL, code: str = CODE) -> Model:
    path = tmp_path / "functions.cpp"
    path.write_text(code, encoding="utf-8")
    return supply(read(text), path)


def test_laws_call_what_the_model_declares() -> None:
    model = read()
    assert [(f.name, f.arguments, f.partials, f.span.line) for f in model.functions] == [
        ("pull", ("x", "v"), True, 5), ("push", ("x",), False, 6)
    ]  # fmt: skip
    (law,) = model.forces[0].expressions
    x, rate = variable("position"), variable("rate")
    pull, push = SuppliedCall("pull", -1, 1, x, 2 * rate), SuppliedCall("push", -1, 0, x)
    assert law == -pull - 3 * push
    assert law.diff(rate) == -2 * SuppliedCall("pull", 1, 1, x, 2 * rate)
    assert law.xreplace({x: sympy.Float(0.5)}).has(SuppliedCall("push", -1, 0, sympy.Float(0.5)))


WORN = MODEL.replace(
    "  push: {arguments: [x]}\n",
    "  push: {arguments: {x: m}, unit: N}\n  wear: {arguments: {x: m, v: m/s}, results: {force: N, heat: W}, memory: 64}\n",
).replace(
    "scenes:",
    "controllers:\n  keep: {every: 10 ms, memory: {kept: {function: wear, arguments: [slide.displacement, slide.displacement_rate]}}}\n"
    "signals:\n  lost: wear.heat(slide.displacement, slide.displacement_rate, keep.kept)\nscenes:",
).replace("- 3*push(position)", "- push(position) - wear.force(position, rate, keep.kept)")  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("wear.heat(", "wear(", "m.yaml:17:3: signal 'lost': wear has several results; "
            "write wear.force(x, v, memory) or wear.heat(x, v, memory)"),
        ("wear.heat(", "wear.cold(", "m.yaml:17:3: signal 'lost': wear has no result 'cold'; "
            "write wear.force(x, v, memory) or wear.heat(x, v, memory)"),
        ("rate, keep.kept)\nscenes", "rate)\nscenes", "m.yaml:17:3: signal 'lost': the last argument of wear is its memory; "
            "give a controller memory: {kept: {function: wear, arguments: [...]}}, and write its name there"),
        ("lost: wear", "lost: 2*keep.kept + wear", "m.yaml:17:3: signal 'lost': 'keep.kept' is the memory of a function, and no number; "
            "write it as the last argument of wear"),
        ("heat(slide.displacement,", "heat(slide.displacement_rate,", "m.yaml:17:3: signal 'lost': x of wear needs m, got m/s"),
        ("function: wear", "function: ware", "m.yaml:15:50: controller 'keep': there is no function 'ware'; did you mean 'wear'?"),
        ("function: wear", "function: pull", "m.yaml:15:67: controller 'keep': memory kept: the function 'pull' has no memory; "
            "declare its size in bytes: memory: 64"),
        (", slide.displacement_rate]}}}", "]}}}",
            "m.yaml:15:67: controller 'keep': memory kept: wear needs 2 arguments, got 1; write wear(x, v)"),
        ("memory: 64", "memory: 0", "m.yaml:7:75: function 'wear': memory: 0 bytes is out of range; write 1 to 256"),
        ("v: m/s}", "v: mm/s}", "m.yaml:7:31: function 'wear': 'mm/s' is no SI unit, and its code has numbers in SI units; write m/s"),
        ("unit: N}", "unit: N, results: [a]}", "m.yaml:6:3: function 'push': 'unit' is that of one result, and 'results' has several; "
            "write their units there: results: {force: N}"),
        ("outputs: [", "outputs: [keep.kept, ", "m.yaml:19:65: scene 'run': output 'keep.kept': 'keep' has no quantity 'kept'; "
            "a memory of a function is none"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_memories_and_results_is_named(old: str, new: str, message: str) -> None:
    assert old in WORN
    with pytest.raises(ModelError) as raised:
        read(WORN.replace(old, new, 1))
    assert message in str(raised.value).splitlines()


def test_a_memory_is_words_that_a_controller_holds() -> None:
    """Each has four bytes; derivatives pass it by, and readers see one."""
    model = read(WORN)
    (controller,) = model.controllers
    assert len(controller.discrete_states) == 16
    assert controller.quantities == {}
    (lost,) = (signal.value for signal in model.signals if signal.name == "lost")
    assert isinstance(lost, SuppliedCall)
    assert lost.function == "opaque.wear:1:2:16"
    assert len(lost.arguments) == 18
    assert lost.diff(controller.discrete_states[3].symbol) == 0
    assert str(lost) == "wear_2(@slide.displacement, @slide.displacement_rate, @keep.kept:0)"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("push(position)", "pusk(position)", "m.yaml:12:50: force 'spring': law: unknown function 'pusk'; did you mean 'push'?"),
        ("push(position)", "push(position, 1)", "m.yaml:12:50: force 'spring': law: push needs 1 argument, got 2; write push(x)"),
        ("pull(position, 2*rate)", "pull(position)", "m.yaml:12:50: force 'spring': law: pull needs 2 arguments, got 1; write pull(x, v)"),
        ("mass: 2", "mass: push(2)", "m.yaml:8:17: body 'block': mass: the function 'push' cannot be called here; "
            "laws of forces, signals, rates of states and controllers may call it"),
        ("push:", "sin:", "m.yaml:6:3: function 'sin': the name 'sin' has a meaning of its own in expressions; write for example 'sin_0'"),
        ("[x, v]", "[x, x]", "m.yaml:5:21: function 'pull': two arguments have one name; rename one of them"),
        ("partials: true", "code: pull.cpp", "m.yaml:5:29: function 'pull': unknown field 'code'; "
            "fields: arguments, memory, partials, results, unit"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(old: str, new: str, message: str) -> None:
    assert old in MODEL
    with pytest.raises(ModelError) as raised:
        read(MODEL.replace(old, new, 1))
    assert message in str(raised.value).splitlines()


def test_code_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"m\.yaml:5:3: function 'pull': its code is missing; name a C\+\+ file that has it by"):
        require_code(read())
    with pytest.raises(ModelError, match=r"m\.yaml:6:3: function 'push': .*functions\.cpp has no cutjoint_push; write extern \"C\" void"):
        supplied(tmp_path, code=CODE.replace("cutjoint_push", "my_cutjoint_push"))
    with pytest.raises(ModelError, match=r"none\.cpp:1:1: .*cannot be read: No such file or directory"):
        supply(read(), tmp_path / "none.cpp")
    without = MODEL.replace("-pull(position, 2*rate) - 3*push(position)", "0").replace(", {twice: 2*push(slide.displacement)}", "")
    lines = [line for line in without.splitlines() if not line.startswith(("functions:", "  pull:", "  push:"))]
    with pytest.raises(ModelError, match="it declares no functions"):
        supplied(tmp_path, "\n".join(lines))


def test_programs_without_the_code_are_refused(tmp_path: Path) -> None:
    model = supplied(tmp_path)
    with pytest.raises(CutjointError, match=r"m\.yaml:5:3: function 'pull': only generated code calls functions"):
        compile_interpreted(model, model.scenes["run"])
    with pytest.raises(ModelError, match=r"m\.yaml:5:3: function 'pull': only cutjoint calls functions of users"):
        require_mechanics_alone(model)


def test_derivatives_that_are_missing_are_named_where_they_are_needed(tmp_path: Path) -> None:
    model = supplied(tmp_path)
    scene = model.scenes["run"]
    assert generate(model, scene, scene.outputs, method="recursive").source.files["supplied.cpp"].endswith(CODE)
    for method in ("recursive-newton", "augmented"):
        with pytest.raises(CutjointError, match=r"m\.yaml:6:3: function 'push': has no partial derivatives"):
            generate(model, scene, scene.outputs, method=method)


def test_blocks_have_the_chain_rule() -> None:
    b = Builder()
    x = b.symbol("x", 1, BindingTime.ITERATION)
    value = b.call("supplied.pull", b.call("sin", x), x)
    derivatives = Differentiator(b, [x]).jacobian(value)
    calls = {block.data[0] for block in _all(derivatives[x]) if block.op == "call" and isinstance(block.data, tuple)}
    assert {"supplied.pull.0", "supplied.pull.1", "cos"} <= calls


def _all(block: Block) -> list[Block]:
    return [block, *(inner for part in block.args for inner in _all(part))]
