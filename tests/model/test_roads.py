"""Surfaces and patches of roads in model files, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model
from cutjoint.model.records import HeightTable, Road

MODEL = """cutjoint: 1
name: m
gravity: [0, 0, -9.81]
bodies:
  b: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  j: {kind: free, bodies: [ground, b], at: [0, 0, 0]}
scenes:
  s:
    end: 1
    road:
      %s
"""

ROWS = "x [m], y [m], value [mm]\n0, 0, 1\n0, 1, 2\n2, 0, 3\n2, 1, 4\n4, 0, 5\n4, 1, 6\n"


LISTS = "{surface: {table: {x: [0 m, 2 m, 400 cm], y: [0, 1], value: [[1 mm, 2 mm], [0.003, 0.004], [0.005, 6 mm]]}}}"


def read(folder: Path, road: str, table: str = "") -> Road:
    (folder / "m.yaml").write_text(MODEL % road, encoding="utf-8")
    (folder / "t.csv").write_text(table, encoding="utf-8")
    return read_model(folder / "m.yaml").scenes["s"].road


def test_a_table_in_a_file_is_the_lists_of_it(tmp_path: Path) -> None:
    of_file = read(tmp_path, "{surface: {table: {file: t.csv}}}", ROWS).surface
    listed = read(tmp_path, LISTS).surface
    assert isinstance(of_file, HeightTable)
    assert isinstance(listed, HeightTable)
    assert (of_file.start, of_file.step, of_file.heights) == ((0, 0), (2, 1), ((0.001, 0.002), (0.003, 0.004), (0.005, 0.006)))
    assert (listed.start, listed.step, listed.heights) == (of_file.start, of_file.step, of_file.heights)


def test_columns_may_have_other_names_and_y_may_be_first(tmp_path: Path) -> None:
    turned = "across, along, z\n0, 0, 1\n0, 2, 3\n0, 4, 5\n1, 0, 2\n1, 2, 4\n1, 4, 6\n"
    surface = read(tmp_path, "{surface: {table: {file: t.csv, y: across, x: along, value: z}}}", turned).surface
    assert isinstance(surface, HeightTable)
    assert (surface.start, surface.step, surface.heights) == ((0, 0), (2, 1), ((1, 2), (3, 4), (5, 6)))


def test_ten_thousand_places_and_more(tmp_path: Path) -> None:
    rows = "\n".join(f"{i / 10}, {j / 10}, {i * j % 7}" for i in range(600) for j in range(21))
    surface = read(tmp_path, "{surface: {table: {file: t.csv}}}", f"x, y, value [mm]\n{rows}\n").surface
    assert isinstance(surface, HeightTable)
    assert (len(surface.heights), len(surface.heights[0])) == (600, 21)


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        (ROWS.replace("2, 1, 4\n", ""), "t.csv:5:4: scene 's': the table has a hole"),
        (ROWS.replace("3\n", "nan\n"), "t.csv:4:7: scene 's': 'nan' is not a number"),
        (ROWS.replace("3\n", "\n"), "t.csv:4:6: scene 's': "),
        (ROWS.replace("2, ", "1, "), "t.csv:4:1: scene 's': the table's x has steps that are not equal: 1 m is not 2 m; take heights"),
        ("x, y, value\n0, 0, 1\n0, 1, 2\n", "t.csv:1:1: scene 's': the table of heights has 1 of x; a surface needs two places"),
        ("x, y, value\n0, 0, 1\n1, 0, 2\n", "t.csv:1:4: scene 's': the table of heights has 1 of y"),
        ("x, y, z\n0, 0, 1\n0, 1, 2\n", "t.csv:1:7: scene 's': road.surface.table.z: must be 'x', 'y' or 'value', not 'z'"),
        (ROWS.replace("[mm]", "[kg]"), "t.csv:"),
        ("x, y, value\n", "t.csv:1:1: scene 's': the table has no rows"),
    ],
)  # fmt: skip
def test_faults_of_tables(tmp_path: Path, table: str, problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        read(tmp_path, "{surface: {table: {file: t.csv}}}", table)
    assert problem in str(caught.value)


@pytest.mark.parametrize(
    ("road", "problem"),
    [
        ("{contact: disc, surface: {iso8608: C}}", "a disc rolls over profiles alone"),
        ("{surface: {iso8608: F}}", "iso8608"),
        ("{surface: {iso8608: C, seed: -1}}", "seed"),
        ("{surface: {iso8608: C, width: 0}}", "width must be greater than zero"),
        ("{surface: {}}", "needs {table: {file: road.csv}} or {iso8608: class, seed: number}"),
        ("{friction: [{x: [2, 1], y: [0, 1], value: 1}]}", "the patch ends along x where it begins, or before; write x: [smaller, larger]"),
        ("{friction: [{x: [1, 2], y: [0, 1], value: 0}]}", "value must be greater than zero"),
        ("{friction: [{x: [1, 2], y: [0, 1], value: 1, edge: 0}]}", "edge must be greater than zero"),
        ("{friction: [{x: [1, 2, 3], y: [0, 1], value: 1}]}", "x"),
        ("{surface: {table: {x: [0, 1], y: [0, 1], value: [[0, 1], [0]]}}}", "the table has 2 of x and 2 of y, and needs as many rows"),
        ("{surface: {table: {x: [0, 1], y: [0, 1], value: [[0, [1]], [0, 1]]}}}", "road.surface.table.value needs a number"),
        ("{surface: {table: {x: [0, 1], y: [0, 1]}}}", "the table of heights has no value"),
    ],
)  # fmt: skip
def test_faults_of_roads(tmp_path: Path, road: str, problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        read(tmp_path, road)
    assert problem in str(caught.value)
    assert "m.yaml:12:" in str(caught.value)
