"""Binary glTF that anyone may have written, read strictly: Khronos Group, glTF 2.0 specification, 2021.

Written here: trimesh draws sparse and normalised numbers, fans, and what an extension must unpack, wrongly and silently.
"""

import base64
import re
import struct
from binascii import Error as EncodingError
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from cutjoint.view.records import Array, Faces

#: Limits: rows of all accessors together, and entries of a list; more than any mesh that can be drawn has.
_ROWS, _ENTRIES = 10_000_000, 100_000
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
#: Modes of primitives: triangle lists, strips, fans; lower numbers are points and lines.
_TRIANGLES, _FAN = 4, 6
#: Beginnings of extensions that change no triangle, or only the types of numbers that are read anyhow.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization")

Index: TypeAlias = Annotated[int, Field(ge=0, le=2**32)]
Size: TypeAlias = Annotated[int, Field(ge=1, le=2**32)]
Triple: TypeAlias = Annotated[list[float], Field(min_length=3, max_length=3)]
Quadruple: TypeAlias = Annotated[list[float], Field(min_length=4, max_length=4)]
_Any = TypeVar("_Any")
Some: TypeAlias = Annotated[list[_Any], Field(max_length=_ENTRIES)]


class GlbError(ValueError):
    """A file is no sound glTF; the text says what is wrong with it."""


class _Described(BaseModel):
    """An object of a document; keys that are not listed have no influence on triangles and motions."""

    model_config = ConfigDict(strict=True, frozen=True, alias_generator=to_camel, allow_inf_nan=False)


class Asset(_Described):
    version: str


class Buffer(_Described):
    byte_length: Size
    uri: str | None = None


class View(_Described):
    buffer: Index
    byte_offset: Index = 0
    byte_length: Size
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class SparseIndices(_Described):
    buffer_view: Index
    byte_offset: Index = 0
    component_type: Literal[5121, 5123, 5125]


class SparseValues(_Described):
    buffer_view: Index
    byte_offset: Index = 0


class Sparse(_Described):
    count: Size
    indices: SparseIndices
    values: SparseValues


class Accessor(_Described):
    buffer_view: Index | None = None
    byte_offset: Index = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Size
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None
    min: Any = []
    max: Any = []


class Primitive(_Described):
    attributes: dict[str, Index]
    indices: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = _TRIANGLES


class GltfMesh(_Described):
    primitives: Some[Primitive]


class GltfNode(_Described):
    name: str = ""
    children: list[Index] = []
    mesh: Index | None = None
    matrix: Annotated[list[float], Field(min_length=16, max_length=16)] | None = None
    translation: Triple = [0.0, 0.0, 0.0]
    rotation: Quadruple = [0.0, 0.0, 0.0, 1.0]
    scale: Triple = [1.0, 1.0, 1.0]
    extras: Any = None


class GltfScene(_Described):
    nodes: list[Index] = []


class Document(_Described):
    """The part of a document that determines triangles, and motions as they are."""

    asset: Asset
    scene: Index = 0
    scenes: Some[GltfScene] = []
    nodes: Some[GltfNode] = []
    meshes: Some[GltfMesh] = []
    accessors: Some[Accessor] = []
    buffer_views: Some[View] = []
    buffers: Some[Buffer] = []
    animations: Any = []
    extensions_required: list[str] = []


def read_glb(content: bytes) -> "Glb":
    """The document of a file and its bytes. Raises GlbError: the file is none, or needs what is not known here."""
    text, binary = _chunks(content)
    try:
        document = Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise GlbError(f"{'.'.join(map(str, first['loc'])) or 'its document'}: {first['msg']}") from None
    if document.asset.version.split(".")[0] != "2":
        raise GlbError("it is not of version 2")
    if sum(accessor.count for accessor in document.accessors) > _ROWS:
        raise GlbError(f"its accessors count more than {_ROWS} rows")
    for name in document.extensions_required:
        if not name.startswith(_HARMLESS):
            raise GlbError(f"it requires the extension '{name}', which is not known")
    return Glb(document=document, binary=binary)


def _chunks(content: bytes) -> tuple[bytes, bytes]:
    """The JSON text of a file and its binary buffer, empty if there is none."""
    if len(content) < 20 or content[:8] != struct.pack("<4sI", b"glTF", 2):
        raise GlbError("it does not begin as binary glTF 2.0 does")
    if struct.unpack_from("<I", content, 8) != (len(content),):
        raise GlbError(f"it has {len(content)} bytes, and says another number")
    chunks: list[tuple[bytes, bytes]] = []
    at = 12
    while at < len(content):
        size, kind = struct.unpack_from("<I4s", content, at) if at + 8 <= len(content) else (len(content), b"")
        if at + 8 + size > len(content):
            raise GlbError("a chunk goes beyond its end")
        chunks.append((kind, content[at + 8 : at + 8 + size]))
        at += 8 + size
    if chunks[0][0] != b"JSON":
        raise GlbError("its first chunk is no JSON")
    return chunks[0][1], chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else b""


