"""`method: auto` keeps its tolerance, measured by references of another make, and says so when it cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from cutjoint.cli import main
from cutjoint.compile import prepared
from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Numerics, Road, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce import choose as choose_module
from cutjoint.reduce.choose import DEARER, FULL, INACCURATE, Candidate, Choice, Search, choose, chosen_model, pairs_of, steps_of
from cutjoint.reduce.measure import distance, find_reference
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.report.tasks import choice_tables
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_default_closure
from cutjoint.run.simulation import simulate
from cutjoint.toolchain import origins
from cutjoint.toolchain.compiler import Compiler
from cutjoint_bench.exact.chain import Chain, crank_motion
from cutjoint_bench.exact.elliptic import quarter_period
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_scene
from tests.toolchain.damage import damaged_records

pytestmark = needs_cpp

PENDULUM = """\
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
bodies: {bob: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
outputs: [bob.x, bob.z]
scenes:
  swing: {end: 4, output_step: 0.02, method: auto, accuracy: 1 mm}
"""


def auto(name: str, tolerance: float, end: float) -> tuple[Model, Scene]:
    model = read_model(MODELS / f"{name}.yaml")
    (scene,) = model.scenes.values()
    return model, replace(scene, method="auto", accuracy=tolerance, end=end)


def picked_run(choice: Choice) -> Trajectory:
    reduced, settings = chosen_model(choice)
    run = simulate(compile_scene(reduced, settings, CompileOptions(method=choice.chosen.method)))
    assert run.failure is None
    return run


def test_the_pendulum_keeps_its_tolerance() -> None:
    """Against its period 4 K(1/2)/sqrt(g): it is back where it began."""
    model = read_model_text(PENDULUM, "pendulum.yaml")
    scene = model.scenes["swing"]
    choice = choose(model, scene)
    run = picked_run(choice)
    period = 4 * quarter_period(0.5) / np.sqrt(9.81)
    x = np.interp(period + np.array([-0.04, 0.0, 0.04]), run.t, run["bob.x"])
    assert x[1] == pytest.approx(1, abs=3e-3)  # interpolated between rows
    assert np.hypot(run["bob.x"], run["bob.z"]) == pytest.approx(1, abs=1e-9)
    assert choice.chosen in choice.evidence
    assert all(c.failure or c.error <= 0.8e-3 for c in choice.evidence)


def test_the_pendulum_keeps_errors_of_outputs() -> None:
    """A loose target of an output takes less work than the default, a tight one of an objective more; errors are multiples of targets."""
    works = []
    for asked in ("accuracy: {bob.x: 10 cm}", "accuracy: 1 mm", "accuracy: {bob.x: 1 cm, end(bob.z): 1.0e-6}"):
        model = read_model_text(PENDULUM.replace("accuracy: 1 mm", asked), "pendulum.yaml")
        scene = model.scenes["swing"]
        choice = choose(model, scene)
        works.append(choice.chosen.work)
        assert choice.chosen.error <= 0.8
        run, exact = picked_run(choice), find_reference(model, replace(scene, method="", accuracy=1e-8, targets={}), {}).run
        for name, most in scene.targets.items():
            apart = (run["bob.z"] - exact["bob.z"])[-1] if name.startswith("end") else run["bob.x"] - exact["bob.x"]
            assert np.abs(apart).max() <= most
    assert works == sorted(works)
    assert works[0] < works[-1]


def test_the_chain_keeps_its_tolerance_across_its_singular_pose() -> None:
    """Against elliptic functions."""
    model, scene = auto("four_bar", 1e-3, 2.0)
    run = picked_run(choose(model, scene))
    angle, _ = crank_motion(Chain(windows=2), run.t)
    assert np.abs(run["tip.x"] - np.sin(angle)).max() <= 1e-3
    assert np.abs(run["tip.y"] - np.cos(angle)).max() <= 1e-3


CHOSEN = Candidate(variant="full", method="recursive", steps=Steps(integrator="trapezoidal", dt=0.01), error=1e-4, work=1e6)
SWING = read_model_text(PENDULUM, "pendulum.yaml")
MADE = Choice(chosen=CHOSEN, evidence=(CHOSEN,), reference_change=1e-6, reduced=(SWING, SWING.scenes["swing"]))


@pytest.fixture
def calibrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The models that were calibrated, with a cache of their own; the calibration is a stand-in's."""
    calibrated: list[str] = []

    def calibrate(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Choice:
        calibrated.append(model.name)
        return MADE

    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("cutjoint.reduce.choose._calibrate", calibrate)
    yield calibrated
    origins.code_digest.cache_clear()


def choose_again(**changes: object) -> Choice:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    return choose(model, replace(model.scenes["swing"], **changes))  # type: ignore[arg-type]


def test_a_choice_is_kept(calibrations: list[str]) -> None:
    assert [choose_again(), choose_again()] == [MADE, MADE]
    assert calibrations == ["pendulum"]


def test_other_code_of_a_function_is_another_choice(calibrations: list[str]) -> None:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    for code in ("double f;", "double g;"):
        choose(replace(model, code=code), model.scenes["swing"])
    assert len(calibrations) == 2


def test_a_choice_that_came_to_harm_is_made_again(calibrations: list[str], tmp_path: Path) -> None:
    choose_again()
    (file,) = (tmp_path / "cache" / "choices").iterdir()
    for harmed in damaged_records(file.read_bytes()):
        file.write_bytes(harmed)
        assert choose_module._read(file, *MADE.reduced) is None
    assert [choose_again(), choose_again()] == [MADE, MADE]
    assert len(calibrations) == 2


def test_a_choice_needs_no_cache_to_write_to(calibrations: list[str], tmp_path: Path) -> None:
    (tmp_path / "cache").touch()
    assert [choose_again(), choose_again()] == [MADE, MADE]
    assert len(calibrations) == 2


def another_source(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "source").mkdir()
    (folder / "source" / "more.py").write_text("", encoding="utf-8")
    folders = (*prepared.code_folders(), folder / "source")
    monkeypatch.setattr(prepared, "code_folders", lambda: folders)


def another_flag(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepared, "FLAGS", ("-O2",))


def another_compiler(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepared, "find_compiler", lambda: Compiler(command=("c++",), version="another"))


@pytest.mark.parametrize("change", [another_source, another_flag, another_compiler])
def test_what_has_changed_is_calibrated_anew(
    change: Callable[[Path, pytest.MonkeyPatch], None], calibrations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    choose_again()
    change(tmp_path, monkeypatch)
    choose_again()
    assert len(calibrations) == 2


@pytest.mark.parametrize(
    "change", [{"accuracy": 1e-4}, {"budget": 2.0}, {"numerics": Numerics(frequency=20.0)}, {"road": Road(contact="disc")}]
)
def test_another_scene_is_calibrated_anew(change: Mapping[str, object], calibrations: list[str]) -> None:
    choose_again()
    choose_again(**change)
    assert len(calibrations) == 2


def test_without_versions_nothing_is_kept(calibrations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise PackageNotFoundError

    monkeypatch.setattr(prepared, "versions", fail)
    assert [choose_again(), choose_again()] == [MADE, MADE]
    assert len(calibrations) == 2
    assert not (tmp_path / "cache" / "choices").exists()


def test_an_impossible_accuracy_says_what_came_nearest() -> None:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    with pytest.raises(RunError, match=r"scene .swing.: no converged reference run: .*still changes by .* at the smallest step"):
        choose(model, replace(model.scenes["swing"], accuracy=1e-15))


def test_an_impossible_budget_says_what_is_possible() -> None:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    with pytest.raises(RunError, match=r"budget 1e\+12: the run of the least work is .* times as fast as real time"):
        choose(model, replace(model.scenes["swing"], budget=1e12))


def test_outputs_without_places_cannot_be_compared() -> None:
    model = read_model_text(PENDULUM.replace("[bob.x, bob.z]", "[bob.vx]"), "pendulum.yaml")
    with pytest.raises(RunError, match="no output is a position or an angle, by which runs are compared"):
        choose(model, model.scenes["swing"])


def test_runs_are_as_far_apart_as_their_worst_place() -> None:
    t = np.array([0.0, 0.1, 0.2])
    columns = {"a.x": np.zeros(3), "a.vx": np.zeros(3), "tyre.slip": np.zeros(3)}
    units = {"a.x": "m", "a.vx": "m/s", "tyre.slip": "rad"}
    truth = Trajectory(t=t, columns=columns, units=units, steps=2, evaluations=2, seconds=0.0, undetermined=(), failure=None)
    other = replace(truth, columns={"a.x": np.array([0.0, 0.3, -0.5]), "a.vx": np.full(3, 9.0), "tyre.slip": np.full(3, 9.0)})
    assert distance(other, truth) == 0.5


def test_the_steps_are_the_coarsest_that_keep_the_accuracy() -> None:
    """Against a walk through the whole grid; a search by large jumps may leave what saves less than ENOUGH."""
    model, scene = auto("press", 1e-4, 0.5)
    truth = find_reference(model, scene, {})
    (full, *_) = reduction_sequence(model, scene)
    for integrator in ("dormand-prince", "trapezoidal"):
        found = Search(scene, {}, truth).try_steps(full, scene, "recursive", integrator)
        trials = Trials(model, with_default_closure(scene, "recursive", integrator), "recursive")
        runs = ((steps, trials.run(steps, {})) for steps in steps_of(integrator, scene.output_step))
        steps, first = next((steps, run) for steps, run in runs if distance(run, truth.run) <= 0.8e-4)
        assert found.failure == ""
        assert found.error <= 0.8e-4
        assert found.steps.setting <= steps.setting
        assert found.work <= 1.1 * trials.work(first, steps)


def test_what_takes_more_work_at_coarser_steps_is_left() -> None:
    model, scene = auto("press", 1e-6, 0.5)
    search = Search(scene, {}, find_reference(model, scene, {}))
    (full, *_) = reduction_sequence(model, scene)
    search.found.append(replace(CHOSEN, work=1e3))
    left = search.try_steps(full, scene, "recursive", "dormand-prince")
    assert (left.failure, left.steps.tolerance) == ("dearer", 1e-2)


def test_embedded_loops_and_all_integrators_are_candidates() -> None:
    model, scene = auto("press", 1e-4, 0.5)
    tried = {(c.method, c.loops, c.steps.integrator) for c in choose(model, scene).evidence}
    assert tried >= {
        ("recursive", "exact", "dormand-prince"), ("recursive", "embedded", "dormand-prince"), ("recursive", "embedded", "dop853"),
        ("recursive", "embedded", "trapezoidal"), ("recursive-newton", "embedded", "radau5"),
        ("recursive-newton", "embedded", "trapezoidal"),
    }  # fmt: skip


def test_an_integrator_of_the_scene_is_the_only_one_of_its_methods() -> None:
    assert {pair[:2] for pair in pairs_of(Numerics(integrator="radau5"))} == {
        ("recursive-newton", "radau5"), *(("recursive", name) for name in ("dormand-prince", "dop853", "rk4", "trapezoidal")),
    }  # fmt: skip
    assert {pair[2] for pair in pairs_of(Numerics(events="located"))} == {None}


@pytest.mark.parametrize(
    ("steps", "options"),
    [
        (Steps(integrator="radau5", tolerance=1e-3), ["--loops", "embedded", "--integrator", "radau5", "--solver-tolerance", "0.001"]),
        (Steps(integrator="trapezoidal", dt=0.01 / 7), ["--loops", "embedded", "--integrator", "trapezoidal", "--dt", repr(0.01 / 7)]),
    ],
)
def test_a_choice_runs_as_its_options_do(
    steps: Steps, options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    chosen = replace(CHOSEN, method="recursive-newton", loops="embedded", steps=steps)

    def choose_it(model: Model, scene: Scene, **how: object) -> Choice:
        return Choice(chosen=chosen, evidence=(chosen,), reference_change=0.0, reduced=(model, scene))

    monkeypatch.setattr("cutjoint.commands.picking.choose", choose_it)
    outs, asked = [tmp_path / "auto.csv", tmp_path / "own.csv"], ["--method", "auto"]
    for out in outs:
        result = CliRunner().invoke(main, ["simulate", str(MODELS / "press.yaml"), *asked, "--no-error", "--out", str(out)])
        assert result.exit_code == 0, result.output
        if asked == ["--method", "auto"]:
            named = result.output.partition("without auto:")[2].split()
            assert named[: 2 + len(options)] == ["--method", "recursive-newton", *options]
            asked = named[: 2 + len(options)]
    assert outs[0].read_bytes() == outs[1].read_bytes()


def test_the_table_of_candidates_fits_80_columns() -> None:
    """One line for each candidate that ran, whatever the terminal; reasons of others stand below."""
    named = replace(CHOSEN, method="recursive-newton", loops="embedded", variant="idle equations")
    others = [
        replace(named, steps=Steps(integrator="generalised-alpha", dt=0.01 / 39), work=1.234e8, failure=DEARER),
        replace(CHOSEN, error=2e-3, failure=INACCURATE), replace(CHOSEN, error=np.inf, failure="a reason\nand more"),
        replace(CHOSEN, error=3e-6, failure="a fallback"),
    ]  # fmt: skip
    choice = replace(MADE, chosen=named, evidence=(named, *others))
    console = Console(width=80, file=StringIO(), color_system=None)
    for part in choice_tables(choice, replace(next(iter(read_model_text(PENDULUM, "p.yaml").scenes.values())), accuracy=1e-4)):
        console.print(part)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert sum("recursive" in line for line in lines) == 6
    assert [line.split()[-1] for line in lines if "idle" in line] == ["chosen", "123"]
    assert {line.split()[-1] for line in lines if "3.0e-6" in line} == {"-"}
    assert {"and more", "recursive, full, exact, trapezoidal: a fallback"} <= set(lines)
    assert "without auto: no option has the reduced model" in lines


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--dt", "0.1"], "--dt cannot be combined with method auto"),
        (["--precision", "quad"], "--precision cannot be combined with method auto"),
        (["--accuracy-of", "bob.x=1mm"], "--accuracy-of cannot be combined with method auto"),
    ],
)
def test_options_that_auto_picks(tmp_path: Path, options: list[str], message: str) -> None:
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM)
    result = CliRunner().invoke(main, ["simulate", str(path), *options, "--out", str(tmp_path / "out.csv")])
    assert result.exit_code == 1
    assert message in " ".join(result.output.split())


def test_auto_runs_to_the_end_of_the_command(tmp_path: Path) -> None:
    """--end was refused, as something that method auto chooses."""
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM)
    options = ["--scene", "swing", "--method", "auto", "--end", "0.5", "--no-error", "--out", str(tmp_path / "out.csv")]
    result = CliRunner().invoke(main, ["simulate", str(path), *options])
    assert result.exit_code == 0, result.output
    assert float((tmp_path / "out.csv").read_text().splitlines()[-1].split(",")[0]) == 0.5


@pytest.mark.parametrize(
    ("written", "options", "accuracy", "said"),
    [
        ("", ["--method", "auto"], 1e-4, ""),
        ("", ["--method", "auto", "--accuracy", "1 mm"], 1e-3, ""),
        ("", ["--method=auto", "--tolerance=1e-3"], 1e-3, "simulate --tolerance is now --accuracy"),
        (", method: auto, tolerance: 1 mm", [], 1e-3, ""),
        (", method: auto", ["--tolerance", "0.01"], 0.01, "method auto has no solver tolerance; taken as --accuracy 0.01"),
    ],
)
def test_the_accuracy_of_auto(
    written: str, options: list[str], accuracy: float, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The default without any, and words of earlier versions."""
    wanted: list[Scene] = []

    def stop(model: Model, scene: Scene, **how: object) -> None:
        wanted.append(scene)
        raise RunError("stopped")

    monkeypatch.setattr("cutjoint.commands.picking.choose", stop)
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM.replace(", method: auto, accuracy: 1 mm", written))
    result = CliRunner().invoke(main, ["simulate", str(path), *options, "--out", str(tmp_path / "out.csv")])
    assert "stopped" in result.output
    assert said in result.output
    assert [(scene.method, scene.accuracy) for scene in wanted] == [("auto", accuracy)]


def test_the_command_runs_what_it_picks(tmp_path: Path) -> None:
    path, out = tmp_path / "pendulum.yaml", tmp_path / "out.csv"
    path.write_text(PENDULUM)
    result = CliRunner().invoke(main, ["simulate", str(path), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "chosen" in result.output
    assert out.read_text().startswith("t,bob.x,bob.z\n")


def test_reduce_prints_the_sequence() -> None:
    result = CliRunner().invoke(main, ["reduce", str(MODELS / "flyball.yaml")])
    assert result.exit_code == 0, result.output
    assert "welded" in result.output
    assert "differences" not in result.output


def test_the_full_model_is_taken_where_a_reduction_breaks_the_likeness_of_parts() -> None:
    """An axle whose links are welded takes fewer operations and more instructions: its sides share fewer lanes."""
    model = read_model(MODELS / "axle.yaml")
    found = choose(model, replace(model.scenes["bump"], method="auto", accuracy=1e-4))
    least = {name: min(c.work for c in found.evidence if c.variant == name and not c.failure) for name in (FULL, "welded")}
    assert found.chosen.variant == FULL
    assert least[FULL] < 0.8 * least["welded"]
