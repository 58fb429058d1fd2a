"""Output of commands: results and errors first, notes about the model, the progress of long work."""

from __future__ import annotations

import io
from pathlib import Path
from threading import Event
from time import monotonic, sleep

import pytest
from click.testing import CliRunner
from rich.console import Console

from cutjoint.cli import main
from cutjoint.commands import options
from cutjoint.model.read import read_model, read_model_text
from cutjoint.report.tables import loop_table, real_time
from cutjoint.toolchain.progress import Watch
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp

PRESS = MODELS / "press.yaml"
ARM = """\
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {twice: 2*long, long: 1, gain: 2, lever: {value: 3, binding: param}, drive: {value: 0, binding: input}, spare: 5}
bodies: {bob: {mass: lever, centre_of_mass: [twice, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {push: {kind: joint_force, joint: pin, law: "drive*gain"}}
outputs: [bob.x]
scenes: {swing: {end: 1, inputs: {drive: "spare*t"}}}
"""


def said_by_check(text: str, folder: Path) -> str:
    file = folder / "model.yaml"
    file.write_text(text)
    result = CliRunner().invoke(main, ["check", str(file)])
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


def test_a_narrow_terminal_keeps_the_lines_of_loops() -> None:
    """A place is folded, and nothing of it is left out."""
    model = read_model_text(PRESS.read_text(), "a/model/in/a/folder.yaml")
    narrow = Console(width=60, file=io.StringIO())
    narrow.print(loop_table(build_topology(model)))
    assert isinstance(narrow.file, io.StringIO)
    said = narrow.file.getvalue()
    assert "…" not in said


@needs_cpp
def test_words_of_modes_are_explained(tmp_path: Path) -> None:
    """Words that stand above them alone: a swing without dampers, and a wheel that nothing brings back."""
    file = tmp_path / "model.yaml"
    words = dict[str, str]()
    for name, text in (("swing", ARM.replace("[twice, 0, 0]", "[0, 0, -1]")), ("wheel", ARM.replace("-9.81", "0"))):
        file.write_text(text)
        result = CliRunner().invoke(main, ["modes", str(file)])
        assert result.exit_code == 0, result.output
        words[name] = " ".join(result.output.partition("words")[2].split())
    assert words["swing"].startswith("eigenvalue real part: growth rate")
    assert "moves coordinates with amplitudes" in words["swing"]
    assert "rigid-body" not in words["swing"]
    assert words["wheel"] == "rigid-body modes motions without restoring force, each by its leading coordinate"


def test_parameters_that_nothing_uses_are_named() -> None:
    assert read_model_text(ARM, "arm.yaml").notes == ()
    changed = ARM.replace("*gain", "").replace("[twice, 0, 0]", "[1, 0, 0]").replace('"spare*t"', "t")
    notes = read_model_text(changed, "arm.yaml").notes
    assert [note.rpartition(" ")[2] for note in notes] == ["'twice'", "'gain'", "'spare'"]
    assert notes[0] == "arm.yaml:4:14: nothing uses the parameter 'twice'"


def test_contacts_of_wheels_that_are_off_are_said_to_be_zero() -> None:
    wheel = "tread: {kind: wheel, body: bob, centre: [0, 0, 1], axis: y, radius: 1, force: [0, 0, 1]}"
    text = ARM.replace('"drive*gain"}}', f'"drive*gain"}}, {wheel}}}').replace("[bob.x]", "[bob.x, tread.deflection, tread.Fz, push.force]")
    assert read_model_text(text, "arm.yaml").notes == ()
    scene = "scenes: {still: {end: 1, switches: {tread: false, push: false}}, "
    notes = read_model_text(text.replace("scenes: {", scene), "arm.yaml").notes
    zero = "scene 'still' has 0 for tread.deflection, since the force is switched off; give it a law of 0 instead"
    assert notes == (f"arm.yaml:9:10: {zero}",)


@pytest.mark.parametrize("file", sorted(MODELS.glob("*.yaml")), ids=lambda file: file.stem)
def test_our_models_use_their_parameters_and_the_words_of_this_version(file: Path) -> None:
    assert read_model(file).notes == ()


def test_a_mechanism_that_cannot_move_is_reported_from_one_that_guides_drive(tmp_path: Path) -> None:
    free = ARM
    assert "degrees of freedom 1 words" in said_by_check(free, tmp_path)
    rigid = said_by_check(free.replace("kind: revolute", "kind: fixed").replace(", axis: [0, 1, 0]", "").replace(
        "forces: {push: {kind: joint_force, joint: pin, law: \"drive*gain\"}}", ""), tmp_path)  # fmt: skip
    assert "motion none: loops and joints leave no degree of freedom, and no joint is guided" in rigid
    assert "note" in rigid
    driven = said_by_check(free.replace("axis: [0, 1, 0]", "axis: [0, 1, 0], guide: t"), tmp_path)
    assert "motion kinematic: guides prescribe all degrees of freedom" in driven


