"""One integrator in all hosts: the table of the command line, of the interpreter, of folders, FMUs and sweeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from tests.conftest import MODELS, needs_cpp
from tests.fmu.slaves import OK, Slave, fmu_of, text_of
from tests.mechanisms.bouncing import exact_bounces
from tests.physics.simulation import read_reference

pytestmark = needs_cpp

PRESS = MODELS / "press.yaml"
INTEGRATOR, TOLERANCE, END = "dop853", 1e-10, 0.6


def table_of(file: Path, out: Path, *words: str) -> dict[str, np.ndarray]:
    """The table of the command line."""
    settings = ("--integrator", INTEGRATOR, "--solver-tolerance", str(TOLERANCE), "--end", str(END), "--no-error", *words)
    done = CliRunner().invoke(main, ["simulate", str(file), "--out", str(out), *settings])
    assert done.exit_code == 0, done.output
    return read_reference(out)


def test_hosts_have_one_table(tmp_path: Path) -> None:
    """The press closes a loop.  Hosts' steps end at their rows, others do not: errors of a step apart."""
    known = table_of(PRESS, tmp_path / "generated.csv", "--implementation", "generated")
    interpreted = table_of(PRESS, tmp_path / "interpreted.csv", "--implementation", "interpreted")
    assert cells_of(interpreted) == pytest.approx(cells_of(known), abs=1e-9)
    sim = cutjoint.load(PRESS, integrator=INTEGRATOR).reset(tolerance=TOLERANCE)
    rows = [list(sim.outputs.array), *(list(row) for row in sim.run(len(known["t"]) - 1))]
    assert np.array(rows) == pytest.approx(np.array([known[name] for name in sim.outputs]).T, abs=1e-7)
    slave = Slave(fmu_of("press", 3, integrator=INTEGRATOR))
    assert slave.set(integrator__relative_tolerance=TOLERANCE, integrator__absolute_tolerance=TOLERANCE) == slave.initialise() == OK
    assert slave.step(0.0, END) == OK, slave.log
    assert slave.get("slider.x")[0] == pytest.approx(known["slider.x"][-1], abs=1e-8)
    study = {
        "cutjoint_study": 1, "model": str(PRESS), "parameters": {"stiffness": [2000]}, "design": "grid", "integrator": INTEGRATOR,
        "solver_tolerance": TOLERANCE, "end": END, "trajectories": {"outputs": ["slider.x"]},
    }  # fmt: skip
    done = cutjoint.sweep(study, tmp_path / "out.parquet")
    alone = table_of(PRESS, tmp_path / "alone.csv", "--set", "stiffness=2000")
    assert done.failures == [None]
    assert done["slider.x(t)"][0] == pytest.approx(alone["slider.x"], abs=1e-8)


def cells_of(table: dict[str, np.ndarray]) -> np.ndarray:
    return np.stack(list(table.values()))


@pytest.mark.parametrize("closure", ["penalty", "proximal"])
def test_closures_have_one_motion(closure: str, tmp_path: Path) -> None:
    """Multipliers are corrected until nothing of either is left."""
    other = tmp_path / "press.yaml"
    other.write_text(PRESS.read_text(encoding="utf-8"), encoding="utf-8")
    found = table_of(other, tmp_path / "one.csv", "--closure", closure)
    assert cells_of(found)[:3] == pytest.approx(cells_of(table_of(PRESS, tmp_path / "other.csv"))[:3], abs=1e-8)


@pytest.mark.parametrize(("events", "within"), [("located", 1e-8), ("crossed", 1e-2)])
def test_events_are_located_or_crossed(events: str, within: float, tmp_path: Path) -> None:
    """A mass that falls on a stop with a damper, whose force jumps."""
    path = tmp_path / "bounce.yaml"
    path.write_text(text_of("bounce"), encoding="utf-8")
    found = table_of(path, tmp_path / "run.csv", "--events", events)
    heights, _ = exact_bounces(found["t"], 5.0, 0.3)
    assert np.abs(found["mass.z"] - heights).max() < within
