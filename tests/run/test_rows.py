"""Rows of equal steps: steps fit into rows whose distance the scene's step does not divide."""

from __future__ import annotations

from math import sqrt
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.ranges import count_steps
from cutjoint.model.read import read_model_text
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import Options
from tests.conftest import MODELS, needs_cpp
from tests.run.test_failing_starts import PENDULUM

pytestmark = needs_cpp

SCENE = "end: 0.02, output_step: 0.01, numerics: {dt: 0.01}"


def steps_of(row: str, dt: str, method: str = "recursive", task: str = "simulate", options: Options | None = None) -> tuple[float, float]:
    """The length of the steps of a run (s), and the distance of its rows."""
    text = PENDULUM.replace(SCENE, f"end: 1, output_step: {row}, numerics: {{dt: {dt}, frequency: 0.1/dt}}")
    assert text != PENDULUM
    model = read_model_text(text, "pendulum.yaml")
    file = make_run_file(model, model.scenes["rest"], {}, task=task, method=method, options=options or Options())
    dt_ = file.settings.dt
    if method == "recursive":
        assert file.settings.stabilisation.frequency == pytest.approx(0.1 / dt_)
    return dt_, dt_ * count_steps(dt_, file.end, file.output_step).stride


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented", "classical"])
@pytest.mark.parametrize(
    ("row", "dt", "expected", "distance"),
    [
        ("2.5 ms", "1 ms", 2.5e-3 / 3, 2.5e-3),
        (f"{sqrt(2)} ms", "1 ms", sqrt(2) * 5e-4, sqrt(2) * 1e-3),
        ("1/300", "1e-3", 1 / 1200, 1 / 300),
        ("3 ms", "1 ms", 1e-3, 3e-3),
        ("0.3", "0.1", 0.1, 0.3),
        ("1 ms", "1 ms", 1e-3, 1e-3),
    ],
)
def test_steps_are_the_next_shorter_that_divide_a_row(method: str, row: str, dt: str, expected: float, distance: float) -> None:
    assert steps_of(row, dt, method) == pytest.approx((expected, distance), rel=1e-12)


def test_steps_that_are_longer_than_a_row_have_a_row_each() -> None:
    assert steps_of("1 ms", "3 ms") == (3e-3, 3e-3)


def test_a_step_of_the_caller_and_of_real_time_stays() -> None:
    assert steps_of("2.5 ms", "1 ms", options=Options(dt=1e-3)) == (1e-3, 3e-3)
    assert steps_of("2.5 ms", "1 ms", task="realtime", options=Options(integrator="trapezoidal"))[0] == 1e-3


@pytest.mark.parametrize(("dt", "apart"), [("0.003", "0.009"), ("0.02", "0.02")])
def test_rows_that_a_step_of_the_caller_moves_are_named(tmp_path: Path, dt: str, apart: str) -> None:
    assert f"samples are {apart} s apart, not 0.01 s" in simulated(tmp_path, "--dt", dt)


@pytest.mark.parametrize("arguments", [(), ("--dt", "0.0025")])
def test_rows_at_the_multiples_of_the_output_step_need_no_word(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    assert "samples are" not in simulated(tmp_path, *arguments)


def simulated(folder: Path, *arguments: str) -> str:
    """The command line's output for the press, whose rows are to be 10 ms apart."""
    out = str(folder / "press.csv")
    done = CliRunner().invoke(main, ["simulate", str(MODELS / "press.yaml"), "--out", out, "--no-error", "--end", "0.1", *arguments])
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())
