"""Runs against the wall clock, and steps of fixed cost."""

from __future__ import annotations

import os
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_model, compile_scene
from cutjoint.model.read import read_model
from cutjoint.package.errors import RunError
from cutjoint.run.results import read_table
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import StepTimes, run_in_real_time
from cutjoint_bench.generic.artifact import compile_generic_model
from tests.conftest import MODELS
from tests.mechanisms.driven import pushed_text
from tests.physics.simulation import completed


@pytest.mark.parametrize("iterations", [1, 3, 12])
def test_every_step_has_as_many_iterations(iterations: int) -> None:
    run = completed(simulate(compile_model(MODELS / "four_bar.yaml"), iterations=iterations, dt=1e-3, end=1.0))
    assert run.steps == 1000
    assert run.evaluations == 1000 * iterations


def test_more_iterations_come_nearer() -> None:
    artifact = compile_model(MODELS / "slider_crank.yaml")
    exact = completed(simulate(artifact, tolerance=1e-9, end=1.0))
    apart = [np.abs(completed(simulate(artifact, iterations=n, end=1.0))["slider.x"] - exact["slider.x"]).max() for n in (1, 2, 4)]
    assert apart[2] < apart[1] < apart[0] < 0.1


def test_steps_of_fixed_cost_keep_loops_closed_by_projection(tmp_path: Path) -> None:
    model = read_model(MODELS / "slider_crank.yaml")
    artifact = compile_scene(model, with_closure(find_scene(model, None), "proximal"))
    exact = completed(simulate(artifact, tolerance=1e-9, end=1.0))
    run = completed(simulate(artifact, iterations=4, end=1.0, steps=tmp_path / "steps.csv"))
    assert run.statistics.residuals.position < 1e-9
    assert np.abs(run["slider.x"] - exact["slider.x"]).max() < 1e-3


@pytest.mark.parametrize(("model", "error"), [("four_bar", 1e-11), ("slider_crank", 1e-8)])
def test_two_multiplier_updates_in_each_evaluation_of_rk4_suffice(model: str, error: float, tmp_path: Path) -> None:
    """The slider-crank has a penalty of its scene, with which an update leaves a larger share of the error."""
    artifact = compile_model(MODELS / f"{model}.yaml")
    how = {"integrator": "rk4", "events": "crossed", "dt": 1e-3, "end": 0.3, "error": False}
    exact, run = completed(simulate(artifact, **how)), completed(simulate(artifact, iterations=2, steps=tmp_path / "steps.csv", **how))
    assert run.evaluations == 2 * (1 + 4 * 300)
    assert run.statistics.residuals.position < 1e-11
    for name in run.columns:
        assert np.abs(run[name] - exact[name]).max() <= error * max(1.0, np.abs(exact[name]).max())


@pytest.mark.parametrize("how", [{"method": "augmented"}, {"integrator": "dop853"}])
def test_what_has_no_fixed_cost(how: dict[str, str]) -> None:
    model = read_model(MODELS / "four_bar.yaml")
    scene = with_closure(find_scene(model, None), "penalty")
    artifact = compile_scene(model, scene, CompileOptions(method=how.get("method", "recursive")))
    with pytest.raises(RunError, match="a fixed number of iterations needs the method recursive with the integrator trapezoidal or rk4"):
        simulate(artifact, iterations=4, integrator=how.get("integrator"))


def test_steps_begin_when_they_are_due(tmp_path: Path) -> None:
    artifact = compile_model(MODELS / "pendulum.yaml")
    begin = perf_counter()
    times = run_in_real_time(artifact, dt=0.01, end=0.3, out=tmp_path / "times.csv")
    assert perf_counter() - begin >= 0.29  # the last step begins there
    assert times.durations.size == 30
    assert (times.durations > 0).all()
    assert (times.lateness >= times.durations - times.period - 1e-9).all()
    assert times.missed == np.count_nonzero(times.lateness > 0)
    t, columns = read_table(tmp_path / "times.csv")
    assert t == pytest.approx(0.01 * np.arange(1, 31))
    assert (columns["duration"] == times.durations).all()


