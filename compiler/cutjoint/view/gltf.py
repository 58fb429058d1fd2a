"""Drawings as glTF 2.0 in one binary file (Khronos Group, glTF 2.0 specification, 2021).

Written here: of the libraries for it, trimesh writes no animations, and pygltflib leaves the buffer and its accessors to the caller.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.package.locations import __version__
from cutjoint.view.motions import shortest
from cutjoint.view.records import Array, Colour, Drawing, Mesh, Node

_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_SIZES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
#: A node is constant if all rows differ from the first by less than this, relative to its size.
_STILL = 1e-7


def write_gltf(drawing: Drawing, motions: Mapping[str, Drawing] | None = None) -> bytes:
    """The content of a .glb file; the model's up is glTF's y.

    Its animation is "run", how the drawing moves, or those of ``motions`` by name: drawings of the same nodes.
    """
    writer = _Writer(drawing, {"run": drawing} if motions is None else motions)
    return packed(writer.document(), bytes(writer.buffer))


def packed(document: dict[str, Any], buffer: bytes) -> bytes:
    """The header and the chunks, each of a length that four divides."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if buffer:
        chunks += struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


class _Writer:
    """Collects a document's arrays in its buffer."""

    def __init__(self, drawing: Drawing, motions: Mapping[str, Drawing]) -> None:
        self._drawing, self._motions = drawing, motions
        self.buffer = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: dict[tuple[Colour, float], int] = {}
        self._meshes: list[dict[str, Any]] = []
        self._known: dict[int, dict[str, Any]] = {}

    def document(self) -> dict[str, Any]:
        """The document, without lists that would be empty; the buffer is whole afterwards."""
        drawing = self._drawing
        nodes = [self._node(node) for node in drawing.nodes]
        root = {"name": drawing.name, "rotation": _numbers(shortest(drawing.up, np.array([0.0, 1.0, 0.0])))}
        animations = [self._animation(name, motion) for name, motion in self._motions.items()]
        document = {
            "asset": {"version": "2.0", "generator": f"cutjoint {__version__}"},
            "scene": 0, "scenes": [{"name": drawing.name, "nodes": [0]}],
            "nodes": [{**root, **({"children": list(range(1, len(nodes) + 1))} if nodes else {})}, *nodes],
            "meshes": self._meshes, "materials": [_material(colour, roughness) for colour, roughness in self._materials],
            "animations": [animation for animation in animations if animation], "accessors": self._accessors, "bufferViews": self._views,
            "buffers": [{"byteLength": len(self.buffer)}] if self.buffer else [],
        }  # fmt: skip
        return {key: value for key, value in document.items() if value != []}

    def _node(self, node: Node) -> dict[str, Any]:
        if node.parts:
            materials = [self._materials.setdefault((p.colour, p.roughness), len(self._materials)) for p in node.parts]
            parts = [{**self._arrays(p.mesh), "material": m} for p, m in zip(node.parts, materials, strict=True)]
            self._meshes.append({"name": node.name, "primitives": parts})
        return {
            "name": node.name, **({"mesh": len(self._meshes) - 1} if node.parts else {}),
            "translation": _numbers(node.translation[0]), "rotation": _numbers(node.rotation[0]), "scale": _numbers(node.scale[0]),
            **({"extras": dict(node.about)} if node.about else {}),
        }  # fmt: skip

    def _arrays(self, mesh: Mesh) -> dict[str, Any]:
        """The arrays of a mesh; primitives share them."""
        if id(mesh) not in self._known:
            attributes = {"POSITION": self._add(mesh.points, _VERTICES), "NORMAL": self._add(mesh.normals, _VERTICES)}
            self._known[id(mesh)] = {"attributes": attributes, "indices": self._add(mesh.faces.reshape(-1, 1), _INDICES)}
        return self._known[id(mesh)]

    def _animation(self, name: str, motion: Drawing) -> dict[str, Any]:
        """The motions of all nodes, as far as they leave the place where they are drawn first."""
        moving = [
            (i, path, track)
            for i, (drawn, node) in enumerate(zip(self._drawing.nodes, motion.nodes, strict=True), 1)
            for path, still, track in (
                ("translation", drawn.translation, node.translation), ("rotation", drawn.rotation, node.rotation),
                ("scale", drawn.scale, node.scale),
            )
            if len(track) > 1 and np.abs(track - still[0]).max() > _STILL * np.abs(track).max()
        ]  # fmt: skip
        if motion.t.size < 2 or not moving:
            return {}
        times = self._add(motion.t[:, np.newaxis])
        samplers = [{"input": times, "output": self._add(track), "interpolation": "LINEAR"} for _, _, track in moving]
        channels = [{"sampler": s, "target": {"node": node, "path": path}} for s, (node, path, _) in enumerate(moving)]
        return {"name": name, "samplers": samplers, "channels": channels}

    def _add(self, values: Array | NDArray[np.int64], target: int | None = None) -> int:
        """An accessor of values (n, width); glTF wants the bounds of what they are as numbers of 32 bits."""
        kind = _UNSIGNED if values.dtype.kind == "i" else _FLOAT
        data = np.ascontiguousarray(values, dtype="<u4" if kind == _UNSIGNED else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": data.nbytes}
        self._views.append(view if target is None else {**view, "target": target})
        self.buffer += data.tobytes()
        bounds = {"min": data.min(axis=0).tolist(), "max": data.max(axis=0).tolist()}
        accessor = {"bufferView": len(self._views) - 1, "componentType": kind, "count": len(data), "type": _SIZES[data.shape[1]], **bounds}
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _numbers(row: Array) -> list[float]:
    return [float(x) + 0.0 for x in row]


def _material(colour: Colour, roughness: float) -> dict[str, Any]:
    """A material; glTF counts light itself, screens something near its square root (IEC 61966-2-1)."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    surface = {"baseColorFactor": [*(round(c, 6) for c in linear), 1], "metallicFactor": 0, "roughnessFactor": roughness}
    return {"pbrMetallicRoughness": surface}
