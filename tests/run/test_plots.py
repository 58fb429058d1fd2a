"""Plots as files: those that a scene names, one a dimension otherwise, other runs beside."""

from __future__ import annotations

from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from cutjoint.cli import main
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Plot
from cutjoint.package.errors import RunError
from cutjoint.report import plots
from cutjoint.report.plots import plot_run, read_others
from cutjoint.run.display import in_units, unused_units
from cutjoint.run.figures import Line, draw
from cutjoint.run.results import Columns, Trajectory
from tests.conftest import needs_cpp

TEXT = """\
cutjoint: 1
name: swing
gravity: [0, 0, -9.81]
bodies: {bob: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
outputs: [bob.x, bob.z, bob.vx]
scenes:
  fall: {end: 0.2, output_step: 0.05, plots: {path: {x: bob.x, y: [bob.z]}, both: {y: [bob.x, bob.vx]}}}
  again: {end: 0.2, output_step: 0.05}
"""
T = np.array([0.0, 0.5, 1.0])
RUN = Trajectory(
    t=T, columns=Columns({"bob.x": T**2, "bob.z": -T, "bob.vx": 2 * T}), units=Columns({"bob.x": "m", "bob.z": "m", "bob.vx": "m/s"}),
    steps=2, evaluations=4, seconds=0.0, undetermined=(), failure=None,
)  # fmt: skip
OTHERS = {"stiff": {"t": T[:2], "bob.x": T[:2], "bob.z": T[:2] - 3}}


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    figures: list[Figure] = []
    write = plots.as_png

    def watched(figure: Figure) -> bytes:
        figures.append(figure)
        return write(figure)

    monkeypatch.setattr(plots, "as_png", watched)
    return figures


def lines(figure: Figure) -> list[list[tuple[object, list[float], list[float]]]]:
    return [[(line.get_label(), list(line.get_xdata()), list(line.get_ydata())) for line in axes.get_lines()] for axes in figure.axes]


def test_a_named_plot_has_y_over_x_of_all_runs_that_have_both(drawn: list[Figure], tmp_path: Path) -> None:
    chosen = [Plot(name="path", x="bob.x", y=("bob.z",)), Plot(name="both", x="t", y=("bob.x", "bob.vx"))]
    assert plot_run(RUN, "swing, fall", tmp_path, chosen, OTHERS) == [tmp_path / "path.png", tmp_path / "both.png"]
    assert lines(drawn[0]) == [[("bob.z", list(T**2), list(-T)), ("bob.z, stiff", list(T[:2]), list(T[:2] - 3))]]
    assert (drawn[0].axes[0].get_xlabel(), drawn[0].axes[0].get_ylabel()) == ("bob.x [m]", "[m]")
    assert [[label for label, *_ in panel] for panel in lines(drawn[1])] == [["bob.x", "bob.x, stiff"], ["bob.vx"]]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in tmp_path.iterdir())


def test_without_names_there_is_one_for_each_dimension(drawn: list[Figure], tmp_path: Path) -> None:
    assert [path.name for path in plot_run(RUN, "swing", tmp_path, beside=OTHERS)] == ["position.png", "velocity.png"]
    assert [[label for label, *_ in panel] for panel in lines(drawn[0])] == [["bob", "bob, stiff"], ["bob", "bob, stiff"]]


def test_rounding_is_a_straight_line_and_not_noise() -> None:
    """The pen of a straight-line linkage stands at 0.4 m but for 1e-12 m of closed loops; a change of a micrometre is seen."""
    t = np.linspace(0.0, 1.0, 50)
    for size, seen in ((1e-12, False), (1e-6, True)):
        x = 0.4 + size * np.sin(40 * t)
        figure = draw([Line(x=x, y=t, label="pen", unit="m"), Line(x=x, y=x, label="pen", unit="mm")], x_label="x [m]")
        for low, high in (figure.axes[0].get_xlim(), figure.axes[1].get_ylim()):
            assert (high - low < 10 * size) == seen
            assert low < x.min() <= x.max() < high


