"""Steps that follow from the accuracy that is wanted, its tables and its words."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.report.tables import error_facts
from cutjoint.run import accuracy
from cutjoint.run.accuracy import compare
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import FailureReport, Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator_run import SimulatorRun
from tests.mechanisms.bouncing import bouncing_text, exact_bounces
from tests.physics.simulation import compile_scene, completed

#: A mass of 1 kg on a spring of 400 N/m: 20 rad/s, from 0.1 m at rest.
OSCILLATOR = """
cutjoint: 1
name: oscillator
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {spring: {kind: joint_force, joint: rail, law: "-400*position"}}
outputs: [block.x, block.vx]
scenes: {swing: {end: 3, output_step: 10 ms, positions: {rail.displacement: 0.1}SCENE}}
"""

#: A double pendulum that tumbles: neighbouring motions part by a factor of e several times a second.
CHAOS = """
cutjoint: 1
name: chaos
gravity: [0, 0, -9.81]
bodies:
  upper: {mass: 1, centre_of_mass: [0, 0, -1], inertia: [0.001, 0.001, 0.001]}
  lower: {mass: 1, centre_of_mass: [0, 0, -2], inertia: [0.001, 0.001, 0.001]}
joints:
  top: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 1, 0]}
  middle: {kind: revolute, bodies: [upper, lower], at: [0, 0, -1], axis: [0, 1, 0]}
outputs: [top.angle, middle.angle]
scenes: {tumble: {end: 60, output_step: 50 ms, positions: {top.angle: 3, middle.angle: 0.5}}}
"""

#: A crank of 1 kg, a rod and a slider, of which nothing is said but what they are.
CRANK = """
cutjoint: 1
name: crank
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.05], inertia: [0.001, 0.001, 0.0005]}
  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.001, 0.008, 0.008]}
  slider: {mass: 1, centre_of_mass: [0.3, 0, 0]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [crank, rod], at: [0, 0, 0.1], axis: [0, 1, 0]}
  wrist: {kind: revolute, bodies: [rod, slider], at: [0.3, 0, 0], axis: [0, 1, 0]}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0]}
