"""Settings that no run has are refused by name, on the command line and from Python, before anything runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.commands.table import Setting
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import require_settings
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import run_in_real_time
from cutjoint.tasks.states import find_scene_modes
from cutjoint_bench.generic.artifact import compile_generic
from tests.conftest import needs_cpp
from tests.run.test_failing_starts import PENDULUM

pytestmark = needs_cpp


@cache
def pendulum() -> Model:
    return read_model_text(PENDULUM, "pendulum.yaml")


@cache
def compiled() -> Artifact:
    return compile_scene(pendulum(), pendulum().scenes["rest"])


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"dt": -1e-3}, "dt: -0.001 is not above 0; write a larger number"),
        ({"dt": 0.0}, "dt: 0 is not above 0; write a larger number"),
        ({"dt": nan}, "dt: nan is not a finite number; write a plain number in SI units"),
        ({"end": inf}, "end: inf is not a finite number; write a plain number in SI units"),
        ({"end": -1.0}, "end: -1 is below 0; write a larger number"),
        ({"at": -1.0}, "at: -1 is below 0; write a larger number"),
        ({"tolerance": nan}, "solver_tolerance: nan is not a finite number; write a plain number in SI units"),
        ({"penalty": -inf}, "penalty: -inf is not a finite number; write a plain number in SI units"),
        ({"iterations": 0}, "iterations: 0 is not above 0; write a larger number"),
        ({"threads": 0}, "threads: 0 is not above 0; write a larger number"),
    ],
)
def test_what_no_run_has(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(RunError) as error:
        require_settings(**asked)
    assert str(error.value) == message


def test_what_runs_have() -> None:
    require_settings(dt=1e-3, end=0.0, at=0.0, penalty=1e5, tolerance=1e-9, iterations=1, threads=1)
    require_settings()


@pytest.mark.parametrize(
    ("run", "name"),
    [
        (lambda: simulate(compiled(), dt=-1e-3), "dt"),
        (lambda: simulate(compiled(), end=inf), "end"),
        (lambda: simulate(compiled(), tolerance=0.0), "solver_tolerance"),
        (lambda: simulate(compiled(), accuracy=0.0), "accuracy"),
        (lambda: simulate(compiled(), penalty=nan), "penalty"),
        (lambda: simulate(compiled(), penalty=inf), "penalty"),
        (lambda: simulate(compiled(), iterations=0), "iterations"),
        (lambda: simulate(compiled(), parameters={"gap": nan}), "parameter 'gap'"),
        (lambda: run_in_real_time(compiled(), end=-1.0), "end"),
        (lambda: find_scene_modes(pendulum(), pendulum().scenes["rest"], at=nan), "at"),
    ],
)
def test_every_run_refuses_them(run: Callable[[], object], name: str) -> None:
    with pytest.raises(RunError, match=rf"^{name}: \S+ is (not a finite number|not above 0|below 0); write "):
        run()


def test_nothing_else_is_said_of_steps_beside_an_accuracy() -> None:
    with pytest.raises(RunError, match=r"^accuracy: it determines the steps; remove dt and solver_tolerance or the accuracy$"):
        simulate(compiled(), accuracy=1e-3, dt=1e-3, tolerance=1e-9)


def test_an_unknown_method() -> None:
    words = r"^no method 'euler'; there is recursive, augmented, classical, recursive-newton$"
    with pytest.raises(RunError, match=words):
        compile_scene(pendulum(), pendulum().scenes["rest"], CompileOptions(method="euler"))
    with pytest.raises(RunError, match=words):
        compile_generic(pendulum(), pendulum().scenes["rest"], method="euler")


def test_parameters_are_numbers() -> None:
    with pytest.raises(RunError, match=r"^parameter 'gap': inf is not a finite number; write a plain number in SI units$"):
        make_run_file(pendulum(), pendulum().scenes["rest"], {"gap": inf}, task="simulate")


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--set", "gap=nan"], 1, "--set gap=nan: unknown symbol 'nan'; write NAME=NUMBER, with a unit or without"),
        (["--set", "gap=1e400"], 1, "--set gap=1e400: inf is not a finite number; write a plain number in SI units"),
        (["--set", "gap=1", "--set", "gap=2"], 1, "--set gap=2: 'gap' is set twice; write one of the two"),
        (["--dt", "1 mm"], 2, "Invalid value for '--dt': '1 mm' is in m, and a time needs s."),
        (["--dt", "1mss"], 2, "Invalid value for '--dt': unknown unit 'mss'."),
        (["--dt", "nan"], 2, "Invalid value for '--dt': 'nan' is not a plain decimal number."),
        (["--dt", "1e400"], 2, "Invalid value for '--dt': inf is not a finite number; write a plain number in SI units"),
        (["--end", "inf"], 2, "Invalid value for '--end': 'inf' is not a plain decimal number."),
        (["--solver-tolerance", "1 ms"], 2, "Invalid value for '--solver-tolerance': '1 ms' is in s, and a tolerance needs m or rad."),
        (["--solver-tolerance", "inf"], 2, "Invalid value for '--solver-tolerance': 'inf' is not a plain decimal number."),
    ],
)
def test_the_command_names_the_option(arguments: list[str], status: int, message: str, tmp_path: Path) -> None:
    """Of a run that is kept as of one that is not."""
    (tmp_path / "pendulum.yaml").write_text(PENDULUM, encoding="utf-8")
    plain = ["simulate", str(tmp_path / "pendulum.yaml"), "--out", str(tmp_path / "run.csv")]
    for _ in range(2):
        done = CliRunner().invoke(main, [*plain, *arguments])
        assert done.exit_code == status
        assert message in done.output
        assert CliRunner().invoke(main, plain).exit_code == 0


@pytest.mark.parametrize(("text", "value"), [("1mm", 1e-3), ("2e-3", 2e-3), ("180 deg", pi)])
def test_a_tolerance_may_have_a_unit(text: str, value: float) -> None:
    assert Setting("tolerance").convert(text, None, None) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("arguments", [["modes", "--at", "nan"], ["reduce", "--dt", "inf"], ["realtime", "--end", "nan"]])
def test_other_commands_do_as_well(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "pendulum.yaml").write_text(PENDULUM, encoding="utf-8")
    done = CliRunner().invoke(main, [arguments[0], str(tmp_path / "pendulum.yaml"), *arguments[1:]])
    assert done.exit_code == 2
    assert f"Invalid value for '{arguments[1]}'" in done.output
