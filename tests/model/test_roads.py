"""Surfaces and patches of roads in model files, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model
from cutjoint.model.records import HeightTable, Road
from cutjoint.run.road_field import surface_of

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


# OpenCRG

#: Three channels of the reference line and four long sections, NaN where a channel has none.
HEAD = """$CT
a road, 2.0 m wide
$
$ROAD_CRG                                                    ! the line
REFERENCE_LINE_START_U   = 10.0
reference_line_increment = 0.5
long_section_v_right     = -0.75
long_section_v_left      = 0.75
reference_line_start_z   = 3.0
LINE
$
BLOCKS$KD_DEFINITION
#:FORMAT
U:reference line u,m,10.0,0.5
D:reference line phi,rad
D:reference line slope,m/m
D:reference line banking,m/m
D:long section 1,m
D:long section 2,m
D:long section 3,m
D:long section 4,m
$
"""

GRID = np.random.default_rng(7).normal(0, 0.02, (9, 4)).round(5)
SLOPES = np.array([np.nan, 0.02, 0.03, -0.01, 0, 0.04, 0.01, -0.02, 0.03])
BANKS = np.array([0, 0.01, 0.02, 0.02, 0.03, 0.01, 0, -0.02, -0.01])


def crg(
    folder: Path, form: str, *, blocks: str = "", line: str = "", heading: Any = 0.6, grid: np.ndarray = GRID, old: str = "", new: str = ""
) -> Road:  # fmt: skip
    """The road of a file that is written here."""
    records = np.column_stack([np.where(np.arange(9) == 0, np.nan, heading), SLOPES, BANKS, grid])
    text = HEAD.replace("FORMAT", form).replace("BLOCKS", blocks).replace("LINE\n", line).replace(old, new) + "$" * 72 + "\n"
    if form[0] == "K":
        kind = np.dtype(">f4" if form == "KRBI" else ">f8")
        data = records.astype(kind).tobytes()
        content = text.encode() + data + np.full(-len(data) % 80 // kind.itemsize, np.nan, dtype=kind).tobytes()
    else:
        size = 10 if form == "LRFI" else 20
        cells = [[("*" * size if np.isnan(x) else f"{x:{size}.6f}") for x in record] for record in records]
        each = 80 // size
        rows = ["".join(record[i : i + each]) for record in cells for i in range(0, len(record), each)]
        content = (text + "\n".join(rows) + "\n").encode()
    (folder / "road.crg").write_bytes(content)
    return read(folder, "{surface: {table: {file: road.crg}, interpolation: linear}}")


def surface_of_file(road: Road) -> HeightTable:
    assert isinstance(road.surface, HeightTable)
    return road.surface


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_opencrg_has_grid_slope_and_banking(form: str, tmp_path: Path) -> None:
    """Without modifiers the line's begin is moved to the origin, and its heading is turned to x."""
    found = surface_of_file(crg(tmp_path, form))
    v = np.array([-0.75, -0.25, 0.25, 0.75])
    line = np.concatenate([[0], 0.5 * np.cumsum(SLOPES[1:])])
    expected = GRID + line[:, None] + BANKS[:, None] * v
    begin = np.interp(0, v, expected[0])
    assert found.start == pytest.approx((0, -0.75), abs=1e-12)
    assert found.step == pytest.approx((0.5, 0.5))
    assert found.bilinear
    assert np.array(found.heights) == pytest.approx(expected - begin, abs=1e-8 if form == "KRBI" else 1e-15)


def test_modifiers_of_opencrg_are_applied(tmp_path: Path) -> None:
    settings = {"scale_z_grid": 2, "scale_slope": 0.5, "scale_banking": 3, "scale_length": 1.5, "scale_width": 0.8}
    point = {"refpoint_u": 10.75, "refpoint_v_fraction": 0.75, "refpoint_x": 100, "refpoint_y": -5, "refpoint_z": 0.2, "refpoint_phi": 0}
    block = "$ROAD_CRG_MODS\n" + "".join(f"{key} = {value}\n" for key, value in {**settings, **point}.items()) + "$\n"
    found = surface_of_file(crg(tmp_path, "LDFI", blocks=block))
    v = np.array([-0.6, -0.2, 0.2, 0.6])
    expected = 2 * GRID + 0.75 * np.concatenate([[0], 0.5 * np.cumsum(SLOPES[1:])])[:, None] + 3 * BANKS[:, None] * v
    assert found.start == pytest.approx((99.25, -5.9))
    assert found.step == pytest.approx((0.75, 0.4))
    at = 0.75 * expected[1, 2] + 0.25 * expected[1, 3]
    assert np.array(found.heights) == pytest.approx(expected - at + 0.2, abs=1e-14)