outputs: [pin.angle, slider.x]
scenes: {turn: {end: 2, output_step: 10 ms, rates: {pin.angle_rate: 10}}}
"""


@cache
def compiled(text: str, method: str = "recursive") -> Artifact:
    model = read_model_text(text, "model.yaml")
    (scene,) = model.scenes.values()
    return compile_scene(model, scene, CompileOptions(method=method))


def oscillator(method: str = "recursive", scene: str = "") -> Artifact:
    return compiled(OSCILLATOR.replace("SCENE", scene), method)


def true_errors(run: Trajectory) -> dict[str, float]:
    exact = {"block.x": 0.1 * np.cos(20 * run.t), "block.vx": -2 * np.sin(20 * run.t)}
    return {name: float(np.max(np.abs(run[name] - values))) for name, values in exact.items()}


@pytest.mark.parametrize(("scene", "goal"), [("", 1e-4), (", accuracy: 1 mm", 1e-3), (", accuracy: 1.0e-7", 1e-7)])
@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented"])
def test_a_run_keeps_the_tolerance_of_its_scene(method: str, scene: str, goal: float) -> None:
    run = completed(simulate(oscillator(method, scene)))
    assert true_errors(run)["block.x"] < goal
    assert run.error["block.x"] < goal


@pytest.mark.parametrize("scene", ["", ", numerics: {dt: 0.01}", ", numerics: {solver_tolerance: 1.0e-4}"])
def test_the_accuracy_of_a_caller_comes_before_what_its_scene_says(scene: str) -> None:
    run = completed(simulate(oscillator(scene=scene), accuracy=1e-6))
    assert true_errors(run)["block.x"] < 1e-6
    assert run.error.converged
    assert true_errors(completed(simulate(oscillator(scene=", numerics: {dt: 0.01}"))))["block.x"] > 1e-6


@pytest.mark.parametrize(("method", "settings"), [("recursive", {}), ("recursive", {"integrator": "dop853"}), ("recursive-newton", {})])
def test_steps_follow_from_the_accuracy_that_is_asked_for(method: str, settings: dict[str, str]) -> None:
    """Beside the exact motion: no error above what is asked, and a larger one takes fewer evaluations than one without a wish."""
    usual = completed(simulate(oscillator(method), **settings))
    runs = {goal: completed(simulate(oscillator(method), accuracy=goal, **settings)) for goal in (1e-2, 1e-4, 1e-6)}
    for goal, run in runs.items():
        assert run.error.converged
        assert true_errors(run)["block.x"] < goal
        assert true_errors(run)["block.x"] < 3 * run.error["block.x"]
    assert runs[1e-2].evaluations <= runs[1e-4].evaluations < runs[1e-6].evaluations <= usual.evaluations
    assert runs[1e-2].evaluations < 0.7 * usual.evaluations


@pytest.mark.parametrize("goal", [1e-2, 1e-4, 1e-6])
def test_bounces_keep_the_accuracy_that_is_asked_for(goal: float) -> None:
    """Each bounce beside parabolas and damped oscillations: long steps over contacts agree by chance."""
    model = read_model_text(bouncing_text(3.0, 0.3).replace(", numerics: {dt: 0.01}", ""), "bounce.yaml")
    run = completed(simulate(compile_interpreted(model, model.scenes["drop"]), accuracy=goal))
    heights, switched = exact_bounces(run.t, 3.0, 0.3)
    assert switched > 2
    assert np.abs(run["mass.z"] - heights).max() < goal


def test_only_the_run_that_returns_writes_its_table(tmp_path: Path) -> None:
    """The returned run is not the last one of the search."""
    written, kept = (simulate(oscillator(), accuracy=1e-3, out=out) for out in (tmp_path / "run.npy", None))
    assert np.array_equal(np.load(tmp_path / "run.npy")["block.x"], written["block.x"])
    assert np.array_equal(written["block.x"], kept["block.x"])
    assert written.error["block.x"] == kept.error["block.x"]


@pytest.mark.parametrize("how", [{"accuracy": 1e-3}, {"integrator": "trapezoidal"}])
def test_a_pipe_has_one_table(tmp_path: Path, how: dict[str, float | str]) -> None:
    """Equal steps are halved several times."""
    os.mkfifo(pipe := tmp_path / "run.csv")
    with ThreadPoolExecutor(1) as reader:
        table = reader.submit(pipe.read_text)
        completed(simulate(oscillator(), out=pipe, **how))
        assert [line[:2] for line in table.result().splitlines()].count("t,") == 1
    assert table.result().count("\n") == 302


@pytest.mark.parametrize(("asked", "status"), [("1e-6", 0), ("1e-15", 1)])
def test_an_accuracy_that_is_not_reached_ends_with_a_status(tmp_path: Path, asked: str, status: int) -> None:
    """No run with numbers of 16 digits shows that places keep 1e-15 m; without a wish the goal is no promise."""
    model = tmp_path / "oscillator.yaml"
    for scene, more in (("", ["--accuracy", asked]), (f", accuracy: {float(asked):.1e}", [])):
        model.write_text(OSCILLATOR.replace("SCENE", scene), encoding="utf-8")
        words = ["simulate", str(model), "--implementation", "interpreted", "--out", str(tmp_path / "run.csv"), *more]
        done = CliRunner().invoke(main, words)
        assert done.exit_code == status, done.output
        assert done.output.count("accuracy not reached") == 2 * status
        assert (tmp_path / "run.csv").exists()


def test_a_chaotic_run_says_that_it_has_not_converged() -> None:
    run = completed(simulate(compiled(CHAOS)))
    assert not run.error.converged
    assert run.error["middle.angle"] > 0.1


def test_equal_steps_follow_from_the_tolerance_too() -> None:
    """A step of 1 ms has an error of 1e-4 m after 3 s, which halves three times to keep 1e-6 m."""
    run = completed(simulate(oscillator(scene=", accuracy: 1.0e-6"), integrator="trapezoidal"))
    assert run.steps == 3 * 8000 or run.steps == 3 * 16000
    assert true_errors(run)["block.x"] < 1e-6


@pytest.mark.parametrize("settings", [{}, {"dt": 1e-3}, {"dt": 5e-4}])
def test_a_light_mechanism_runs_with_nothing_said(settings: dict[str, float]) -> None:
    """The equations of the implicit method, which has others, as reference; the first run of this model once stopped in its first step."""
    run = completed(simulate(compiled(CRANK), **settings))
    reference = completed(simulate(compiled(CRANK, "recursive-newton"), integrator="radau5", tolerance=1e-9))
    for name in run.columns:
        assert np.max(np.abs(run[name] - reference[name])) < 1.5 * run.error[name] + 1e-6


_RUN = Trajectory(
    t=np.zeros(1), columns={}, units={"b.x": "m", "s.force": "N"}, steps=1, evaluations=1, seconds=0.0, undetermined=(), failure=None
)  # fmt: skip

#: Loops that a large penalty holds: rounding leaves so much that iterations of finer runs come to no end.
HELD = """
cutjoint: 1
name: held
gravity: [0, 0, -9.81]
bodies:
  left: {mass: 1, centre_of_mass: [0, 0, 0.5], inertia: [0.1, 0.1, 0.1]}
  bar: {mass: 1, centre_of_mass: [0.5, 0, 1.1], inertia: [0.1, 0.1, 0.1]}
  right: {mass: 1, centre_of_mass: [1, 0, 0.6], inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, left], at: [0, 0, 0], axis: y}
  b: {kind: revolute, bodies: [left, bar], at: [0, 0, 1], axis: y}
  c: {kind: revolute, bodies: [bar, right], at: [1, 0, 1.2], axis: y}
  d: {kind: revolute, bodies: [ground, right], at: [1, 0, 0], axis: y}
