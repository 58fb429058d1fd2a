"""Targets for the errors of outputs: `accuracy` of a scene as a mapping, beside the closed form of an oscillator."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.report.tables import error_facts
from cutjoint.run.results import ErrorEstimate, Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp

pytestmark = needs_cpp

#: 1 kg on a spring of 400 N/m, 0.1 m from its rest.
OSCILLATOR = """
cutjoint: 1
name: swing
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {spring: {kind: joint_force, joint: rail, law: -400*position}}
outputs: [block.x, block.vx, spring.force, pull: {value: spring.force, unit: kN}]
scenes: {swing: {end: 3, output_step: 10 ms, positions: {rail.displacement: 0.1}, ACCURACY}}
"""


def run_with(accuracy: str) -> Trajectory:
    model = read_model_text(OSCILLATOR.replace("ACCURACY", accuracy), "swing.yaml")
    return simulate(compile_interpreted(model, model.scenes["swing"]))


def exact_columns(run: Trajectory) -> dict[str, NDArray[np.float64]]:
    x, v = 0.1 * np.cos(20 * run.t), -2 * np.sin(20 * run.t)
    return {"block.x": x, "block.vx": v, "spring.force": -400 * x, "pull": -0.4 * x}


def true_errors(run: Trajectory) -> dict[str, float]:
    return {name: float(np.max(np.abs(run[name] - values))) for name, values in exact_columns(run).items()}


@pytest.mark.parametrize("target", [2.0, 2e-2, 2e-5])
def test_steps_follow_from_the_error_asked_of_a_force(target: float) -> None:
    run = run_with(f"accuracy: {{spring.force: {target} N}}")
    assert run.error.converged
    assert run.error.targets == {"spring.force": target}
    assert 1e-4 * target < true_errors(run)["spring.force"] < target
    assert run.error["spring.force"] < target


def test_a_coarse_target_takes_fewer_steps_than_the_default() -> None:
    assert run_with("accuracy: {block.vx: 0.1 m/s}").steps < 0.5 * run_with("accuracy: 1.0e-4").steps


def test_a_target_is_in_any_unit_of_its_output() -> None:
    """An output in kN whose target is written in N."""
    run, same = run_with("accuracy: {pull: 0.5 N}"), run_with("accuracy: {spring.force: 5.0e-4 kN}")
    assert run.error.targets == {"pull": 5e-4}
    assert same.error.targets == {"spring.force": pytest.approx(0.5)}
    assert np.array_equal(run["block.x"], same["block.x"])
    assert true_errors(run)["pull"] < 5e-4


def test_several_targets_hold_at_once() -> None:
    run = run_with("accuracy: {block.x: 1 mm, block.vx: 1.0e-7 m/s}")
    assert true_errors(run)["block.vx"] < 1e-7


@pytest.mark.parametrize(
    ("objective", "column", "error", "value"),
    [
        ("minimum", "spring.force", "1 mN", np.min), ("maximum", "pull", "1.0e-3 N", np.max), ("mean", "block.x", "1.0e-7 m", np.mean),
        ("end", "block.vx", "1.0e-4 m/s", lambda y: y[-1]), ("rms", "block.vx", "1.0e-5 m/s", lambda y: np.sqrt(np.mean(y**2))),
    ],
)  # fmt: skip
def test_a_target_of_an_objective(objective: str, column: str, error: str, value: Callable[[NDArray[np.float64]], float]) -> None:
    """The error of the objective is below the target, whatever that of the output at other times."""
    run, name = run_with(f"accuracy: {{{objective}({column}): {error}}}"), f"{objective}({column})"
    assert run.error.converged
    assert list(run.columns) == ["block.x", "block.vx", "spring.force", "pull"]
    assert abs(value(run[column]) - value(exact_columns(run)[column])) < run.error.targets[name]
    assert run.error[name] < run.error.targets[name]
    assert run.steps <= run_with(f"accuracy: {{{column}: {error}}}").steps


@pytest.mark.parametrize(
    ("accuracy", "words"),
    [
        ("accuracy: {peak(spring.force): 1 N}", "accuracy: 'peak' is no objective; objectives: end, maximum, mean, minimum, rms"),
        ("accuracy: {end(spring.forc): 1 N}", "the scene has no output 'spring.forc'; add it to outputs; did you mean 'spring.force'"),
        ("accuracy: {rms(spring.force): 1 mm}", "accuracy.rms(spring.force) needs N, got m"),
        ("accuracy: {spring.forc: 1 N}", "accuracy: the scene has no output 'spring.forc'; add it to outputs; did you mean 'spring.force'"),
        ("accuracy: {spring.force: 1 mm}", "accuracy.spring.force needs N, got m"),
        ("accuracy: {spring.force: 0 N}", "spring.force must be greater than zero"),
        ("accuracy: {}", "accuracy needs at least 1 item, got 0"),
    ],
)
def test_wrong_targets_are_refused_at_their_line(accuracy: str, words: str) -> None:
    with pytest.raises(ModelError) as refusal:
        run_with(accuracy)
    assert words in str(refusal.value)
    assert "swing.yaml:9:" in str(refusal.value)


def test_callers_name_outputs_too(tmp_path: Path) -> None:
    """On the command line in any unit, in Python in SI units; not beside what determines the steps or the outputs."""
    model, one = tmp_path / "swing.yaml", ("--implementation", "interpreted", "--accuracy-of")
    model.write_text(OSCILLATOR.replace("ACCURACY", "accuracy: 1.0e-9"), encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(model), *one, "pull=0.5N"])
    assert done.exit_code == 0
    assert "(pull, asked 0.0005)" in done.output
    for _ in range(2):  # the second run is prepared already
        done = CliRunner().invoke(main, ["simulate", str(model), *one, "maximum(pull)=0.5N"])
        assert done.exit_code == 0
        assert "(maximum(pull), asked 0.0005)" in done.output
    missed = CliRunner().invoke(main, ["simulate", str(model), *one, "end(pull)=1e-20N"])
    assert missed.exit_code == 1
    assert "errors may exceed 1e-23 kN of end(pull)" in missed.output
    read = read_model_text(OSCILLATOR.replace("ACCURACY", "method: recursive"), "swing.yaml")
    run = simulate(compile_interpreted(read, read.scenes["swing"]), accuracy={"pull": 0.5})
    assert run.error.targets == {"pull": 5e-4}
    for asked, words in (
        (("pul=1N",), "accuracy of pul: is no output of the scene; did you mean 'pull'?"),
        (("pull=1mm",), "accuracy of pull: needs N, got m: 1mm"),
        (("pull=0",), "accuracy of pull: 0 is not above 0; write a larger number"),
        (("pull=1N", "--no-error"), "accuracy: it needs the runs that estimate the error; remove --no-error"),
        (("peak(pull)=1N",), "accuracy of peak(pull): 'peak' is no objective; objectives: end, maximum, mean, minimum, rms"),
        (("end(pull)=1mm",), "accuracy of end(pull): needs N, got m: 1mm"),
        (("pull=1N", "--dt", "1ms"), "accuracy: it determines the steps; remove dt or the accuracy"),
        (("pull=1N", "--accuracy", "1mm"), "accuracy: steps follow from errors of positions or from those of named outputs; remove one"),
        (("pull=1N", "--method", "auto", "--implementation", "auto"), "--accuracy-of cannot be combined with method auto"),
    ):  # fmt: skip
        if asked == ("pull=1mm",):  # also where the run with this number is in the cache
            assert CliRunner().invoke(main, ["simulate", str(model), *one, "pull=0.001"]).exit_code == 0
        refused = CliRunner().invoke(main, ["simulate", str(model), *one, *asked])
        assert refused.exit_code == 1
        assert words in " ".join(refused.output.split())


@pytest.mark.parametrize(("targets", "remedy"), [({"a": 2.0}, "name them in the accuracy too"), ({}, "use a smaller accuracy")])
def test_rough_outputs_have_the_remedy_that_helps(targets: dict[str, float], remedy: str) -> None:
    errors = {"a": 1.0, "b": 1.0}
    found = ErrorEstimate(max_error=errors, units=dict.fromkeys(errors, "N"), converged=True, rough=("b",), targets=targets)
    assert any(str(cell).endswith(f"not converging with finer steps; {remedy}") for cell in error_facts(found).columns[1].cells)


def test_targets_of_outputs_that_a_run_lacks_do_not_count() -> None:
    """Reductions report places in place of a scene's outputs, and `compile_model` those of its caller."""
    read = read_model_text(OSCILLATOR.replace("ACCURACY", "accuracy: {spring.force: 1 N, block.x: 1 mm}"), "swing.yaml")
    scene = read.scenes["swing"]
    places, none = (tuple(o for o in scene.outputs if o.column in names) for names in (("block.x",), ("block.vx",)))
    assert simulate(compile_interpreted(read, scene, outputs=places)).error.targets == {"block.x": 1e-3}
    assert simulate(compile_interpreted(read, scene, outputs=none)).error.goal == 1e-4


def test_a_target_that_no_steps_meet_is_said(tmp_path: Path) -> None:
    """Rounding of the place, times 1e18, is noise."""
    text = OSCILLATOR.replace("forces:", "signals: {noise: sin(1e18*block.x)}\nforces:").replace("[block.x", "[noise.value, block.x")
    model = tmp_path / "swing.yaml"
    model.write_text(text.replace("ACCURACY", "accuracy: {noise.value: 1.0e-3}"), encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(model), "--implementation", "interpreted"])
    assert done.exit_code == 1
    assert "accuracy not reached: errors may exceed 0.001 of noise.value" in " ".join(done.output.split())
    assert "(noise.value, asked 0.001)" in done.output
