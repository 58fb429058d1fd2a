"""Explicit integrators: orders, errors that follow the tolerance, events, closed loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from cutjoint.pipeline import Artifact, compile_model
from cutjoint.run.results import Trajectory
from tests.conftest import DATA, MODELS
from tests.mechanisms.bouncing import bouncing_text, exact_bounces
from tests.mechanisms.verification import PROBLEMS, measure_errors
from tests.physics.simulation import compile_text, completed, read_reference, simulate
from tests.physics.test_iltis_references import WHEELS, check
from tests.physics.test_spin import SPIN, TEXT, attitude, body_rates

BY_NAME = {p.name: p for p in PROBLEMS}


@cache
def compiled(name: str, scene: str | None = None) -> Artifact:
    return compile_model(MODELS / f"{name}.yaml", scene=scene)


def orders(errors: Sequence[float]) -> list[float]:
    """What each halving of the step shows."""
    return [float(np.log2(a / b)) for a, b in pairwise(errors)]


def check_proportional(error: Callable[[float], float], tolerances: Sequence[float], *, within: float = 3.0) -> None:
    """Errors over tolerance stay within a factor, over decades of tolerance: the sign of an order that is kept everywhere."""
    ratios = [error(tolerance) / tolerance for tolerance in tolerances]
    assert max(ratios) < within * min(ratios), ratios


#: Problem, length of the run (A02 before its singular pose), steps for RK4.
SMOOTH = [("A01", 2.0, (4e-2, 2e-2, 1e-2)), ("A02", 0.6, (4e-2, 2e-2, 1e-2)), ("SC3D", 1.0, (6.25e-4, 3.125e-4, 1.5625e-4))]


@pytest.mark.parametrize(("name", "end", "steps"), SMOOTH, ids=[s[0] for s in SMOOTH])
def test_fourth_order(name: str, end: float, steps: tuple[float, ...]) -> None:
    problem = BY_NAME[name]
    runs = [completed(simulate(compiled(problem.model), integrator="rk4", dt=dt, end=end)) for dt in steps]
    errors = [measure_errors(problem, run).largest for run in runs]
    assert orders(errors) == pytest.approx([4, 4], abs=0.3)


@pytest.mark.parametrize(("name", "end"), [(s[0], s[1]) for s in SMOOTH])
def test_errors_follow_the_tolerance(name: str, end: float) -> None:
    problem = BY_NAME[name]

    def error(tolerance: float) -> float:
        run = completed(simulate(compiled(problem.model), integrator="dormand-prince", tolerance=tolerance, end=end))
        return measure_errors(problem, run).largest

    check_proportional(error, (1e-5, 1e-6, 1e-7, 1e-8, 1e-9), within=6.0)


def test_fifth_order() -> None:
    """With steps of the tolerance's fifth root the error goes with the fifth power of the number of steps."""
    problem = BY_NAME["A01"]
    runs = [completed(simulate(compiled("pendulum"), integrator="dormand-prince", tolerance=x, end=10.0)) for x in (1e-7, 1e-9, 1e-11)]
    errors, steps = [measure_errors(problem, run).largest for run in runs], [run.steps for run in runs]
    found = [np.log(a / b) / np.log(n / m) for (a, b), (m, n) in zip(pairwise(errors), pairwise(steps), strict=True)]
    assert found == pytest.approx([5, 5], abs=0.3)


def test_order_of_a_body_that_spins_in_space(tmp_path: Path) -> None:
    """Quaternions: body rates and momentum, through flips that magnify whatever error there is."""
    artifact = compile_text(tmp_path, TEXT)

    def error(**how: float | str) -> float:
        run = completed(simulate(artifact, end=6.0, **how))  # type: ignore[arg-type]
        R = np.array([attitude(*angles) for angles in zip(run["book.roll"], run["book.pitch"], run["book.yaw"], strict=True)])
        w = np.stack([run[f"book.w{a}"] for a in "xyz"], axis=1)
        momentum = np.einsum("nij,j,nkj,nk->ni", R, [1.0, 2.0, 3.0], R, w)
        assert momentum[0] == pytest.approx(np.array([1.0, 2.0, 3.0]) * SPIN, abs=1e-12)
        rates = np.abs(np.einsum("nji,nj->ni", R, w) - body_rates(run.t)).max()
        return float(max(rates, np.abs(momentum - momentum[0]).max()))

    assert orders([error(integrator="rk4", dt=dt) for dt in (1e-2, 5e-3, 2.5e-3)]) == pytest.approx([4, 4], abs=0.3)
    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-5, 1e-6, 1e-7, 1e-8), within=6.0)