outputs: [a.angle, bar.x]
scenes: {fall: {end: 0.5, output_step: 50 ms, rates: {a.angle_rate: 4.0}, numerics: NUMERICS}}
"""


def _held(text: str, scene: str) -> Artifact:
    model = read_model_text(text, "held.yaml")
    return compile_interpreted(model, model.scenes[scene])


@pytest.mark.parametrize(
    "numerics", ["{penalty: 1.0e+9, dt: 5 ms, solver_tolerance: 1.0e-8}", "{penalty: 1.0e+11, dt: 5 ms, solver_tolerance: 1.0e-6}"]
)
def test_a_run_whose_finer_ones_come_to_no_end_has_an_estimate(numerics: str) -> None:
    run, exact = (simulate(_held(HELD.replace("NUMERICS", how), "fall"), error=not i, integrator="dormand-prince" if i else None,
                           tolerance=1e-10 if i else None) for i, how in enumerate((numerics, "{}")))  # fmt: skip
    for name, error in run.error.max_error.items():
        true = float(np.abs(run[name] - exact[name]).max())
        assert true / 3 < error < 10 * true


def test_where_no_other_run_comes_to_its_end_the_words_say_so() -> None:
    run = simulate(_held(HELD.replace("NUMERICS", "{penalty: 1.0e+9, dt: 5 ms, solver_tolerance: 1.0e-8}"), "fall"), error=False)
    estimate = compare(run, lambda times: None, remaining=0.25)[0]
    console = Console(width=200)
    with console.capture() as said:
        console.print(error_facts(estimate))
    assert "unknown: no run with finer or coarser steps reached its end" in said.get()
    assert "inf" not in said.get()


def test_where_no_other_run_comes_to_its_end_its_failure_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs with another tolerance than that of the first one fail."""
    started = accuracy.start
    failure = FailureReport(message="the run stands still", time=0.25, step=250, element="rail.displacement", residual=1e-9, advice="")

    def start(plan: SimulatorRun, **how: Any) -> Trajectory:
        run = started(plan, **how)
        return run if plan.run_file.settings.tolerance == 1e-6 else replace(run, failure=failure)

    monkeypatch.setattr(accuracy, "start", start)
    monkeypatch.setattr(accuracy, "_completed", partial(accuracy._completed, begin=start))
    error = simulate(oscillator(), tolerance=1e-6, integrator="dormand-prince").error
    assert set(error.max_error.values()) == {np.inf}
    (warning,) = error.warnings
    assert warning.startswith("with finer steps: the run stands still at t = 0.25 s (step 250); worst at 'rail.displacement'")
    assert "solver_tolerance 1e-06" in warning  # goes on


def test_without_an_error_there_is_one_run() -> None:
    run = simulate(oscillator(), error=False)
    assert run.steps < simulate(oscillator()).steps
    with pytest.raises(ValueError, match="can be taken again"):
        _ = run.error
