"""From a model and the poses of its bodies to a drawing, and the camera of its page at the start."""

from collections.abc import Mapping

import numpy as np

from cutjoint.export.laws import Numbers
from cutjoint.model.records import GROUND, Model
from cutjoint.view.bodies import BodyParts
from cutjoint.view.forces import Arrows, ForceNodes
from cutjoint.view.motions import quaternions_of, rotated, rotation_to
from cutjoint.view.page import Camera, mark
from cutjoint.view.records import Array, Drawing, Mesh, Node, Part
from cutjoint.view.sizes import Placed, Sizes, point_of


def draw(placed: Placed, t: Array, *, failed: str = "", columns: Mapping[tuple[str, str], Array] | None = None) -> Drawing:
    """The drawing of a mechanism at times ``t`` (times,), s, each body at its centre of mass; the element that ``failed`` is marked.

    Forces and reactions that ``columns`` (times,) by element and quantity have are arrows.
    """
    model, numbers = placed.model, placed.numbers
    up = up_of(numbers, model)
    parts = BodyParts(model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes).all()
    nodes = [Node(name=GROUND, parts=parts[GROUND], translation=np.zeros((1, 3)))]
    for body in model.bodies:
        centre, pose = point_of(numbers, body.centre_of_mass), placed.poses[body.name]
        nodes.append(
            Node(
                name=body.name, parts=tuple(_moved(part, -centre) for part in parts[body.name]), translation=pose.place(centre),
                rotation=quaternions_of(pose.rotation), about={"body": body.name},
            )
        )  # fmt: skip
    forces = ForceNodes(model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes, poses=placed.poses, up=up)
    arrows = Arrows(
        model=model, scene=placed.scene, numbers=numbers, sizes=placed.sizes, poses=placed.poses, up=up, columns=columns or {}
    )  # fmt: skip
    return Drawing(name=model.name, t=t, nodes=(*nodes, *forces.all(), *mark(placed, failed), *arrows.all()), up=up)


def up_of(numbers: Numbers, model: Model) -> Array:
    """The direction against gravity, (3,); z without gravity."""
    gravity = point_of(numbers, model.gravity)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def _moved(part: Part, shift: Array) -> Part:
    mesh = part.mesh
    return Part(
        mesh=Mesh(points=mesh.points + shift, normals=mesh.normals, faces=mesh.faces), colour=part.colour, roughness=part.roughness
    )  # fmt: skip


#: The camera follows a body that moves further than this many extents of the mechanism; rotation about a pivot gives at most two.
_FAR = 3.0
#: The number of times at which a node's position is sampled.
_SAMPLES = 50


def find_camera(placed: Placed, drawing: Drawing) -> Camera:
    """The camera looks from the side if all rotation axes are parallel, else from ahead, the left and above."""
    model, numbers, sizes = placed.model, placed.numbers, placed.sizes
    has_road = any(force.has_road for force in model.forces)
    return Camera(
        direction=_direction(model, numbers, drawing.up).tolist(), extent=sizes.extent, floor=_floor(sizes, drawing), road=has_road,
        follow=_followed(placed),
    )  # fmt: skip


def _direction(model: Model, numbers: Numbers, up: Array) -> Array:
    axes = [point_of(numbers, joint.axes[0]) for joint in model.joints if joint.axes and "rad" in joint.element.units.values()]
    level = rotation_to(up)  # axes of an upright observer
    across = axes[0] if axes else None
    if across is not None and all(np.linalg.norm(np.cross(across, axis)) < 1e-6 for axis in axes) and abs(across @ up) < 0.5:
        right = np.cross(up, across)
        side = across if right @ np.ones(3) > 0 else -across
        return np.asarray(side + 0.28 * up + 0.30 * np.cross(up, side))
    return np.asarray(level @ np.array([0.85, 1.0, 0.55]))


def _floor(sizes: Sizes, drawing: Drawing) -> float:
    """A height slightly below the lowest point at any time."""
    lowest = [_lowest(node, drawing.up) for node in drawing.nodes if node.parts and "arrow" not in node.about]
    return min(lowest, default=0.0) - 0.02 * sizes.extent


def _lowest(node: Node, up: Array) -> float:
    """The lowest point of a node at some of its times."""
    rows = max(len(node.translation), len(node.rotation), len(node.scale))
    kept = np.unique(np.linspace(0, rows - 1, _SAMPLES).astype(int))
    places, turns, scales = (track[np.minimum(kept, len(track) - 1)] for track in (node.translation, node.rotation, node.scale))
    seen_up = rotated(turns * [-1, -1, -1, 1], np.broadcast_to(up, (len(kept), 3))) * scales
    points = np.concatenate([part.mesh.points for part in node.parts])
    return float((places @ up + (points @ seen_up.T).min(axis=0)).min())


def _followed(placed: Placed) -> str:
    """The heaviest body if it moves far, else none."""
    if not placed.model.bodies:
        return ""
    body = max(placed.model.bodies, key=lambda b: placed.numbers.number(b.mass))
    way = placed.place(body.name, body.centre_of_mass)
    return body.name if np.ptp(way, axis=0).max() > _FAR * placed.sizes.extent else ""