@pytest.mark.parametrize("damping", [0.0, 10.0])
def test_order_across_contacts_that_are_made_and_lost(damping: float, tmp_path: Path) -> None:
    """With damping the force jumps when the stop is met.  Steps that ignored events would be of order 2 without damping and 1 with it."""
    artifact = compile_text(tmp_path, bouncing_text(damping, 0.5))

    def error(**how: float | str) -> float:
        run = completed(simulate(artifact, **how))  # type: ignore[arg-type]
        heights, switched = exact_bounces(run.t, damping, 0.5)
        assert run.effort.events == switched == sum(run.effort.events_by_element.values()) == run.effort.events_by_element["floor"]
        return float(np.abs(run["mass.z"] - heights).max())

    found = orders([error(integrator="rk4", dt=dt) for dt in (5e-3, 2.5e-3, 1.25e-3, 6.25e-4)])
    assert min(found) > 3.5
    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-6, 1e-8, 1e-10, 1e-12), within=4.0)


TABLE = """
cutjoint: 1
name: knots
gravity: [0, 0, 0]
bodies:
  mass: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  spring:
    kind: joint_force
    joint: slide
    law: {table: {position: [-1, -0.4, 0.1, 0.3, 1], value: [90, 25, -1, -40, -60]}}
outputs: [mass.x, mass.vx]
scenes:
  swing: {end: 3, output_step: 0.1, positions: {slide.displacement: 0.9}}
"""


def swing_over_knots(times: np.ndarray) -> np.ndarray:
    """Places by SciPy: from knot to knot with the cubic of one piece, which goes on smoothly beyond its ends."""
    knots = np.array([-1, -0.4, 0.1, 0.3, 1])
    pieces = PchipInterpolator(knots, [90, 25, -1, -40, -60]).c
    piece, begin, state, places = 3, 0.0, np.array([0.9, 0.0]), np.empty(len(times))
    while begin < times[-1]:
        def pull(_: float, y: np.ndarray, piece: int = piece) -> list[float]:
            return [y[1], np.polyval(pieces[:, piece], y[0] - knots[piece])]

        def below(_: float, y: np.ndarray, piece: int = piece) -> float:
            return float(y[0] - knots[piece])

        def above(_: float, y: np.ndarray, piece: int = piece) -> float:
            return float(y[0] - knots[piece + 1])

        below.terminal = above.terminal = True  # type: ignore[attr-defined]
        below.direction, above.direction = -1, 1  # type: ignore[attr-defined]
        ahead = solve_ivp(pull, (begin, times[-1] + 1e-6), state, method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True,
                          events=[below, above])  # fmt: skip
        inside = (times >= begin) & (times <= ahead.t[-1])
        if inside.any():
            places[inside] = ahead.sol(times[inside])[0]
        begin, state, piece = ahead.t[-1], ahead.y[:, -1], piece + (1 if len(ahead.t_events[1]) else -1)
    return places


def test_order_across_the_knots_of_a_table(tmp_path: Path) -> None:
    """The monotone cubic of a table has jumps in its second derivative."""
    artifact = compile_text(tmp_path, TABLE)
    places = swing_over_knots(np.arange(31) * 0.1)

    def error(**how: float | str) -> float:
        return float(np.abs(completed(simulate(artifact, **how))["mass.x"] - places).max())  # type: ignore[arg-type]

    assert min(orders([error(integrator="rk4", dt=dt) for dt in (1e-2, 5e-3, 2.5e-3)])) > 3.6
    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-7, 1e-8, 1e-9, 1e-10), within=6.0)


