"""From a model and the poses of its bodies to a drawing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutjoint.export.laws import Numbers
from cutjoint.model.records import GROUND, Model
from cutjoint.view.arrows import Arrows
from cutjoint.view.bodies import BodyParts
from cutjoint.view.failure import mark
from cutjoint.view.forces import ForceNodes
from cutjoint.view.motions import quaternions_of
from cutjoint.view.placed import Placed
from cutjoint.view.records import Array, Drawing, Mesh, Node, Part
from cutjoint.view.sizes import point_of


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
    )
    return Drawing(name=model.name, t=t, nodes=(*nodes, *forces.all(), *mark(placed, failed), *arrows.all()), up=up)


def up_of(numbers: Numbers, model: Model) -> Array:
    """The direction against gravity, (3,); z where there is none."""
    gravity = point_of(numbers, model.gravity)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def _moved(part: Part, shift: Array) -> Part:
    mesh = part.mesh
    return Part(
        mesh=Mesh(points=mesh.points + shift, normals=mesh.normals, faces=mesh.faces), colour=part.colour, roughness=part.roughness
    )  # fmt: skip
