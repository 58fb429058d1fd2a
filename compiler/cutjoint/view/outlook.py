"""How a page first looks at a mechanism."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.export.numbers import Numbers
from cutjoint.model.records import Model, Tyre
from cutjoint.view.page import Outlook
from cutjoint.view.records import Array, Drawing
from cutjoint.view.sizes import Sizes, point_of
from cutjoint.view.turns import rotation_to

#: A body that goes further than this many extents of the mechanism is followed.
_FAR = 1.5


def find_outlook(model: Model, numbers: Numbers, sizes: Sizes, drawing: Drawing, poses: Mapping[str, BodyPose]) -> Outlook:
    """From the side if all axes of turns are one direction, else from ahead, the left and above."""
    has_road = any(isinstance(force, Tyre) for force in model.forces)
    return Outlook(
        direction=_direction(model, numbers, drawing.up).tolist(), extent=sizes.extent, floor=_floor(sizes, drawing), road=has_road,
        follow=_followed(model, numbers, sizes, poses),
    )  # fmt: skip


def _direction(model: Model, numbers: Numbers, up: Array) -> Array:
    axes = [point_of(numbers, joint.axes[0]) for joint in model.joints if joint.axes and "rad" in joint.element.units.values()]
    level = rotation_to(up)  # x, y and z of an observer who stands upright
    across = axes[0] if axes else None
    if across is not None and all(np.linalg.norm(np.cross(across, axis)) < 1e-6 for axis in axes) and abs(across @ up) < 0.5:
        right = np.cross(up, across)
        side = across if right @ np.ones(3) > 0 else -across
        return np.asarray(side + 0.28 * up + 0.30 * np.cross(up, side))
    return np.asarray(level @ np.array([0.85, 1.0, 0.55]))


def _floor(sizes: Sizes, drawing: Drawing) -> float:
    """The height of the lowest point at any time; parts turn about their node, so that no more than their size counts."""
    lowest = []
    for node in drawing.nodes:
        for part in node.parts:
            reach = part.mesh.points
            if len(node.rotation) == 1 and len(node.scale) == 1:
                lowest.append((node.translation @ drawing.up).min() + (reach @ drawing.up).min())
    heights = [float((node.translation @ drawing.up).min()) for node in drawing.nodes if len(node.translation) > 1]
    return float(min([*lowest, *heights], default=0.0)) - 0.06 * sizes.extent


def _followed(model: Model, numbers: Numbers, sizes: Sizes, poses: Mapping[str, BodyPose]) -> str:
    """The heaviest body if it goes far."""
    if not model.bodies:
        return ""
    body = max(model.bodies, key=lambda b: numbers.number(b.mass))
    way = poses[body.name].place(point_of(numbers, body.centre_of_mass))
    return body.name if np.ptp(way, axis=0).max() > _FAR * sizes.extent else ""
