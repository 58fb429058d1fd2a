"""Files that a model names: tables and points as if they stood in the model, submodels, places of problems, and folders that hold them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.model.files.referenced import MAX_FILES, library
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model
from cutjoint.package.locations import without_mark

from .pendulum import PENDULUM, varied

#: Each table with the same one in the model.
TABLES = {
    "damper.csv": (
        "# measured\nrate [mrad/s], value [kN*mm]\n-500, 60\n0,0\n\n1000, -0.2e2\n",
        "{rate: [-0.5, 0, 1], value: [60, 0, -20]}",
    ),
    "map.csv": (
        "position, rate [rad/s], value\n0,-1,3\n0,1,-3\n1,-1,4\n1,1,-5\n2.5,-1,0\n2.5,1,1\n",
        "{position: [0, 1, 2.5], rate: [-1, 1], value: [[3, -3], [4, -5], [0, 1]]}",
    ),
}
HINGE = "hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}"


def written(folder: Path, files: Mapping[str, str], model: str = PENDULUM) -> Path:
    """The path of a model in a folder with other files."""
    for name, text in {"m.yaml": model, **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "m.yaml"


def reported(folder: Path, files: Mapping[str, str], model: str) -> list[str]:
    """Problems of a model in a folder, without that folder."""
    with pytest.raises(ModelError) as caught:
        read_model(written(folder, files, model))
    return str(caught.value).replace(f"{folder}/", "").splitlines()


def with_law(law: str) -> str:
    return varied('"-0.1*rate"', law)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_code_of_a_table_in_a_file_is_that_of_one_in_the_model(name: str, interpolation: str, tmp_path: Path) -> None:
    content, inline = TABLES[name]
    law = f"{{table: TABLE, interpolation: {interpolation}}}"
    of_file = read_model(written(tmp_path, {f"data/{name}": content}, with_law(law.replace("TABLE", f"{{file: data/{name}}}"))))
    of_text = read_model_text(with_law(law.replace("TABLE", inline)), "m.yaml")
    assert of_file.forces[0].law == of_text.forces[0].law
    assert of_file.files == {f"{tmp_path}/data/{name}": content}
    assert code(of_file) == code(of_text)


def code(model: Model) -> dict[str, str]:
    source = generate(model, model.scenes["fall"], model.scenes["fall"].outputs)[2]
    return {name: without_mark(text) for name, text in source.files.items()}


def test_the_banner_of_generated_code_changes_with_a_file(tmp_path: Path) -> None:
    content = TABLES["damper.csv"][0]
    path = written(tmp_path, {"damper.csv": content}, with_law("{table: {file: damper.csv}}"))
    first = read_model(path)
    (tmp_path / "damper.csv").write_text(content + "# the same numbers\n", encoding="utf-8")
    second = read_model(path)
    assert code(first) == code(second)
    banners = [generate(m, m.scenes["fall"], ())[2].files for m in (first, second)]
    assert banners[0] != banners[1]


@pytest.mark.parametrize(("file", "names"), [("damper.csv", "012"), ("map.csv", ("0.0", "0.1", "1.0", "1.1", "2.0", "2.1"))])
def test_values_of_tables_in_files_are_tunable(tmp_path: Path, file: str, names: Sequence[str]) -> None:
    path = written(tmp_path, {file: TABLES[file][0]}, with_law(f"{{table: {{file: {file}}}}}"))
    tunable = [p.name for p in read_model(path, tunable=["drag.law.table.*"]).parameters if p.name.startswith("drag")]
    assert tunable == [f"drag.law.table.value.{name}" for name in names]


def test_columns_are_named_and_inputs_have_tables(tmp_path: Path) -> None:
    files = {"all.csv": "Time [ms],speed [rad/s], steer, front\n0, -1, 0, 10\n1000, 0, 3, 2\n2000, 1, 4, -7\n"}
    text = with_law("{table: {file: all.csv, rate: speed, value: front}}")
    text = varied("end: 2", "end: 2, inputs: {swing: {table: {file: all.csv, t: Time, value: steer}}}", text)
    model = read_model(written(tmp_path, files, text))
    text = with_law("{table: {rate: [-1, 0, 1], value: [10, 2, -7]}}")
    same = read_model_text(varied("end: 2", "end: 2, inputs: {swing: {table: {t: [0, 1, 2], value: [0, 3, 4]}}}", text), "m.yaml")
    assert model.forces[0].law == same.forces[0].law
    assert model.scenes["fall"].inputs == same.scenes["fall"].inputs


def test_points_of_a_file_are_points_and_numbers_to_tune(tmp_path: Path) -> None:
    files = {"points.csv": "\ufeffx [mm], name, y, z [m]\r\n1500, tip, 0.25, -0.5\r\n1e3, C, 0, 0\r\n"}
    text = varied("points:\n  tip: [arm_length, 0, 0]", "points: {file: points.csv, half: {midpoint: [tip, C]}}")
    text = varied("centre_of_mass: [1, 0, 0]", "centre_of_mass: half", text).replace("  arm_length: {value: 1.5, unit: m}\n", "")
    model = read_model(written(tmp_path, files, text), tunable=["tip.x"])
    assert [p.value for p in model.parameters if p.name == "tip.x"] == [1.5]
    assert tuple(map(float, model.bodies[0].centre_of_mass[1:])) == (0.125, -0.25)
    (marker,) = model.markers
    assert (str(marker.point[0]), *map(float, marker.point[1:])) == ("p_tip.x", 0.25, -0.5)


def test_a_point_may_still_be_called_file() -> None:
    model = read_model_text(varied("  tip: [arm_length, 0, 0]", "  file: [0, 0, 1]\n  tip: {sum: [file, [arm_length, 0, 0]]}"), "m.yaml")
    assert float(model.markers[0].point[2]) == 1.0


CONTENTS = [
    ("rate,value\n0,1\n1,abc\n", "t.csv:3:3: force 'drag': 'abc' is not a number; write plain decimal numbers, such as -0.5 or 1e-3"),
    ("rate,value\n0,1\n1, nan\n", "t.csv:3:4: force 'drag': 'nan' is not a number; write plain decimal numbers, such as -0.5 or 1e-3"),
    ("rate,value\n0,1\n1,inf\n", "t.csv:3:3: force 'drag': 'inf' is not a number; write plain decimal numbers, such as -0.5 or 1e-3"),
    ("rate,value\n0,1e999\n1,1\n", "t.csv:2:3: force 'drag': '1e999' is out of range; write a smaller number"),
    ("rate,value\n0,1\n1,\n", "t.csv:3:3: force 'drag': a cell is empty; write a number, or leave the row out"),
    ("rate,value\n0,1\n1\n", "t.csv:3:1: force 'drag': the row has 1 cells, the line of names 2; write as many"),
    ("rate,value\n0,1\n1,2,3\n", "t.csv:3:3: force 'drag': the row has 3 cells, the line of names 2; write as many"),
    ("rate;value\n0;1,5\n", "t.csv:1:1: force 'drag': commas separate the cells of a table, and decimals have a point; "
     "replace semicolons by commas"),
    ("rate,value\n0,1\n2,1\n# down\n1,1\n", "t.csv:5:1: force 'drag': the table's rate does not rise; sort the table"),
    ("rate,value\n0,1\n0,1\n", "t.csv:3:1: force 'drag': the table's rate does not rise; sort the table"),
    ("rate,value\n0,1\n", "m.yaml:15:56: force 'drag': the table has 1 of rate and 1 of value; give as many of both, two or more"),
    ("rate,value\n", "t.csv:1:1: force 'drag': the table has no rows; write a line of names, and a row of numbers below it"),
    ("", "t.csv:1:1: force 'drag': the table has no rows; write a line of names, and a row of numbers below it"),
    ("rate [m/s],value\n0,1\n1,1\n", "t.csv:1:1: force 'drag': law.table.rate needs rad/s, got m/s"),
    ("rate,value [N]\n0,1\n1,1\n", "t.csv:1:6: force 'drag': law.table.value needs N*m, got N"),
    ("rate,value [N*ells]\n0,1\n1,1\n", "t.csv:1:6: force 'drag': unknown unit 'N*ells'; write for example [mm] or [N*s/m]"),
    ("rate,speed\n0,1\n1,1\n", "m.yaml:15:56: force 'drag': a table has the list of a variable, or of two, and 'value'; "
     "for example {length: [0, 1], value: [0, 100]}"),
    ("travel,value\n0,1\n1,1\n", "t.csv:1:1: force 'drag': 'travel' is not a variable of this law; variables: position, rate, t"),
    ('"rate",value\n0,1\n1,1\n',
     "t.csv:1:1: force 'drag': '\"rate\"' is not a column's name; write for example travel [mm], without quotes"),
    ("rate,rate\n0,1\n1,1\n", "t.csv:1:6: force 'drag': two columns are called 'rate'; rename one of them"),
    ("rate,value\n" + "".join(f"{i},{i}\n" for i in range(201)),
     "t.csv:202:1: force 'drag': the table has 201 rows, and a law at most 200 points; leave rows out where the curve is straight"),
    ("position,rate,value\n0,0,1\n0,1,1\n1,0,1\n",
     "t.csv:4:3: force 'drag': the table has a hole: it needs a row for each pair of position and rate; "
     "write the same values of rate for each of position"),
    ("position,rate,value\n0,0,1\n0,1,1\n1,0,1\n1,2,1\n",
     "t.csv:5:3: force 'drag': the table has a hole: it needs a row for each pair of position and rate; "
     "write the same values of rate for each of position"),
    ("position,rate,value\n0,0,1\n0,1,1\n1,0,1\n2,0,1\n2,1,1\n",
     "t.csv:5:3: force 'drag': the table has a hole: it needs a row for each pair of position and rate; "
     "write the same values of rate for each of position"),
    ("position,rate,value\n0,1,1\n0,0,1\n1,1,1\n1,0,1\n",
     "t.csv:3:3: force 'drag': '0' is not larger than the value before; sort the rows by position, then by rate"),
    ("position,rate,value\n1,0,1\n1,1,1\n0,0,1\n0,1,1\n",
     "t.csv:4:1: force 'drag': '0' is not larger than the value before; sort the rows by position, then by rate"),
    ("position,rate,value\n1,0,1\n1,1,1\n",
     "t.csv:1:15: force 'drag': the table has 1 of position and 2 of rate, and needs as many rows of as many values, two or more; "
     "give a list of values for each position: value: [[...], [...]]"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "expected"), CONTENTS)
def test_what_is_wrong_with_a_table(content: str, expected: str, tmp_path: Path) -> None:
    assert reported(tmp_path, {"t.csv": content}, with_law("{table: {file: t.csv}}")) == [expected]


def test_all_problems_of_a_table_come_at_once(tmp_path: Path) -> None:
    lines = reported(tmp_path, {"t.csv": "rate,value\nx,1\n1,y\n"}, with_law("{table: {file: t.csv}}"))
    assert [line.split(" ")[0] for line in lines] == ["t.csv:2:1:", "t.csv:3:3:"]


NAMES = [
    ("../t.csv", "the file '../t.csv' is not below the folder of the model file; write its path from there, such as data/damper.csv"),
    ("data/../t.csv",
     "the file 'data/../t.csv' is not below the folder of the model file; write its path from there, such as data/damper.csv"),
    ("/etc/t.csv", "the file '/etc/t.csv' is not below the folder of the model file; write its path from there, such as data/damper.csv"),
    ('"C:/t.csv"', "the file 'C:/t.csv' is not below the folder of the model file; write its path from there, such as data/damper.csv"),
    ("'data\\t.csv'",
     "the file 'data\\t.csv' is not below the folder of the model file; write its path from there, such as data/damper.csv"),
    ("u.csv", "there is no file 'u.csv'; put it into FOLDER, beside the file that names it"),
    ("link.csv", "the file 'link.csv' is a link that leaves the folder of the model file; put the file itself there"),
    ("loop.csv", "there is no file 'loop.csv'; put it into FOLDER, beside the file that names it"),
    ("folder.csv", "'folder.csv' is no file; name another"),
    ("t.txt", "the file 't.txt' is no table; name a file with comma-separated values, such as damper.csv"),
    ("3", "needs the name of a file; write its path from the folder of the model file"),
    ("{a: 1}", "needs the name of a file; write its path from the folder of the model file"),
    ("t.csv, rate: fast, value: value", "@:30 the file 't.csv' has no column 'fast'; columns: rate, value"),
    ("t.csv, rate: [1, 2]", "'rate' is the name of a column of 't.csv'; remove the list, or the file"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "expected"), NAMES)
def test_what_is_wrong_with_a_name(name: str, expected: str, tmp_path: Path) -> None:
    folder = tmp_path / "inside"
    (folder / "data").mkdir(parents=True)
    (tmp_path / "t.csv").write_text(TABLES["damper.csv"][0])
    (folder / "link.csv").symlink_to(tmp_path / "t.csv")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    (folder / "folder.csv").mkdir()
    files = {"t.csv": TABLES["damper.csv"][0], "t.txt": "", "data/t.csv": ""}
    line = "m.yaml:15:63:" if "@" not in expected else f"m.yaml:15:{63 + len('t.csv, rate: ')}:"
    text = expected.removeprefix("@:30 ").replace("FOLDER", folder.name)
    assert reported(folder, files, with_law(f"{{table: {{file: {name}}}}}")) == [f"{line} force 'drag': {text}"]


def test_a_link_within_the_folder_is_followed(tmp_path: Path) -> None:
    path = written(tmp_path, {"data/t.csv": TABLES["damper.csv"][0]}, with_law("{table: {file: t.csv}}"))
    (tmp_path / "t.csv").symlink_to(tmp_path / "data" / "t.csv")
    assert len(read_model(path).forces) == 1


def test_a_text_and_a_pipe_have_no_folder(tmp_path: Path) -> None:
    text = with_law("{table: {file: t.csv}}")
    expected = (
        "m.yaml:15:63: force 'drag': the file 't.csv' cannot be found: a model that is given as text has no folder; "
        "save the model as a file and read that"
    )
    with pytest.raises(ModelError) as caught:
        read_model_text(text, "m.yaml")
    assert str(caught.value) == expected
    written(tmp_path, {"t.csv": TABLES["damper.csv"][0]})
    assert read_model_text(text, "m.yaml", folder=tmp_path).files == {"t.csv": TABLES["damper.csv"][0]}


def test_a_file_that_is_no_text_is_reported_at_its_place(tmp_path: Path) -> None:
    path = written(tmp_path, {}, with_law("{table: {file: t.csv}}"))
    (tmp_path / "t.csv").write_bytes(b"rate,value\n0,\xff\n")
    with pytest.raises(ModelError, match=r"t\.csv:2:1: file: the file is not UTF-8 text$"):
        read_model(path)


POINTS = [
    ("name,x,y\ntip,1,2\n", "p.csv:1:1: model: a table of points has the columns name, x, y and z, not name, x, y; "
     "write for example: name, x [mm], y [mm], z [mm]"),
    ("name,x,y,z,w\ntip,1,2,3,4\n", "p.csv:1:1: model: a table of points has the columns name, x, y and z, not name, x, y, z, w; "
     "write for example: name, x [mm], y [mm], z [mm]"),
    ("name,x,y [s],z\ntip,1,2,3\n", "p.csv:1:8: column 'y': needs m, got s; write x [mm]"),
    ("name,x,y,z\ntip,1,2,3\ntip,1,2,3\n", "p.csv:3:1: point 'tip': duplicate name 'tip', first defined at line 2; rename one of them"),
    ("name,x,y,z\ntip,1,2,3\nhalf,1,2,3\n",
     "p.csv:3:1: point 'half': duplicate name 'half', first defined at m.yaml:8; rename one of them"),
    ("name,x,y,z\nthe tip,1,2,3\n",
     "p.csv:2:1: point: 'the tip' is not a name; use letters, digits and underscores, starting with a letter"),
    ("name,x,y,z\ntip,1,2,up\n", "p.csv:2:9: model: 'up' is not a number; write plain decimal numbers, such as -0.5 or 1e-3"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "expected"), POINTS)
def test_what_is_wrong_with_points(content: str, expected: str, tmp_path: Path) -> None:
    text = varied("points:\n  tip: [arm_length, 0, 0]", "points: {file: p.csv, half: [arm_length, 0, 0]}")
    assert reported(tmp_path, {"p.csv": content}, text) == [expected]


# Submodels

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
