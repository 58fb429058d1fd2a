"""The independent equations of cut joints: peers that solve for all multipliers want no others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.analysis.closing import Array, FlatRoad, explore, make_inputs
from cutjoint.analysis.redundancy import choose_independent
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import GROUND, Model, Output, Scene
from cutjoint.program.interpret import RoadTable, interpret_blocks
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import TOLERANCE
from cutjoint_bench.export.laws import Triple
from cutjoint_bench.export.records import Mechanism, Place
from cutjoint_bench.export.starts import markers_of


@dataclass(frozen=True, kw_only=True)
class Row:
    """One equation of a cut joint: the follower's ``point`` does not leave the base along ``direction``.
    Without a point, the follower does not turn about it.  The base carries the direction; both are given at the start."""

    base: str
    follower: str
    direction: Triple
    point: Triple | None


def independent_rows(model: Model, scene: Scene, mechanism: Mechanism, rows: Sequence[Row]) -> list[int]:
    """Rows, of those given the first ones, on which all others depend in every pose that the loops can take near the design position."""
    if not rows:
        return []
    jacobians = [_jacobian(mechanism, rows, motion) for motion in _motions(model, scene)]
    ranks = [int(np.linalg.matrix_rank(J, tol=TOLERANCE * np.linalg.norm(J, 2))) for J in jacobians]
    best = [J for J, rank in zip(jacobians, ranks, strict=True) if rank == max(ranks)]
    return choose_independent(best, max(ranks))


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """A body in a pose: ``rotation`` (3, 3) since the design position, the place (3,) of its design origin.
    Of that point's velocity and of the angular velocity the Jacobians (3, speeds)."""

    rotation: Array
    place: Array
    velocity: Array
    spin: Array

    def velocity_of(self, point: Array) -> Array:
        """The Jacobian (3, speeds) of the velocity of what the body carries at a place."""
        return np.asarray(self.velocity + np.cross(self.spin, point - self.place, axis=0))


def _jacobian(mechanism: Mechanism, rows: Sequence[Row], motions: Mapping[str, _Motion]) -> Array:
    return np.array([_row(row, mechanism.places, motions) for row in rows])


def _row(row: Row, places: Mapping[str, Place], motions: Mapping[str, _Motion]) -> Array:
    base, follower = motions[row.base], motions[row.follower]
    direction = base.rotation @ _to_design(places[row.base], row.direction)
    if row.point is None:
        return np.asarray(direction @ (follower.spin - base.spin))
    design = _to_design(places[row.follower], np.array(row.point) - np.array(places[row.follower].shift))
    point = follower.place + follower.rotation @ design
    return np.asarray(direction @ (follower.velocity_of(point) - base.velocity_of(point)))


def _to_design(place: Place, direction: Triple | Array) -> Array:
    return np.asarray(np.array(place.rotation).T @ np.array(direction))


def _motions(model: Model, scene: Scene) -> list[dict[str, _Motion]]:
    """The motions of all bodies in the poses that ``explore`` finds."""
    marked = replace(model, markers=tuple(m for body in model.bodies for m in markers_of(model, body.name)))
    outputs = tuple(Output(element=m.name, quantity=q, span=m.span) for m in marked.markers for q in ("x", "y", "z", "vx", "vy", "vz"))
    spins = tuple(Output(element=body.name, quantity=q, span=body.span) for body in model.bodies for q in ("wx", "wy", "wz"))
    equations = formulate_recursive(build_topology(marked), scene, (*outputs, *spins))
    return [_in_pose(model, equations, pose.q) for pose in explore(equations)]


def _in_pose(model: Model, equations: RecursiveEquations, q: Array) -> dict[str, _Motion]:
    blocks = {name: block for function in equations.functions for name, block in function.results.items() if name.startswith("column:")}
    roads: dict[str, RoadTable] = {name: FlatRoad() for name in equations.roads}
    values = interpret_blocks(blocks.values(), make_inputs(equations, q, np.eye(equations.speeds)), roads)

    def rows(element: str, names: Sequence[str]) -> Array:
        columns = (values[blocks[f"column:{element}.{name}"]][..., 0, 0] for name in names)
        return np.array([np.broadcast_to(column, (equations.speeds,)) for column in columns])

    still = np.zeros((3, equations.speeds))
    motions = {GROUND: _Motion(rotation=np.eye(3), place=np.zeros(3), velocity=still, spin=still)}
    for body in model.bodies:
        origin, *tips = (rows(f"{body.name}@{i}", ("x", "y", "z"))[:, 0] for i in range(4))
        motions[body.name] = _Motion(
            rotation=np.column_stack([tip - origin for tip in tips]), place=origin,
            velocity=rows(f"{body.name}@0", ("vx", "vy", "vz")), spin=rows(body.name, ("wx", "wy", "wz")),
        )  # fmt: skip
    return motions
