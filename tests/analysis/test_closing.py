"""Numbers of the cut joints' equations against the dense oracle."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import design_coordinates, evaluate_closures, explore, retract
from tests.analysis.formulated import dense_closures, formulated
from tests.mechanisms.overconstrained import parallel_cranks_text
from tests.mechanisms.random_models import chosen_loops, random_loops, state
from tests.oracles.dense import DenseMechanism


@pytest.mark.parametrize("seed", range(4))
def test_residual_and_jacobian(seed: int) -> None:
    equations = formulated(random_loops(seed))
    dense = DenseMechanism(equations.topology, equations.scene)
    q, _ = state(dense.layout, dense.nq, dense.nv, np.random.default_rng(seed))
    residual, jacobian = evaluate_closures(equations, q)
    oracle = dense_closures(equations, q)
    np.testing.assert_allclose(residual, oracle.residual, rtol=0, atol=1e-12)
    np.testing.assert_allclose(jacobian, oracle.jacobian, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(2))
def test_coordinates_are_stepped_as_the_runtime_does(seed: int) -> None:
    """To third order the oracle's own retraction."""
    equations = formulated(chosen_loops(seed))
    dense = DenseMechanism(equations.topology, equations.scene)
    rng = np.random.default_rng(seed)
    q, v = state(dense.layout, dense.nq, dense.nv, rng)
    np.testing.assert_allclose(retract(equations, q, 1e-5 * v), dense.retract(q, 1e-5 * v), rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_poses_close_the_loops_and_differ(seed: int) -> None:
    equations = formulated(random_loops(seed))
    design, *others = explore(equations)
    assert len(others) == 4
    for pose in (design, *others):
        assert np.abs(dense_closures(equations, pose.q).residual).max() < 1e-9
    assert all(np.abs(pose.q - design.q).max() > 1e-3 for pose in others)


def test_a_mechanism_that_its_guides_hold_open_stays_in_its_design_position() -> None:
    text = parallel_cranks_text(2).replace("pin_1: {kind: revolute,", 'pin_1: {kind: revolute, guide: "0.3",')
    equations = formulated(text.replace("pin_0: {kind: revolute,", 'pin_0: {kind: revolute, guide: "0",'))
    (pose,) = explore(equations)
    assert not pose.closed
    np.testing.assert_array_equal(pose.q, design_coordinates(equations))


def test_poses_are_the_same_each_time() -> None:
    equations = formulated(random_loops(1))
    first, second = explore(equations), explore(equations)
    assert all(np.array_equal(a.q, b.q) for a, b in zip(first, second, strict=True))
