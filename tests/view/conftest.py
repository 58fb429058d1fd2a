"""Runs that are shown: a press with the places of all bodies, and the vehicle of ten seconds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from tests.conftest import MODELS
from tests.physics.simulation import is_generated


@pytest.fixture(scope="module", autouse=True)
def _interpreted() -> Iterator[None]:
    """Runs that are shown are interpreted, but in `make full`."""
    with pytest.MonkeyPatch.context() as patch:
        if not is_generated():
            patch.setenv("CUTJOINT_IMPLEMENTATION", "interpreted")
        yield


@dataclass(frozen=True)
class Shown:
    """A run's files."""

    page: Path
    glb: Path
    table: Path


def call(*arguments: object, status: int = 0) -> str:
    """The output of a command; it must end with a status."""
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == status, result.output
    return result.output


def places(*bodies: str) -> str:
    """Outputs that say where bodies are."""
    return ", ".join(f"{body}.{axis}" for body in bodies for axis in "xyz")


def show(folder: Path, text: str, *options: object) -> Shown:
    """A run of a model's text as a page and as glTF."""
    model, shown = folder / "model.yaml", Shown(page=folder / "run.html", glb=folder / "run.glb", table=folder / "run.csv")
    model.write_text(text, encoding="utf-8")
    for view in (shown.page, shown.glb):
        call("simulate", model, *options, "--no-error", "--out", shown.table, "--view", view)
    return shown


@pytest.fixture(scope="session")
def press(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    text = text.replace("outputs: [", f"outputs: [{places('crank', 'rod', 'slider')}, ").replace("slider.x, slider.vx", "slider.vx")
    return show(tmp_path_factory.mktemp("press"), text)


@pytest.fixture(scope="session")
def iltis(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    text = (MODELS / "iltis.yaml").read_text(encoding="utf-8")
    more = places("front_left.carrier", "rear_right.tie_rod")
    return show(tmp_path_factory.mktemp("iltis"), text.replace("outputs: [chassis.x", f"outputs: [{more}, chassis.x"), "--scene", "simul1")
