"""Runs that leave the range of loop embeddings go on by the loops' equations, beside runs that have these from the start."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.derivation import schedule_method
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.failures import FailedRunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.analysis.test_assembled import STEERED, SWING
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.one_degree import four_bar, spatial
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

#: A motor whose current is a state, with a controller that adds up and one with a delay, each at times of its own, and a stop at which
#: the spring's formula changes.
MOTOR = """
forces:
  motor: {kind: joint_force, joint: a, law: 8*current + late.push}
  stop: {kind: joint_force, joint: a, law: "where(position > 0.3, -40*(position - 0.3), 0)"}
states: {current: {start: 0.1, rate: 20*(pid.torque - current)}}
controllers:
  pid:
    every: 30 ms
    signals: {torque: 0.05*(1 - a.angle) + 0.3*sum}
    memory: {sum: {start: 0, next: sum + 0.03*(1 - a.angle)}}
  late: {every: 70 ms, offset: 20 ms, delay: 140 ms, signals: {push: 2*bar.vx}}
outputs: [pid.sum, late.push, current.value, """
CONTROLLED = SWING.replace("outputs: [", MOTOR) % ", numerics: {events: located}"


def compiled(text: str, scene: str, loops: str, *, terms: int = 20, method: str = "recursive") -> Artifact:
    model = read_model_text(text, "model.yaml")
    numerics = replace(model.scenes[scene].numerics, loops=loops, loop_terms=terms)
    return compile_interpreted(model, replace(model.scenes[scene], numerics=numerics), method=method)


def both(text: str, scene: str, how: dict[str, Any], **choices: Any) -> tuple[Trajectory, Trajectory]:
    exact, gone_on = (simulate(compiled(text, scene, loops, **choices), **how) for loops in ("exact", "embedded"))
    assert gone_on.fallback.startswith("the loops' equations at t = ")
    assert not exact.fallback
    assert np.array_equal(gone_on.t, exact.t)
    return exact, gone_on


def apart(exact: Trajectory, other: Trajectory) -> dict[str, float]:
    """The largest differences of the columns beside their sizes."""
    return {name: float(np.abs(exact[name] - other[name]).max() / max(1.0, np.abs(exact[name]).max())) for name in exact.columns}


@pytest.mark.parametrize(
    ("text", "scene", "terms"),
    with_heavy(
        [(four_bar(0), "fall", 9), (spatial(2), "fall", 9), (spatial(3), "fall", 15), (four_bar(1), "fall", 15), (spatial(0), "fall", 12)],
        (four_bar(1), "fall", 15), (spatial(0), "fall", 12),
    ),
    ids=["plane", "spatial", "another spatial", "another plane", "a third spatial"],
)  # fmt: skip
def test_a_run_that_leaves_the_range_is_that_of_the_loops_equations(text: str, scene: str, terms: int) -> None:
    """Plane and spatial loops on a free carrier, one with a ball that follows, steps at a tolerance of 1e-11."""
    text = text.replace("end: 0.12, output_step: 12 ms", "end: 1, output_step: 50 ms")
    exact, gone_on = both(text, scene, {"integrator": "dormand-prince", "tolerance": 1e-11}, terms=terms)
    assert gone_on.energy is not None
    assert gone_on.energy.share < 1e-8
    for name, difference in apart(exact, gone_on).items():
        assert difference < (1e-6 if name.startswith(("pin", "rod.ax")) else 1e-8), (name, difference)


def test_a_guide_that_moves_carries_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Followers of a block with a moving rack have the rack's part of their coordinates and speeds."""
    monkeypatch.setattr("cutjoint.analysis.embedding.embed.DEAREST", 10_000)
    monkeypatch.setattr("cutjoint.analysis.embedding.embed._KEPT", {})
    exact, gone_on = both(STEERED, "steer", {"integrator": "dormand-prince", "tolerance": 1e-11, "error": False}, terms=10)
    for name, difference in apart(exact, gone_on).items():
        assert difference < (1e-6 if name == "hub.ax" else 1e-8), (name, difference)


def test_states_and_controllers_carry_over() -> None:
    """Sums and delays of controllers are known behind the range's end, and samples are taken once."""
    exact, gone_on = both(CONTROLLED, "fall", {"integrator": "dormand-prince", "tolerance": 1e-11, "error": False})
    for name, difference in apart(exact, gone_on).items():
        assert difference < 1e-8, (name, difference)
    assert gone_on.statistics.events_by_element == exact.statistics.events_by_element
    assert exact.statistics.events > 0


def test_runs_of_one_model_derive_the_loops_equations_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs with other steps go on by the same program."""
    artifact, made = compiled(CONTROLLED, "fall", "embedded"), []
    monkeypatch.setattr("cutjoint.compile.interpreted.schedule_method", lambda *a, **b: made.append(a) or schedule_method(*a, **b))
    for tolerance in (1e-8, 1e-9):
        assert simulate(artifact, integrator="dormand-prince", tolerance=tolerance, error=False).fallback
    assert len(made) == 1


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_equal_steps_go_on(method: str, tmp_path: Path) -> None:
    """Steps come nearer to those by the loops' equations by the square of their length; each has one row of what it took."""
    text = spatial(2).replace("end: 0.12, output_step: 12 ms", "end: 0.4, output_step: 50 ms")
    found = []
    for dt in (1e-3, 5e-4):
        how = {"integrator": "trapezoidal", "dt": dt, "tolerance": 1e-9, "error": False, "steps": tmp_path / "steps.csv"}
        exact, gone_on = both(text, "fall", how, terms=9, method=method)
        assert gone_on.steps == exact.steps == round(0.4 / dt)
        found.append(max(difference for name, difference in apart(exact, gone_on).items() if not name.startswith(("pin", "rod.ax"))))
    assert found[1] < 0.3 * found[0]
    times = np.loadtxt(tmp_path / "steps.csv", delimiter=",", skiprows=1)[:, 0]
    assert np.allclose(times, 5e-4 * np.arange(1, 801), atol=1e-15)


def test_newtons_method_goes_on() -> None:
    exact, gone_on = both(CONTROLLED.replace("end: 3", "end: 0.9"), "fall", {"integrator": "radau5", "tolerance": 1e-9, "error": False},
                          method="recursive-newton")  # fmt: skip
    assert max(apart(exact, gone_on).values()) < 1e-6


def test_the_command_line_writes_one_table(tmp_path: Path) -> None:
    """A table and a stream have the header and each row once; the command says where the run went over."""
    file = tmp_path / "swing.yaml"
    file.write_text(SWING % ", numerics: {loops: embedded, solver_tolerance: 1e-11}", encoding="utf-8")
    tables = {}
    for loops in ("exact", "embedded"):
        out = tmp_path / f"{loops}.csv"
        asked = ["simulate", str(file), "--loops", loops, "--implementation", "interpreted", "--no-error", "--out", str(out)]
        result = CliRunner().invoke(main, asked)
        assert result.exit_code == 0, result.output
        tables[loops] = out.read_text(encoding="utf-8")
        said = "switched to: the loops' equations at t = 0.1 s, since the functions of 'a' end at t = 0.15 s"
        assert (said in result.output.replace("\n", " ")) == (loops == "embedded")
    exact, gone_on = ([line.split(",") for line in table.splitlines()] for table in tables.values())
    assert [line[0] for line in gone_on] == [line[0] for line in exact]
    assert gone_on[0] == exact[0]
    assert np.abs(np.array(gone_on[1:], dtype=float) - np.array(exact[1:], dtype=float)).max() < 1e-8


def test_a_run_that_cannot_go_on_stops() -> None:
    """Coordinates of a view have another number behind the end; a range that the start is not in has no row."""
    artifact = compiled(SWING % "", "fall", "embedded")
    with pytest.raises(FailedRunError, match="the functions of its loops end there") as caught:
        simulate(artifact, coordinates=True, error=False)
    assert caught.value.trajectory.t[-1] == 0.1


@pytest.mark.heavy
def test_generated_code_goes_on() -> None:
    model = read_model_text(CONTROLLED, "model.yaml")
    scenes = [
        replace(model.scenes["fall"], on_violation="restart", numerics=replace(model.scenes["fall"].numerics, loops=loops))
        for loops in ("exact", "embedded")
    ]
    exact, gone_on = (simulate(compile_scene(model, scene), integrator="dormand-prince", tolerance=1e-11) for scene in scenes)
    assert gone_on.fallback
    assert max(apart(exact, gone_on).values()) < 1e-8
