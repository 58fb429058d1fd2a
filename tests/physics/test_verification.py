"""The verification problems against their references: order of convergence, errors at the scene's own step, invariants, the limit of dt.

The reference files were computed by high-order integration to 12 digits or more; the values in this file are the published ones.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
import pytest

from cutjoint.compile import pipeline
from cutjoint.model.read import read_model
from cutjoint.model.records import Output
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint_bench.studies import verification
from cutjoint_bench.studies.problems import PROBLEMS, Array, Problem, measure_errors, observed_orders, read_reference, reference_rows
from tests.physics.simulation import compile_model, completed, simulate

BY_NAME = {p.name: p for p in PROBLEMS}

each_problem = pytest.mark.parametrize("problem", PROBLEMS, ids=[p.name for p in PROBLEMS])


@cache
def compiled(problem: Problem) -> Artifact:
    """The problem's model, with the outputs that its invariants need beside its own."""
    model = read_model(problem.path)
    (scene,) = model.scenes.values()
    own = {o.column for o in scene.outputs}
    extra = [c for c in INVARIANT_OUTPUTS.get(problem.name, ()) if c not in own]
    outputs = [*scene.outputs, *(Output(element=e, quantity=q, span=scene.span) for e, _, q in (c.rpartition(".") for c in extra))]
    return compile_model(problem.path, outputs=outputs)


def run_of(name: str, **changes: float) -> Trajectory:
    return completed(simulate(compiled(BY_NAME[name]), **changes))


def columns(bodies: Iterable[str], quantities: str) -> list[str]:
    return [f"{body}.{quantity}" for body in bodies for quantity in quantities.split()]


def vectors(run: Trajectory, element: str, quantity: str) -> Array:
    """Three columns as one array (3, n): quantity "" for places, "v" for velocities, "w" for angular velocities."""
    return np.stack([run[f"{element}.{quantity}{axis}"] for axis in "xyz"])


INVARIANT_OUTPUTS = {
    "A03": columns([f"K{i}" for i in range(1, 8)], "vx vy wz"),
    "A05": columns(["slider", "shaft"], "wz")
    + columns(["right.rod", "left.rod"], "x y z vx vy vz wx wy wz")
    + columns(["right.ball", "left.ball"], "x y z vx vy vz"),
    "SC3D": columns(["crank"], "x y z vx vy vz wx wy wz") + columns(["rod"], "x y z vx vy vz wx wy wz") + columns(["slider"], "y z"),
}


@each_problem
def test_second_order(problem: Problem) -> None:
    """Halving dt quarters the largest error.  `augmented` and `classical`: test_lagrangian.py."""
    runs = [completed(simulate(compiled(problem), dt=dt, end=problem.smooth)) for dt in problem.steps]
    assert observed_orders([measure_errors(problem, run) for run in runs]) == pytest.approx([2, 2], abs=0.1)


#: Steps over which the error's dt^2 term leads, where they are not those of the recursive method: stiffness does not limit them.
NEWTON_STEPS = {"A05": (5e-3, 2.5e-3, 1.25e-3), "SC3D": (2.5e-4, 1.25e-4, 6.25e-5)}


@each_problem
def test_second_order_of_newtons_iteration(problem: Problem) -> None:
    """At a tolerance so small that the iteration does not lead, see docs/reference/integrators.md.

    A03 shows 2.11 and 2.06: the first of its steps are long for its jerks.
    """
    artifact = compile_model(problem.path, method="recursive-newton")
    steps = NEWTON_STEPS.get(problem.name, problem.steps)
    runs = [completed(simulate(artifact, dt=dt, end=problem.smooth, tolerance=1e-10)) for dt in steps]
    assert observed_orders([measure_errors(problem, run) for run in runs]) == pytest.approx([2, 2], abs=0.12)


def test_lanes_change_nothing() -> None:
    """The governor's two arms side by side or one after the other: the same motion, to what the tolerance of the iteration leaves."""
    problem = BY_NAME["A05"]
    together, apart = (pipeline.compile_model(problem.path, lanes=lanes) for lanes in (True, False))
    assert together.program.instructions("evaluate") < 0.6 * apart.program.instructions("evaluate")
    one, other = (completed(simulate(artifact, end=2.0)) for artifact in (together, apart))
    for column in one.columns:
        assert one[column] == pytest.approx(other[column], abs=1e-9), column


#: Largest and scaled error that the scenes may have as they stand in the model files: about one and a half times what was measured.
BOUNDS = {"A01": (3.5e-5, 4.5e-5), "A02": (2.5e-4, 2.5e-4), "A03": (2.7e-5, 2.4e-6), "A05": (3.6e-7, 2.4e-7), "SC3D": (2.4e-4, 3.0e-4)}


