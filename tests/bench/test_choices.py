"""Which setting for which error: choices, their command lines, runs to an accuracy, and the page that shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.commands.simulate import command as simulate_command
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.choose import Candidate, Choice
from cutjoint.reduce.trials import Steps
from cutjoint.run.artifact import Artifact
from cutjoint_bench import asked_contenders, cutjoint_contenders
from cutjoint_bench.asked_contenders import AccuracyRunner, AutoRunner
from cutjoint_bench.cases import make_case
from cutjoint_bench.choices import Entry, choice_lines, find_choices
from cutjoint_bench.contenders import CONTENDERS, choose
from cutjoint_bench.cutjoint_contenders import tolerance_of, tolerated_steps
from cutjoint_bench.errors import measure_errors
from cutjoint_bench.exact.pendulum import PENDULUM, pendulum_motion
from cutjoint_bench.failures.outcomes import exact_truth
from cutjoint_bench.findings import describe_setting
from cutjoint_bench.measure import measure_point
from cutjoint_bench.records import Case
from cutjoint_bench.reference import Reference
from cutjoint_bench.report.choices import describe_choices, tabulate_accuracies
from cutjoint_bench.report.page import render_page
from tests.conftest import MODELS


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contenders interpret their equations instead of compiling them."""

    def compile_scene(model: Model, scene: Scene, options: CompileOptions) -> Artifact:
        return compile_interpreted(model, scene, method=options.method, outputs=options.outputs)

    for module in (cutjoint_contenders, asked_contenders):
        monkeypatch.setattr(module, "compile_scene", compile_scene)


def point(dt: float, seconds: float, error: float | None, *, command: str = "", **more: Any) -> dict[str, Any]:
    errors = {"position": 1.0, "velocity": None, "energy": None, "residual": None, "outputs": error}
    given = {"command": command} if command else {}
    return {"dt": dt, "seconds": [seconds], "steps": 7, "errors": errors, "failure": "", **given, **more}


def line(name: str, group: str, *points: dict[str, Any]) -> dict[str, Any]:
    return {"contender": name, "label": name, "group": group, "dt": 1e-3, "configuration": {}, "points": list(points)}


ABOUT = {"estimated": 2e-5, "kept": True, "fallback": "", "warnings": [], "waited": 0.5}
LINES = [
    line(
        "recursive", "generated", point(1e-2, 1.0, 2e-3, command="A"), point(1e-3, 2.0, 5e-4, command="B"),
        point(1e-4, 9.0, 4e-6, command="C"),
    ),
    line("recursive/rk4", "integrators", point(1e-3, 2.2, 1e-4, command="D")),
    line("recursive/reduced", "reduced", point(1e-3, 0.5, 3e-4)),
    line("mujoco/rk4", "peer", point(1e-3, 0.1, 1e-9)),
    line(
        "recursive/dormand-prince/accuracy", "accuracy", point(1e-3, 3.0, 1e-5, command="E", about=ABOUT),
        point(1e-4, 3.0, 2e-4, about=ABOUT),
    ),
    line("recursive/dop853/accuracy", "accuracy", point(1e-3, 2.5, 5e-3, command="F", about=ABOUT)),
    line("auto", "auto", point(1e-3, 2.1, 4e-4, command="G", about={"chosen": "recursive, 1 ms"})),
]  # fmt: skip


def as_measured(entries: Sequence[Entry]) -> list[float]:
    return [entry.seconds for entry in entries]


def test_a_choice_is_the_fastest_within_its_error_that_a_command_names() -> None:
    first, second, *_, last = find_choices(LINES, "outputs", as_measured)
    assert (first["target"], first["fastest"]["command"], first["fastest"]["setting"]) == (1e-3, "B", "step 1 ms")
    assert first["unnamed"]["contender"] == "recursive/reduced"
    assert first["accuracy"]["command"] == "E", "the faster one is not within the accuracy"
    assert first["auto"]["about"]["chosen"] == "recursive, 1 ms"
    assert (second["fastest"]["command"], second["unnamed"], second["auto"]) == ("D", None, None)
    assert second["accuracy"]["within"] is False
    assert (last["target"], last["fastest"], last["accuracy"]) == (1e-7, None, None)


