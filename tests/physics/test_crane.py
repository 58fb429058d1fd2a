"""The crane of docs/how-to/mechanism-recipes.md beside SciPy with the pendulum's equation by hand."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import cutjoint
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.run.scenes import load_model
from tests.conftest import ROOT, needs_cpp

Vector = NDArray[np.float64]

FOOT, BOOM, G = np.array([0, 0, 3.0]), np.array([8.0, 0, 6]), np.array([0, 0, -9.81])
#: Times at which a law goes over to another formula, with the same rate on either side, s.
KINKS = (0.0, 5.0, 10.0, 15.0, 20.0)


def turn(axis: int, angle: complex) -> NDArray[np.complex128]:
    """The matrix of a turn about a global axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3, dtype=complex)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def tip(t: complex, at: float) -> NDArray[np.complex128]:
    """The end of the boom (m), by the formulas that hold about the time ``at``."""
    slewing = 0.5 * (1 - np.cos(np.pi * (t if at < 10 else 10) / 10))
    luffing = 0 * t if at < 5 else 0.1 * (1 - np.cos(np.pi * (t - 5) / 10)) if at < 15 else 0.2 + 0 * t
    return turn(2, slewing) @ (FOOT + turn(1, -luffing) @ BOOM)


def second(t: float, at: float, step: float = 1e-3) -> Vector:
    """The tip's acceleration, by differences of the rate that a complex step has to rounding."""

    def rate(when: float) -> Vector:
        return tip(when + 1e-30j, at).imag / 1e-30

    return (rate(t - 2 * step) - 8 * rate(t - step) + 8 * rate(t + step) - rate(t + 2 * step)) / (12 * step)


def swing(t: float, state: Vector, at: float) -> Vector:
    """The rates of the load's place on the rope and of its speed beside the tip: r . r = L^2 along the rope, weight across it."""
    r, w, w0 = state[:3], state[3:], np.pi / 20
    length, rate, acceleration = 6 - np.cos(w0 * t), w0 * np.sin(w0 * t), w0**2 * np.cos(w0 * t)
    pull = G - second(t, at)
    tension = (length * acceleration + rate**2 - w @ w - r @ pull) / (r @ r)
    return np.concatenate([w, pull + tension * r])


@needs_cpp
def test_the_load_swings_as_a_pendulum_by_hand(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "how-to" / "mechanism-recipes.md").read_text(encoding="utf-8")
    (text,) = re.findall(r'```yaml title="crane.yaml"\n(.*?)```', page, re.DOTALL)
    (tmp_path / "crane.yaml").write_text(text, encoding="utf-8")
    run = cutjoint.simulate(compile_interpreted(*load_model(tmp_path / "crane.yaml")), accuracy=1e-7)
    state = np.concatenate([[0, 0, -5.0], np.zeros(3)])
    for begin, end in pairwise(KINKS):
        path = solve_ivp(swing, (begin, end), state, args=(begin,), method="DOP853", rtol=1e-11, atol=1e-11, dense_output=True)
        rows = [i for i, t in enumerate(run["t"]) if begin <= t <= end]
        for i in rows:
            expected = tip(run["t"][i], begin).real + path.sol(run["t"][i])[:3]
            assert np.abs(expected - [run[f"load.{x}"][i] for x in "xyz"]).max() < 1e-6
        state = path.y[:, -1]
