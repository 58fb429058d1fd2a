"""Surfaces and patches of roads in model files, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model
from cutjoint.model.records import CurvedGrid, HeightTable, Road
from cutjoint.run.road_field import CurvedField, surface_of

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
    folder: Path, form: str, *, blocks: str = "", line: str = "", heading: Any = 0.6, grid: np.ndarray = GRID, slopes: np.ndarray = SLOPES,
    banks: np.ndarray = BANKS, old: str = "", new: str = "", interpolation: str = "linear", ruler: str = "$" * 72,
) -> Road:  # fmt: skip
    """The road of a file that is written here."""
    records = np.column_stack([np.where(np.arange(len(grid)) == 0, np.nan, heading), slopes, banks, grid])
    text = HEAD.replace("FORMAT", form).replace("BLOCKS", blocks).replace("LINE\n", line).replace(old, new) + ruler + "\n"
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
    return read(folder, f"{{surface: {{table: {{file: road.crg}}, interpolation: {interpolation}}}}}")


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


@pytest.mark.parametrize("form", ["LDFI", "KDBI"])
def test_a_ruler_with_numbers_ends_the_header_of_opencrg(form: str, tmp_path: Path) -> None:
    ruler = "".join(f"{i:$>8}" for i in range(10, 90, 10))
    assert surface_of_file(crg(tmp_path, form, ruler=ruler)) == surface_of_file(crg(tmp_path, form))


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
    ({"blocks": "$ROAD_CRG_OPTS\nborder_mode_u = 0\n$\n"}, "road.crg:12:1: scene 's': border_mode_u = 0 is not heeded; write 1, 2, 3 or 4"),
    ({"blocks": "$ROAD_CRG_OPTS\nborder_mode_w = 2\n$\n"}, "border_mode_w = 2 is not heeded; leave it out"),
    ({"blocks": "$ROAD_CRG_OPTS\nrefline_continuation = 1\n$\n"}, "leave it out: the line's ends do not meet"),
    ({"blocks": "$ROAD_CRG_OPTS\nborder_mode_u = 1\n$\n$ROAD_CRG_MODS\nrefpoint_v = 2\n$\n"},
     "the reference point is beyond the road's edges, at u = 10, v = 2"),
    ({"blocks": "$ROAD_CRG_OPTS\nborder_offset_v = 1\n$\n", "interpolation": "cubic"},
     "road.crg:12:1: scene 's': the file has border_offset_v = 1; write interpo"),
    ({"blocks": "$ROAD_CRG_MODS\nrefpoint_w = 0.5\n$\n"}, "refpoint_w = 0.5 is not heeded"),
    ({"blocks": "$ROAD_CRG_MODS\nscale_width = 0\n$\n"}, "scale_width = 0 is not heeded; write a number above zero"),
    ({"blocks": "$ROAD_CRG_MODS\n$\n", "interpolation": "cubic"},
     "the file has a line that is not along x; write interpolation: linear, as the format has it"),
    ({"heading": np.linspace(0, 0.1, 9), "interpolation": "cubic"}, "the file has a line that is not along x"),
    ({"heading": np.where(np.arange(9) == 4, np.nan, 0)}, "'reference line phi' is missing in a cross section; fill it in"),
    ({"heading": np.where(np.arange(9) > 4, 2.0, 0)}, "the line stands still, or turns by a right angle or more from one cross section"),
    ({"blocks": "$ROAD_CRG_MODS\ngrid_nan_mode = 0\n$\n", "grid": np.where(np.arange(36).reshape(9, 4) == 12, np.nan, GRID)},
     "grid_nan_mode = 0 is not heeded; write 1 or 2"),
    ({"blocks": "$ROAD_CRG_FILE\nother.crg\n$\n"}, "the data is in another file"),
    *(({"old": "increment = 0.5", "new": f"increment = {step}"}, f"road.crg:6:1: scene 's': reference_line_increment is {step}; write 1e")
      for step in (0, -1, 1e-300)),
    ({"line": "reference_line_end_u = 4\n", "old": "reference_line_increment = 0.5\n"}, "reference_line_increment is -0.75; write 1e-06"),
    ({"line": "long_section_v_increment = 0\n"}, "road.crg:10:1: scene 's': long_section_v_increment is 0"),
    ({"old": "increment = 0.5", "new": "increment = 1e999"}, "road.crg:6:1: scene 's': reference_line_increment = 1e999 is very large"),
    ({"old": "10.0,0.5", "new": "10.0,1e999"}, "'U:reference line u,m,10.0,1e999' has no start and increment"),
    ({"old": "long section 3,m", "new": "long section \u00b2,m"}, "has no place; write long section 1"),
    ({"grid": np.full((9, 4), np.inf)}, "the data has numbers that are not finite"),
    ({"grid": GRID[:0], "slopes": SLOPES[:0], "banks": BANKS[:0]}, "the file has less than two cross sections"),
    ({"line": "what is this\n"}, "'what is this' is no keyword with a number"),
    ({"old": "#:LDFI", "new": "#:LXFI"}, "the format of the data is 'LXFI'; it is LRFI, LDFI, KRBI or KDBI"),
    ({"old": "long section 3,m", "new": "long section 3,mm"}, "'long section 3' is in 'mm'; it is in m"),
    ({"grid": np.where(np.arange(36).reshape(9, 4) == 13, np.nan, GRID)}, "heights are missing in a cross section, not at its sides alone"),
])  # fmt: skip
def test_what_is_not_heeded_of_opencrg_is_reported(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        crg(tmp_path, "LDFI", **given)
    assert message in str(caught.value)
    assert "road.crg" in str(caught.value)


def test_a_straight_line_of_opencrg_keeps_its_heading_beyond_both_ends(tmp_path: Path) -> None:
    """With a heading at its start alone and slopes across: heights follow the distance to the left, as they do on the line."""
    text = """$ROAD_CRG