@each_problem
def test_errors_of_the_scene_as_it_stands(problem: Problem) -> None:
    assert compiled(problem).scene.numerics.dt == problem.steps[1]
    run = run_of(problem.name)
    assert run.t[-1] == pytest.approx(compiled(problem).scene.end, abs=1e-9)
    errors = measure_errors(problem, run)
    largest, scaled = BOUNDS[problem.name]
    assert errors.largest < largest
    assert errors.scaled < scaled


#: x and y of the pendulum.
PENDULUM = {
    1: (0.986291751132, -0.165010853126), 5: (-0.942305435044, -0.334754338414), 10: (-0.275087462577, -0.961419205099),
    100: (-0.181513351427, -0.983388480334),
}  # fmt: skip


def test_pendulum_through_42_swings() -> None:
    """The error is one of the period and grows with time: 2.3e-6 m a second."""
    run = run_of("A01", end=100.0)
    for t, published in PENDULUM.items():
        row = np.searchsorted(run.t, t - 1e-9)
        assert BY_NAME["A01"].exact(np.array([float(t)]))[0] == pytest.approx(published, abs=1e-12)
        assert (run["bob.x"][row], run["bob.y"][row]) == pytest.approx(published, abs=4e-6 * t)


@pytest.mark.parametrize(
    ("name", "column", "published", "tolerance"),
    [
        ("A02", "tip.x", {10: 0.328458111541}, 5e-5),
        ("A02", "tip.y", {10: 0.944518538179}, 5e-5),
        ("A03", "crank.angle", {0.03: 15.800174671 + 0.062, 0.05: 33.815340721 + 0.062}, 4e-6),
        ("A03", "F.x", {0.03: -0.006970261}, 3e-8),
        ("A03", "F.y", {0.03: -0.000644565}, 3e-8),
        ("A05", "slider.z", {0.1: 0.5238364756, 1: 0.5014209224, 5: 0.5355631037, 10: 0.6196229171}, 1e-7),
        ("SC3D", "slider.x", {1: 0.2117216614, 5: 0.2407195737}, 6e-5),
    ],
)
def test_published_values(name: str, column: str, published: dict[float, float], tolerance: float) -> None:
    """At half the scene's step."""
    run = run_of(name, dt=BY_NAME[name].steps[2])
    found = [run[column][np.searchsorted(run.t, t - 1e-9)] for t in published]
    assert found == pytest.approx(list(published.values()), abs=tolerance)


def test_andrews_joint_angles_and_point_f() -> None:
    """The other columns of the reference, at every row."""
    run = run_of("A03")
    reference = reference_rows("ref_a03_andrews_iftomm.csv", ("x_F", "y_F", "dbeta"), run.t)
    assert run["F.x"] == pytest.approx(reference[:, 0], abs=2e-7)
    assert run["F.y"] == pytest.approx(reference[:, 1], abs=2e-7)
    assert run["crank.angle_rate"] == pytest.approx(reference[:, 2], abs=0.03)


ANDREWS_MASSES = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
ANDREWS_INERTIAS = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)


def andrews_balance(run: Trajectory) -> Array:
    """Kinetic energy and that of the spring, less the work of the torque."""
    bodies = zip(range(1, 8), ANDREWS_MASSES, ANDREWS_INERTIAS, strict=True)
    kinetic = sum(m * (run[f"K{i}.vx"] ** 2 + run[f"K{i}.vy"] ** 2) / 2 + J * run[f"K{i}.wz"] ** 2 / 2 for i, m, J in bodies)
    return np.asarray(kinetic + 4530 * (run["spring.length"] - 0.07785) ** 2 / 2 - 0.033 * run["crank.angle"])


def test_andrews_energy_is_the_work_of_the_torque() -> None:
    """T + V - 0.033 (beta - beta_0), while T rises to 1.1 J; its error is of second order too."""
    coarse, fine = (andrews_balance(run_of("A03", dt=dt)) for dt in BY_NAME["A03"].steps[1:])
    assert coarse[0] == pytest.approx(read_reference("ref_a03_andrews_iftomm.csv")["E_minus_work"][0], abs=1e-11)
    drift = [np.abs(b - b[0]).max() for b in (coarse, fine)]
    assert drift[0] < 7e-5
    assert np.log2(drift[0] / drift[1]) == pytest.approx(2, abs=0.1)


def rod_inertia_times(axial: float, across: float, along: Array, w: Array) -> Array:
    """J w of slender rods along unit vectors, all (3, n)."""
    return across * w + (axial - across) * (along * w).sum(axis=0) * along


def flyball_momentum(run: Trajectory) -> Array:
    """Angular momentum about the shaft."""

    def orbital(mass: float, body: str) -> Array:
        place, velocity = vectors(run, body, ""), vectors(run, body, "v")
        return np.asarray(mass * (place[0] * velocity[1] - place[1] * velocity[0]))

    total = 5.0e-6 * run["shaft.wz"] + 0.005 * run["slider.wz"]
    for side in ("right", "left"):
        along = 2 * (vectors(run, f"{side}.ball", "") - vectors(run, f"{side}.rod", ""))
        spin = rod_inertia_times(5.0e-6, 0.0250025, along, vectors(run, f"{side}.rod", "w"))
        total = total + orbital(0.3, f"{side}.rod") + orbital(5.0, f"{side}.ball") + spin[2]
    return np.asarray(total)


