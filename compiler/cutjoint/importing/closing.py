"""The position of a robot in which its loops close, nearest to the file's zero position, and its couplings solved into gears."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cutjoint.importing.robot import Array, Coupling, Loop, Pose, Robot

CLOSED = 1e-5  #: a loop that stays open by less is closed, m and rad: files are written with rounded numbers
_STEPS, _STEP = 200, 0.3
_PATIENCE = 25  #: so many steps that win less than a tenth each end the way
_TRIALS = 12
_ZERO = 1e-12


@dataclass(frozen=True)
class Closed:
    """Coordinates by joints where loops close, the links' poses there, and the largest violation that is left, m or rad."""

    q: dict[str, Array]
    poses: dict[str, Pose]
    violation: float

    def own(self, references: Mapping[str, float]) -> dict[str, Array]:
        """The coordinates as the file counts them."""
        return {name: values + references.get(name, 0.0) for name, values in self.q.items()}


def close(robot: Robot, *, free: bool = False) -> Closed:
    """Find where loops and couplings close; bodies that move freely stay, unless nothing else closes them, or they are ``free`` to move.
    Raises ModelError at the loop that stays open by more than CLOSED."""
    able = [joint for joint in robot.outwards() if joint.name in robot.in_loops() and joint.freedom]
    joints = [joint for joint in able if free or joint.kind != "free"]
    still = {joint.name: np.zeros(joint.freedom) for joint in robot.outwards() if joint.freedom}
    ends = np.cumsum([0] + [joint.freedom for joint in joints])

    def unpacked(values: Array) -> dict[str, Array]:
        return still | {joint.name: values[ends[i] : ends[i + 1]] for i, joint in enumerate(joints)}

    def violations(values: Array) -> list[Array]:
        q = unpacked(values)
        poses = robot.poses(q)
        return [*(_violation(loop, poses) for loop in robot.loops), *(np.array([c.violation(q)]) for c in robot.couplings)]

    def residual(values: Array) -> Array:
        found = violations(values)
        return np.concatenate(found) if found else np.zeros(0)

    values = _solve(residual, int(ends[-1]))
    left = residual(values)
    closing: list[Loop | Coupling] = [*robot.loops, *robot.couplings]
    for one, violation in zip(closing, violations(values), strict=True):
        if np.abs(violation).max() > CLOSED and len(joints) < len(able):
            return close(robot, free=True)
        if np.abs(violation).max() > CLOSED:
            apart = f"{np.abs(violation).max():.2g} m or rad"
            one.node.refuse(f"does not close: in the position found it is violated by {apart}", "correct the frames of its two ends")
    values[np.abs(values) < 1e-12] = 0
    q = {
        name: each - 2 * np.pi * np.round(each / (2 * np.pi)) if robot.joints[name].kind == "revolute" else each
        for name, each in unpacked(values).items()
    }  # fmt: skip
    return Closed(q, robot.poses(q), float(np.abs(left).max(initial=0.0)))


def _solve(residual: Callable[[Array], Array], count: int) -> Array:
    """Find where the residual is least, from zero and then, where it does not vanish, from a few positions around."""
    best = np.zeros(count)
    random = np.random.default_rng(1)
    for trial in range(_TRIALS):
        start = np.zeros(count) if trial == 0 else random.uniform(-1, 1, count) * trial / 4
        found = _descend(residual, start)
        if trial == 0 or np.linalg.norm(residual(found)) < 0.1 * np.linalg.norm(residual(best)):
            best = found
        if np.abs(residual(best)).max(initial=0.0) < CLOSED:
            break
    return best