def test_steps_that_are_too_short_miss_their_deadlines() -> None:
    times = run_in_real_time(compile_model(MODELS / "pendulum.yaml"), dt=1e-9, end=1e-6, iterations=4)
    assert times.missed == times.durations.size == 1000
    assert times.percentile(50) <= times.percentile(99.9) <= times.durations.max()


def test_late_wake_ups_and_long_steps_are_reported_apart() -> None:
    took = np.array([0.2, 0.3, 2.5, 0.2, 0.2, 0.2, 0.2])
    begun = np.array([0.0, 1.0, 2.1, 4.6, 4.8, 5.9, 6.0])  # due at 0 to 6; the sixth step wakes late, the third is too long
    late = begun + took - np.arange(1, 8)
    times = StepTimes(period=1.0, durations=took, lateness=late, failure=None)
    assert times.missed == 3  # the third, the fourth and the sixth
    assert times.stalls == 2
    assert times.missed_by_steps == 2
    assert times.wakeup_latency == pytest.approx([0, 0, 0.1, 0, 0, 0.9, 0], abs=1e-12)


@pytest.mark.parametrize(("how", "words"), [({"processor": 5000}, "there is no such processor"), ({"priority": 100}, "no right to it")])
def test_what_the_operating_system_refuses(how: dict[str, int], words: str) -> None:
    affinity = os.sched_getaffinity(0)
    with pytest.raises(RunError, match=words):
        run_in_real_time(compile_model(MODELS / "pendulum.yaml"), end=0.01, **how)
    assert os.sched_getaffinity(0) == affinity


def test_steps_run_on_the_processor_that_is_asked_for() -> None:
    affinity = os.sched_getaffinity(0)
    times = run_in_real_time(compile_model(MODELS / "pendulum.yaml"), end=0.05, processor=min(affinity))
    assert times.durations.size == 50
    assert os.sched_getaffinity(0) == affinity


def test_the_command(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["realtime", str(MODELS / "pendulum.yaml"), "--end", "0.1", "--iterations", "4"])
    assert result.exit_code == 0, result.output
    for word in ("p50", "p99.9", "largest", "missed deadlines", "histogram"):
        assert word in result.output


def test_steps_up_to_a_failure_are_reported(tmp_path: Path) -> None:
    """The force has no value after 10 ms, so that the fixed point ends with the first step of 50 ms."""
    out, model = tmp_path / "times.csv", tmp_path / "pushed.yaml"
    model.write_text(pushed_text("push + sqrt(0.01 - t)"))
    result = CliRunner().invoke(main, ["realtime", str(model), "--dt", "0.05", "--out", str(out)])
    assert result.exit_code == 1
    assert "the law of 'hand'" in result.output
    assert f"the rows up to then are in {tmp_path / 'times.partial.csv'}" in result.output
    assert read_table(tmp_path / "times.partial.csv")[0].size == 0  # the first step fails
    assert not out.exists()


def test_a_step_without_a_fixed_point_names_the_option_of_fixed_iterations(tmp_path: Path) -> None:
    """The force jumps where it stops the motion, so that no end of a step satisfies the trapezoidal rule."""
    model = tmp_path / "pushed.yaml"
    model.write_text(pushed_text("where(position > 1e-3, -1e4, 1e3)"))
    command = ["realtime", str(model), "--dt", "0.01", "--end", "0.1"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 1
    assert "the fixed point did not converge" in result.output
    assert "or --iterations 6, a fixed number" in result.output
    assert CliRunner().invoke(main, [*command, "--iterations", "6"]).exit_code == 0


@pytest.mark.heavy
def test_the_generic_solver_does_not_run_against_the_clock() -> None:
    with pytest.raises(RunError, match="real-time runs need generated code"):
        run_in_real_time(compile_generic_model(MODELS / "pendulum.yaml"))
