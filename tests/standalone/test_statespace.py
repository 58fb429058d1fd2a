"""The motion near a state: against closed forms, and against the modes by the exact tangent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from tests.conftest import MODELS, needs_cpp

from .folders import ALONE

pytestmark = needs_cpp

CART_POLE = Path(__file__).parents[2] / "examples" / "cart_pole.yaml"


def sorted_roots(A: np.ndarray) -> np.ndarray:
    return np.sort_complex(np.linalg.eigvals(A))


@pytest.mark.parametrize(("model", "at"), [("press", 0.0), ("press", 0.1), ("slider_crank", 0.3)])
@pytest.mark.parametrize("method", ALONE)
def test_eigenvalues_are_those_of_the_modes(method: str, model: str, at: float) -> None:
    path = MODELS / f"{model}.yaml"
    sim = cutjoint.load(path, method=method).reset(dt=1e-4)
    sim.advance(at)
    before = sim.snapshot()
    near = cutjoint.linearise(sim)
    assert sim.snapshot() == before
    known = [mode.eigenvalue for mode in cutjoint.find_modes(path, at=at).modes]
    pairs = [x for root in known for x in ([root, root.conjugate()] if root.imag else [root])]
    # the two runs to this moment have steps of their own
    assert sorted_roots(near.A) == pytest.approx(np.sort_complex(np.array(pairs)), rel=5e-4)


@pytest.mark.parametrize("method", ALONE)
def test_a_cart_with_a_pole(method: str) -> None:
    sim = cutjoint.load(CART_POLE, method=method).reset(coordinates={"pin.angle": 0.0})
    near = cutjoint.linearise(sim)
    M, m, h, inertia, g = 1.0, 0.2, 0.5, 0.2 * 0.5**2 / 3, 9.81  # the pole is a rod of length 2 h
    mass = np.array([[M + m, m * h], [m * h, inertia + m * h**2]])
    K = np.array([[0.0, 0.0], [0.0, -m * g * h]])
    order = [list(sim.speeds).index(name) for name in ("rail.displacement_rate", "pin.angle_rate")]
    N = near.basis[order]
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, K), np.zeros((2, 2))]])
    turned = np.kron(np.eye(2), N)
    assert turned @ near.A @ turned.T == pytest.approx(A, abs=1e-8)
    assert turned @ near.B == pytest.approx(np.concatenate([[0, 0], np.linalg.solve(mass, [1.0, 0.0])])[:, None], abs=1e-8)
    assert near.inputs == ("push",)
    sim.set_state(0.0, np.array([0.1, 0.02])[order], np.array([0.3, -0.1])[order])
    assert turned @ near.state(sim) == pytest.approx([0.1, 0.02, 0.3, -0.1], abs=1e-12)