def test_a_road_in_opencrg_stays_where_an_empty_block_of_modifiers_leaves_it(tmp_path: Path) -> None:
    found = surface_of_file(crg(tmp_path, "LDFI", blocks="$ROAD_CRG_MODS\n$\n", line="reference_line_start_x = 4\n", heading=0))
    assert found.start == pytest.approx((4, -0.75))
    assert found.heights[0][1] == pytest.approx(3 + GRID[0, 1])


def test_heights_that_are_missing_at_the_sides_are_those_beside_them(tmp_path: Path) -> None:
    grid = GRID.copy()
    grid[3, :2] = grid[5, 3] = np.nan
    found = np.array(surface_of_file(crg(tmp_path, "KDBI", grid=grid)).heights)
    filled = grid.copy()
    filled[3, :2], filled[5, 3] = grid[3, 2], grid[5, 2]
    assert found == pytest.approx(np.array(surface_of_file(crg(tmp_path, "KDBI", grid=filled)).heights), abs=1e-15)


@pytest.mark.parametrize(("given", "message"), [
    ({"blocks": "$ROAD_CRG_OPTS\nborder_mode_u = 4\n$\n"}, "border_mode_u = 4 is not heeded; 2 is heeded, which is its default"),
    ({"blocks": "$ROAD_CRG_OPTS\nrefline_continuation = 1\n$\n"}, "refline_continuation = 1 is not heeded"),
    ({"blocks": "$ROAD_CRG_MODS\nrefline_offset_phi = 0.5\n$\n"}, "refline_offset_phi = 0.5 is not heeded"),
    ({"blocks": "$ROAD_CRG_MODS\nrefpoint_phi = 0.5\n$\n"}, "refpoint_phi = 0.5 is not heeded"),
    ({"blocks": "$ROAD_CRG_MODS\n$\n"}, "the reference line's heading is 0.6 rad, not that of x; give the modifier refpoint_phi = 0"),
    ({"heading": np.linspace(0, 0.1, 9)}, "the reference line is curved: its heading is 0.0125 to 0.1 rad"),
    ({"blocks": "$ROAD_CRG_FILE\nother.crg\n$\n"}, "the data is in another file"),
    ({"line": "what is this\n"}, "'what is this' is no keyword with a number"),
    ({"old": "#:LDFI", "new": "#:LXFI"}, "the format of the data is 'LXFI'; it is LRFI, LDFI, KRBI or KDBI"),
    ({"old": "long section 3,m", "new": "long section 3,mm"}, "'long section 3' is in 'mm'; it is in m"),
    ({"grid": np.where(np.arange(36).reshape(9, 4) == 13, np.nan, GRID)}, "heights are missing in a cross section, not at its sides alone"),
])  # fmt: skip
def test_what_is_not_heeded_of_opencrg_is_told(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        crg(tmp_path, "LDFI", **given)
    assert message in str(caught.value)
    assert "road.crg" in str(caught.value)


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_opencrg_beside_another_reader(form: str, tmp_path: Path) -> None:
    """Heights at 1e5 places, also beyond the edges, and normals: 1e-12 m and 1e-10."""
    peer = pytest.importorskip("pyopencrg")
    field = surface_of(crg(tmp_path, form))
    assert field is not None
    assert field.field is not None
    random = np.random.default_rng(2)
    x, y = np.sort(random.uniform(-1, 5, 317)), np.sort(random.uniform(-1, 1, 317))
    here = field.field.over(x, y)
    there = peer.read(tmp_path / "road.crg").apply_mods()
    places = [each.ravel() for each in np.meshgrid(x, y, indexing="ij")]
    assert here.ravel() == pytest.approx(np.asarray(there.xy_to_z(*places)), abs=1e-12)
    inside = list(zip(random.uniform(0, 4, 200), random.uniform(-0.75, 0.75, 200), strict=True))
    normals = np.array([[-field.height(a, b, 1, 0), -field.height(a, b, 0, 1), 1] for a, b in inside])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert normals == pytest.approx(np.column_stack(there.xy_to_normal(*np.transpose(inside))), abs=1e-10)
