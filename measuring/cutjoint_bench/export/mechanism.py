"""Model -> Mechanism: the bodies and joints of a scene as numbers, in the pose in which it starts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cutjoint.elements.joint import Direction
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import TIME
from cutjoint.kernels.joints import direction_of
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import GROUND, Body, Gear, Joint, Model, Scalar, Scene
from cutjoint.package.errors import RunError
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint_bench.export.laws import Array, Numbers, Triple
from cutjoint_bench.export.records import Matrix, Mechanism, PeerGear, PeerJoint, Place, RigidBody
from cutjoint_bench.export.starts import Start, find_start
from cutjoint_bench.mechanics_alone import is_reduced, require_mechanics_alone


def build_mechanism(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Mechanism:
    """The mechanism of a scene: bodies that never move in each other are one, and every body has mass.

    Raises:
        ModelError: a body without mass.
        RunError: a change names no tunable parameter, the scene has no start, or the model is reduced.
        TopologyError, SimulatorError, ToolchainError: as for a run.
    """
    if is_reduced(model, scene):
        raise RunError(f"{model.span.file}: peers know neither guards nor sensors of rods of reduced models; export the full model")
    if scene.road.parts:
        raise RunError(f"{scene.span}: scene '{scene.name}': peers know neither surfaces nor friction of roads; leave them out of 'road'")
    require_mechanics_alone(model)
    topology = build_topology(model)
    starts, coordinates = find_start(topology, scene, parameters)
    return _Builder(topology, scene, Numbers.of(model, scene, parameters), starts, coordinates).build()


@dataclass(frozen=True)
class _Builder:
    """Puts numbers to a topology; ``roots`` in its methods says what each body is welded to."""

    topology: Topology
    scene: Scene
    numbers: Numbers
    starts: Mapping[str, Start]
    coordinates: Mapping[str, tuple[float, ...]]

    def build(self) -> Mechanism:
        model = self.topology.model
        roots = self.roots()
        joints = [(t, self.joint(t.joint, roots, t.reversed)) for t in self.topology.tree]
        bodies = tuple(self.rigid_body(root, members) for root, members in _groups(roots).items())
        _require_mass(bodies)
        return Mechanism(
            name=model.name, gravity=self.numbers.triple(model.gravity), bodies=bodies,
            places={name: self.place(name, roots) for name in roots},
            tree=tuple(joint for t, joint in joints if roots[t.child] == t.child),
            cuts=tuple(j for j in (self.joint(cut, roots, False) for cut in self.topology.cuts) if j.base != j.follower),
            gears=tuple(map(self.gear, model.gears)), forces=tuple(force for force in model.forces if is_active(force, self.scene)),
        )  # fmt: skip

    def roots(self) -> dict[str, str]:
        """Of every body the one, next to the ground, that it is welded to; itself if it is not."""
        roots = {GROUND: GROUND}
        for t in self.topology.tree:
            roots[t.child] = roots[t.parent] if self.is_weld(t) else t.child
        return roots

    def is_weld(self, t: TreeJoint) -> bool:
        return t.joint.element.is_rigid or (t.joint.guide is not None and not any(g.has(TIME) for g in self.guide(t.joint)))

    def guide(self, joint: Joint) -> tuple[Scalar, ...]:
        return tuple(self.numbers.law(guide) for guide in joint.guide or ())

    def place(self, name: str, roots: Mapping[str, str]) -> Place:
        if name == GROUND:
            return Place(of=GROUND, rotation=_matrix(np.eye(3)), shift=(0.0, 0.0, 0.0), centre=(0.0, 0.0, 0.0), mass=0.0)
        body, start = self.body(name), self.starts[name]
        centre = self.point(name, body.centre_of_mass)
        return Place(
            of=roots[name], rotation=_matrix(start.rotation), shift=_triple(start.shift), centre=_triple(centre),
            mass=self.numbers.number(body.mass),
        )  # fmt: skip

    def body(self, name: str) -> Body:
        return next(b for b in self.topology.model.bodies if b.name == name)

    def point(self, body: str, point: Sequence[Scalar]) -> Array:
        """A point of a body at the start."""
        if body == GROUND:
            return np.array(self.numbers.triple(point))
        return self.direction(body, point) + self.starts[body].shift

    def direction(self, body: str, direction: Sequence[Scalar]) -> Array:
        vector = np.array(self.numbers.triple(direction))
        return vector if body == GROUND else self.starts[body].rotation @ vector

    def rigid_body(self, root: str, members: Sequence[str]) -> RigidBody:
        """Welded bodies as one; their speeds are those of the first."""
        parts = [self.body(name) for name in members]
        masses = [self.numbers.number(part.mass) for part in parts]
        centres = [self.point(part.name, part.centre_of_mass) for part in parts]
        total = sum(masses)
        centre = centres[0] if total in (0.0, masses[0]) else np.average(centres, axis=0, weights=masses)
        moved = (self.inertia(p) + m * _steiner(c - centre) for p, m, c in zip(parts, masses, centres, strict=True))
        inertia = sum(moved, np.zeros((3, 3)))
        first = self.starts[root]
        velocity = first.velocity + np.cross(first.spin, centre - centres[0])
        return RigidBody(
            name=root, mass=total, centre=_triple(centre), inertia=_matrix(inertia), velocity=_triple(velocity), spin=_triple(first.spin),
            span=parts[0].span,
        )  # fmt: skip

    def inertia(self, body: Body) -> Array:
        """About the body's own centre of mass in global axes at the start, (3, 3)."""
        xx, yy, zz, xy, xz, yz = (self.numbers.number(e) for e in body.inertia)
        R = self.starts[body.name].rotation
        J: Array = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        return (J + J.T) / 2

    def joint(self, joint: Joint, roots: Mapping[str, str], is_reversed: bool) -> PeerJoint:
        axes = [*joint.axes, *_across(joint)]
        return PeerJoint(
            name=joint.name, kind=joint.kind, base=roots[joint.base], follower=roots[joint.follower],
            base_point=_triple(self.point(joint.base, joint.at)),
            follower_point=_triple(self.point(joint.follower, joint.to or joint.at)),
            base_axes=tuple(_triple(self.direction(joint.base, a)) for a in axes),
            follower_axes=tuple(_triple(self.direction(joint.follower, a)) for a in axes),
            pitch=self.numbers.number(joint.pitch or 0), coordinates=self.coordinates.get(joint.name, ()),
            reversed=is_reversed, guide=self.guide(joint), span=joint.span,
        )  # fmt: skip

    def gear(self, gear: Gear) -> PeerGear:
        joints = {t.joint.name: t.joint for t in self.topology.tree}
        first, second = ((c.joint, joints[c.joint].element.coordinates.index(c.name)) for c in gear.coordinates)
        return PeerGear(name=gear.name, first=first, second=second, ratio=self.numbers.number(gear.ratio), span=gear.span)


