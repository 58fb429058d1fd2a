"""Linear relations between coordinates, solved into gears of two joints each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cutjoint.importing.robot import Robot


@dataclass(frozen=True)
class Relation:
    """The coordinate of ``follower`` is ``ratio`` times that of ``leader``, and a polynomial of it with coefficients ``bend`` from the square
    up."""

    name: str
    follower: str
    leader: str
    ratio: float
    bend: tuple[float, ...] = ()


def solve_couplings(robot: Robot) -> list[Relation]:
    """The couplings of a robot as relations of two joints.  Raises ModelError where more than two hang together, or one is held still."""
    bent = [c for c in robot.couplings if c.bend]
    if bent:
        straight = solve_couplings(replace(robot, couplings=[c for c in robot.couplings if not c.bend]))
        ends = [(c, next(j for j in c.terms if j != c.leader)) for c in bent]
        return [*straight, *(Relation(c.name, joint, c.leader, -c.terms[c.leader], c.bend) for c, joint in ends)]
    if not robot.couplings:
        return []
    joints = list(dict.fromkeys(name for coupling in robot.couplings for name in coupling.terms))
    for coupling in robot.couplings:
        for name in coupling.terms:
            if robot.joints[name].freedom != 1:
                coupling.node.refuse(f"couples '{name}', a joint without a coordinate of its own", "couple revolute and prismatic joints")
    rows = np.array([[coupling.terms.get(name, 0.0) for name in joints] for coupling in robot.couplings])
    driven = {drive.joint for drive in robot.drives}
    followers: list[int] = []
    for i, coupling in enumerate(robot.couplings):
        # the follower: the first of the coupling's own joints that no motor drives, the largest factor if all or none are driven
        able = sorted(np.flatnonzero(np.abs(rows[i]) > 1e-12), key=lambda j: (joints[j] in driven, -abs(coupling.terms.get(joints[j], 0)), j))
        if not able:
            coupling.node.refuse("says nothing that other couplings do not say", "leave it out")
        j = able[0]
        rows[i] /= rows[i, j]
        for k in range(len(rows)):
            if k != i:
                rows[k] -= rows[k, j] * rows[i]
        followers.append(j)
    found = []
    for coupling, row, j in zip(robot.couplings, rows, followers, strict=True):
        others = [k for k in np.flatnonzero(np.abs(row) > 1e-12) if k != j]
        if len(others) != 1:
            which = ", ".join(joints[k] for k in (j, *others))
            coupling.node.refuse(f"relates {len(others) + 1} coordinates ({which}), where a gear relates two", "write gears of two joints each")
        found.append(Relation(coupling.name, joints[j], joints[others[0]], -float(row[others[0]])))
    return found