reference_line_increment = 10
reference_line_start_phi = 0.3
long_section_v_right = -40
long_section_v_increment = 40
$
$ROAD_CRG_MODS
$
$KD_DEFINITION
#:LRFI
D:long section 1,m
D:long section 2,m
D:long section 3,m
$
$$$$
  -4.00000   0.00000   4.00000
  -4.00000   0.00000   4.00000
  -4.00000   0.00000   4.00000
"""
    (tmp_path / "road.crg").write_text(text)
    surface = surface_of(read(tmp_path, "{surface: {table: {file: road.crg}, interpolation: linear}}"))
    assert surface is not None
    assert isinstance(surface.field, CurvedField)
    u, v = np.array([-50, 10, 30, 90]), np.array([-20, 12, 5, 20])
    x, y = u * np.cos(0.3) - v * np.sin(0.3), u * np.sin(0.3) + v * np.cos(0.3)
    assert surface.field.at(x, y) == pytest.approx(0.1 * v, abs=1e-9)


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_opencrg_beside_another_reader(form: str, tmp_path: Path) -> None:
    """Heights at 1e5 places, also beyond the edges, and normals: 1e-12 m and 1e-10."""
    peer = pytest.importorskip("pyopencrg")
    field = surface_of(crg(tmp_path, form))
    assert field is not None
    assert field.field is not None
    random = np.random.default_rng(2)
    x, y = np.sort(random.uniform(-1, 5, 317)), np.sort(random.uniform(-1, 1, 317))
    here = field.field.heights_on_grid(x, y)
    there = peer.read(tmp_path / "road.crg").apply_mods()
    places = [each.ravel() for each in np.meshgrid(x, y, indexing="ij")]
    assert here.ravel() == pytest.approx(np.asarray(there.xy_to_z(*places)), abs=1e-12)
    inside = list(zip(random.uniform(0, 4, 200), random.uniform(-0.75, 0.75, 200), strict=True))
    normals = np.array([[-field.height(a, b, 1, 0), -field.height(a, b, 0, 1), 1] for a, b in inside])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert normals == pytest.approx(np.column_stack(there.xy_to_normal(*np.transpose(inside))), abs=1e-10)


# Curved lines

#: Two hundred cross sections of a line that winds, half a metre apart, and of a ring with a gap.
COUNT = 200
WINDING = np.concatenate([[0.0], 0.4 + np.cumsum(0.02 * np.sin(np.arange(COUNT - 1) / 15) + 0.004)])
RING = np.concatenate([[0.0], np.linspace(0.1, 0.1 + 0.985 * 2 * np.pi, COUNT - 1)])
PLACES = np.array([-0.75, -0.25, 0.25, 0.75])
OPTIONS = "$ROAD_CRG_OPTS\nborder_mode_u = {}\nborder_mode_v = {}\nborder_offset_u = 0.3\nborder_offset_v = -0.2\n{}$\n"
SMOOTH = "border_smooth_ubeg = 4\nborder_smooth_uend = 7\n"


def curved(folder: Path, heading: np.ndarray, blocks: str = "", line: str = "") -> CurvedField:
    """A road along a line, with random heights, slopes and banking."""
    random = np.random.default_rng(5)
    grid, slopes, banks = random.normal(0, 0.02, (COUNT, 4)), random.normal(0, 0.02, COUNT), random.normal(0, 0.01, COUNT)
    road = crg(folder, "KDBI", heading=heading, grid=grid, slopes=slopes, banks=banks, blocks=blocks, line=line)
    assert isinstance(road.surface, CurvedGrid)
    surface = surface_of(road)
    assert surface is not None
    assert isinstance(surface.field, CurvedField)
    return surface.field


def test_cross_sections_of_a_curved_line_halve_its_corners(tmp_path: Path) -> None:
    """Of a line with equal pieces: places by complex numbers, heights at all places of the grid, and halfway between them their means."""
    field = curved(tmp_path, WINDING, line="reference_line_start_x = 3\n", blocks="$ROAD_CRG_MODS\nrefline_offset_y = 2\n$\n")
    x, y, z, banking = np.array(field.grid.sections).T
    line = 3 + 2j + np.concatenate([[0], np.cumsum(0.5 * np.exp(1j * WINDING[1:]))])
    assert x + 1j * y == pytest.approx(line, abs=1e-12)
    middle, half = (WINDING[1:-1] + WINDING[2:]) / 2, np.diff(WINDING[1:]) / 2
    normals = 1j * np.concatenate([[np.exp(1j * WINDING[1])], np.exp(1j * middle) / np.cos(half), [np.exp(1j * WINDING[-1])]])
    places = line[:, None] + normals[:, None] * PLACES
    heights = np.array(field.grid.heights) + z[:, None] + banking[:, None] * PLACES
    assert field.at(places.real.ravel(), places.imag.ravel()) == pytest.approx(heights.ravel(), abs=1e-12)
    between = (places[1:] + places[:-1]) / 2
    assert field.at(between.real.ravel(), between.imag.ravel()) == pytest.approx((heights[1:] + heights[:-1]).ravel() / 2, abs=1e-12)


@pytest.mark.parametrize("modes", ["2, 2", "1, 3", "4, 2"])
def test_slopes_of_a_curved_road_are_those_of_its_heights(modes: str, tmp_path: Path) -> None:
    """By differences within cells; the second ones too."""
    field, h = curved(tmp_path, WINDING, OPTIONS.format(*modes.split(", "), SMOOTH)), 1e-6
    random = np.random.default_rng(6)
    x, y, *_ = np.array(field.grid.sections).T
    k, way = random.integers(0, COUNT, 400), random.normal(0, 0.6, (2, 400))
    x, y = x[k] + way[0], y[k] + way[1]
    for i, j in ((0, 0), (1, 0), (0, 1)):
        for over, (dx, dy) in (((i + 1, j), (h, 0)), ((i, j + 1), (0, h))):
            found = (field.at(x + dx, y + dy, i, j) - field.at(x - dx, y - dy, i, j)) / (2 * h)
            far = np.abs(found - field.at(x, y, *over)) > 1e-6
            assert far.sum() <= 8  # those at lines of the grid


MODIFIERS = """$ROAD_CRG_MODS
scale_z_grid = 2
scale_slope = 0.5
scale_banking = 3
scale_length = 1.5
scale_width = 0.8
scale_curvature = 0.7
refpoint_u = 40.3
refpoint_v = 0.3
refpoint_x = 5
refpoint_y = -3
refpoint_z = 0.2
refpoint_phi = 0.7
$
"""
OFFSETS = """$ROAD_CRG_MODS
refline_offset_x = 3
refline_offset_y = -2
refline_offset_z = 0.3
refline_offset_phi = 0.4
refline_rotcenter_x = 2
$
"""
BORDERS = [(1, 2), (2, 1), (3, 4), (4, 3), (2, 2), (1, 1)]
CASES = [
    *(pytest.param(WINDING, OPTIONS.format(u, v, SMOOTH), "", id=f"borders {u} and {v}") for u, v in BORDERS),
    pytest.param(WINDING, "", "reference_line_end_x = 40\nreference_line_end_y = 80\nreference_line_end_z = 2.5\n", id="ends"),
    pytest.param(RING, "$ROAD_CRG_OPTS\nrefline_continuation = 1\n$\n", "", id="closed"),
    pytest.param(WINDING, MODIFIERS, "", id="reference point"),
    pytest.param(WINDING, OFFSETS, "reference_line_start_y = 7\n", id="offsets"),
]


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(("heading", "blocks", "line"), CASES)
def test_curved_roads_beside_another_reader(heading: np.ndarray, blocks: str, line: str, tmp_path: Path) -> None:
    """Heights at 1e5 places on the road, beyond its sides and its ends, to 1e-12 m, and normals to 1e-10."""
    peer = pytest.importorskip("pyopencrg")
    field, there, random = curved(tmp_path, heading, blocks, line), peer.read(tmp_path / "road.crg").apply_mods(), np.random.default_rng(2)
    reach = 1.5 if "scale" in blocks else 1.0
    places = np.array(there.uv_to_xy(10 + reach * random.uniform(-3, 0.5 * COUNT + 3, 100_000), random.uniform(-2, 2, 100_000)))
    assert np.abs(field.at(*places) - there.xy_to_z(*places)).max() < 1e-12
    slopes = np.array([-field.at(*places, 1, 0), -field.at(*places, 0, 1), np.ones(100_000)])
    assert np.abs(slopes / np.linalg.norm(slopes, axis=0) - there.xy_to_normal(*places)).max() < 1e-10