@needs_cpp
def test_the_command_draws_them_when_compiled_and_from_the_cache(tmp_path: Path) -> None:
    file, folder = tmp_path / "swing.yaml", tmp_path / "plots"
    file.write_text(TEXT)

    def call(*words: object) -> str:
        result = CliRunner().invoke(main, ["simulate", str(file), "--no-error", *map(str, words)])
        assert result.exit_code == 0, result.output
        return result.output

    first = call("--scene", "again", "--out", tmp_path / "again.csv", "--plots", folder)
    assert {path.name for path in folder.iterdir()} == {"position.png", "velocity.png"}
    for name in ("one", "two"):
        said = call("--scene", "fall", "--out", tmp_path / "run.csv", "--plots", tmp_path / name, "--compare", tmp_path / "again.csv")
        assert {path.name for path in (tmp_path / name).iterdir()} == {"path.png", "both.png"}
        assert f"plots: {tmp_path / name / 'path.png'}, {tmp_path / name / 'both.png'}" in said
    assert "plots: " in first


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("y: [bob.z]", "y: [bob.q]", "8:68: scene 'fall': plots.path: the scene has no output 'bob.q'; add it to outputs; did you mean"),
        ("x: bob.x", "x: time", "plots.path: the scene has no output 'time'; add it to outputs"),
        ("y: [bob.z]", "y: []", "plots.path.y needs at least 1 item, got 0"),
        ("y: [bob.z]", "y: [bob.z], z: t", "unknown field 'z'"),
    ],
)  # fmt: skip
def test_what_is_wrong(old: str, new: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(TEXT.replace(old, new), "swing.yaml")
    assert message in str(error.value)


def test_a_file_that_is_no_table_is_named(tmp_path: Path) -> None:
    file = tmp_path / "swing.yaml"
    for content in (TEXT.encode(), b"\xff\xfe", b"t,a\n1\n", b"t,a\n1,x\n", b"stiffness\n1000\n", b""):
        file.write_bytes(content)
        with pytest.raises(RunError, match=r"--compare .*swing\.yaml: this is no table of a run"):
            read_others([file])
    words = ["simulate", str(file), "--out", "run.csv", "--compare", str(file)]
    assert "--compare: its runs are drawn in plots; add --plots FOLDER" in CliRunner().invoke(main, words).output


def test_display_units_convert_columns_of_their_quantity_alone(drawn: list[Figure], tmp_path: Path) -> None:
    """Millimetres for lengths, also of another run, km/h for speeds; a ratio is no angle, and a torque no energy."""
    columns = {"bob.x": T, "bob.vx": T, "ratio": T, "pin.torque": T, "bob.roll": T, "work": T}
    units = {"bob.x": "m", "bob.vx": "m/s", "ratio": "", "pin.torque": "N*m", "bob.roll": "rad", "work": "J"}
    values, named = in_units(columns, units, ["mm", "km/h", "deg", "kJ"])
    assert named == {"bob.x": "mm", "bob.vx": "km/h", "ratio": "", "pin.torque": "N*m", "bob.roll": "deg", "work": "kJ"}
    expected = {"bob.x": 1000, "bob.vx": 3.6, "ratio": 1, "pin.torque": 1, "bob.roll": 180 / np.pi, "work": 1e-3}
    for name, factor in expected.items():
        np.testing.assert_allclose(values[name], factor * T, rtol=4e-16)
    written = plot_run(RUN, "swing", tmp_path, beside=OTHERS, display=["mm"])
    assert [path.name for path in written] == ["position.png", "velocity.png"]
    assert lines(drawn[0])[0][1][2] == [0.0, 500.0]
    assert drawn[0].axes[0].get_ylabel() == "x [mm]"


def test_display_units_that_no_output_has_are_named() -> None:
    """A mass is no length; deg fits no ratio, and J no torque."""
    units = ["m", "m/s", "", "N*m"]
    assert unused_units(units, ["mm", "kg", "deg", "kJ"]) == ["kg", "deg", "kJ"]
    assert unused_units([*units, "rad", "kg"], ["mm", "g", "deg"]) == []


def test_yaw_in_plots_has_no_jumps_of_a_turn() -> None:
    angles = np.linspace(0, 20, 50)
    columns = {"bob.yaw": np.arctan2(np.sin(angles), np.cos(angles)), "pin.angle": 10 * T}
    values, _ = in_units(columns, dict.fromkeys(columns, "rad"), [])
    np.testing.assert_allclose(values["bob.yaw"], angles, atol=1e-14)
    np.testing.assert_array_equal(values["pin.angle"], 10 * T)


@pytest.mark.parametrize(
    ("units", "fault"),
    [(["foo"], "unknown unit 'foo'"), (["deg", "mrad"], "'deg' and 'mrad' are units of one quantity"), (["degC"], "'degC' has an offset")],
)
def test_wrong_display_units_are_refused(units: list[str], fault: str) -> None:
    with pytest.raises(RunError, match=fault):
        in_units({}, {}, units)


@needs_cpp
def test_a_model_names_its_display_units(drawn: list[Figure], tmp_path: Path) -> None:
    """Plots have them, of a prepared run too, and the option's in their place."""
    path = tmp_path / "swing.yaml"
    path.write_text(TEXT.replace("outputs:", "display: [mm, km/h]\noutputs:"), encoding="utf-8")
    assert read_model(path).display == ("mm", "km/h")
    words = ["simulate", str(path), "--scene", "again", "--no-error", "--implementation", "interpreted", "--plots", str(tmp_path)]
    labels = []
    for options in ([], [], ["--display", "cm"]):
        drawn.clear()
        done = CliRunner().invoke(main, [*words, *options])
        assert done.exit_code == 0, done.output
        labels.append({axis.get_ylabel() for figure in drawn for axis in figure.axes})
    assert labels[0] == labels[1] == {"x [mm]", "z [mm]", "vx [km/h]"}
    assert labels[2] == {"x [cm]", "z [cm]", "vx [m/s]"}


def test_wrong_display_units_of_a_model_are_errors_of_their_line() -> None:
    with pytest.raises(ModelError, match=r"swing\.yaml:6:\d+: model: display: 'mm' and 'cm' are units of one quantity"):
        read_model_text(TEXT.replace("outputs:", "display: [mm, cm]\noutputs:"), "swing.yaml")


def test_display_units_that_are_no_list_hide_no_other_fault() -> None:
    with pytest.raises(ModelError) as raised:
        read_model_text(TEXT.replace("outputs:", "display: deg\noutputs:").replace("mass: 1,", "mass: -1,"), "swing.yaml")
    assert "display" in str(raised.value)
    assert "mass" in str(raised.value)


@needs_cpp
def test_a_display_unit_without_an_output_is_said(tmp_path: Path) -> None:
    (tmp_path / "swing.yaml").write_text(TEXT, encoding="utf-8")
    words = ["simulate", "swing.yaml", "--scene", "fall", "--no-error", "--implementation", "interpreted", "--plots", "plots"]
    for unit, said in {"kg": True, "mm": False}.items():
        with chdir(tmp_path):
            done = CliRunner().invoke(main, [*words, "--display", unit])
        assert done.exit_code == 0, done.output
        assert ("--display: no output of this run has the quantity of kg" in done.output) == said


def test_display_units_without_plots_are_refused(tmp_path: Path) -> None:
    (tmp_path / "swing.yaml").write_text(TEXT, encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(tmp_path / "swing.yaml"), "--scene", "fall", "--display", "deg"])
    assert done.exit_code == 1
    assert "--display: plots and pages have these units" in done.output
