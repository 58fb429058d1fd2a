"""Submodels in files of their own, instances within instances, and what is wrong with them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.files.referenced import MAX_FILES, library
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model
from tests.model.test_files import reported, with_law, written

from .pendulum import PENDULUM, varied

#: A row of two bodies: one in a submodel of its own, with a table beside its file.
ROW = """\
cutjoint: 1
connectors: [base]
parameters: [reach]
points: {A: [0.1, 0.2, 0.3], B: [reach, 0.5, -0.2]}
bodies:
  first: {mass: 2, centre_of_mass: B, inertia: [2, 3, 4, 0.1, 0.2, 0.3]}
joints:
  turn: {kind: revolute, bodies: [base, first], at: A, axis: [1, 2, 3]}
submodels:
  tail: {include: tail.yaml}
instances:
  end: {use: tail, connect: {base: first}, with: {far: 2*reach}, mirror: y}
outputs: [turn.angle]
"""

TAIL = """\
cutjoint: 1
connectors: [base]
parameters: [far]
bodies:
  last: {mass: 1, centre_of_mass: [far, 0.1, 0.2], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [base, last], at: [far, 0, 0.1], axis: [2, 1, 1]}
forces:
  drag: {kind: joint_force, joint: slide, law: {table: {file: drag.csv}}}
signals:
  across: last.vy*slide.displacement
outputs: [slide.displacement, across.value]
"""

DRAG = "rate,value\n-1,2\n1,-2\n"

WHOLE = """\
cutjoint: 1
name: rows
gravity: [0, 0, -9.81]
bodies: {}
joints: {}
submodels: {row: {include: parts/row.yaml}}
instances:
  a: {use: row, connect: {base: ground}, with: {reach: 1}}
  b: {use: row, connect: {base: ground}, with: {reach: 1}, mirror: x}