RAMP, SPEED, MASS, STIFFNESS, RADIUS = 0.02, 5.0, 30.0, 2e4, 0.3

WHEEL = f"""
cutjoint: 1
name: wheel
gravity: [0, 0, -9.81]
parameters:
  along: {{value: 0, unit: m, binding: input}}
bodies:
  carriage: {{massless: true}}
  hub: {{mass: {MASS}, centre_of_mass: [0, 0, {RADIUS}]}}
joints:
  drive: {{kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: [1, 0, 0], guide: along}}
  lift: {{kind: prismatic, bodies: [carriage, hub], at: [0, 0, {RADIUS}], axis: [0, 0, 1]}}
forces:
  tyre:
    kind: tyre
    body: hub
    centre: [0, 0, {RADIUS}]
    axis: [0, 1, 0]
    radius: {RADIUS}
    stiffness: {STIFFNESS}
    calspan: {{A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}}
outputs: [hub.z, tyre.Fz]
scenes:
  ride:
    end: 1
    output_step: 0.05
    positions: {{lift.displacement: {-MASS * 9.81 / STIFFNESS}}}
    inputs: {{along: "{SPEED}*t"}}
    road: {{start: 1.03, profile: [{{ramp: 1.7, rise: {1.7 * RAMP}}}, {{flat: 0.4}}, {{ramp: 0.9, rise: {-0.9 * RAMP}}}]}}
"""


def test_order_across_breaks_of_the_road(tmp_path: Path) -> None:
    """On a straight piece of road the height over it swings freely; piece after piece is joined."""
    artifact = compile_text(tmp_path, WHEEL)
    begins, slopes = np.array([0, 1.03, 2.73, 3.13, 4.03, 6]) / SPEED, (0.0, RAMP, 0.0, -RAMP, 0.0)
    times, heights = np.arange(21) * 0.05, np.empty(21)
    z, v = RADIUS - MASS * 9.81 / STIFFNESS, 0.0
    ground = 0.0
    for begin, end, slope in zip(begins[:-1], begins[1:], slopes, strict=True):
        k = STIFFNESS / (1 + slope**2)
        w, rest = np.sqrt(k / MASS), RADIUS - MASS * 9.81 / k
        a, b = z - ground - rest, (v - SPEED * slope) / w
        now = (times >= begin - 1e-12) & (times <= end + 1e-12)
        s = times[now] - begin
        heights[now] = ground + SPEED * slope * s + rest + a * np.cos(w * s) + b * np.sin(w * s)
        s = end - begin
        ground += SPEED * slope * s
        z, v = ground + rest + a * np.cos(w * s) + b * np.sin(w * s), SPEED * slope + w * (b * np.cos(w * s) - a * np.sin(w * s))

    def error(**how: float | str) -> float:
        run = completed(simulate(artifact, **how))  # type: ignore[arg-type]
        assert run.effort.events_by_element["tyre"] >= 4
        assert run["tyre.Fz"].min() > 0
        return float(np.abs(run["hub.z"] - heights).max())

    assert min(orders([error(integrator="rk4", dt=dt) for dt in (1e-2, 5e-3, 2.5e-3)])) > 3.6
    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-5, 1e-7, 1e-9), within=6.0)


PULSES = """
cutjoint: 1
name: pulses
gravity: [0, 0, 0]
parameters: {push: {value: 0, unit: N, binding: input}}
bodies:
  mass: {mass: 2, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  thrust: {kind: joint_force, joint: slide, law: push}
outputs: [mass.x, mass.vx]
scenes:
  fire:
    end: 1
    output_step: 0.1
    inputs:
      push:
        of: t
        piecewise: [{below: 0.2371, expression: "4 N"}, {below: 0.61, expression: "-10 N"}, {expression: "0 N"}]
"""


