"""The Lagrangian methods on systems whose motion is known another way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.conftest import needs_cpp
from tests.runtime.points import (
    AUGMENTED,
    CLASSICAL,
    DOUBLE_PENDULUM,
    DRIVEN_PENDULUM,
    GRAVITY,
    METHODS,
    ORIGIN,
    PENDULUM,
    SLIDER,
    SOLVERS,
    completed,
    distance,
    four_bar,
    plane,
    point,
    redundant,
)

pytestmark = needs_cpp


def solve(rate: Callable[[float, np.ndarray], np.ndarray], start: list[float], t: np.ndarray) -> np.ndarray:
    """States over time, good to about 1e-11."""
    return np.array(solve_ivp(rate, (0.0, t[-1]), start, t_eval=t, rtol=1e-12, atol=1e-12, method="DOP853").y)


def pendulum(t: np.ndarray) -> np.ndarray:
    angle, _ = solve(lambda _, y: np.array([y[1], -GRAVITY * np.cos(y[0])]), [0.0, 0.0], t)
    return np.stack([np.cos(angle), 0 * t, np.sin(angle)], axis=1)


def driven_pendulum(t: np.ndarray) -> np.ndarray:
    """The pivot's acceleration acts like a sideways gravity."""
    push = lambda t: -0.2 * 25 * np.sin(5 * t)  # noqa: E731
    angle, _ = solve(lambda t, y: np.array([y[1], -GRAVITY * np.cos(y[0]) + push(t) * np.sin(y[0])]), [0.0, 0.0], t)
    return np.stack([0.2 * np.sin(5 * t) + np.cos(angle), 0 * t, np.sin(angle)], axis=1)


def double_pendulum(t: np.ndarray) -> np.ndarray:
    """Accelerations and tensions from the equations' second derivative, which drift by no more than the integration errs."""
    mass = np.diag([1.5] * 3 + [0.5] * 3)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        (p, q), (v, w) = y[:6].reshape(2, 3), y[6:].reshape(2, 3)
        J = np.array([[*p, 0, 0, 0], [*(p - q), *(q - p)]])
        matrix = np.block([[mass, J.T], [J, np.zeros((2, 2))]])
        right = [0, 0, -1.5 * GRAVITY, 0, 0, -0.5 * GRAVITY, -v @ v, -(w - v) @ (w - v)]
        return np.concatenate([y[6:], np.linalg.solve(matrix, right)[:6]])

    return solve(rate, [1, 0, 0, 1, 1, 0, 0, 0.5, 0.3, 0.4, 0.5, -0.6], t)[:6].T


def slider(t: np.ndarray) -> np.ndarray:
    """A damped oscillator along the line, about where the spring carries the weight."""
    rest = -2.0 * GRAVITY * 0.6 / 50
    decay, omega = 1.2 / 4, np.sqrt(50 / 2 - (1.2 / 4) ** 2)
    s = rest + (1 - rest) * np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    return s[:, None] * np.array([0.8, 0, 0.6])


KNOWN = {
    "pendulum": (PENDULUM, pendulum), "driven pendulum": (DRIVEN_PENDULUM, driven_pendulum),
    "double pendulum": (DOUBLE_PENDULUM, double_pendulum), "slider": (SLIDER, slider),
}  # fmt: skip


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("method", METHODS)
def test_second_order(method: str, name: str, tmp_path: Path) -> None:
    """Halving the step quarters the error, but for the next term of its expansion."""
    system, exact = KNOWN[name]
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        run = completed(tmp_path, system, method, dt=dt, output_step=0.1)
        errors.append(np.abs(run.vectors() - exact(run.t)).max())
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.02)


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("method", METHODS)
def test_equations_hold_to_rounding_after_the_projections(method: str, name: str, tmp_path: Path) -> None:
    """With dt^2/4 alpha = 250 kg beside masses of 1 kg an iteration leaves 1/100 of what the multipliers lack, the projections 1e-11."""
    run = completed(tmp_path, KNOWN[name][0], method)
    assert run.summary["residuals"]["position"] < 1e-10
    assert run.summary["residuals"]["velocity"] < 1e-9
    assert run.summary["residuals"]["acceleration"] < 1e-9
    for kind in ("position", "velocity", "acceleration"):
        assert run.steps[kind].max() <= run.summary["residuals"][kind]
    assert run.steps["iterations"].sum() == run.summary["iterations"]
    assert len(run.steps["t"]) == run.summary["steps"] == 1000
    assert run.summary["factorisations"] == run.summary["iterations"] + 1


@pytest.mark.parametrize("method", METHODS)
def test_multipliers_are_the_tension(method: str, tmp_path: Path) -> None:
    """With Phi = (r^2 - 1)/2 the rod pulls by lambda r: at angle a from the horizontal start, v^2 = -2 g sin(a), lambda = -3 m g sin(a)."""
    run = completed(tmp_path, PENDULUM, method)
    expected = -3 * 2.0 * GRAVITY * run["p0.z"]
    assert np.abs(run["lambda0"] - expected).max() < 1e-3 * expected.max()