def test_close_settings_are_timed_again_in_turns() -> None:
    """D took a tenth longer than B at first, and less in turns; C took too long to be tried again."""
    timed: list[list[str]] = []

    def again(entries: Sequence[Entry]) -> list[float]:
        timed.append([entry.point.get("command", entry.line["contender"]) for entry in entries])
        return [1.5 if entry.point.get("command") == "D" else entry.seconds for entry in entries]

    first = find_choices(LINES, "outputs", again)[0]
    assert timed[0] == ["B", "D", "recursive/reduced", "E", "G"]
    assert (first["fastest"]["command"], first["fastest"]["seconds"]) == ("D", 1.5)


def test_a_setting_that_is_faster_and_more_accurate_is_named_for_the_larger_error_too() -> None:
    """Other load made all runs for 1e-3 slow."""
    lines = [line("recursive", "generated", point(1e-3, 1.0, 5e-4, command="B"), point(1e-4, 2.0, 5e-5, command="C"))]
    rounds = iter([[9.0], [2.0], [], [], []])
    assert [c["fastest"]["command"] for c in find_choices(lines, "outputs", lambda _: next(rounds))[:2]] == ["C", "C"]


def test_of_equally_fast_settings_the_simpler_command_is_named() -> None:
    lines = [
        line("recursive/rk4", "integrators", point(1e-3, 1.0, 1e-4, command="B --events crossed"), point(2e-3, 1.04, 1e-4, command="B")),
        line("recursive", "generated", point(1e-3, 1.06, 1e-4, command="C")),
    ]  # fmt: skip
    assert find_choices(lines, "outputs", as_measured)[0]["fastest"]["command"] == "B"


def test_the_command_prints_the_fastest_setting_at_each_error() -> None:
    cases = [{"name": "clock/swing", "choices": find_choices(LINES, "outputs", as_measured)}, {"name": "other"}]
    said = list(choice_lines({"cases": cases}))
    assert said[:3] == [
        "clock/swing: the fastest setting whose error is at most", "  1e-03: 2e+03 ms, error 5.0e-04: B",
        "  1e-04: 2.2e+03 ms, error 1.0e-04: D",
    ]  # fmt: skip
    assert (len(said), said[-1]) == (6, "  1e-07: none that was tried")


def test_settings_are_described_by_what_a_point_is() -> None:
    adaptive = line("recursive/dormand-prince", "integrators")
    assert describe_setting(adaptive, {"dt": 1e-3}) == "tolerance 1e-06"
    assert describe_setting(line("recursive/rk4", "integrators"), {"dt": 1e-3}) == "step 1 ms"
    assert describe_setting(line("recursive/dormand-prince/accuracy", "accuracy"), {"dt": 1e-3}) == "accuracy 0.001"


def test_tolerances_are_two_a_decade() -> None:
    found = [tolerance_of(dt, 5e-4) for dt in tolerated_steps(5e-4)]
    assert found == pytest.approx([10 ** (-2 - k / 2) for k in range(21)], rel=5e-3)
    assert 1e-6 in found


def test_a_case_that_is_watched_has_the_scenes_places_and_angles() -> None:
    case = make_case(MODELS / "slider_crank.yaml", watched=True, end=0.5, parameters={})
    assert list(case.watched) == ["slider.x", "crank_pin.angle", "cross.angle_1", "cross.angle_2"], "slider.vx is neither"
    assert {"crank.x", "slider.vz", "cross.angle_2"} <= {o.column for o in case.outputs}
    assert case.command == f"cutjoint simulate {MODELS / 'slider_crank.yaml'} --scene turn --end 0.5"
    assert make_case(MODELS / "slider_crank.yaml").command == ""
    rods = make_case(MODELS / "iltis.yaml", "simul1", watched=True, link_masses={"*.tie_rod": 1.0})
    assert rods.command == "", "no option of it makes rods"


