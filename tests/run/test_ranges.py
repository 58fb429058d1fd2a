"""Settings at the ends of their ranges: each bad value is refused by name before anything runs, from the file, Python and the command."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.errors import ModelError
from cutjoint.model.ranges import LARGEST_INTEGER, MOST_ROWS, RANGES, Steps, StepsError, count_steps, fault_of_setting
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.modes import _with_step_ending_at
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import with_settings
from cutjoint.run.settings import Options, require_settings
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.run.test_failing_starts import PENDULUM
from tests.run.test_settings import compiled, pendulum


@pytest.mark.parametrize(
    ("dt", "end", "output_step", "message"),
    [
        (1e-3, 1e16, 1.0, "end: 1e+16 s in steps of 0.001 s are more than 9.0072e+15 steps"),
        (1e-3, 1e100, 1.0, "end: 1e+100 s in steps of 0.001 s are more than"),
        (1e-3, 1e300, 1.0, "end: 1e+300 is above 1e+100"),
        (1e-300, 1.0, 1.0, "dt: 1e-300 is below 1e-100"),
        (1e-90, 1.0, 1.0, "end: 1 s in steps of 1e-90 s are more than"),
        (1e300, 1.0, 1.0, "dt: 1e+300 is above 1e+100"),
        (2.0, 1.0, 1.0, "dt: a step of 2 s is longer than the run, which ends at 1 s; write a smaller dt or a later end"),
        (nan, 1.0, 1.0, "dt: nan is not a finite number"),
        (1e-3, nan, 1.0, "end: nan is not a finite number"),
        (1e-3, 1.0, nan, "output_step: nan is not a finite number"),
        (1e-3, 1.0, 0.0, "output_step: 0 is not above 0"),
        (1e-3, 1.0, 1e300, "output_step: 1e+300 is above 1e+100"),
        (1e-3, 1e6, 1e-3, "end: 1e+06 s with a row each 0.001 s are more than 1e+08 rows"),
    ],
)
def test_steps_that_no_run_has(dt: float, end: float, output_step: float, message: str) -> None:
    with pytest.raises(StepsError) as error:
        count_steps(dt, end, output_step)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("dt", "end", "output_step", "steps"),
    [
        (1e-3, 0.0, 1e-3, Steps(number=0, stride=1)),
        (0.1, 0.3, 0.1, Steps(number=3, stride=1)),
        (0.1, 0.35, 0.2, Steps(number=4, stride=2)),
        (1e-3, 1.0, 1e99, Steps(number=1000, stride=1000)),
        (1e-3, 1.0, 1e-9, Steps(number=1000, stride=1)),
        (1.0, 1.0, 1.0, Steps(number=1, stride=1)),
        (1e-3, 1e12, 1e5, Steps(number=10**15, stride=10**8)),
    ],
)
def test_steps_that_runs_have(dt: float, end: float, output_step: float, steps: Steps) -> None:
    assert count_steps(dt, end, output_step) == steps
    assert steps.rows <= MOST_ROWS


@pytest.mark.parametrize("name", sorted(RANGES))
def test_both_ends_of_each_range(name: str) -> None:
    own = RANGES[name]
    for value in (nan, inf, -inf, -1, -1e300):
        assert fault_of_setting(name, value)
    assert ("above" in own or own["least"] > 0) == bool(fault_of_setting(name, 0))
    if "most" in own:
        assert not fault_of_setting(name, own["most"])
        assert fault_of_setting(name, own["most"] * 2)


@pytest.mark.parametrize("value", [LARGEST_INTEGER + 1, 2**32 + 1, 2**63, 2**64 + 1, 10**400, 1.5])
def test_integers_that_no_simulator_reads(value: float) -> None:
    with pytest.raises(RunError, match=r"^iterations: .* write (a smaller number|one)$"):
        require_settings(iterations=value)  # type: ignore[arg-type]


@needs_cpp
@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"end": 1e16}, "scene 'rest': end: 1e+16 s in steps of 0.01 s are more than"),
        ({"dt": 1e-50}, "scene 'rest': end: 0.02 s in steps of 1e-50 s are more than"),
        ({"dt": 1.0}, "scene 'rest': dt: a step of 1 s is longer than the run, which ends at 0.02 s"),
    ],
)
def test_runs_of_no_steps_are_refused(figures: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(RunError) as error:
        simulate(compiled(), out=tmp_path / "run.csv", **figures)
    assert message in str(error.value)
    assert not (tmp_path / "run.csv").exists()


def test_a_clock_has_as_many_rows_as_steps() -> None:
    scene = replace(pendulum().scenes["rest"], end=1e7, output_step=1e6)
    make_run_file(pendulum(), scene, {}, task="simulate")
    with pytest.raises(RunError, match=r"rows; write an earlier end or a larger dt$"):
        make_run_file(pendulum(), scene, {}, task="realtime")


def test_motions_are_linearised_at_times_that_are_reached() -> None:
    scene = pendulum().scenes["rest"]
    assert _with_step_ending_at(scene, 0.025).numerics.of_method("recursive-newton").dt == pytest.approx(0.025 / 3, rel=1e-15)
    assert _with_step_ending_at(scene, 1e-5).numerics.of_method("recursive-newton").dt == 1e-5
    with pytest.raises(RunError, match=r"end: 1e\+17 s in steps of 0\.01 s are more than"):
        _with_step_ending_at(scene, 1e17)


def test_rows_of_adaptive_runs_end_with_the_run() -> None:
    scene = replace(pendulum().scenes["rest"], output_step=5.0)
    file = make_run_file(pendulum(), scene, {}, task="simulate", options=Options(integrator="dormand-prince"))
    assert file.settings.dt == scene.end


def scene_text(settings: str) -> str:
    before, _, _ = PENDULUM.partition("scenes:")
    return f"{before}scenes: {{rest: {{{settings}}}}}\n"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("end: 1e300", "end must be at most 1e+100"),
        ("end: 1e16", "end: 1e+16 s in steps of 0.001 s are more than 9.0072e+15 steps"),
        ("end: 1, output_step: 1e300", "output_step must be at most 1e+100"),
        ("end: 1, output_step: 2", "output_step: 2 s is longer than the run, which ends at 1 s; write a smaller output_step"),
        ("end: 1, numerics: {dt: 2}", "dt: a step of 2 s is longer than the run, which ends at 1 s; write a smaller dt or a later end"),
        ("end: 1, numerics: {methods: {classical: {dt: 2}}}", "dt: a step of 2 s is longer than the run"),
        ("end: 1, numerics: {dt: 1e-300}", "dt: 1e-300 is below 1e-100"),
        ("end: 1, numerics: {iterations: 4294967297}", "iterations must be at most 2147483647"),
        ("end: 1, numerics: {multiplier_updates: 4294967297}", "multiplier_updates must be at most 2147483647"),
        ("end: 1, numerics: {methods: {augmented: {iterations: 4294967297}}}", "iterations must be at most 2147483647"),
        ("end: 1, numerics: {penalty: 1e200}", "penalty must be at most 1e+100"),
        ("end: 1, numerics: {penalty: 1/(dt-0.001)}", "penalty has no finite value at dt = 0.001 s; write another expression"),
        ("end: 1, numerics: {frequency: sqrt(0.0005-dt)}", "frequency has no finite value at dt = 0.001 s; write another expression"),
        ("end: 1, numerics: {penalty: 1/(dt-0.002), methods: {recursive: {dt: 2 ms}}}", "penalty has no finite value at dt = 0.002 s"),
    ],
)
def test_a_file_names_the_setting(settings: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(scene_text(settings), "pendulum.yaml")
    assert message in str(error.value)
    assert "pendulum.yaml:" in str(error.value)


def test_an_expression_of_dt_has_a_value_at_the_step_of_the_run() -> None:
    model = read_model_text(scene_text("end: 1, numerics: {penalty: 1/(dt-0.002)**2}"), "pendulum.yaml")
    scene = with_settings(model.scenes["rest"], "recursive", {"dt": 0.002})
    with pytest.raises(RunError, match=r"scene 'rest': penalty = .*: nan is not a finite number"):
        make_run_file(model, scene, {}, task="simulate")


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "--end", "1e300"], ["simulate", "--dt", "1e300"], ["simulate", "--dt", "1e-300"],
        ["simulate", "--solver-tolerance", "0"],
        ["simulate", "--iterations", "4294967297"], ["simulate", "--iterations", "0"], ["simulate", "--iterations", "1.5"],
        ["simulate", "--iterations", "1" + "0" * 400], ["batch", "--threads", "4294967297"], ["modes", "--at", "1e300"],
        ["realtime", "--end", "1e300"], ["realtime", "--iterations", "4294967297"],
    ],
)  # fmt: skip
def test_commands_refuse_what_is_out_of_range(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "pendulum.yaml").write_text(PENDULUM, encoding="utf-8")
    out = ["--out", str(tmp_path / "run.csv")]
    done = CliRunner().invoke(main, [arguments[0], str(tmp_path / "pendulum.yaml"), *arguments[1:], *out])
    assert done.exit_code == 2
    assert f"Invalid value for '{arguments[1]}'" in done.output
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.parametrize("command", [["check"], ["simulate", "--out", "run\udcff.csv"], ["check\udcff"]])
def test_names_are_utf_8(command: list[str], tmp_path: Path) -> None:
    (tmp_path / "pendulum.yaml").write_text(PENDULUM, encoding="utf-8")
    model = str(tmp_path / ("pendulum.yaml" if len(command) > 1 else "pendulum\udcff.yaml"))
    done = CliRunner().invoke(main, [command[0], model, *command[1:]])
    assert done.exit_code == 2
    assert "is not UTF-8; rename the file, or write another name" in done.output


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("positions: {pin.angle: 1e300}", "positions: 'pin.angle': an angle of 1e+300 rad has no exact sine and cosine"),
        ("positions: {pin.angle: -1.1e6}", "positions: 'pin.angle': an angle of -1.1e+06 rad has no exact sine and cosine"),
        ("rates: {pin.angle_rate: 1e13}", "rates: 'pin.angle_rate': 1e+13 is above 1e+12"),
    ],
)
def test_starts_have_exact_angles(settings: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(scene_text(f"end: 1, {settings}"), "pendulum.yaml")
    assert message in str(error.value)
    assert "pendulum.yaml:" in str(error.value)
