"""Runs that take long say so after ten seconds; where stability limits their steps, the implicit integrator takes over."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.run import simulator
from cutjoint.run.simulator import call_simulator, watched
from tests.conftest import needs_cpp

SLOW = {"progress": 0.05, "slow": {"steps": 1000, "stiff_steps": 900, "time": 0.01}}
MODEL = """
cutjoint: 1
name: swing
gravity: [0, 0, -9.81]
bodies: {arm: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
outputs: [pin.angle]
scenes: {fall: {end: 0.4, output_step: 10 ms SETTINGS}}
"""


def test_a_watcher_hears_of_a_run_that_takes_long(tmp_path: Path) -> None:
    script = tmp_path / "simulator"
    script.write_text(
        """#!/bin/sh
echo '{"progress": 0.5}'
echo '{"progress": 0.51, "slow": {"steps": 7, "time": 0.1}}'
echo '{"status": "done"}'
""", encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    heard: list[Any] = []
    shares: list[float] = []
    with watched(heard.append):
        assert call_simulator(script, {}, shares.append) == {"status": "done"}
    call_simulator(script, {})
    assert heard == [{"steps": 7, "time": 0.1}]
    assert shares == [0.5, 0.51]


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run seems to take long, and stiff."""
    read = simulator._read_record
    monkeypatch.setattr(simulator, "_read_record", lambda line: {**SLOW, **record} if "progress" in (record := read(line)) else record)


def run(tmp_path: Path, settings: str = "", *options: str) -> tuple[str, np.ndarray]:
    file, out = tmp_path / "swing.yaml", tmp_path / "out.csv"
    file.write_text(MODEL.replace("SETTINGS", settings), encoding="utf-8")
    result = CliRunner().invoke(main, ["simulate", str(file), "--implementation", "interpreted", "--no-error", "--out", str(out), *options])
    assert result.exit_code == 0, result.output
    return result.output.replace("\n", " "), np.loadtxt(out, delimiter=",", skiprows=1)


@needs_cpp
@pytest.mark.usefixtures("slow")
def test_the_implicit_integrator_takes_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.commands.options.is_watched", lambda: True)
    said, rows = run(tmp_path)
    assert "after 10 s at t = 0.01 s of 0.4 s, 1000 steps by dormand-prince, limited by stability, not accuracy" in said
    assert "switched to: the method recursive-newton" in said
    assert abs(rows[-1, 0] - 0.4) < 1e-12
    speed = np.gradient(rows[:, 1], rows[:, 0], edge_order=2)
    energy = 0.5 * 0.35 * speed**2 - 9.81 * 0.5 * np.sin(rows[:, 1])  # the angle falls about y
    assert np.abs(energy).max() < 0.01 * 9.81 * 0.5


@needs_cpp
@pytest.mark.usefixtures("slow")
@pytest.mark.parametrize(
    ("settings", "options", "words"),
    [("", (), "limited by stability, not accuracy; use --method recursive-newton"),
     ("", ("--method", "recursive"), "limited by stability, not accuracy; use --method recursive-newton"),
     (", numerics: {integrator: dormand-prince}", (), "limited by stability, not accuracy; use --method recursive-newton")],
)  # fmt: skip
def test_who_has_chosen_is_reported(settings: str, options: tuple[str, ...], words: str, tmp_path: Path) -> None:
    said, _ = run(tmp_path, settings, *options)
    assert words in said
    assert "went over" not in said
