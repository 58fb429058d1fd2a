"""Tables, points and texts in files of their own, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
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