NAMED = (
    ("recursive", 2e-3), ("recursive/events", 2e-3), ("recursive/rk4", 2e-3), ("recursive/dormand-prince", 1e-3), ("augmented", 2e-3),
    ("recursive-newton/radau5", 1e-3), ("recursive/dormand-prince/functions", 1e-3), ("recursive/dop853/functions", 1e-3),
)  # fmt: skip


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize(("name", "dt"), NAMED, ids=[name for name, _ in NAMED])
def test_a_command_line_makes_the_run_that_was_measured(name: str, dt: float, tmp_path: Path) -> None:
    """Bit for bit in the columns of the scene."""
    case = make_case(MODELS / "slider_crank.yaml", end=0.1, watched=True)
    contender = CONTENDERS[name]
    run = contender.prepare(case)(dt)
    assert contender.options is not None
    words = [*case.command.split()[2:], *contender.options(case, dt), "--implementation", "interpreted", "--out", str(tmp_path / "out.csv")]
    done = CliRunner().invoke(simulate_command, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    with (tmp_path / "out.csv").open(encoding="utf-8") as stream:
        names = stream.readline().rstrip("\n").split(",")
        table = np.loadtxt(stream, delimiter=",")
    for column in case.watched:
        assert table[:, names.index(column)].tolist() == run[column].tolist(), column


def test_only_contenders_that_the_command_line_lacks_have_no_command() -> None:
    lacking = {c.name if c.group == "precision" else c.group for c in CONTENDERS.values() if c.options is None}
    assert lacking == {"scalar", "reduced", "reductions", "peer", "augmented/mixed", "classical/mixed"}
    case = make_case(MODELS / "pendulum.yaml", watched=True)
    for contender in (c for c in CONTENDERS.values() if c.options is not None):
        words = contender.options(case, 1e-3) if contender.options else []
        context = simulate_command.make_context("simulate", [str(MODELS / "pendulum.yaml"), *words])
        assert context.params["model"] == MODELS / "pendulum.yaml", contender.name


def pendulum(folder: Path) -> tuple[Case, Reference]:
    """A case whose scene reports a place and a velocity, and its exact motion."""
    path = folder / "pendulum.yaml"
    path.write_text(PENDULUM, encoding="utf-8")
    case = make_case(path, end=2.0, watched=True)
    body = case.outputs[0].element
    outputs = tuple(o for o in case.outputs if o.column in (f"{body}.x", f"{body}.vy"))
    scene = replace(case.scene, outputs=outputs)
    model = replace(case.model, scenes={name: replace(s, outputs=outputs) for name, s in case.model.scenes.items()})
    rows = round(scene.end / scene.output_step)
    known = exact_truth(pendulum_motion, scene.end).at(np.arange(rows + 1) * scene.output_step)
    return replace(case, model=model, scene=scene, watched={f"{body}.x": 1.0}), known


@pytest.mark.usefixtures("interpreted")
def test_a_run_to_an_accuracy_tells_its_estimate_beside_the_true_error(tmp_path: Path) -> None:
    case, reference = pendulum(tmp_path)
    for name in ("recursive/dormand-prince/accuracy", "augmented/trapezoidal/accuracy"):
        runner = CONTENDERS[name].prepare(case)
        assert isinstance(runner, AccuracyRunner)
        for asked in (1e-3, 1e-5):
            measured = measure_point(case, name, runner, asked, reference, 1)
            about, true = runner.about[asked], measured.errors.outputs
            assert about["kept"] is True
            assert 0 < true <= asked
            assert true / 3 <= about["estimated"] <= asked
            assert about["waited"] > measured.seconds[0]
            assert np.isnan(measured.errors.position), "its table has no body as a whole"


@pytest.mark.usefixtures("interpreted")
def test_what_the_method_auto_takes_is_run_and_named(tmp_path: Path) -> None:
    case, reference = pendulum(tmp_path)
    runner = CONTENDERS["auto"].prepare(case)
    assert isinstance(runner, AutoRunner)
    measured = measure_point(case, "auto", runner, 1e-4, reference, 1)
    assert measured.failure == ""
    assert 0 < measured.errors.outputs <= 1e-4
    assert runner.about[1e-4]["chosen"].startswith(("recursive, ", "recursive-newton, ")), runner.about


def test_errors_of_outputs_are_in_si_units(tmp_path: Path) -> None:
    case, reference = pendulum(tmp_path)
    (name,) = case.watched
    shifted = replace(case, watched={name: 1e-3})
    runner = partial(measure_errors, run=_shifted(reference, name), reference=reference)
    assert runner(shifted).outputs == pytest.approx(0.5e-3)
    assert np.isnan(measure_errors(replace(case, watched={"none.x": 1.0}), _shifted(reference, name), reference).outputs)


def _shifted(reference: Reference, name: str) -> Any:
    from cutjoint.run.results import Trajectory

    columns = {**reference.columns, name: reference.columns[name] + 0.5}
    return Trajectory(t=reference.t, columns=columns, units={}, steps=1, evaluations=1, seconds=1.0, undetermined=(), failure=None)


def study_of(lines: list[dict[str, Any]]) -> dict[str, Any]:
    case = {
        "name": "clock/swing", "title": "", "model": "clock", "scene": "swing", "end": 1.0, "reference": None, "lines": lines,
        "choices": find_choices(lines, "outputs", as_measured), "watched": ["bob.x"],
    }  # fmt: skip
    return {"machine": {"processor": "one", "system": "another"}, "drifts": [], "atlases": [], "situations": [], "cases": [case]}


def test_the_page_names_choices_and_what_accuracies_keep() -> None:
    lines = [{**x, "points": [{**p, "command": f"cutjoint simulate '<b>' {p['command']}"} if "command" in p else p for p in x["points"]]}
             for x in LINES]  # fmt: skip
    page = render_page({"bench": study_of(lines)})
    assert "<code><span>cutjoint</span> <span>simulate</span> <span>&#39;&lt;b&gt;&#39;</span> <span>B</span></code>" in page
    assert "Faster, without a command of its own: recursive/reduced, step 1 ms" in page
    assert "Method auto: recursive, 1 ms" in page
    assert page.count("<svg") == 2, "the chart of all points, and that of accuracies"
    case = study_of(LINES)["cases"][0]
    choices, accuracies = describe_choices(case), tabulate_accuracies(case)
    assert choices is not None
    assert accuracies is not None
    rows = choices["targets"][1]["rows"]
    assert [row["notes"] for row in rows] == [
        "", "its error is larger than asked for; estimated error 2.0e-05; 500 ms with all its runs",
    ]  # fmt: skip
    assert rows[1]["time"] == "3000 (1.4 ×)"
    assert accuracies.rows[0] == ("recursive/dormand-prince/accuracy", "1e-03", "2.0e-05", "1.0e-05", "2", "yes", "3000", "500", "7")
    assert accuracies.rows[1][5] == "no"


def test_groups_of_accuracies_have_each_adaptive_integrator() -> None:
    names = [c.name for c in choose(["accuracy"])]
    assert {"recursive/dormand-prince/accuracy", "recursive/dop853/accuracy", "recursive-newton/radau5/accuracy"} < set(names)
    (auto,) = choose(["auto"])
    assert auto.options is not None
    case = make_case(MODELS / "pendulum.yaml", watched=True)
    assert auto.options(case, 1e-4) == ["--method", "auto", "--accuracy", "0.0001", "--no-error"]
    assert auto.options(make_case(MODELS / "pendulum.yaml", watched=True, end=1.0), 1e-4) == [], "auto takes no --end"


@pytest.mark.usefixtures("interpreted")
def test_what_auto_chose_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pendulum's end beside elliptic functions, by the steps that a choice names."""
    steps = Steps(integrator="dop853", tolerance=1e-10)
    case = make_case(MODELS / "pendulum.yaml", watched=True)
    chosen = Candidate(variant="full", method="recursive", steps=steps)
    choice = Choice(chosen=chosen, evidence=(), reference_change=0.0, reduced=(case.model, case.scene))
    monkeypatch.setattr(asked_contenders, "choose", lambda *_, **__: choice)
    runner = AutoRunner(case=case, configuration={})
    run = runner(1e-3)
    assert runner.about[1e-3]["chosen"] == "recursive, dop853 at 1.0e-10, exact loops, the full model"
    assert np.max(np.abs(run["bob.x"] - pendulum_motion(run.t)["bob.x"])) < 1e-8