@pytest.mark.parametrize("how", [{"integrator": "rk4", "dt": 0.1}, {"integrator": "dormand-prince"}])
def test_steps_end_where_a_function_of_time_jumps(how: dict[str, float | str], tmp_path: Path) -> None:
    """Piecewise parabolas, which both methods have exactly: what is left is where the jumps are."""
    run = completed(simulate(compile_text(tmp_path, PULSES), **how))  # type: ignore[arg-type]
    a, b = 0.2371, 0.61
    speed = 2 * np.minimum(run.t, a) - 5 * (np.clip(run.t, a, b) - a)
    assert run.effort.events == 2
    assert run["mass.vx"] == pytest.approx(speed, abs=1e-12)
    assert run["mass.x"][-1] == pytest.approx(a * a + 2 * a * (b - a) - 2.5 * (b - a) ** 2 + (2 * a - 5 * (b - a)) * (1 - b), abs=1e-12)


def test_rows_do_not_limit_steps() -> None:
    """The pendulum with rows 100 times as far apart: the same steps, and as accurate between them."""
    many, few = (
        completed(simulate(with_rows(compiled("pendulum"), row), integrator="dormand-prince", tolerance=1e-8, end=5.0))
        for row in (1e-3, 1e-1)
    )  # fmt: skip
    assert (many.steps, many.evaluations, many.effort.rejected) == (few.steps, few.evaluations, few.effort.rejected)
    assert many["bob.x"][::100] == pytest.approx(few["bob.x"], abs=1e-13)
    errors = [measure_errors(BY_NAME["A01"], run).largest for run in (many, few)]
    assert errors[0] < 3 * errors[1]


def with_rows(artifact: Artifact, row: float) -> Artifact:
    return replace(artifact, scene=replace(artifact.scene, output_step=row))


@pytest.mark.parametrize("model", ["four_bar", "slider_crank", "andrews"])
@pytest.mark.parametrize("how", [{"integrator": "rk4"}, {"integrator": "dormand-prince", "tolerance": 1e-5}])
def test_loops_stay_closed(model: str, how: dict[str, float | str], tmp_path: Path) -> None:
    end = {"four_bar": 0.6, "slider_crank": 2.0, "andrews": 0.05}[model]
    run = completed(simulate(compiled(model), end=end, steps=tmp_path / "steps.csv", **how))  # type: ignore[arg-type]
    assert run.effort.residuals.position < 1e-10
    assert run.effort.residuals.velocity < 1e-9


def vehicle(tmp_path: Path, **how: float | str) -> Trajectory:
    """Over the bump, bumpers on: kinks of the shock absorbers' laws, breaks of the road, slip that changes sign."""
    return completed(simulate(compiled("iltis", "iavsd_inphase_5"), end=0.6, steps=tmp_path / "steps.csv", **how))  # type: ignore[arg-type]


def test_the_vehicle_over_a_bump(tmp_path: Path) -> None:
    tight = vehicle(tmp_path, integrator="dormand-prince", tolerance=1e-11)
    names = ["chassis.x", "chassis.z", "chassis.pitch"]

    def error(**how: float | str) -> float:
        run = vehicle(tmp_path, **how)
        assert run.effort.residuals.position < 1e-10
        return max(float(np.abs(run[name] - np.interp(run.t, tight.t, tight[name])).max()) for name in names)

    check_proportional(lambda x: error(integrator="dormand-prince", tolerance=x), (1e-5, 1e-7, 1e-9), within=10.0)
    assert min(orders([error(integrator="rk4", dt=dt) for dt in (2e-3, 1e-3)])) > 3.5
    coarse, fine = (completed(simulate(compiled("iltis", "iavsd_inphase_5"), end=0.6, dt=dt)) for dt in (1e-3, 5e-4))
    extrapolated = (4 * fine["chassis.z"] - coarse["chassis.z"]) / 3
    assert tight["chassis.z"] == pytest.approx(extrapolated, abs=1e-6)


def test_the_vehicle_as_published() -> None:
    """As close as the trapezoidal rule is."""
    run = completed(simulate(compiled("iltis", "iavsd_inphase_5"), integrator="dormand-prince"))
    limits = {"x": 1e-4, "y": 1e-6, "z": 5e-5, "pitch": 0.003, "roll": 1e-5, "yaw": 1e-5}
    check(run, read_reference(DATA / "iavsd_inphase_5ms.csv"), WHEELS, limits)
