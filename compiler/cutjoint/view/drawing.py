"""From a model and the poses of its bodies to a drawing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutjoint.analysis.body_poses import BodyPose
from cutjoint.export.numbers import Numbers
from cutjoint.model.records import GROUND, Model, Scene
from cutjoint.view.bodies import BodyParts
from cutjoint.view.forces import ForceNodes
from cutjoint.view.records import Array, Drawing, Mesh, Node, Part
from cutjoint.view.sizes import Sizes, point_of
from cutjoint.view.turns import quaternions_of


def draw(model: Model, scene: Scene, numbers: Numbers, sizes: Sizes, t: Array, poses: Mapping[str, BodyPose]) -> Drawing:
    """The drawing of a scene at times ``t`` (times,), s; a body's node is at its centre of mass."""
    up = up_of(numbers, model)
    parts = BodyParts(model=model, scene=scene, numbers=numbers, sizes=sizes).all()
    still = BodyPose(rotation=np.broadcast_to(np.eye(3), (t.size, 3, 3)), shift=np.zeros((t.size, 3)))
    nodes = [Node(name=GROUND, parts=parts[GROUND], translation=np.zeros((1, 3)))]
    for body in model.bodies:
        centre, pose = point_of(numbers, body.centre_of_mass), poses[body.name]
        nodes.append(
            Node(
                name=body.name, parts=tuple(_moved(part, -centre) for part in parts[body.name]), translation=pose.place(centre),
                rotation=quaternions_of(pose.rotation), about={"body": body.name},
            )
        )  # fmt: skip
    forces = ForceNodes(model=model, scene=scene, numbers=numbers, sizes=sizes, poses={**poses, GROUND: still}, up=up)
    return Drawing(name=model.name, t=t, nodes=(*nodes, *forces.all()), up=up)


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
