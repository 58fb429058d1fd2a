"""A run that would wait for the compiler is interpreted until compiled code is there."""

import json
from collections.abc import Iterator
from pathlib import Path
from secrets import randbelow
from subprocess import Popen

import numpy as np
import pytest
from click.testing import CliRunner, Result

from cutjoint.cli import main
from cutjoint.commands import options, preparing
from cutjoint.methods import AUTO
from cutjoint.toolchain import background
from cutjoint.toolchain.background import BuildPending
from cutjoint.toolchain.build import FLAGS, build_interpreter
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

IS_WATCHED = options.is_watched


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Popen[bytes]]]:
    """No patience with any compile; the begun ones end with the test."""
    build_interpreter("recursive", flags=FLAGS)
    monkeypatch.setattr(preparing, "PATIENCE", 0.0)
    monkeypatch.setattr(options, "is_watched", lambda: True)
    all_begun: list[Popen[bytes]] = []
    begin = background.build_in_background

    def build_in_background(*args: object, **how: object) -> tuple[Popen[bytes], float] | None:
        if (one := begin(*args, **how)) is not None:  # type: ignore[arg-type]
            all_begun.append(one[0])
        return one

    monkeypatch.setattr("cutjoint.compile.pipeline.build_in_background", build_in_background)
    yield all_begun
    for one in all_begun:
        one.wait()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The four-bar with a number of its own, so that no cache has it."""
    text = (MODELS / "four_bar.yaml").read_text(encoding="utf-8")
    assert text.count("gravity: [0, -9.81, 0]") == 1
    file = tmp_path / "four_bar.yaml"
    file.write_text(text.replace("-9.81", f"-{9.8 + 1e-12 * randbelow(10**9)!r}"))
    return file


def simulate(model: Path, out: Path, implementation: str = AUTO) -> Result:
    given = ("simulate", model, "--end", "0.3", "--verbose", "--implementation", implementation, "--out", out)
    return CliRunner().invoke(main, [str(x) for x in given])


def implementation_of(out: Path) -> str:
    return str(json.loads(out.with_suffix(".error.json").read_text())["implementation"])


def table(out: Path) -> np.ndarray:
    return np.loadtxt(out, delimiter=",", skiprows=1)


def test_the_first_answer_is_interpreted_and_the_next_compiled(begun: list[Popen[bytes]], model: Path, tmp_path: Path) -> None:
    first = simulate(model, tmp_path / "first.csv")
    assert first.exit_code == 0, first.output
    assert "interpreted, since compiling takes about" in first.output
    assert implementation_of(tmp_path / "first.csv") == "interpreted"
    assert [one.wait() for one in begun] == [0]
    second = simulate(model, tmp_path / "second.csv")
    assert "found in the cache" in second.output
    assert implementation_of(tmp_path / "second.csv") == "generated"
    assert len(begun) == 1
    np.testing.assert_allclose(table(tmp_path / "first.csv"), table(tmp_path / "second.csv"), rtol=0, atol=1e-8)


def test_compiled_code_that_is_there_first_takes_over(
    begun: list[Popen[bytes]], model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(BuildPending, "done", property(lambda self: self.process.wait() == 0))
    done = simulate(model, tmp_path / "run.csv")
    assert done.exit_code == 0, done.output
    assert len(begun) == 1
    assert "interpreted" not in done.output
    assert implementation_of(tmp_path / "run.csv") == "generated"
    assert {p.name for p in tmp_path.iterdir()} == {"four_bar.yaml", "run.csv", "run.units.json", "run.error.json"}
    monkeypatch.undo()
    simulate(model, tmp_path / "again.csv", "generated")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "run.csv").read_bytes()


def test_who_asks_for_generated_code_waits_for_it(begun: list[Popen[bytes]], model: Path, tmp_path: Path) -> None:
    assert simulate(model, tmp_path / "run.csv", "generated").exit_code == 0
    assert not begun
    assert implementation_of(tmp_path / "run.csv") == "generated"


def test_scripts_wait_for_generated_code(
    begun: list[Popen[bytes]], model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(options, "is_watched", IS_WATCHED)
    assert simulate(model, tmp_path / "run.csv").exit_code == 0
    assert not begun
    assert implementation_of(tmp_path / "run.csv") == "generated"


def test_a_compile_that_fails_leaves_the_answer(
    begun: list[Popen[bytes]], model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background, "_START", "raise SystemExit(1)")
    assert simulate(model, tmp_path / "run.csv").exit_code == 0
    assert implementation_of(tmp_path / "run.csv") == "interpreted"