@pytest.mark.parametrize("system", [PENDULUM, DOUBLE_PENDULUM, SLIDER], ids=["pendulum", "double pendulum", "slider"])
@pytest.mark.parametrize("method", METHODS)
def test_all_solvers_agree(method: str, system: dict, tmp_path: Path) -> None:
    """Steps agree up to rounding: 1e-16 against accelerations, times dt^2 alpha, over a thousand steps."""
    emitted, *others = [completed(tmp_path, system, method, solver=solver) for solver in SOLVERS[method]]
    for other in others:
        assert np.abs(other.vectors() - emitted.vectors()).max() < 1e-10
        assert np.abs(other.vectors("a") - emitted.vectors("a")).max() < 1e-7
        assert other.summary["iterations"] == pytest.approx(emitted.summary["iterations"], rel=0.01)


def test_redundant_equations_do_not_matter_to_augmented(tmp_path: Path) -> None:
    once = completed(tmp_path, DOUBLE_PENDULUM, AUGMENTED)
    for solver in SOLVERS[AUGMENTED]:
        twice = completed(tmp_path, redundant(DOUBLE_PENDULUM), AUGMENTED, solver=solver)
        assert np.abs(twice.vectors() - once.vectors()).max() < 1e-9
        assert np.abs(twice["lambda0"] + twice["lambda2"] - once["lambda0"]).max() < 1e-5 * np.abs(once["lambda0"]).max()


@pytest.mark.parametrize("penalty", [1e7, 1e9, 1e11])
@pytest.mark.parametrize("dt", [1e-4, 1e-5])
def test_augmented_stays_accurate_with_small_steps(dt: float, penalty: float, tmp_path: Path) -> None:
    """dt^2/4 alpha goes down to 2.5e-4 kg beside a mass of 2 kg: multipliers that cannot follow within a step.

    The error is that of the rule, 6.9 dt^2 at 1 s, or what the penalty spring gives way, 60 N / alpha.
    """
    run = completed(tmp_path, PENDULUM, AUGMENTED, dt=dt, penalty=penalty, end=0.2, output_step=0.02, tolerance=1e-6)
    error = np.abs(run.vectors() - pendulum(run.t)).max()
    assert error < 1.0 * dt**2 + 60 / penalty * 1e-3
    assert run.steps["iterations"].max() <= 6


@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-5])
def test_augmented_chooses_a_penalty_that_suits_masses_and_step(dt: float, tmp_path: Path) -> None:
    """An iteration leaves 1e-5 of what the multipliers lack: the tolerance of the iteration remains at any step."""
    run = completed(tmp_path, DOUBLE_PENDULUM, AUGMENTED, dt=dt, penalty=None, end=100 * dt, tolerance=1e-6)
    assert run.summary["residuals"]["position"] < 1e-10
    assert run.summary["residuals"]["velocity"] < 1e-9
    assert run.summary["residuals"]["acceleration"] < 1e-9
    assert np.abs(run.vectors() - double_pendulum(run.t)).max() < 30 * dt**2 + 1e-12


@pytest.mark.parametrize("dt", [1e-5, 1e-6])
def test_classical_ends_its_iterations_at_the_rounding_of_coordinates(dt: float, tmp_path: Path) -> None:
    """An acceleration moves a coordinate by dt^2/4, 2.5e-13 m: at 1e-8 of it nothing is left to iterate on."""
    run = completed(tmp_path, PENDULUM, CLASSICAL, dt=dt, end=2000 * dt, output_step=200 * dt, tolerance=1e-12)
    assert run.steps["iterations"].max() <= 8
    assert np.abs(run.vectors() - pendulum(run.t)).max() < 1e-9
    assert run.summary["residuals"]["acceleration"] < 1e-9


@pytest.mark.parametrize("loops", [1, 5])
@pytest.mark.parametrize("method", METHODS)
def test_through_singular_poses(method: str, loops: int, tmp_path: Path) -> None:
    """Cranks that turn at 6/s and more lie down several times in 2 s; no step meets the pose itself, which classical could not."""
    errors = []
    for dt in (1e-2, 1e-3):
        run = completed(tmp_path, four_bar(loops, -6.0), method, dt=dt, end=2.0, output_step=0.1, tolerance=1e-6)
        angle, _ = solve(lambda _, y: np.array([y[1], -GRAVITY * np.cos(y[0])]), [np.pi / 2, -6.0], run.t)
        errors.append(np.hypot(run["p0.x"] - np.cos(angle), run["p0.z"] - np.sin(angle)).max())
    assert errors[0] / errors[1] == pytest.approx(100, rel=0.1)


@pytest.mark.parametrize("mass", [0.0, 1e-24])
def test_classical_pivots_where_the_static_order_is_unsafe(mass: float, tmp_path: Path) -> None:
    """A point without mass, held by equations, carries a pendulum: its pivot is nothing, or far too small, until an equation fills it."""
    system = {
        "points": [point(mass, (0, 0, 0)), point(2.0, (1, 0, 0))],
        "equations": [
            *(plane(0, normal, ORIGIN) for normal in np.eye(3)), distance(1, 0, 1.0), plane(1, (0, 1, 0), ORIGIN),
        ],
    }  # fmt: skip
    run = completed(tmp_path, system, CLASSICAL, end=0.2)
    enough = 1.0 if mass == 0.0 else 0.8  # some right-hand sides happen to miss what the small pivot spoils
    assert run.summary["pivoting_fallbacks"] >= enough * run.summary["factorisations"]
    plain = completed(tmp_path, PENDULUM, CLASSICAL, end=0.2)
    assert np.abs(run.vectors()[:, 3:] - plain.vectors()).max() < (1e-12 if mass == 0.0 else 1e-8)  # solutions good to 1e-8 are kept
    assert plain.summary["pivoting_fallbacks"] == 0
