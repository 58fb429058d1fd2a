"""The peers: each runs what is exported, and agrees with cutjoint's recursive method as far as `expected.py` says.

The first test with Pinocchio compiles the common part of all its models for seven minutes; it is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.model.records import JointKind
from cutjoint_bench.export.peers import PEERS
from cutjoint_bench.peers.run import run_peer
from tests.export.cases import turning_loop
from tests.export.expected import EXPECTED, LOOPS, Expected, Trajectory
from tests.export.own import Case, both_accelerations, case_of, exported, largest_differences, moving, needs, wheel
from tests.mechanisms.random_models import random_tree


def of_each(what: Callable[[Expected], Iterable[Any]] = lambda _: ("",)) -> list[Any]:
    """The peers with what is expected of each; they are skipped where they are not installed.  Pinocchio's programs compile for minutes."""
    return [
        pytest.param(
            peer, value, id=f"{peer}-{getattr(value, 'name', value)}".rstrip("-"),
            marks=(needs(peer), pytest.mark.heavy) if peer == "pinocchio" else needs(peer),
        )
        for peer, expected in EXPECTED.items() for value in what(expected)
    ]  # fmt: skip


def differ_by(peer: str, case: Case, folder: Path) -> float:
    """Largest difference of the accelerations at the start, over the largest acceleration."""
    found, own = both_accelerations(peer, case, folder)
    return float(np.abs(found - own).max() / np.abs(own).max())


def test_every_peer_is_expected_to_agree_in_all_that_it_has() -> None:
    assert EXPECTED.keys() == PEERS.keys()
    for name, expected in EXPECTED.items():
        assert {trajectory.integrator for trajectory in expected.trajectories} == set(PEERS[name].integrators)


@pytest.mark.parametrize(("peer", "model"), of_each(lambda expected: expected.accelerations))
def test_accelerations_at_the_start(peer: str, model: str, tmp_path: Path) -> None:
    assert differ_by(peer, case_of(model), tmp_path) < EXPECTED[peer].accelerations[model]


@pytest.mark.parametrize(("peer", "seed"), of_each(lambda expected: expected.trees))
def test_random_trees_with_all_forces(peer: str, seed: int, tmp_path: Path) -> None:
    model = random_tree(seed)
    case = Case(model=model, scene=moving(model, seed), parameters={})
    assert differ_by(peer, case, tmp_path) < EXPECTED[peer].trees[seed]


@pytest.mark.parametrize(("peer", "kind"), of_each(lambda expected: expected.loops))
def test_random_loops(peer: str, kind: JointKind, tmp_path: Path) -> None:
    assert differ_by(peer, turning_loop(kind, *LOOPS[kind]), tmp_path) < EXPECTED[peer].loops[kind]


@pytest.mark.parametrize("speed", ["8", "0.05"])
@pytest.mark.parametrize("road", ["point", "disc"])
@pytest.mark.parametrize(("peer", "_"), of_each())
def test_a_wheel_on_a_road(peer: str, _: str, road: str, speed: str, tmp_path: Path) -> None:
    found, own = both_accelerations(peer, wheel(road, speed), tmp_path)
    np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize(("peer", "trajectory"), of_each(lambda expected: expected.trajectories))
def test_trajectories(peer: str, trajectory: Trajectory, tmp_path: Path) -> None:
    case = trajectory.case()
    found = [
        largest_differences(peer, case, tmp_path, dt=dt, own_dt=trajectory.own_dt, end=trajectory.end, integrator=trajectory.integrator)
        for dt in trajectory.steps
    ]
    limits = {column: limit for column in found[0] if (limit := trajectory.limit(column)) is not None}
    assert limits
    assert {column: found[-1][column] for column in limits if not found[-1][column] < limits[column]} == {}
    largest = [max(differences[column] for column in limits) for differences in found]
    assert largest[0] < trajectory.with_largest
    if trajectory.ratio is not None:
        low, high = trajectory.ratio
        assert all(low < coarse / fine < high for coarse, fine in pairwise(largest))


@pytest.mark.parametrize(("peer", "_"), of_each())
def test_a_run_that_breaks_down_keeps_its_rows(peer: str, _: str, tmp_path: Path) -> None:
    expected = EXPECTED[peer].breakdown
    folder = exported(peer, case_of(expected.model), tmp_path)
    run = run_peer(PEERS[peer], folder, dt=expected.dt, end=expected.end, integrator=expected.integrator, output_step=expected.dt)
    assert run.failure is not None
    assert run.failure.message == expected.message
    assert 0 < run.steps < round(expected.end / expected.dt)
    assert run.t.size == run.steps + 1
    assert expected.steps in (None, run.steps)