def test_check_explains_its_words(tmp_path: Path) -> None:
    alone, with_loops = said_by_check(ARM, tmp_path), said_by_check(PRESS.read_text(), tmp_path)
    assert "isomorphic parts that differ in numbers only" in alone
    assert "counted once: parts" not in alone
    assert "counted once: parts evaluated in lanes count as one" in with_loops


@needs_cpp
def test_a_run_says_its_file_and_errors_first_and_the_rest_by_request(tmp_path: Path) -> None:
    words = ["simulate", str(PRESS), "--end", "0.1", "--implementation", "interpreted", "--out", str(tmp_path / "run.csv")]
    short, long = (CliRunner().invoke(main, [*words, *more]) for more in ([], ["--verbose"]))
    lines = [line for line in short.stdout.splitlines() if line.strip()]
    assert lines[0] == f"results: {tmp_path / 'run.csv'}, 4 outputs, 11 rows"
    assert lines[1] == "error estimate"
    assert lines[-1].startswith("scene turn, method recursive: ")
    assert lines[-1].endswith("; --verbose prints more")
    assert len(lines) < 12
    assert long.stdout.splitlines()[0] == lines[0]
    assert all(word in long.stdout for word in ("degrees of freedom", "evaluations each", "work and energy"))
    assert not any(word in short.stdout for word in ("degrees of freedom", "evaluations each", "work and energy"))


@needs_cpp
def test_a_run_without_rows_has_no_pictures(tmp_path: Path) -> None:
    file, plots = tmp_path / "falls.yaml", tmp_path / "plots"
    file.write_text(ARM.replace("axis: [0, 1, 0]", "axis: [1, 0, 0]").replace("end: 1,", "end: 1, pose: equilibrium,").replace(
        "kind: revolute", "kind: prismatic").replace("axis: [1, 0, 0]", "axis: [0, 0, 1]"))  # fmt: skip
    words = ["simulate", str(file), "--implementation", "interpreted", "--out", str(tmp_path / "run.csv"), "--plots", str(plots)]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 1
    assert "no static equilibrium was found" in done.output
    assert "plots:" not in done.output
    assert not plots.exists() or not any(plots.iterdir())


def test_slow_runs_have_their_share_of_real_time() -> None:
    assert [real_time(12.0, seconds) for seconds in (29.2, 2.0, 0.01, 0.0)] == [
        "0.41 times real time", "6 times real time", "1200 times real time", "-"
    ]  # fmt: skip


def test_work_says_off_a_terminal_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    said, written = Event(), io.StringIO()

    class Listening(options._PlainConsole):
        def print(self, *objects: object, **how: object) -> None:
            super().print(*objects, **how)
            said.set()

    monkeypatch.setattr(options, "err", Listening(file=written, width=100))
    monkeypatch.setattr(options, "EVERY", 1e-3)
    with options.progress_bar("running swing") as progress:
        progress(0.25)
        assert said.wait(60)
        said.clear()
        assert said.wait(60)
    assert "running swing: 25 %, 0 s so far" in written.getvalue()


def test_a_first_model_is_said_to_compile_what_all_models_share(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    written = io.StringIO()
    monkeypatch.setattr(options, "err", Console(file=written, width=200))
    monkeypatch.setattr(options, "EVERY", 0.05)
    driver, own = "driver/CMakeFiles/driver.dir/recursive.cpp.o", "CMakeFiles/start.dir/start.cpp.o"
    watch = Watch(tmp_path, ["g++"], [driver, own])
    with options.progress_bar("compiling swing"):
        watch.notify()
        _wait_for("compiling swing and, once, the parts common to all models: 0 %", written)
        watch.finish(driver)
        _wait_for("compiling swing: 50 %", written)


def _wait_for(words: str, written: io.StringIO) -> None:
    end = monotonic() + 60
    while words not in written.getvalue():
        assert monotonic() < end, written.getvalue()
        sleep(0.01)


def test_a_terminal_has_a_bar_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(options, "err", Console(file=written, force_terminal=True, width=100))
    monkeypatch.setattr(options, "EVERY", 1e-3)
    with options.progress_bar("running swing") as progress:
        progress(0.25)
    assert "so far" not in written.getvalue()