def _groups(roots: Mapping[str, str]) -> dict[str, list[str]]:
    """The members of each rigid body, parents first; what is welded to the ground is no body."""
    groups: dict[str, list[str]] = {}
    for name, root in roots.items():
        groups.setdefault(root, []).append(name)
    return {root: members for root, members in groups.items() if root != GROUND}


def _require_mass(bodies: Sequence[RigidBody]) -> None:
    """Raise ModelError for bodies without mass."""
    problems = [
        Problem(
            span=body.span, element=f"body '{body.name}'", message="other simulators need mass, and it is massless",
            hint="give it some in the model file" if np.any(body.inertia) else f"give it some by --link-mass '{body.name}=KG'",
        )
        for body in bodies if body.mass == 0.0
    ]  # fmt: skip
    if problems:
        raise ModelError(problems)


def _across(joint: Joint) -> Iterator[Sequence[Scalar]]:
    """The two directions across a joint's axis or rod, if its motions are along them."""
    across = (Direction.ACROSS_1, Direction.ACROSS_2)
    if any(m.direction in across for m in joint.element.scalar_motions):
        yield from (direction_of(joint, d) for d in across)


def _steiner(way: Array) -> Array:
    return np.eye(3) * (way @ way) - np.outer(way, way)


def _triple(vector: Array) -> Triple:
    x, y, z = map(float, vector)
    return x + 0.0, y + 0.0, z + 0.0


def _matrix(matrix: Array) -> Matrix:
    x, y, z = map(_triple, matrix)
    return x, y, z
