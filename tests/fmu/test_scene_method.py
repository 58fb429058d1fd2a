"""The method of a scene in what is exported: FMUs, C, C99 and explained equations."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from tests.conftest import MODELS


def press(method: str) -> str:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    begin = text.index("{", text.index("scenes:")) + 1
    return f"{text[:begin]}method: {method}, {text[begin:]}"


def read(method: str) -> Model:
    return read_model_text(press(method), "press.yaml")


@pytest.mark.parametrize("method", METHODS)
def test_an_fmu_has_the_steps_of_the_scenes_method(method: str) -> None:
    model = read(method)
    scene = next(iter(model.scenes.values()))
    assert make_fmu(model, scene, version=2).standalone.method == method
    assert make_fmu(model, scene, version=2, method="recursive").standalone.method == "recursive"


def test_model_exchange_has_the_equations_of_the_recursive_method() -> None:
    model = read("recursive-newton")
    assert make_fmu(model, next(iter(model.scenes.values())), version=2, kind="me").standalone.method == "recursive"


@pytest.mark.parametrize("options", [("explain",), ("compile", "--language", "c99", "--out", "press")])
def test_commands_take_the_scenes_method_where_it_has_what_they_write(options: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "press.yaml"
    path.write_text(press("recursive-newton"), encoding="utf-8")
    command, *more = options
    if "press" in more:
        more[-1] = str(tmp_path / "press")
    result = CliRunner().invoke(main, [command, str(path), *more])
    assert result.exit_code == 0, result.output
    said = result.output if command == "explain" else (tmp_path / "press" / "README.md").read_text(encoding="utf-8")
    assert ("recursive-newton" in said) is (command == "explain")
