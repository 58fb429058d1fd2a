"""Joints between bodies that move in a plane: what is left of their motion, and how its coordinates count."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from cutjoint.model.records import COORDINATES, GROUND, Joint, JointKind, Vector
from cutjoint.reduce.half.plane import AsymmetryError, Plane

K = JointKind


@dataclass(frozen=True, kw_only=True)
class InPlane:
    """A joint in the plane: ``kept`` has for a coordinate or speed of the whole joint its name here and the factor to what it was.

    Those that are not kept would leave the plane and are zero; ``unknown`` ones depend on which of its bodies is the inner one.
    """

    joint: Joint
    kept: Mapping[str, tuple[str, int]]
    unknown: frozenset[str] = frozenset()


def restrict(joint: Joint, plane: Plane) -> InPlane:
    """A tree joint between bodies in the plane with the motions in the plane alone.

    A joint that the model cuts needs no such change: its other equations hold by themselves.

    Raises:
        AsymmetryError: the motions that remain are not those of one of the joint kinds.
    """
    found = _RULES[joint.kind](joint, plane) if joint.kind in _RULES else None
    if found is None:
        raise AsymmetryError(joint.name, f"is a {joint.kind} joint that no joint kind stands for in the plane {plane}", joint.span)
    return found


def in_plane_words(plane: Plane, kind: str, before: str) -> str:
    """The words about a joint that becomes one of another kind."""
    return f"moves in the plane {plane} alone: a {kind} joint in place of a {before} one"


def _changed(joint: Joint, kind: str, axes: tuple[Vector, ...], kept: Mapping[str, str]) -> InPlane:
    """A joint of another kind that keeps some coordinates under new names, with their rates."""
    names = COORDINATES[joint.kind]
    guides = dict(zip(names, joint.guide or (), strict=False))
    guide = tuple(guides[name] for name in kept) if joint.guide is not None and kept else None
    rates = {f"{old}_rate": f"{new}_rate" for old, new in kept.items()}
    return InPlane(
        joint=replace(joint, kind=kind, axes=axes, to=None, pitch=None, guide=guide),
        kept={old: (new, 1) for old, new in {**kept, **rates}.items()},
    )  # fmt: skip


def _unchanged(joint: Joint, plane: Plane) -> InPlane:
    return _changed(joint, joint.kind, joint.axes, {name: name for name in COORDINATES[joint.kind]})


def _at_rest(joint: Joint) -> InPlane:
    return _changed(joint, K.FIXED, (), {})


def _revolute(joint: Joint, plane: Plane) -> InPlane:
    return _unchanged(joint, plane) if plane.along_normal(joint.axes[0]) else _at_rest(joint)


def _prismatic(joint: Joint, plane: Plane) -> InPlane | None:
    if plane.within(joint.axes[0]):
        return _unchanged(joint, plane)
    return _at_rest(joint) if plane.along_normal(joint.axes[0]) else None


def _cylindrical(joint: Joint, plane: Plane) -> InPlane | None:
    if plane.along_normal(joint.axes[0]):
        return _changed(joint, K.REVOLUTE, joint.axes, {"angle": "angle"})
    return _changed(joint, K.PRISMATIC, joint.axes, {"displacement": "displacement"}) if plane.within(joint.axes[0]) else None


def _universal(joint: Joint, plane: Plane) -> InPlane | None:
    """One of the axes stands across the plane, the other turns nothing."""
    along = [i for i, axis in enumerate(joint.axes) if plane.along_normal(axis)]
    return _changed(joint, K.REVOLUTE, (joint.axes[along[0]],), {f"angle_{along[0] + 1}": "angle"}) if along else None


def _planar(joint: Joint, plane: Plane) -> InPlane | None:
    return _unchanged(joint, plane) if plane.along_normal(joint.axes[0]) else None


def _spherical(joint: Joint, plane: Plane) -> InPlane:
    hinge = _changed(joint, K.REVOLUTE, (plane.normal,), {})
    return replace(hinge, unknown=frozenset({f"w{plane.axis}"}))


def _free(joint: Joint, plane: Plane) -> InPlane | None:
    """A planar joint from the ground on, whose displacements stand along global axes."""
    if GROUND not in (joint.base, joint.follower):
        return None
    body = joint.follower if joint.base == GROUND else joint.base
    kept = {f"w{plane.axis}": ("angle_rate", 1)}
    for name, tangent in zip(("displacement_1", "displacement_2"), plane.tangents(), strict=True):
        (axis,) = (a for a, component in zip("xyz", tangent, strict=True) if component != 0)
        sign = int(tangent["xyz".index(axis)])
        kept |= {axis: (name, sign), f"v{axis}": (f"{name}_rate", sign)}
    return InPlane(joint=replace(joint, kind=K.PLANAR, base=GROUND, follower=body, axes=(plane.normal,), cut=False), kept=kept)


_RULES: Mapping[str, Callable[[Joint, Plane], InPlane | None]] = {
    K.FIXED: _unchanged, K.REVOLUTE: _revolute, K.PRISMATIC: _prismatic, K.CYLINDRICAL: _cylindrical, K.UNIVERSAL: _universal,
    K.PLANAR: _planar, K.SPHERICAL: _spherical, K.FREE: _free,
}  # fmt: skip
