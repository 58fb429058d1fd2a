"""The .glb files of tests, read without what writes them."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Gltf:
    """A .glb file: its JSON document, and the numbers of its accessors."""

    def __init__(self, content: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size = struct.unpack_from("<I", content, 12)[0]
        self.document: dict[str, Any] = json.loads(content[20 : 20 + size])
        self._buffer = content[28 + size :]

    @classmethod
    def read(cls, file: Path) -> Gltf:
        return cls(file.read_bytes())

    def numbers(self, accessor: int) -> Array:
        """The rows of an accessor."""
        described = self.document["accessors"][accessor]
        view = self.document["bufferViews"][described["bufferView"]]
        kind, width = {5126: "<f4", 5125: "<u4"}[described["componentType"]], {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[described["type"]]
        data = np.frombuffer(self._buffer, kind, described["count"] * width, view["byteOffset"])
        return data.reshape(-1, width).astype(float)

    def track(self, name: str, path: str) -> tuple[Array, Array]:
        """Times and values of a node's motion."""
        (animation,) = self.document["animations"]
        for channel in animation["channels"]:
            if (self.document["nodes"][channel["target"]["node"]]["name"], channel["target"]["path"]) == (name, path):
                sampler = animation["samplers"][channel["sampler"]]
                return self.numbers(sampler["input"])[:, 0], self.numbers(sampler["output"])
        raise KeyError(f"{name} has no {path}")


def read_csv(file: Path) -> dict[str, Array]:
    """The columns of a table."""
    header = file.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
    rows = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    return {name: rows[:, i] for i, name in enumerate(header)}