@dataclass(frozen=True, kw_only=True)
class Glb:
    """A file that was read: its ``document``, and the ``binary`` part that its first buffer is."""

    document: Document
    binary: bytes
    _known: dict[int, Array] = field(default_factory=dict)

    def nodes(self) -> Iterator[tuple[GltfNode, Array]]:
        """The nodes of the scene with their matrices (4, 4), parents first.
        Raises GlbError: a node stands at several places, or below itself."""
        document = self.document
        waiting = [(index, np.eye(4)) for index in _at(document.scenes, document.scene, "scene").nodes]
        met: set[int] = set()
        while waiting:
            index, above = waiting.pop()
            node = _at(document.nodes, index, "node")
            if index in met:
                raise GlbError(f"node {index} stands at several places, or below itself")
            met.add(index)
            matrix = above @ _matrix(node)
            yield node, matrix
            waiting += [(child, matrix) for child in node.children]

    def triangles(self) -> Iterator[Array]:
        """Corners (n, 3, 3) of the scene's triangles in global axes, one primitive at a time; points and lines are left out."""
        for node, matrix in self.nodes():
            if node.mesh is None:
                continue
            for primitive in _at(self.document.meshes, node.mesh, "mesh").primitives:
                if primitive.mode >= _TRIANGLES and "POSITION" in primitive.attributes:
                    points, index = self.numbers(primitive.attributes["POSITION"], "VEC3"), primitive.indices
                    if index is not None and _at(self.document.accessors, index, "accessor").component_type not in (5121, 5123, 5125):
                        raise GlbError(f"accessor {index} has no whole numbers, and indices are wanted")
                    corners = np.arange(len(points)) if index is None else self.numbers(index, "SCALAR")[:, 0].astype(np.int64)
                    if corners.max() >= len(points):
                        raise GlbError(f"a triangle has corner {corners.max()} of {len(points)}")
                    yield points[_faces(corners, primitive.mode)] @ matrix[:3, :3].T + matrix[:3, 3]

    def numbers(self, index: int, type_: str) -> Array:
        """The rows (n, width) of an accessor, which is of a type such as VEC3."""
        accessor = _at(self.document.accessors, index, "accessor")
        if accessor.type != type_:
            raise GlbError(f"accessor {index} is {accessor.type}, and {type_} is wanted")
        if index not in self._known:
            self._known[index] = self._values(accessor, _TYPES[accessor.component_type], _WIDTHS[type_])
            if not np.isfinite(self._known[index]).all():
                raise GlbError(f"accessor {index} has a number that is not finite")
        return self._known[index]

    def _values(self, accessor: Accessor, kind: str, width: int) -> Array:
        if accessor.buffer_view is None:
            rows: NDArray[Any] = np.zeros((accessor.count, width), kind)
        else:
            rows = self._rows(accessor.buffer_view, accessor.byte_offset, kind, accessor.count, width)
        if accessor.sparse is not None:
            rows = self._substituted(rows, accessor.sparse)
        values = rows.astype(np.float64)
        return np.maximum(values / np.iinfo(kind).max, -1.0) if accessor.normalized and kind != "<f4" else values

    def _substituted(self, rows: NDArray[Any], sparse: Sparse) -> NDArray[Any]:
        where = self._rows(sparse.indices.buffer_view, sparse.indices.byte_offset, _TYPES[sparse.indices.component_type], sparse.count, 1)
        places = where[:, 0].astype(np.int64)
        if places.max() >= len(rows):
            raise GlbError(f"a sparse accessor replaces row {places.max()} of {len(rows)}")
        values = self._rows(sparse.values.buffer_view, sparse.values.byte_offset, rows.dtype.str, sparse.count, rows.shape[1])
        rows = rows.copy()
        rows[places] = values
        return rows

    def _rows(self, view: int, offset: int, kind: str, count: int, width: int) -> NDArray[Any]:
        """Numbers (count, width) of a view from an offset on."""
        described = _at(self.document.buffer_views, view, "buffer view")
        row = width * np.dtype(kind).itemsize
        stride = described.byte_stride or row
        if stride < row or offset + (count - 1) * stride + row > described.byte_length:
            raise GlbError(f"an accessor goes beyond buffer view {view}")
        content = self._buffer(described.buffer)
        if described.byte_offset + described.byte_length > len(content):
            raise GlbError(f"buffer view {view} goes beyond its buffer")
        return np.ndarray((count, width), kind, content, described.byte_offset + offset, (stride, np.dtype(kind).itemsize))

    def _buffer(self, index: int) -> bytes:
        buffer = _at(self.document.buffers, index, "buffer")
        if buffer.uri is None:
            content = self.binary if index == 0 else b""
        elif found := re.fullmatch(r"data:[\w/.+-]*;base64,([A-Za-z0-9+/]*={0,2})", buffer.uri):
            try:
                content = base64.b64decode(found[1], validate=True)
            except EncodingError:
                raise GlbError(f"buffer {index} is cut off") from None
        else:
            raise GlbError(f"buffer {index} is in another file")
        return content[: buffer.byte_length]


def _at(listed: Sequence[_Any], index: int, what: str) -> _Any:
    if index >= len(listed):
        raise GlbError(f"it has no {what} {index}")
    return listed[index]


def _matrix(node: GltfNode) -> Array:
    """The matrix from a node's points to those of its parent, (4, 4)."""
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    q = np.array(node.rotation)
    size = np.linalg.norm(q)
    if size == 0:
        raise GlbError("a node's rotation is of length zero")
    x, y, z, w = q / size
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) + 2 * w * skew + 2 * skew @ skew) * node.scale
    matrix[:3, 3] = node.translation
    return matrix


def _faces(corners: NDArray[np.int64], mode: int) -> Faces:
    """The triangles (m, 3) of a list of corners (section 3.7.2.1)."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise GlbError(f"{len(corners)} corners make no whole triangles")
        return corners.reshape(-1, 3)
    first = np.arange(len(corners) - 2)
    if mode == _FAN:
        return np.stack([corners[first + 1], corners[first + 2], np.full(len(first), corners[0])], axis=1)
    odd = first % 2
    return np.stack([corners[first], corners[first + 1 + odd], corners[first + 2 - odd]], axis=1)
