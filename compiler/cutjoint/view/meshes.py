"""Meshes of simple bodies, around the origin along z."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations, pairwise
from math import pi, tau

import numpy as np

from cutjoint.view.motions import rotation_to
from cutjoint.view.records import Array, Faces, Mesh

_AROUND = 20
#: The length at which the wire of a coil has a round section, in radii of the coil.
_DRAWN = 8.0


def _grid_faces(rows: int, columns: int, *, closes: bool = True) -> Faces:
    """Two triangles for each cell of a grid of (rows, columns) points, whose last column is beside the first one if it ``closes``."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closes else columns - 1), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    return np.concatenate([np.stack([a, b, b + columns], axis=1), np.stack([a, b + columns, a + columns], axis=1)])


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    firsts = np.cumsum([0, *(len(m.points) for m in meshes[:-1])])
    faces = [m.faces + first for m, first in zip(meshes, firsts, strict=True)]
    return Mesh(points=np.concatenate([m.points for m in meshes]), faces=np.concatenate(faces))


def revolved(profile: Sequence[tuple[float, float]], around: int = _AROUND) -> Mesh:
    """The surface that a profile of points (radius, z) sweeps about z, upwards outside, with an edge at each point."""
    angle = np.linspace(0.0, tau, around, endpoint=False)
    rows = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)], axis=1) for r, z in profile]
    return joined([Mesh(points=np.concatenate(pair), faces=_grid_faces(2, around)) for pair in pairwise(rows)])


def cylinder(radius: float, length: float, around: int = _AROUND) -> Mesh:
    """A solid cylinder."""
    h = length / 2
    return revolved([(0.0, -h), (radius, -h), (radius, h), (0.0, h)], around)


def disc(r: float, length: float) -> Mesh:
    """A solid cylinder with a radial bar on its ends, which shows its rotation."""
    return joined([cylinder(r, length, 40), box(r, 0.1 * r, length + 0.06 * r).moved(np.eye(3), np.array([r / 2, 0.0, 0.0]))])


@cache
def sphere(radius: float) -> Mesh:
    """A sphere."""
    rows = 11
    theta, phi = np.meshgrid(np.linspace(-pi / 2, pi / 2, rows), np.linspace(0.0, tau, _AROUND, endpoint=False), indexing="ij")
    points = radius * np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)], axis=-1)
    return Mesh(points=points.reshape(-1, 3), faces=_grid_faces(rows, _AROUND))


def box(a: float, b: float, c: float) -> Mesh:
    """A cuboid with lengths along x, y, z."""
    sides = []
    half = np.array([a, b, c]) / 2
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal, u = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            v = np.cross(normal, u)
            corners = np.array([normal - u - v, normal + u - v, normal + u + v, normal - u + v]) * half
            sides.append(Mesh(points=corners, faces=np.array([[0, 1, 2], [0, 2, 3]])))
    return joined(sides)


def between(start: Array, end: Array, radius: float) -> Mesh:
    """A round bar from one point (3,) to another."""
    way = end - start
    return cylinder(radius, float(np.linalg.norm(way)), 14).moved(rotation_to(way), (start + end) / 2)


def hull(points: Array, least: float) -> list[Mesh]:
    """The convex hull of points (points, 3), none where they lie within ``least`` (m) of a plane; of many those that are far out count."""
    points = _outermost(points)
    middle = points.mean(axis=0)
    if np.ptp((points - middle) @ np.linalg.svd(points - middle)[2][-1]) < least:
        return []
    size = np.ptp(points, axis=0).max()
    i, j, k = np.array(list(combinations(range(len(points)), 3))).T  # all planes through three points
    normals = np.cross(points[j] - points[i], points[k] - points[i])
    lengths = np.linalg.norm(normals, axis=1)
    planes = lengths > 1e-9 * size**2
    normals, first = normals[planes] / lengths[planes, np.newaxis], points[i[planes]]
    normals *= np.where(((first - middle) * normals).sum(axis=1) < 0, -1.0, 1.0)[:, np.newaxis]
    heights = normals @ points.T - (normals * first).sum(axis=1)[:, np.newaxis]
    sides: dict[tuple[int, ...], Array] = {}
    for normal, height in zip(normals, heights, strict=True):
        if height.max() < 1e-9 * size:
            sides.setdefault(tuple(np.flatnonzero(height > -1e-9 * size).tolist()), normal)
    return [_polygon(points[list(corners)], normal) for corners, normal in sides.items()]


