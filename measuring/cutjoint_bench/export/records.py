"""The records of an export: one scene of a model as other simulators (peers) meet it.

Peers begin where the scene begins.  All geometry is that of the *start*: points and directions in the one global frame, in the pose in
which the scene starts, all joint coordinates of a peer zero there.  A frame that a body carries is parallel to the global one at the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from cutjoint.elements.joint import JointElement
from cutjoint.elements.joints import JOINTS
from cutjoint.model.records import Force, Scalar, Span
from cutjoint_bench.export.laws import Triple

#: Three rows.
Matrix: TypeAlias = tuple[Triple, Triple, Triple]


@dataclass(frozen=True, kw_only=True)
class RigidBody:
    """One or several welded bodies of the model, named after the one next to the ground.

    ``mass`` in kg; ``centre`` is the centre of mass at the start (m), ``inertia`` about it in global axes at the start (kg m2),
    ``velocity`` that of the centre (m/s), ``spin`` the angular velocity (rad/s), in global axes.
    """

    name: str
    mass: float
    centre: Triple
    inertia: Matrix
    velocity: Triple
    spin: Triple
    span: Span


@dataclass(frozen=True, kw_only=True)
class Place:
    """The place of a body of the model at the start: part of the rigid body ``of`` ("ground" if it is welded to the ground).

    A point p of the design position stands at ``rotation`` p + ``shift``; a direction is turned by ``rotation``.  ``centre`` is the body's
    own centre of mass at the start; ``mass`` its own mass.
    """

    of: str
    rotation: Matrix
    shift: Triple
    centre: Triple
    mass: float

    def point(self, design: Triple) -> Triple:
        """The place of a point of the body at the start, m."""
        x, y, z = (a + b for a, b in zip(self.direction(design), self.shift, strict=True))
        return x, y, z

    def direction(self, design: Triple) -> Triple:
        """A direction that the body carries, at the start."""
        x, y, z = (sum(a * b for a, b in zip(row, design, strict=True)) for row in self.rotation)
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class PeerJoint:
    """A joint between two rigid bodies, or one and the ground.

    ``base`` and ``follower`` name rigid bodies or "ground".  ``base_point`` and ``follower_point`` are the joint's points of both at the
    start: apart by what the joint has slid, or by the rod of a distance joint.  ``base_axes`` and ``follower_axes`` are the joint's
    directions as the base and as the follower carry them: its axes as in the model, then two directions across an axis
    along which displacements count, and across a distance joint's rod.  ``coordinates`` are the model's coordinates of a tree joint at
    the start (by ``cutjoint.model.records.COORDINATES``), none for a cut joint.  ``reversed`` is whether the tree passes from the follower
    to the base.  ``guide`` prescribes the coordinates as functions of ``t``, all other symbols put in; a joint whose guides stand still
    is welded and does not appear.
    """

    name: str
    kind: str
    base: str
    follower: str
    base_point: Triple
    follower_point: Triple
    base_axes: tuple[Triple, ...]
    follower_axes: tuple[Triple, ...]
    pitch: float
    coordinates: tuple[float, ...]
    reversed: bool
    guide: tuple[Scalar, ...]
    span: Span

    @property
    def element(self) -> JointElement:
        """The record of the joint's kind."""
        return JOINTS[self.kind]

    @property
    def parent(self) -> str:
        """The rigid body nearer to the ground of a tree joint."""
        return self.follower if self.reversed else self.base

    @property
    def child(self) -> str:
        """The rigid body that a tree joint moves."""
        return self.base if self.reversed else self.follower


@dataclass(frozen=True, kw_only=True)
class PeerGear:
    """A gear: the first coordinate's movement since the start is ``ratio`` times that of the second one.

    ``first`` and ``second`` are a joint's name and the number of its coordinate.  A joint whose guides stand still is not in the tree.
    """

    name: str
    first: tuple[str, int]
    second: tuple[str, int]
    ratio: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Bodies and tree joints, parents first; cut joints between different rigid bodies; gears; forces that the scene has switched on.

    ``places`` has every body of the model and the ground.  ``gravity`` in m/s2.
    """

    name: str
    gravity: Triple
    bodies: tuple[RigidBody, ...]
    places: Mapping[str, Place]
    tree: tuple[PeerJoint, ...]
    cuts: tuple[PeerJoint, ...]
    gears: tuple[PeerGear, ...]
    forces: tuple[Force, ...]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column of a peer's table: x y z (m), vx vy vz (m/s) or wx wy wz (rad/s) of a rigid body.

    ``point`` is given at the start, in m.
    """

    name: str
    body: str
    point: Triple
    quantity: str
    unit: str
