"""Half of what lies in the plane: bodies."""

from __future__ import annotations

from dataclasses import replace

from cutjoint.model.records import Body


def halve_body(body: Body) -> Body:
    """A body with half its mass and inertia."""
    xx, yy, zz, xy, xz, yz = (i / 2 for i in body.inertia)
    return replace(body, mass=body.mass / 2, inertia=(xx, yy, zz, xy, xz, yz))
