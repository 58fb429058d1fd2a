"""The Lagrangian methods on the vehicle and the verification problems: one motion by all, second order, projections, singular poses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cutjoint.model.read import read_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint_bench.studies.problems import PROBLEMS, Problem, measure_errors, observed_orders
from tests.conftest import MODELS, with_heavy
from tests.mechanisms.four_bar import four_bar_text
from tests.physics.simulation import compile_model, completed, simulate, with_numerics
from tests.physics.test_iltis_references import check_in_phase_bump

LAGRANGIAN = ("augmented", "classical")
BY_NAME = {p.name: p for p in PROBLEMS}
each_method = pytest.mark.parametrize("method", LAGRANGIAN)


@cache
def compiled(model: str, scene: str | None, method: str) -> Artifact:
    return compile_model(MODELS / f"{model}.yaml", scene=scene, method=method)


def apart(one: Trajectory, other: Trajectory, columns: tuple[str, ...]) -> float:
    """The largest difference of columns at equal times."""
    assert one.t == pytest.approx(other.t, abs=1e-9)
    return float(np.max([np.abs(one[c] - other[c]) for c in columns]))


PLACE = ("chassis.x", "chassis.y", "chassis.z")


@pytest.mark.heavy
def test_all_methods_converge_to_one_motion_of_the_car() -> None:
    """iavsd_inphase_5 at 1e-4 s: positions of the three methods differ by less than 1e-6 m, and by less than at 2e-4 s."""
    runs = {
        method: {dt: completed(simulate(compiled("iltis", "iavsd_inphase_5", method), dt=dt)) for dt in (2e-4, 1e-4)}
        for method in ("recursive", *LAGRANGIAN)
    }
    for method in LAGRANGIAN:
        fine = apart(runs[method][1e-4], runs["recursive"][1e-4], PLACE)
        assert fine < 1e-6
        coarse = apart(runs[method][2e-4], runs["recursive"][2e-4], PLACE)
        assert fine < coarse / 2 or coarse < 1e-7


SCENES = [(scene, method) for scene in sorted(read_model(MODELS / "iltis.yaml").scenes) for method in LAGRANGIAN]
#: A steep road without bumpers and with them, each by one of the methods.
SOME_SCENES = [("simul1", "classical"), ("simul1s", "augmented")]


@pytest.mark.parametrize(("scene", "method"), with_heavy(SCENES, *(case for case in SCENES if case not in SOME_SCENES)))
def test_every_scene(scene: str, method: str) -> None:
    """At the method's own step the car comes to the end, on the way that the recursive method finds with a fine step.

    Roads with edges magnify small differences of the moment of contact: heights are compared in the mean.
    """
    run = completed(simulate(compiled("iltis", scene, method)))
    fine = completed(simulate(compiled("iltis", scene, "recursive"), dt=5e-4))
    height = np.interp(run.t, fine.t, fine["chassis.z"])
    assert run.t[-1] == pytest.approx(fine.t[-1], abs=run.t[1] - run.t[0])
    assert np.sqrt(np.mean((run["chassis.z"] - height) ** 2)) < 0.02
    assert run.statistics.residuals.position < 2e-8
    assert run.statistics.residuals.velocity < 1e-9


@each_method
def test_residuals_are_reported_for_each_step(method: str, tmp_path: Path) -> None:
    """Position, velocity and acceleration residuals of every step, below 1e-9 on a smooth road at 1 ms."""
    table = tmp_path / "steps.csv"
    run = completed(simulate(compiled("iltis", "iavsd_inphase_5", method), dt=1e-3, end=1.0, steps=table))
    header, *lines = table.read_text().splitlines()
    assert header == "t,iterations,position,velocity,acceleration"
    rows = np.array([[float(x) for x in line.split(",")] for line in lines])
    assert len(rows) == run.steps == 1000
    assert rows[:, 2:4].max() < 1e-9
    assert rows[:, 4].max() < 1e-7
    assert run.statistics.residuals.position >= rows[:, 2].max() > 0.0
    assert 1 <= rows[:, 1].mean() < 5


def test_operations_of_assembly_stay_what_they_are() -> None:
    """Figures to notice changes by, 2 % above those of today; instructions take four suspensions in lanes for one."""
    program = compiled("iltis", "simul1s", "augmented").program
    assert program.operations("linearise") < 1.02 * 26859
    assert program.instructions("linearise") < 1.02 * 7923
    assert program.operations("dynamic_residual") < 1.02 * 4511
    assert program.instructions("dynamic_residual") < 1.02 * 1370


@each_method
def test_in_phase_bump(method: str) -> None:
    """As near to the published run as `recursive`: places 2e-5 m and wheel loads 0.7 %."""
    check_in_phase_bump(completed(simulate(compiled("iltis", "iavsd_inphase_5", method))))


#: Three steps over which the error's dt^2 term leads; those of the recursive method where nothing is said.
STEPS = {"SC3D": (1.25e-4, 6.25e-5, 3.125e-5)}


@each_method
@pytest.mark.parametrize("name", with_heavy(sorted(BY_NAME), "A05", "SC3D"))
def test_second_order(name: str, method: str) -> None:
    problem: Problem = BY_NAME[name]
    artifact = compiled(problem.model, None, method)
    steps = STEPS.get(name, problem.steps)
    errors = [measure_errors(problem, completed(simulate(artifact, dt=dt, end=problem.smooth))) for dt in steps]
    assert observed_orders(errors) == pytest.approx([2, 2], abs=0.15)


#: Largest errors of the scenes as they stand: about one and a half times what was measured.
BOUNDS = {"A01": 1.4e-4, "A02": 3e-4, "A03": 1.5e-3, "A05": 4.2e-7, "SC3D": 6e-5}


@each_method
@pytest.mark.parametrize("name", sorted(BY_NAME))
def test_errors_of_the_scene_as_it_stands(name: str, method: str) -> None:
    """A02 passes ten singular poses."""
    problem = BY_NAME[name]
    run = completed(simulate(compiled(problem.model, None, method)))
    assert measure_errors(problem, run).largest < BOUNDS[name]


def in_line(folder: Path, method: str) -> Artifact:
    """A four-bar that starts where all its bars are in line."""
    positions = "{crank_0.pin.angle: -pi/2, crank_1.pin.angle: -pi/2, coupler_1.pin.angle: pi/2}"
    text = four_bar_text(1).replace("    rates:", f"    positions: {positions}\n    rates:")
    path = folder / "in_line.yaml"
    path.write_text(text, encoding="utf-8")
    return compile_model(path, scene="swing", method=method)


def test_augmented_starts_in_a_singular_pose(tmp_path: Path) -> None:
    """It does not matter to it that one equation says what others say; on which branch it goes on is not determined."""
    run = completed(simulate(in_line(tmp_path, "augmented"), end=0.3))
    assert run.statistics.residuals.position < 1e-9
    assert np.hypot(run["tip.x"], run["tip.y"]) == pytest.approx(np.ones(run.t.size), abs=1e-8)


def test_classical_reports_a_singular_pose_as_what_it_is(tmp_path: Path) -> None:
    """Not as a step that is too long: the equations that depend on others are named, the results up to then are kept."""
    run = simulate(in_line(tmp_path, "classical"), end=0.3, check=False)
    assert run.failure is not None
    assert "classical" in run.failure.message
    assert "singular" in run.failure.message
    assert "depend" in run.failure.message + run.failure.advice
    assert "augmented" in run.failure.advice
    assert run.failure.time == pytest.approx(0.0, abs=2e-3)


def test_results_up_to_a_failure_are_kept() -> None:
    """Newton's iteration does not come to rest in five iterations where the wheels meet the stairs."""
    run = simulate(with_numerics(compiled("iltis", "simul1s", "classical"), iterations=5), dt=0.02, check=False)
    assert run.failure is not None
    assert run.failure.message.startswith("classical: ")
    assert run.failure.element
    assert run.failure.advice
    assert 1.0 < run.failure.time < 10.0
    assert run.t[-1] == pytest.approx(run.failure.time - 0.02, abs=1e-9)
    assert np.isfinite(run["chassis.z"]).all()
