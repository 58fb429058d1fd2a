"""Damage to files of meshes and to glTF documents: what disks, exporters and enemies make of them."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Callable, Iterator
from typing import Any

#: Texts that would run, or be fetched, where they are taken for more than data.
HOSTILE = (
    "</script><script>window.owned = 1</script>", "javascript:window.owned=1", "https://example.org/x.bin", "file:///etc/passwd",
    "/etc/passwd", "//example.org/x", "data:application/octet-stream;base64,AAA", "data:application/octet-stream;base64," + "A" * 128,
    "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' onload='window.owned=1'/>", "data:,", "\x1b[31m", "__proto__",
)  # fmt: skip
_NAN, _INFINITE = float("nan"), float("inf")
_VALUES: tuple[Any, ...] = (
    -1, 0, 1, 2, 3, 7, 255, 5120, 5121, 5123, 5125, 5126, 2**31, 2**32 - 1, 2**53, 10**30, 0.5, 4.0, -0.0, 1e308, 1e-320, _NAN, _INFINITE,
    None, True, "", "1", "VEC2", "MAT4", "SCALAR", [], {}, [0], [0, 1, 2], [1, 1], [0.0] * 16, [1e38] * 16, [_NAN] * 16, ["a"] * 4,
    [0, 0, 0, 5], {"count": 1, "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}}, *HOSTILE,
)  # fmt: skip
#: Parts that a document may have besides.
_ADDED: tuple[tuple[str, Any], ...] = (
    ("images", [{"uri": HOSTILE[2]}]), ("images", [{"uri": HOSTILE[8]}]), ("textures", [{"source": 0}]), ("skins", [{"joints": [0, 0, 9]}]),
    ("extensionsRequired", ["KHR_draco_mesh_compression"]), ("extensionsRequired", ["__proto__"]), ("cameras", [{"type": "perspective"}]),
    ("extensionsUsed", ["KHR_lights_punctual"]), ("extensions", {"KHR_lights_punctual": {"lights": 3}}), ("scene", 7), ("scenes", []),
    ("asset", {"version": "1.0"}), ("asset", {}), ("animations", [{"channels": [], "samplers": []}]),
)  # fmt: skip
_KEYS = (
    "sparse", "uri", "matrix", "children", "skin", "camera", "normalized", "byteStride", "byteOffset", "targets", "extensions", "mode",
    "weights",
)  # fmt: skip


def packed(document: str, binary: bytes) -> bytes:
    """A .glb file."""
    text = document.encode("utf-8", "surrogateescape")
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def damaged_glb(rng: random.Random, glb: bytes, *, grows: bool) -> bytes:
    """A .glb file with changes of its document, its numbers, or its bytes; one that ``grows`` may ask for thousands of meshes."""
    size = struct.unpack_from("<I", glb, 12)[0]
    document, binary = json.loads(glb[20 : 20 + size]), bytearray(glb[28 + size :])
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        rng.choice((_set, _set, _set, _drop, _add, _tangle, _nest, *([_double, _repeat] if grows else [])))(rng, document)
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        at = 4 * rng.randrange(len(binary) // 4)
        binary[at : at + 4] = struct.pack("<f", rng.choice((float("nan"), float("inf"), 1e38, -1.0, 0.0, 1e-40)))
    content = packed(json.dumps(document), bytes(binary))
    return damaged_bytes(rng, content) if rng.random() < 0.2 else content


def damaged_bytes(rng: random.Random, content: bytes) -> bytes:
    """A file with bits flipped, with a part cut out, doubled or filled, or with less or more at its end."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        i = rng.randrange(min(len(content), rng.choice((24, 200, 10**9)))) if content else 0
        j = i + rng.choice((0, 1, 4, 50))
        part = content[i:j]
        content = content[:i] + rng.choice((_flipped(part), b"", part * 2, b"\0" * len(part), b"\xff" * len(part))) + content[j:]
    return rng.choice((content, content, content[: rng.randrange(len(content) + 1)], content + b"\0\0\0\0"))


