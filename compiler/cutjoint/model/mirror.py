"""Mirror images of elements, for instances with ``mirror``.

Points, translation axes and forces mirror as vectors; axes of rotation and torques mirror as pseudo-vectors,
so that a positive angle of the image is the image of a positive angle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cutjoint.model.elements import Elements
from cutjoint.model.expressions import variable
from cutjoint.model.records import (
    AxialForce,
    Body,
    BodyLoad,
    Force,
    Joint,
    JointKind,
    Marker,
    PointSpring,
    Reaction,
    Scalar,
    Tyre,
    Vector,
)

_TRANSLATION = (JointKind.PRISMATIC, JointKind.POINT_ON_LINE)


@dataclass(frozen=True)
class Mirror:
    """Reflection along one global axis: ``signs`` of the three components."""

    signs: tuple[int, int, int]

    def vector(self, v: Vector) -> Vector:
        """The image of a point or a translation."""
        return (self.signs[0] * v[0], self.signs[1] * v[1], self.signs[2] * v[2])

    def rotation(self, v: Vector) -> Vector:
        """The image of an axis of rotation or a torque."""
        a, b, c = self.vector(v)
        return (-a, -b, -c)

    def law(self, expression: Scalar) -> Scalar:
        """An expression over x y z vx vy vz, as the image sees it."""
        axis = "xyz"[self.signs.index(-1)]
        return expression.xreplace({variable(name): -variable(name) for name in (axis, f"v{axis}")})


def mirror_elements(elements: Elements, axis: str) -> Elements:
    """The image of all elements under reflection along "x", "y" or "z"."""
    x, y, z = (-1 if name == axis else 1 for name in "xyz")
    mirror = Mirror((x, y, z))
    return Elements(
        tuple(_body(mirror, body) for body in elements.bodies),
        tuple(_joint(mirror, joint) for joint in elements.joints),
        tuple(_force(mirror, force) for force in elements.forces),
        tuple(_reaction(mirror, reaction) for reaction in elements.reactions),
        tuple(_marker(mirror, marker) for marker in elements.markers),
    )


def _body(mirror: Mirror, body: Body) -> Body:
    x, y, z = mirror.signs
    xx, yy, zz, xy, xz, yz = body.inertia
    inertia = (xx, yy, zz, x * y * xy, x * z * xz, y * z * yz)
    return replace(body, centre_of_mass=mirror.vector(body.centre_of_mass), inertia=inertia)


def _joint(mirror: Mirror, joint: Joint) -> Joint:
    image = mirror.vector if joint.kind in _TRANSLATION else mirror.rotation
    return replace(
        joint,
        at=mirror.vector(joint.at),
        axes=tuple(image(axis) for axis in joint.axes),
        to=None if joint.to is None else mirror.vector(joint.to),
        pitch=None if joint.pitch is None else -joint.pitch,
    )


def _force(mirror: Mirror, force: Force) -> Force:
    match force:
        case PointSpring():
            return replace(force, start=mirror.vector(force.start), end=mirror.vector(force.end))
        case AxialForce():
            origin, point = mirror.vector(force.origin), mirror.vector(force.point)
            return replace(force, origin=origin, point=point, axis=mirror.vector(force.axis))
        case BodyLoad():
            return _load(mirror, force)
        case Tyre():
            return replace(force, centre=mirror.vector(force.centre), axis=mirror.rotation(force.axis))
    return force


def _load(mirror: Mirror, load: BodyLoad) -> BodyLoad:
    x, y, z = (mirror.law(component) for component in load.components)
    if load.point is None:
        return replace(load, components=mirror.rotation((x, y, z)))
    return replace(load, point=mirror.vector(load.point), components=mirror.vector((x, y, z)))


def _reaction(mirror: Mirror, reaction: Reaction) -> Reaction:
    return replace(reaction, direction=mirror.vector(reaction.direction))


def _marker(mirror: Mirror, marker: Marker) -> Marker:
    return replace(marker, point=mirror.vector(marker.point))
