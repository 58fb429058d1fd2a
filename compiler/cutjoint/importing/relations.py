"""Linear relations between coordinates, solved into gears, each with a follower of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cutjoint.importing.robot import Coupling, Robot

_ZERO = 1e-12


@dataclass(frozen=True)
class Relation:
    """The coordinate of ``follower`` is the sum of ``ratios``, by joints, times theirs, and of one leader a polynomial with coefficients
    ``bend`` from the square up."""

    name: str
    follower: str
    ratios: dict[str, float]
    bend: tuple[float, ...] = ()


def solve_couplings(robot: Robot) -> list[Relation]:
    """The couplings of a robot, each solved for a joint that no other one is solved for.

    Raises:
        ModelError: couplings repeat each other, hold a joint still, or couple joints without a coordinate of their own.
    """
    for coupling in robot.couplings:
        for name in coupling.terms:
            if robot.joints[name].freedom != 1:
                coupling.node.refuse(f"couples '{name}', a joint without a coordinate of its own", "couple revolute and prismatic joints")
    bent = [Relation(c.name, *_apart(c), c.bend) for c in robot.couplings if c.bend]
    driven = {drive.joint for drive in robot.drives}
    order = {name: (name in driven, not joint.follows) for name, joint in robot.joints.items()}
    return [*_solve([c for c in robot.couplings if not c.bend], order), *bent]


def _apart(coupling: Coupling) -> tuple[str, dict[str, float]]:
    follower = next(joint for joint in coupling.terms if joint != coupling.leader)
    return follower, {coupling.leader: -coupling.terms[coupling.leader]}


def _solve(couplings: list[Coupling], order: Mapping[str, tuple[bool, bool]]) -> list[Relation]:
    """Gauss-Jordan elimination: of each coupling's joints the first in ``order`` follows, of several that whose factor is nearest to 1."""
    joints = list(dict.fromkeys(name for coupling in couplings for name in coupling.terms))
    rows = np.array([[coupling.terms.get(name, 0.0) for name in joints] for coupling in couplings])
    found = []
    for i, coupling in enumerate(couplings):
        able = [int(j) for j in np.flatnonzero(np.abs(rows[i]) > _ZERO)]
        if not able:
            coupling.node.refuse("says nothing that other couplings do not say", "leave it out")
        rates = {j: abs(np.log(abs(rows[i, j]))) for j in able}
        j = min(able, key=lambda j: (*order[joints[j]], rates[j], j))
        rows[i] /= rows[i, j]
        for k in range(len(rows)):
            if k != i:
                rows[k] -= rows[k, j] * rows[i]
        found.append(j)
    relations = []
    for coupling, row, j in zip(couplings, rows, found, strict=True):
        ratios = {joints[k]: -float(row[k]) for k in np.flatnonzero(np.abs(row) > _ZERO) if k != j}
        if not ratios:
            coupling.node.refuse(f"holds the joint '{joints[j]}' still", "make it a fixed joint")
        relations.append(Relation(coupling.name, joints[j], ratios))
    return relations