def _flipped(part: bytes) -> bytes:
    return bytes([part[0] ^ 0x10]) + part[1:] if part else part


_WORDS = (
    "v nan 0 0", "v 1e308 1e308 -1e308", "v 1e39 0 0", "v", "v 1 2 x", "f 1 2 99999999999", "f -1 -2 -3", "f 0 0 0", "f 1/x/3 2//1 3",
    "f 1 2", "f " + "1 2 3 " * 400, "mtllib /etc/passwd", "usemtl x", "call /etc/passwd", "o </script>", "g \x1b[31m", "vt nan", "l 1 2",
    "p 1", "vertex nan nan nan", "vertex 1 2", "vertex 1e400 0 0", "endsolid", "solid </script>", "facet normal x y z", "outer loop", "\\",
    "o x\nf 1 2 3\n" * 300,
)  # fmt: skip


def damaged_lines(rng: random.Random, content: bytes) -> bytes:
    """A file of lines with some of them changed, moved, doubled or left out."""
    lines = content.split(b"\n")
    for _ in range(rng.choice((1, 1, 2, 5))):
        i = rng.randrange(len(lines) + 1)
        lines[i : i + rng.randrange(3)] = rng.choice(([], lines[i : i + 1] * 3, [rng.choice(_WORDS).encode()]))
    content = b"\n".join(lines)
    return damaged_bytes(rng, content) if rng.random() < 0.2 else content


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    items = list(node.items()) if isinstance(node, dict) else list(enumerate(node)) if isinstance(node, list) else []
    for key, value in items:
        yield node, key
        yield from _places(value)


def _objects(document: dict[str, Any]) -> list[dict[str, Any]]:
    found = [container[key] for container, key in _places(document) if isinstance(container[key], dict)]
    return [document, *found]


_Change = Callable[[random.Random, dict[str, Any]], None]


def _set(rng: random.Random, document: dict[str, Any]) -> None:
    if places := list(_places(document)):
        container, key = rng.choice(places)
        container[key] = rng.choice(_VALUES)


def _drop(rng: random.Random, document: dict[str, Any]) -> None:
    if places := list(_places(document)):
        container, key = rng.choice(places)
        del container[key]


def _add(rng: random.Random, document: dict[str, Any]) -> None:
    if rng.random() < 0.4:
        key, value = rng.choice(_ADDED)
        document[key] = value
    else:
        rng.choice(_objects(document))[rng.choice(_KEYS)] = rng.choice(_VALUES)


def _tangle(rng: random.Random, document: dict[str, Any]) -> None:
    """Nodes that hang on each other at random: cycles, or the same node in several places."""
    nodes = document.get("nodes")
    if isinstance(nodes, list) and nodes and isinstance(node := rng.choice(nodes), dict):
        node["children"] = [rng.randrange(len(nodes)) for _ in range(rng.choice((1, 2, 3)))]


def _nest(rng: random.Random, document: dict[str, Any], times: int = 1) -> None:
    """A chain of nodes under the first one, each below the one before."""
    nodes, count = document.get("nodes"), rng.choice((30, 3000))
    if isinstance(nodes, list) and nodes and isinstance(nodes[0], dict):
        first = len(nodes)
        nodes[0]["children"] = [first]
        nodes += [{"children": [first + i + 1] * times} for i in range(count)]
        nodes.append({"mesh": 0})


def _double(rng: random.Random, document: dict[str, Any]) -> None:
    """A chain of nodes, each twice below the one before."""
    _nest(rng, document, 2)


def _repeat(rng: random.Random, document: dict[str, Any]) -> None:
    """Many nodes with the same mesh."""
    nodes = document.get("nodes")
    if isinstance(nodes, list):
        first, count = len(nodes), rng.choice((100, 60_000))
        nodes += [{"mesh": 0} for _ in range(count)]
        document["scenes"] = [{"nodes": list(range(first, first + count))}]
