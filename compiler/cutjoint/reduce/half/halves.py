"""Half of what lies in the plane: bodies and forces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from cutjoint.model.records import AxialForce, Body, BodyLoad, Bushing, Force, JointForce, PointSpring, Scalar, Tyre, Vector

#: What of a force counts half where the force is halved.
HALVED = frozenset({"force", "stiffness", "damping", "Fx", "Fy", "Fz", "Mx", "My", "Mz"})


def halve_body(body: Body) -> Body:
    """A body with half its mass and inertia."""
    xx, yy, zz, xy, xz, yz = (i / 2 for i in body.inertia)
    return replace(body, mass=body.mass / 2, inertia=(xx, yy, zz, xy, xz, yz))


def halve_force(force: Force) -> Force:
    """A force with half its law; half a tyre's load and spin, since nothing pushes it sideways."""
    match force:
        case PointSpring() | AxialForce() | JointForce():
            return replace(force, law=force.law / 2)
        case Bushing():
            return replace(force, laws=tuple(law / 2 for law in force.laws))
        case BodyLoad():
            return replace(force, components=_half(force.components))
        case Tyre():
            return replace(force, constants=_half_tyre(force.constants))
    return force


def _half(v: Vector) -> Vector:
    return (v[0] / 2, v[1] / 2, v[2] / 2)


def _half_tyre(constants: Mapping[str, Scalar]) -> Mapping[str, Scalar]:
    return {name: value / 2 if name in ("stiffness", "spin_inertia") else value for name, value in constants.items()}
