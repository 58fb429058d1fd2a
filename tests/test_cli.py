"""The command line as a user meets it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result
from jsonschema import Draft202012Validator

from cutjoint import entry
from cutjoint.cli import main
from cutjoint.commands.renamed import rename_arguments
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.mechanisms.gears import TEXT as GEARED

FOUR_BAR, ILTIS = str(MODELS / "four_bar.yaml"), str(MODELS / "iltis.yaml")

#: A block on a spring.
SLIDE = """
cutjoint: 1
name: slide
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {spring: {kind: joint_force, joint: rail, law: 2 - 4*position}}
outputs: [block.x]
scenes: {still: {end: 0.1}, moved: {end: 0.1, positions: {rail.displacement: 0.5}}}
"""


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_check_prints_the_counts() -> None:
    result = call("check", ILTIS)
    assert result.exit_code == 0, result.output
    words = " ".join(result.output.split())
    assert "coordinates 42 relative cut-joint equations 36, rank 32" in words
    assert "degrees of freedom 10" in words


@needs_cpp
def test_earlier_words_of_options_work_and_the_new_ones_are_reported(tmp_path: Path) -> None:
    words = ("simulate", MODELS / "press.yaml", "--end", "0.02", "--no-error", "--integrator", "dormand-prince", "--out")
    old = call(*words, tmp_path / "old.csv", "--tolerance=1e-3")
    assert old.exit_code == 0, old.output
    assert "simulate --tolerance is now --solver-tolerance" in old.output
    assert call(*words, tmp_path / "new.csv", "--solver-tolerance", "1e-3").exit_code == 0
    assert (tmp_path / "old.csv").read_bytes() == (tmp_path / "new.csv").read_bytes()


@pytest.mark.parametrize("words", [("--integrator", "sdirk4"), ("--integrator=sdirk4",)])
def test_integrators_of_earlier_versions_are_reported(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert rename_arguments(["simulate", "a.yaml", *words, "--out", "sdirk4"]) == [
        "simulate", "a.yaml", *(word.replace("sdirk4", "radau5") for word in words), "--out", "sdirk4",
    ]  # fmt: skip
    assert capsys.readouterr().err == "simulate --integrator sdirk4 is now radau5\n"


def test_check_names_gears_that_follow_from_others(tmp_path: Path) -> None:
    file = tmp_path / "gears.yaml"
    again = "  back: {joints: [pinion, rack], ratio: 10 rad/m}\noutputs:"
    file.write_text(GEARED.replace("outputs:", again, 1))
    result = call("check", file)
    assert result.exit_code == 0, result.output
    words = " ".join(result.output.split())
    assert "equations of cut joints and gears 7, rank 6" in words
    assert "redundant equations of cut joints and gears cut joint or gear line equations redundant back" in words
    assert "ratio (or one of mesh.ratio) in every pose" in words


@needs_cpp
def test_simulate_writes_a_table_and_its_units(tmp_path: Path) -> None:
    out = tmp_path / "not" / "there" / "yet" / "run.csv"
    result = call("simulate", FOUR_BAR, "--out", out, "--end", "0.5", "--plots", tmp_path / "plots")
    assert result.exit_code == 0, result.output
    header, first = out.read_text().splitlines()[:2]
    assert header == "t,tip.x,tip.y,tip.vx,tip.vy,crank_0.pin.angle,crank_0.pin.angle_rate"
    assert [float(x) for x in first.split(",")] == [0, 0, 1, 1, 0, 0, -1]
    units = json.loads(out.with_suffix(".units.json").read_text())
    assert units == dict(zip(header.split(","), ["s", "m", "m", "m/s", "m/s", "rad", "rad/s"], strict=True))
    assert np.loadtxt(out, delimiter=",", skiprows=1).shape == (26, 7)
    assert sorted(p.name for p in (tmp_path / "plots").iterdir()) == ["angle.png", "angular_velocity.png", "position.png", "velocity.png"]


@needs_cpp
def test_simulate_without_a_file_prints_a_summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("slide.yaml").write_text(SLIDE)
    result = call("simulate", "slide.yaml", "--scene", "moved", "--implementation", "interpreted")
    assert result.exit_code == 0, result.output
    assert "results: 1 output, 101 rows, not written; --out FILE writes them" in result.output
    assert "converged  yes" in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["slide.yaml"]


@needs_cpp
def test_simulate_takes_a_closure(tmp_path: Path) -> None:
    run = ("simulate", FOUR_BAR, "--end", "0.5", "--closure", "proximal")
    result = call(*run, "--out", tmp_path / "run.csv", "--steps", tmp_path / "steps.csv")
    assert result.exit_code == 0, result.output
    assert np.loadtxt(tmp_path / "steps.csv", delimiter=",", skiprows=1)[:, 2].max() < 1e-12
    result = call(*run, "--method", "augmented", "--out", tmp_path / "no.csv")
    assert result.exit_code == 1
    assert result.output.strip() == "--closure proximal: only the recursive method has one; use --method recursive"


@needs_cpp
@pytest.mark.parametrize("method", ["recursive", "classical"])
def test_compile_leaves_source_and_a_simulator(tmp_path: Path, method: str) -> None:
    result = call("compile", FOUR_BAR, "--method", method, "--out", tmp_path / "fb")
    assert result.exit_code == 0, result.output
    own = (f"four_bar{end}" for end in (".cpp", ".h", ".run", "_simulator", "_simulator.c"))
    names = {"CMakeLists.txt", "LICENSE", "README.md", "example.c", *own}
    assert names <= {p.name for p in (tmp_path / "fb").iterdir()}


@needs_cpp
def test_a_parameter_is_changed_without_compiling(tmp_path: Path) -> None:
    run = ("simulate", ILTIS, "--scene", "iavsd_equilibrium", "--end", "0.01", "--verbose")
    call(*run, "--out", tmp_path / "warm.csv")
    result = call(*run, "--set", "chassis_mass=1300", "--out", tmp_path / "heavy.csv")
    assert result.exit_code == 0, result.output
    assert "found in the cache" in result.output
    warm, heavy = (np.loadtxt(tmp_path / f"{n}.csv", delimiter=",", skiprows=1)[0] for n in ("warm", "heavy"))
    header = (tmp_path / "warm.csv").read_text().splitlines()[0].split(",")
    loads = [i for i, name in enumerate(header) if name.endswith(".Fz")]
    assert (heavy[loads].sum() - warm[loads].sum()) == pytest.approx(40 * 9.81, rel=1e-3)


@needs_cpp
@pytest.mark.parametrize("command", ["equilibrium", "modes"])
def test_numbers_are_tunable_for_states_too(command: str) -> None:
    words = (command, MODELS / "press.yaml", "--tunable", "spring.*", "--tunable", "C.*")
    plain, drawn = call(*words), call(*words, "--set", "C.x=0.805")
    assert (plain.exit_code, drawn.exit_code) == (0, 0), plain.output + drawn.output
    assert plain.output == call(command, MODELS / "press.yaml").output
    assert plain.output != drawn.output


@pytest.mark.parametrize("words", [["check"], ["explain"], ["view", "--out", "view.html"]], ids=lambda words: words[0])
def test_numbers_are_tunable_by_commands_that_draw_and_explain(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    command, *more = words
    assert call(command, MODELS / "pendulum.yaml", *more, "--tunable", "*.mass").exit_code == 0
    wrong = call(command, MODELS / "pendulum.yaml", *more, "--tunable", "nothing.*")
    assert wrong.exit_code == 1
    assert "nothing.*" in wrong.output


@needs_cpp
def test_equilibrium_prints_every_force() -> None:
    result = call("equilibrium", ILTIS)
    assert result.exit_code == 0, result.output
    for element in ("front_left.shock", "rear_right.leaf", "front_right.tyre", "rear_left.leaf_axial"):
        assert element in result.output
    assert "-1408.5" in result.output


@needs_cpp
def test_equilibrium_says_which_forces_hold_positions(tmp_path: Path) -> None:
    """2 kg at 0.5 m pull with 9.81 N m about y, of which a drive takes 2 N m; what nothing pulls has no force."""
    path = tmp_path / "held.yaml"
    path.write_text(
        "cutjoint: 1\nname: held\ngravity: [0, 0, -9.81]\n"
        "bodies: {arm: {mass: 2, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}}\n"
        "joints: {hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}\n"
        "scenes: {rest: {end: 1, positions: {hinge.angle: 0}}}\n"
    )
    assert "locked at the start by: hinge.angle -9.81 N*m, released at t = 0\n" in call("equilibrium", path).output
    text = path.read_text()
    path.write_text(text + "forces: {drive: {kind: joint_force, joint: hinge, law: -2}}\n")
    assert "locked at the start by: hinge.angle -7.81 N*m, released" in call("equilibrium", path).output
    path.write_text(text.replace("angle: 0}", "angle: 0}, near: [hinge.angle]"))
    assert "held at" not in call("equilibrium", path).output
    assert "stable: no small disturbance of the static equilibrium grows\n" in call("equilibrium", path, "--stability").output
    path.write_text(text.replace("-9.81", "0"))
    assert "held at" not in call("equilibrium", path).output


@needs_cpp
def test_equilibrium_says_what_has_no_value_there(tmp_path: Path) -> None:
    path = tmp_path / "slide.yaml"
    path.write_text(SLIDE.replace("outputs:", "signals: {side: rail.displacement_rate/abs(rail.displacement_rate)}\noutputs:"))
    result = call("equilibrium", path, "--scene", "still")
    assert result.exit_code == 0, result.output
    assert ["side", "value", "undefined"] in [line.split() for line in result.output.splitlines()]


@needs_cpp
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulate", ILTIS, "--out", "x.csv"), "name a scene; the model has iavsd_equilibrium, "),
        (("simulate", ILTIS, "--scene", "simul9", "--out", "x.csv"), "no scene 'simul9'; the model has iavsd_equilibrium, "),
        (("simulate", FOUR_BAR, "--set", "mass=3", "--out", "x.csv"), "model 'four_bar' has no parameter 'mass'; it has none"),
        (("simulate", FOUR_BAR, "--set", "mass", "--out", "x.csv"), "--set mass: write NAME=NUMBER"),
    ],
)  # fmt: skip
def test_wrong_requests_end_with_one_clear_line(arguments: tuple[str, ...], message: str) -> None:
    result = call(*arguments)
    assert result.exit_code == 1
    assert message in result.output
    assert "Traceback" not in result.output


@needs_cpp
def test_a_run_that_fails_leaves_its_rows_and_says_where(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    result = call("simulate", ILTIS, "--scene", "simul1s", "--dt", "0.0075", "--out", out)
    assert result.exit_code == 1
    assert "did not converge in 100 iterations at t = 4.0" in result.output
    assert "tried up to" in result.output
    assert "try: method" not in result.output
    line = next(i for i, x in enumerate((MODELS / "iltis.yaml").read_text().splitlines(), 1) if "arm_hinge: {" in x)
    assert f"iltis.yaml:{line}:" in result.output
    assert not out.exists()
    assert np.loadtxt(tmp_path / "run.partial.csv", delimiter=",", skiprows=1)[-1, 0] == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize(
    ("options", "kept", "files"),
    [((), "model.schema.json", "models/*.yaml"), (("--study",), "study.schema.json", "examples/axle/study.yaml")],
)
def test_schema_prints_what_the_docs_keep(options: tuple[str, ...], kept: str, files: str) -> None:
    """And what another reader of schemas finds right files to keep, and an unknown field not."""
    said = call("schema", *options).output
    assert said == (ROOT / "docs" / kept).read_text(encoding="utf-8")
    reader = Draft202012Validator(json.loads(said))
    for path in ROOT.glob(files):
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert [error.message for error in reader.iter_errors(document)] == []
        assert not reader.is_valid({**document, "modell": 1})


@needs_cpp
@pytest.mark.parametrize("command", ["check", "equilibrium", "explain", "modes"])
def test_the_first_of_several_scenes_is_reported(command: str, tmp_path: Path) -> None:
    """Commands that ask for a state take the first scene; those that run one, and modes of a motion, want its name."""
    model = tmp_path / "slide.yaml"
    model.write_text(SLIDE, encoding="utf-8")
    result = call(command, model)
    assert result.exit_code == 0, result.output
    assert result.stderr.strip() == "scene still, the first of 2; choose another with --scene"
    named = call(command, model, "--scene", "still")
    assert named.stdout == result.stdout
    assert named.stderr.strip() == ""
    assert "Default: the first" in " ".join(call(command, "--help").output.split())
    wrong = call(command, model, "--scene", "there")
    assert wrong.exit_code == 1
    assert wrong.output.strip() == f"{model}: no scene 'there'; the model has still, moved"


def test_modes_of_a_motion_want_a_scene_by_name(tmp_path: Path) -> None:
    (tmp_path / "slide.yaml").write_text(SLIDE, encoding="utf-8")
    result = call("modes", tmp_path / "slide.yaml", "--at", "0.1")
    assert result.exit_code == 1
    assert "name a scene; the model has still, moved" in result.output


def test_the_command_uses_one_thread_for_linear_algebra_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.cli.main", lambda: None)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "4")
    entry.main()
    assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["MKL_NUM_THREADS"]) == ("1", "4")
