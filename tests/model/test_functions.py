"""Functions of users: declarations, calls and their problems."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy

from cutjoint.compile.pipeline import compile_interpreted, generate
from cutjoint.export.laws import require_mechanics_alone
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions import variable
from cutjoint.model.functions import SuppliedCall, require_code, supply
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import CutjointError
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.differentiate import Differentiator

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
        ("partials: true", "code: pull.cpp", "m.yaml:5:29: function 'pull': unknown field 'code'; fields: arguments, partials"),
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
    slopes = Differentiator(b, [x]).jacobian(value)
    calls = {block.data[0] for block in _all(slopes[x]) if block.op == "call" and isinstance(block.data, tuple)}
    assert {"supplied.pull.0", "supplied.pull.1", "cos"} <= calls


def _all(block: Block) -> list[Block]:
    return [block, *(inner for part in block.args for inner in _all(part))]