def test_flyball_angular_momentum() -> None:
    """No torque about the shaft: H_z stays, to the order of the integration."""
    momentum = flyball_momentum(run_of("A05"))
    assert momentum[0] == pytest.approx(53.86899865841844, abs=1e-12)
    assert momentum == pytest.approx(momentum[0], abs=2.5e-7)


def test_flyball_stays_symmetric() -> None:
    run = run_of("A05")
    assert run["right.hinge.angle"] == pytest.approx(run["left.hinge.angle"], abs=1e-12)


def test_flyball_goes_by_steps_that_resolve_none_of_its_stiffness() -> None:
    """Its fastest eigenvalue is -8075 1/s, so that a plain fixed point would contract for dt < 2.48e-4 s; errors are those of the rule."""
    ends = [simulate(compiled(BY_NAME["A05"]), dt=dt, end=2.0)["slider.z"][-1] for dt in (2e-3, 1e-3, 5e-4)]
    assert (ends[0] - ends[1]) / (ends[1] - ends[2]) == pytest.approx(4, abs=0.2)


def test_flyball_too_large_a_step_is_refused_clearly() -> None:
    run = simulate(compiled(BY_NAME["A05"]), dt=5e-3, check=False)
    assert run.failure is not None
    assert str(run.failure).startswith("the fixed point diverged to infinity at t = 0.77 s (step 154); worst at 'left.")
    assert run.failure.advice == ("a force, parameter or input may be out of its range; try: a smaller dt, or compiling with the method"
                                  " recursive-newton, as for stiff models")  # fmt: skip
    assert run.t[-1] == pytest.approx(0.76, abs=0.011)


def test_flyball_that_grows_stiffer_keeps_its_results() -> None:
    """Without spin the arms sink, the springs' leverage grows and the step that served becomes too large on the way."""
    artifact = compiled(BY_NAME["A05"])
    run = simulate(artifact, dt=5e-3, parameters={"spin": 0.0}, check=False)
    assert run.failure is not None
    assert "diverged" in run.failure.message
    assert 0.01 < run.failure.time < 0.1
    assert run.t[-1] == pytest.approx(run.failure.time, abs=0.0101)
    small = simulate(artifact, dt=1e-4, parameters={"spin": 0.0}, end=0.1)
    assert run["slider.z"][:-1] == pytest.approx(small["slider.z"][: len(run.t) - 1], abs=1e-4)


def test_slider_crank_starts_with_consistent_speeds() -> None:
    """Only the crank's speed is given; the others follow from the loop."""
    run = run_of("SC3D", end=0.01)
    assert run["crank_pin.angle_rate"][0] == pytest.approx(6, abs=1e-12)
    assert run["slider.vx"][0] == pytest.approx(0.24, abs=1e-12)
    assert vectors(run, "rod", "v")[:, 0] == pytest.approx([0.12, -0.24, 0], abs=1e-12)
    assert vectors(run, "rod", "w")[:, 0] == pytest.approx([1.92, -0.96, 0.48], abs=1e-12)


def slider_crank_energy(run: Trajectory) -> Array:
    """T + V of the three bodies."""
    rod, w, v = vectors(run, "rod", ""), vectors(run, "rod", "w"), vectors(run, "rod", "v")
    end = np.stack([run["slider.x"], run["slider.y"], run["slider.z"]])
    along = (end - rod) / 0.15
    crank = 0.12 * (vectors(run, "crank", "v") ** 2).sum(axis=0) / 2 + 1e-4 * run["crank.wx"] ** 2 / 2
    coupler = 0.5 * (v**2).sum(axis=0) / 2 + (w * rod_inertia_times(0.0004, 0.004, along, w)).sum(axis=0) / 2
    return np.asarray(crank + coupler + run["slider.vx"] ** 2 + 9.81 * (0.12 * run["crank.z"] + 0.5 * run["rod.z"]))


def test_slider_crank_energy() -> None:
    """T + V is constant; its error is of second order."""
    coarse, fine = (slider_crank_energy(run_of("SC3D", dt=dt)) for dt in BY_NAME["SC3D"].steps[1:])
    assert coarse[0] == pytest.approx(0.76643568, abs=1e-12)
    drift = [np.abs(e - e[0]).max() for e in (coarse, fine)]
    assert drift[0] < 1.4e-4
    assert np.log2(drift[0] / drift[1]) == pytest.approx(2, abs=0.1)


def test_the_benchmark_has_a_line_for_every_problem() -> None:
    lines = list(verification.report([verification.measure(p, compiled(p), repetitions=1) for p in PROBLEMS]))
    assert [line.split()[0] for line in lines[-len(PROBLEMS) :]] == list(BY_NAME)
    assert any(line.startswith("compiler") for line in lines)
