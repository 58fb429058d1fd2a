"""The records of a drawing: meshes on nodes that move over time, and colours that light and dark pages both take."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Faces: TypeAlias = NDArray[np.int64]

#: Red, green and blue from 0 to 1, as screens have them (sRGB).
Colour: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Triangles: ``points`` (n, 3), ``faces`` (m, 3), anticlockwise from outside; there is an edge where faces do not share points."""

    points: Array
    faces: Faces

    @cached_property
    def normals(self) -> Array:
        """Unit vectors (n, 3): of the faces around each point, by their areas."""
        a, b, c = self.points[self.faces].swapaxes(0, 1)
        normals = np.zeros_like(self.points)
        np.add.at(normals, self.faces, np.cross(b - a, c - a)[:, np.newaxis])
        sizes = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(sizes > 0, normals / np.where(sizes > 0, sizes, 1.0), (0.0, 0.0, 1.0))  # triangles without area have any

    def moved(self, rotation: Array, shift: Array) -> "Mesh":
        """The mesh turned by (3, 3) and shifted by (3,)."""
        return Mesh(points=self.points @ rotation.T + shift, faces=self.faces)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A mesh of one colour."""

    mesh: Mesh
    colour: Colour
    roughness: float = 0.6


@dataclass(frozen=True, kw_only=True)
class Node:
    """Parts that move together: a point p of theirs is at rotation (scale p) + translation.

    ``translation`` is (times, 3), ``rotation`` (times, 4) as quaternions (x, y, z, w), ``scale`` (times, 3); what does not change has one
    row.  ``about`` is what a page has to know of the node.
    """

    name: str
    parts: tuple[Part, ...]
    translation: Array
    rotation: Array = field(default_factory=lambda: np.array([[0.0, 0.0, 0.0, 1.0]]))
    scale: Array = field(default_factory=lambda: np.ones((1, 3)))
    about: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """Nodes over the times ``t`` (times,), s, in the model's axes; ``up`` (3,) is against gravity."""

    name: str
    t: Array
    nodes: tuple[Node, ...]
    up: Array


def read_colour(text: str) -> Colour:
    """The colour of a text such as "#d9480f"."""
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


STEEL = read_colour("#8b929b")
JOINT = read_colour("#5d646e")
FORCE, REACTION = read_colour("#d9480f"), read_colour("#0b7fab")
ALARM = read_colour("#e5202b")
RUBBER = read_colour("#33373d")
ROAD = (read_colour("#a3a8ae"), read_colour("#b6bac0"))
#: Colours of strips of a road with a different friction.
ICE = (read_colour("#8fb4cf"), read_colour("#a4c4da"))

_OF_BODIES = tuple(
    read_colour(c) for c in ("#3f7fb5", "#e08a33", "#4f9d5a", "#cf5757", "#8a6fc0", "#3fa3a0", "#c9a227", "#c76b9f", "#8d6e5a", "#7f9a3c")
)


def colours_of(bodies: Sequence[str]) -> dict[str, Colour]:
    """A colour for each body; those with one name in several instances of a submodel have one colour, unless all would."""
    labels = {body: body.rpartition(".")[2] for body in bodies}
    if len(set(labels.values())) == 1:
        labels = {body: body for body in bodies}
    names = list(dict.fromkeys(labels.values()))
    return {body: _OF_BODIES[names.index(name) % len(_OF_BODIES)] for body, name in labels.items()}