def _outermost(points: Array) -> Array:
    """At most forty points, each the extreme one in some direction."""
    if len(points) <= 40:
        return points
    turns = np.arange(120) * np.pi * (3 - np.sqrt(5))
    height = np.linspace(-1, 1, 120)
    directions = np.stack([np.cos(turns) * np.sqrt(1 - height**2), np.sin(turns) * np.sqrt(1 - height**2), height], axis=1)
    return np.asarray(points[np.unique((points @ directions.T).argmax(axis=0))[:40]])


def _polygon(corners: Array, normal: Array) -> Mesh:
    middle = corners.mean(axis=0)
    right = (corners[0] - middle) / np.linalg.norm(corners[0] - middle)
    around = np.argsort(np.arctan2((corners - middle) @ np.cross(normal, right), (corners - middle) @ right))
    faces = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)])
    return Mesh(points=corners[around], faces=faces)


@cache
def arrow(length: float) -> Mesh:
    """An arrow from the origin along z."""
    shaft, head, neck = 0.035 * length, 0.085 * length, 0.74 * length
    return revolved([(0.0, 0.0), (shaft, 0.0), (shaft, neck), (head, neck), (0.0, length)], 16)


@cache
def coil(radius: float) -> Mesh:
    """A helical spring from z = 0 to 1 with straight ends, to be drawn out along z."""
    turns, end = 7, 0.08
    steps = 14 * turns
    s = np.linspace(0.0, 1.0, steps + 1)
    reach = radius * np.minimum(1.0, np.minimum(s, 1 - s) * 20)
    path = np.stack([reach * np.cos(tau * turns * s), reach * np.sin(tau * turns * s), end + (1 - 2 * end) * s], axis=1)
    long = np.array([1.0, 1.0, _DRAWN * radius])
    tube = _tube(np.concatenate([[[0.0, 0.0, 0.0]], path, [[0.0, 0.0, 1.0]]]) * long, radius / 6)
    return Mesh(points=tube.points / long, faces=tube.faces)


def _tube(path: Array, radius: float) -> Mesh:
    """A tube of seven sides along a path (n, 3)."""
    sides = 7
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    first = np.cross(ahead, np.eye(3)[np.abs(ahead[0]).argmin()])[0]
    across = np.empty_like(path)
    for i, direction in enumerate(ahead):  # parallel transport, so that the tube does not twist
        first = first - (first @ direction) * direction
        first /= np.linalg.norm(first)
        across[i] = first
    around = np.linspace(0.0, tau, sides, endpoint=False)[np.newaxis, :, np.newaxis]
    out = np.cos(around) * across[:, np.newaxis] + np.sin(around) * np.cross(ahead, across)[:, np.newaxis]
    return Mesh(points=(path[:, np.newaxis] + radius * out).reshape(-1, 3), faces=_grid_faces(len(path), sides))


def tyre(radius: float) -> Mesh:
    """The rubber of a wheel."""
    w, inner = 0.25 * radius, 0.62 * radius
    flank, edge = 0.9 * radius, 0.6 * w
    return revolved([(inner, -w), (flank, -w), (radius, -edge), (radius, edge), (flank, w), (inner, w), (inner, -w)], 36)


def rim(radius: float) -> Mesh:
    """The rim of a wheel, with spokes that make its rotation visible."""
    inner, w = 0.62 * radius, 0.1 * radius
    ring = revolved([(0.9 * inner, -w), (inner, -w), (inner, w), (0.9 * inner, w), (0.9 * inner, -w)], 36)
    bar = box(0.16 * radius, 1.9 * inner, w)
    turns = ((np.cos(k * pi / 3), np.sin(k * pi / 3)) for k in range(3))
    rotated = [bar.moved(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3)) for c, s in turns]
    return joined([ring, cylinder(0.2 * radius, 2.4 * w), *rotated])


def relief(x: Array, y: Array, z: Array) -> Mesh:
    """A surface through heights z (n, m) over x (n,) and y (m,), seen from above."""
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), z], axis=-1).reshape(-1, 3)
    return Mesh(points=points, faces=_grid_faces(len(x), len(y), closes=False)[:, ::-1])


def strip(x: Array, z: Array, left: float, right: float) -> Mesh:
    """A surface over x with heights z (n,), from y = right to left, seen from above; an edge at each point."""
    n = len(x)
    corners = [np.stack([a, np.full(n - 1, y), h], axis=1) for a, h in ((x[:-1], z[:-1]), (x[1:], z[1:])) for y in (right, left)]
    first = 4 * np.arange(n - 1)[:, np.newaxis]
    faces = np.concatenate([first + np.array([0, 2, 3]), first + np.array([0, 3, 1])])
    return Mesh(points=np.stack(corners, axis=1).reshape(-1, 3), faces=faces)
