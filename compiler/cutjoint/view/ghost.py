"""Pages that were written before, read again as a run to lie under another one.  Like a model file a page is data: nothing of it runs."""

import base64
import json
import re
from binascii import Error as EncodingError
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.view.glb import TRIANGLES, Glb, GltfNode, Primitive, read_glb
from cutjoint.view.motions import rotated
from cutjoint.view.records import Array, Drawing, Mesh, Node, Part

#: The largest size of a page, bytes: more than any that is written.
_LARGEST = 60_000_000


@dataclass(frozen=True, kw_only=True)
class GhostRun:
    """A run of a page: its ``name`` for people, what was drawn of it, and columns over the drawing's times with units, by name."""

    name: str
    drawing: Drawing
    columns: Mapping[str, Array]
    units: Mapping[str, str]


def read_page(path: Path, option: str) -> GhostRun:
    """The run of a page. Raises RunError: the file is no such page, or a page without a run."""
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
        if len(content) > _LARGEST:
            raise ValueError
        return _read(path.name, content.decode("utf-8"))
    except (ValueError, LookupError, TypeError, AttributeError, EncodingError, RecursionError):
        raise RunError(f"{option} {path}: not a page of a run; write one with simulate --view") from None


def _read(file: str, text: str) -> GhostRun:
    about = json.loads(_element(text, "about"))
    glb, table = (base64.b64decode(_element(text, name), validate=True) for name in ("glb", "table"))
    names = [str(column["name"]) for column in about["columns"]]
    rows = np.frombuffer(table, "<f4").reshape(len(names) + 1, -1).astype(np.float64)
    if about["motions"] or rows.shape[1] < 2 or not np.isfinite(rows[0]).all() or not (np.diff(rows[0]) > 0).all():
        raise ValueError
    what = ", ".join(str(about[key]) for key in ("title", "scene", "note") if about[key])
    return GhostRun(
        name=f"{file}: {what}", drawing=_drawing(read_glb(glb), rows[0]), columns=dict(zip(names, rows[1:], strict=True)),
        units={name: str(column["unit"]) for name, column in zip(names, about["columns"], strict=True)},
    )  # fmt: skip


def _element(text: str, name: str) -> str:
    found = re.search(f'<script type="application/[a-z-]+" id="{name}"(?: data-crc="([0-9]+)")?>([^<]*)</script>', text)
    if found is None or (found[1] and int(found[1]) != crc32(found[2].encode())):
        raise ValueError(name)
    return found[2]


def _drawing(glb: Glb, t: Array) -> Drawing:
    """The drawing that the writer of .glb files was given, all of it grey: nodes below one whose turn takes up to y."""
    root, *others = glb.document.nodes
    if [scene.nodes for scene in glb.document.scenes] != [[0]] or root.children != [*range(1, len(others) + 1)]:
        raise ValueError
    quaternion = np.array([root.rotation])
    if abs(np.linalg.norm(quaternion) - 1) > 1e-3:
        raise ValueError
    up = rotated(quaternion * [-1, -1, -1, 1], np.array([[0.0, 1.0, 0.0]]))[0]
    tracks, meshes = _tracks(glb, t), _meshes(glb)
    return Drawing(name=root.name, t=t, nodes=tuple(_node(node, meshes, tracks.get(i, {})) for i, node in enumerate(others, 1)), up=up)


def _tracks(glb: Glb, t: Array) -> Mapping[int, Mapping[str, Array]]:
    """The motions of nodes over all times, by number and path."""
    tracks: dict[int, dict[str, Array]] = {}
    for animation in glb.document.animations:
        for channel in animation.channels:
            sampler, path = animation.samplers[channel.sampler], channel.target.path
            values = glb.numbers(sampler.output, "VEC4" if path == "rotation" else "VEC3")
            if channel.target.node is None or not np.array_equal(glb.numbers(sampler.input, "SCALAR")[:, 0], t) or len(values) != t.size:
                raise ValueError
            tracks.setdefault(channel.target.node, {})[path] = values
    return tracks


def _meshes(glb: Glb) -> Sequence[tuple[Part, ...]]:
    """The parts of each mesh; arrays that several parts have are one mesh."""
    known: dict[tuple[int | None, ...], Part] = {}
    for mesh in glb.document.meshes:
        for primitive in mesh.primitives:
            known.setdefault(_arrays(primitive), _part(glb, primitive))
    return [tuple(known[_arrays(primitive)] for primitive in mesh.primitives) for mesh in glb.document.meshes]


def _arrays(primitive: Primitive) -> tuple[int | None, ...]:
    return primitive.attributes["POSITION"], primitive.attributes["NORMAL"], primitive.indices


def _part(glb: Glb, primitive: Primitive) -> Part:
    points, faces = glb.part(primitive)
    normals = glb.numbers(primitive.attributes["NORMAL"], "VEC3")
    if normals.shape != points.shape or primitive.mode != TRIANGLES:
        raise ValueError
    return Part(mesh=Mesh(points=points, normals=normals, faces=faces), colour=(0.5, 0.5, 0.5))


def _node(node: GltfNode, meshes: Sequence[tuple[Part, ...]], track: Mapping[str, Array]) -> Node:
    about = node.extras or {}
    if node.children or node.matrix or not all(isinstance(value, str) or np.isfinite(value) for value in about.values()):
        raise ValueError
    still = {"translation": node.translation, "rotation": node.rotation, "scale": node.scale}
    moving = {path: track.get(path, np.array([value])) for path, value in still.items()}
    return Node(name=node.name, parts=() if node.mesh is None else meshes[node.mesh], about=about, **moving)