scenes: {run: {end: 1}}
"""

FILES = {"parts/row.yaml": ROW, "parts/tail.yaml": TAIL, "parts/drag.csv": DRAG}


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return read_model(written(tmp_path_factory.mktemp("rows"), FILES, WHOLE))


def test_instances_stand_in_instances(rows: Model) -> None:
    assert [body.name for body in rows.bodies] == ["a.first", "a.end.last", "b.first", "b.end.last"]
    assert [output.column for output in rows.scenes["run"].outputs] == [
        f"{row}.{name}" for row in "ab" for name in ("turn.angle", "end.slide.displacement", "end.across.value")
    ]
    slide = next(joint for joint in rows.joints if joint.name == "b.end.slide")
    assert (slide.base, slide.follower) == ("b.first", "b.end.last")
    assert slide.span.place == "tail.yaml:7"


def test_an_included_submodel_is_the_one_that_stands_in_the_model(rows: Model) -> None:
    """The text of the files in the place of their names, with its lines alone elsewhere."""
    tail = "\n".join(f"        {line}" for line in TAIL.splitlines()[1:]).replace("{file: drag.csv}", "{rate: [-1, 1], value: [2, -2]}")
    row = "\n".join(f"    {line}" for line in ROW.splitlines()[1:]).replace("tail: {include: tail.yaml}", f"tail:\n{tail}")
    text = WHOLE.replace("{row: {include: parts/row.yaml}}", f"\n  row:\n{row}")
    same, nowhere = read_model_text(text, "m.yaml"), rows.span
    for group in ("bodies", "joints", "forces", "signals"):
        pairs = zip(getattr(rows, group), getattr(same, group), strict=True)
        assert all(replace(one, span=nowhere) == replace(other, span=nowhere) for one, other in pairs)


def test_mirrors_within_each_other_are_a_half_turn(rows: Model) -> None:
    """Along x and along y: positions, directions and turns of the last body turn about z, and so do what its signal reads."""
    bodies, joints = ({element.name: element for element in group} for group in (rows.bodies, rows.joints))
    at = tuple(map(float, bodies["b.end.last"].centre_of_mass))
    assert at == (-2.0, -0.1, 0.2)
    length = 6**0.5
    assert tuple(map(float, joints["b.end.slide"].axes[0])) == pytest.approx((-2 / length, -1 / length, 1 / length))
    signals = {signal.name: str(signal.value) for signal in rows.signals}
    assert signals["a.end.across"] == "-@a.end.last.vy*@a.end.slide.displacement"
    assert signals["b.end.across"] == "-@b.end.last.vy*@b.end.slide.displacement"
    first = bodies["b.first"]
    assert tuple(map(float, (*first.centre_of_mass, *first.inertia))) == (-1, 0.5, -0.2, 2, 3, 4, -0.1, -0.2, 0.3)


INCLUDES = [
    ({}, {"tail.yaml": "drum.yaml"}, "parts/row.yaml:10:19: submodel 'tail': there is no file 'drum.yaml'; put it into parts, "
     "beside the file that names it"),
    ({}, {"tail.yaml": "../m.yaml"},
     "parts/row.yaml:10:19: submodel 'tail': the file '../m.yaml' is not below the folder of the model file; "
     "write its path from there, such as data/damper.csv"),
    ({}, {"tail.yaml": "row.yaml"}, "parts/row.yaml:10:19: submodel 'tail': the file 'row.yaml' includes itself: row.yaml -> row.yaml; "
     "remove one of these includes"),
    ({}, {"tail.yaml": "tail"}, "parts/row.yaml:10:19: submodel 'tail': the file 'tail' is no submodel; name a .yaml file, or write "
     "library/NAME for one of the package"),
    ({}, {"tail.yaml": "library/double_wishbones"},
     "parts/row.yaml:10:19: submodel 'tail': the library has no submodel 'double_wishbones'; did you mean 'double_wishbone'?"),
    ({"tail.yaml": TAIL[12:]}, {}, "parts/tail.yaml:1:1: submodel 'tail': this is no file of a submodel; it starts with 'cutjoint: 1', and "
     "then has the sections of a submodel"),
    ({"tail.yaml": "[]"}, {}, "parts/tail.yaml:1:1: submodel 'tail': this is no file of a submodel; it starts with 'cutjoint: 1', and "
     "then has the sections of a submodel"),
    ({"tail.yaml": PENDULUM}, {}, "parts/tail.yaml:1:1: submodel 'tail': this is a whole model, not a submodel; leave name, gravity and "
     "scenes to the model that includes it"),
    ({"tail.yaml": TAIL + "bodies: {}\n"}, {},
     "parts/tail.yaml:13:1: file: duplicate key 'bodies', first defined at line 4; keep one of them"),
    ({"tail.yaml": TAIL.replace("mass: 1", "mas: 1")}, {},
     "parts/tail.yaml:5:10: body 'last' of submodel 'tail': unknown field 'mas'; did you mean 'mass'?"),
    ({"tail.yaml": TAIL.replace("far, 0.1", "fur, 0.1")}, {},
     "parts/tail.yaml:5:36: body 'a.end.last': centre_of_mass: unknown symbol 'fur'; did you mean 'far'?"),
    ({"drag.csv": "rate,value\n0,1\n1\n"}, {},
     "parts/drag.csv:3:1: force 'drag': the row has 1 cells, the line of names 2; write as many"),
    ({}, {"tail: {include: tail.yaml}": "tail: {include: tail.yaml, connectors: [base]}"},
     "parts/row.yaml:10:19: submodel 'tail': 'include' stands for the whole submodel; remove what stands beside it, "
     "or write the submodel here"),
    ({}, {"use: tail": "use: tall"}, "parts/row.yaml:12:14: instance 'a.end': unknown submodel 'tall'; did you mean 'tail'?"),
    ({}, {"use: tail, connect: {base: first}, with: {far: 2*reach}": "use: row, connect: {base: first}, with: {reach: 2*reach}"},
     "parts/row.yaml:12:14: instance 'a.end': the submodel 'row' stands inside itself; remove this instance, or use another submodel"),
    ({}, {"connect: {base: first}": "connect: {base: furst}"},
     "parts/row.yaml:12:36: instance 'a.end': unknown body 'furst'; did you mean 'first'?"),
]  # fmt: skip


@pytest.mark.parametrize(("files", "changes", "expected"), INCLUDES)
def test_what_is_wrong_with_includes(files: dict[str, str], changes: dict[str, str], expected: str, tmp_path: Path) -> None:
    row = ROW
    for old, new in changes.items():
        row = varied(old, new, row)
    found = reported(tmp_path, {**FILES, "parts/row.yaml": row, **{f"parts/{name}": text for name, text in files.items()}}, WHOLE)
    assert found[0] == expected


@pytest.mark.heavy
def test_instances_of_endless_number_are_refused() -> None:
    """Two of each in each, 15 deep."""
    names = [f"s{i}" for i in range(15)]
    twice = "a: {{use: {0}, connect: {{base: base}}}}, b: {{use: {0}, connect: {{base: base}}}}"
    inner = "".join(f"  {name}: {{connectors: [base], instances: {{{twice.format(below)}}}}}\n" for name, below in pairwise(names))
    top = "instances:\n  top: {use: s0, connect: {base: arm}}\n"
    text = varied("scenes:", f"submodels:\n{inner}  s14: {{connectors: [base]}}\n{top}scenes:")
    with pytest.raises(ModelError, match="the model has more than 20000 elements; use fewer instances"):
        read_model_text(text, "m.yaml")


TOO_DEEP = "the submodel 's20' stands more than 20 deep in others; remove this instance"


@pytest.mark.parametrize(("count", "found"), [(20, ""), (21, TOO_DEEP)])
def test_instances_stand_in_each_other_up_to_a_depth(count: int, found: str) -> None:
    chain = "".join(f"  s{i}: {{instances: {{a: {{use: s{i + 1}}}}}}}\n" for i in range(count - 1))
    text = varied("scenes:", f"submodels:\n{chain}  s{count - 1}: {{}}\ninstances:\n  top: {{use: s0}}\nscenes:")
    if not found:
        assert len(read_model_text(text, "m.yaml").bodies) == 1
        return
    with pytest.raises(ModelError, match=found):
        read_model_text(text, "m.yaml")


def test_files_of_endless_number_are_refused(tmp_path: Path) -> None:
    count = MAX_FILES + 1
    laws = ", ".join(f"{{table: {{file: t{i}.csv}}}}" for i in range(count))
    # a sum takes at most a hundred laws
    text = with_law("{sum: [{sum: [" + "]}, {sum: [".join(", ".join(laws.split(", ")[i : i + 90]) for i in range(0, count, 90)) + "]}]}")
    found = reported(tmp_path, {f"t{i}.csv": DRAG for i in range(count)}, text)
    assert len(found) == 1
    assert f"the model names more than {MAX_FILES} files; use fewer" in found[0]


@pytest.mark.parametrize("name", library())
def test_each_submodel_of_the_library_stands_in_a_model(name: str) -> None:
    text = varied("scenes:", f"submodels: {{part: {{include: library/{name}}}}}\ninstances:\n  part: {{use: part}}\nscenes:")
    with pytest.raises(ModelError) as caught:
        read_model_text(text, "m.yaml")
    assert all("lacks" in line for line in str(caught.value).splitlines())  # what an instance names, and no fault of the submodel