def _descend(residual: Callable[[Array], Array], values: Array) -> Array:
    """Steps of Levenberg and Marquardt, each of _STEP rad or m at most."""
    left, damping, slow = residual(values), 1e-6, 0
    for _ in range(_STEPS):
        if np.abs(left).max(initial=0.0) < 1e-14 or slow > _PATIENCE:
            break
        h = 1e-6
        columns = [(residual(values + h * e) - residual(values - h * e)) / (2 * h) for e in np.eye(len(values))]
        derivatives = np.array(columns).reshape(len(values), len(left)).T
        u, s, v = np.linalg.svd(derivatives, full_matrices=False)
        able = s > 1e-9 * s.max(initial=0.0)
        while damping < 1e6 and able.any():
            step = -(v[able].T * (s[able] / (s[able] ** 2 + damping * s[able].max() ** 2))) @ (u[:, able].T @ left)
            step *= min(1.0, _STEP / max(np.abs(step).max(), 1e-300))
            there = residual(values + step)
            if np.linalg.norm(there) < np.linalg.norm(left):
                break
            damping *= 10
        else:
            break
        slow = slow + 1 if np.linalg.norm(there) > 0.9 * np.linalg.norm(left) else 0
        values, left, damping = values + step, there, max(damping / 10, 1e-16)
    return values


def _violation(loop: Loop, poses: dict[str, Pose]) -> Array:
    first, second = poses[loop.links[0]] @ loop.first, poses[loop.links[1]] @ loop.second
    apart = second.place - first.place
    match loop.kind:
        case "spherical":
            return apart
        case "revolute":
            return np.concatenate([apart, np.cross(first.rotation @ loop.axis, second.rotation @ loop.axis)])
    turned = _rotation_vector(first.rotation.T @ second.rotation)
    if loop.kind == "prismatic":
        inside = first.rotation.T @ apart
        apart = inside - (loop.axis @ inside) * loop.axis
    return np.concatenate([apart, turned])


def _rotation_vector(rotation: Array) -> Array:
    """The vector about which a rotation (3 by 3) turns, as long as its angle, rad."""
    sine = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]) / 2
    angle = np.arctan2(np.linalg.norm(sine), (np.trace(rotation) - 1) / 2)
    if angle > 3:  # near half a turn the axis is that of rotation + 1
        _, axes = np.linalg.eigh(rotation + rotation.T)
        axis = axes[:, 2]
        return np.asarray(angle * axis * (1 if axis @ sine >= 0 else -1))
    return np.asarray(sine * (angle / np.sin(angle) if angle > 1e-6 else 1))


@dataclass(frozen=True)
class Relation:
    """The coordinate of ``dependent`` is the sum of ``ratios``, by joints, times their coordinates.
    A single other joint may add a polynomial with coefficients ``higher_terms``, from the square up."""

    name: str
    dependent: str
    ratios: dict[str, float]
    higher_terms: tuple[float, ...] = ()


def solve_couplings(robot: Robot) -> list[Relation]:
    """The couplings of a robot, each solved for a joint that no other one is solved for.
    Raises ModelError: couplings repeat each other, hold a joint still, or couple joints without a coordinate of their own."""
    for coupling in robot.couplings:
        for name in coupling.terms:
            if robot.joints[name].freedom != 1:
                coupling.node.refuse(f"couples '{name}', a joint without a coordinate of its own", "couple revolute and prismatic joints")
    higher = [
        Relation(c.name, next(j for j in c.terms if j != c.independent), {c.independent: -c.terms[c.independent]}, c.higher_terms)
        for c in robot.couplings if c.higher_terms
    ]  # fmt: skip
    driven = {joint for drive in robot.drives for joint in drive.joints}
    order = {name: (name in driven, not joint.follows) for name, joint in robot.joints.items()}
    return [*_eliminate([c for c in robot.couplings if not c.higher_terms], order), *higher]


def _eliminate(couplings: list[Coupling], order: Mapping[str, tuple[bool, bool]]) -> list[Relation]:
    """Gauss-Jordan elimination: of each coupling's joints the first in ``order`` follows, of several that whose factor is nearest to 1."""
    joints = list(dict.fromkeys(name for coupling in couplings for name in coupling.terms))
    rows = np.array([[coupling.terms.get(name, 0.0) for name in joints] for coupling in couplings])
    found = []
    for i, coupling in enumerate(couplings):
        able = [int(j) for j in np.flatnonzero(np.abs(rows[i]) > _ZERO)]
        if not able:
            coupling.node.refuse("depends on the other couplings", "leave it out")
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
