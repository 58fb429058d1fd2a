"""A lever with a mesh: its model, and the same tetrahedron as STL, OBJ and glTF."""

from __future__ import annotations

import json
import struct

import numpy as np

from tests.view.files import Array

#: A tetrahedron in millimetres, its corners in no mirror image of themselves.
CORNERS = np.array([[0, 0, 0], [100, 0, 0], [0, 200, 0], [0, 0, 300]])
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]

MODEL = """
cutjoint: 1
name: lever
gravity: [0, 0, -9.81]
submodels:
  lever:
    connectors: [base]
    bodies:
      arm: {mass: 1, centre_of_mass: [0, 1, 0], inertia: [1, 1, 1], visual: {mesh: MESH, scale: 0.001, at: [0, 1, 0], colour: "#20c040"}}
    joints: {hinge: {kind: revolute, bodies: [base, arm], at: [0, 1, 0], axis: [0, 0, 1]}}
instances:
  left: &left {use: lever, connect: {base: ground}}
  right: {<<: *left, mirror: y}
scenes: {rest: {end: 1, output_step: 0.1}}
"""


def stl(corners: Array = CORNERS) -> bytes:
    loops = ["".join("vertex {} {} {}\n".format(*corners[i]) for i in face) for face in FACES]
    facets = [f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in loops]
    return "".join(["solid x\n", *facets, "endsolid x\n"]).encode()


def obj() -> bytes:
    corners, faces = ["v {} {} {}".format(*corner) for corner in CORNERS], ["f {} {} {}".format(*(i + 1 for i in f)) for f in FACES]
    return "\n".join(["mtllib /etc/passwd", *corners, *faces]).encode()


def glb(**other: object) -> bytes:
    points, faces = CORNERS.astype("<f4").tobytes(), np.array(FACES, "<u4").tobytes()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [100, 200, 300]},
            {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}],
        "buffers": [{"byteLength": 96}], **other,
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", 96, b"BIN\0") + points + faces
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
