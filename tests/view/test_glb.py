"""Binary glTF of others: its triangles are those of trimesh and of the standard's words, and what is not sound is named."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh

from cutjoint.view.ghost import _copied
from cutjoint.view.glb import GlbError, read_glb
from tests.view.files import Array
from tests.view.lever import CORNERS, FACES, glb


def triangles(content: bytes) -> Array:
    return np.concatenate([np.zeros((0, 3, 3)), *read_glb(content).triangles()])


def sorted_rows(corners: Array) -> Array:
    rows = np.round(corners.reshape(-1, 9), 4) + 0.0
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("seed", range(8))
def test_scenes_are_those_of_trimesh(seed: int) -> None:
    """Nodes below nodes, turned, shifted, scaled, with a mesh or without."""
    rng = np.random.default_rng(seed)
    scene, frames = trimesh.Scene(), ["world"]
    for i in range(rng.integers(1, 9)):
        matrix = trimesh.transformations.random_rotation_matrix(rng.random(3)) @ np.diag([*rng.uniform(0.5, 2, 3), 1.0])
        matrix[:3, 3] = rng.uniform(-1, 1, 3)
        solid = rng.choice([trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(1), trimesh.creation.cylinder(1, 2)])
        scene.add_geometry(solid, node_name=f"n{i}", geom_name=f"g{i}", parent_node_name=str(rng.choice(frames)), transform=matrix)
        frames.append(f"n{i}")
    content = scene.export(file_type="glb")
    expected = trimesh.load_mesh(io.BytesIO(content), file_type="glb", process=False).triangles
    assert len(expected) > 10
    np.testing.assert_allclose(sorted_rows(triangles(content)), sorted_rows(np.asarray(expected)), atol=1e-3)


INDICES = {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}


def described(points: dict[str, Any]) -> bytes:
    """The tetrahedron with something else said of its points."""
    return glb(accessors=[{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", **points}, INDICES])


def sparse(indices: dict[str, Any], **values: Any) -> dict[str, Any]:
    """One row that is replaced."""
    return {"sparse": {"count": 1, "indices": {"componentType": 5125, **indices}, "values": {"bufferView": 0, **values}}}


def test_sparse_rows_replace_others() -> None:
    corners = CORNERS.copy()
    corners[FACES[0][1]] = CORNERS[2]
    np.testing.assert_allclose(triangles(described(sparse({"bufferView": 1, "byteOffset": 4}, byteOffset=24))), corners[np.array(FACES)])


def test_rows_without_a_view_are_zero() -> None:
    assert not triangles(glb(accessors=[{"componentType": 5126, "count": 4, "type": "VEC3"}, INDICES])).any()


def test_extents_do_not_matter() -> None:
    for extents in ({"max": None}, {"min": [], "max": "none"}):
        np.testing.assert_allclose(triangles(described(extents)), CORNERS[np.array(FACES)])


@pytest.mark.parametrize("extent", [{}, "", None, ["0"], [True]])
def test_extents_of_a_ghost_are_lists_of_numbers(extent: Any) -> None:
    """What the script of a page would read."""
    assert _copied(described({"min": [0, 0.0, 0]}))
    with pytest.raises((TypeError, ValueError)):
        _copied(described({"min": extent}))


@pytest.mark.parametrize(("kind", "type_", "largest"), [(5120, "<i1", 127), (5121, "<u1", 255), (5122, "<i2", 32767), (5123, "<u2", 65535)])
def test_normalised_numbers_are_shares_of_the_largest(kind: int, type_: str, largest: int) -> None:
    raw = np.frombuffer(glb()[-96:], type_)[:12].reshape(4, 3).astype(float)
    np.testing.assert_allclose(
        triangles(described({"componentType": kind, "normalized": True})), np.maximum(raw / largest, -1)[np.array(FACES)]
    )
    np.testing.assert_allclose(triangles(described({"componentType": kind})), raw[np.array(FACES)])


@pytest.mark.parametrize(("mode", "faces"), [
    (0, []), (1, []), (2, []), (3, []), (4, FACES), (5, [(0, 2, 1), (2, 0, 1), (1, 0, 1), (0, 3, 1)]),
    (6, [(2, 1, 0), (1, 0, 0), (0, 1, 0), (1, 3, 0)]),
])  # fmt: skip
def test_modes(mode: int, faces: list[tuple[int, int, int]]) -> None:
    """Lists, and of strips and fans the first triangles of section 3.7.2.1: (i, i + (1 + i % 2), i + (2 - i % 2)) and (i + 1, i + 2, 0)."""
    found = triangles(glb(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}]))
    np.testing.assert_allclose(found[: len(faces)], CORNERS[np.array(faces, int).reshape(-1, 3)])
    assert len(found) == {4: 4, 5: 10, 6: 10}.get(mode, 0)


def test_a_matrix_or_turn_shift_and_scale() -> None:
    matrix = [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 7, 8, 9, 1]  # columns: a quarter about z, doubled, and a shift
    half = np.sqrt(0.5)
    expected = 2 * CORNERS @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [7, 8, 9]
    for node in ({"matrix": matrix}, {"translation": [7, 8, 9], "rotation": [0, 0, half, half], "scale": [2, 2, 2]}):
        np.testing.assert_allclose(triangles(glb(nodes=[{"mesh": 0, **node}])), expected[np.array(FACES)], atol=1e-9)


def test_interleaved_rows_and_a_buffer_in_the_document() -> None:
    views = [{"buffer": 0, "byteLength": 96, "byteStride": 24}, {"buffer": 1, "byteLength": 12}]
    accessors = [{"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3", "byteOffset": 12}]
    accessors.append({"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"})
    buffers = [{"byteLength": 96}, {"byteLength": 12, "uri": "data:application/octet-stream;base64,AAABAAAAAQABAAAA"}]
    found = triangles(glb(bufferViews=views, accessors=accessors, buffers=buffers))
    np.testing.assert_allclose(found, CORNERS[[1, 3]][[[0, 1, 0], [1, 1, 0]]])


def in_chunks(document: object, binary: bytes = b"") -> bytes:
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + (struct.pack("<I4s", len(binary), b"BIN\0") + binary if binary else b"")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


NAN = float("nan")
VIEWS = [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}]


@pytest.mark.parametrize(("content", "message"), [
    (b"", "does not begin as binary glTF 2.0 does"),
    (glb()[:-1], "it has 647 bytes, and says another number"),
    (glb()[:16] + b"BIN\0" + glb()[20:], "its first chunk is no JSON"),
    (glb()[:12] + b"\xff\xff\xff\x7f" + glb()[16:], "a chunk goes beyond its end"),
    (in_chunks(b"{"), "its document: Invalid JSON"),
    (in_chunks(b"[" * 100_000), "its document: Invalid JSON"),
    (in_chunks([]), "its document: Input should be an object"),
    (in_chunks({}), "asset: Field required"),
    (glb(asset={"version": "1.0"}), "it is not of version 2"),
    (glb(scenes=[]), "it has no scene 0"),
    (glb(scene=-1), "scene: Input should be greater than or equal to 0"),
    (glb(scenes=[{"nodes": [7]}]), "it has no node 7"),
    (glb(nodes=[{"mesh": 0, "children": [0]}]), "node 0 stands at several places, or below itself"),
    (glb(nodes=[{"children": [1]}, {"children": [2]}, {"children": [1]}]), "node 1 stands at several places, or below itself"),
    (glb(nodes=[{"children": [1, 1]}, {"mesh": 0}]), "node 1 stands at several places, or below itself"),
    (glb(nodes=[{"mesh": 0, "matrix": [NAN] * 16}]), "nodes.0.matrix.0: Input should be a finite number"),
    (glb(nodes=[{"mesh": 0, "matrix": [1.0] * 15}]), "nodes.0.matrix: List should have at least 16 items"),
    (glb(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "a node's rotation is of length zero"),
    (glb(nodes=[{"mesh": "0"}]), "nodes.0.mesh: Input should be a valid integer"),
    (glb(nodes=[{"mesh": True}]), "nodes.0.mesh: Input should be a valid integer"),
    (glb(nodes=[{"mesh": 3}]), "it has no mesh 3"),
    (glb(nodes=[{"mesh": 0}] + [{}] * 100_000), "nodes: List should have at most 100000 items"),
    (glb(meshes=[{"primitives": [{"attributes": {"POSITION": 2}}]}]), "it has no accessor 2"),
    (glb(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}]), "accessor 0 has no whole numbers"),
    (glb(meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}]), "4 corners make no whole triangles"),
    (described({"type": "VEC2"}), "accessor 0 is VEC2, and VEC3 is wanted"),
    (described({"count": 5}), "an accessor goes beyond buffer view 0"),
    (described({"count": 2**31}), "its accessors count more than 10000000 rows"),
    (described({"count": 10**30}), "accessors.0.count"),
    (described({"count": -1}), "accessors.0.count: Input should be greater than or equal to 1"),
    (described({"byteOffset": -12}), "accessors.0.byteOffset: Input should be greater than or equal to 0"),
    (described({"byteOffset": 4}), "an accessor goes beyond buffer view 0"),
    (described({"componentType": 5124}), "accessors.0.componentType: Input should be"),
    (described({"bufferView": 9}), "it has no buffer view 9"),
    (described({"count": 3}), "a triangle has corner 3 of 3"),
    (described(sparse({"bufferView": 1, "byteOffset": 48})), "an accessor goes beyond buffer view 1"),
    (described(sparse({"bufferView": 0, "byteOffset": 12})), "a sparse accessor replaces row 1120403456 of 4"),
    (glb(bufferViews=[VIEWS[0], {**VIEWS[1], "byteOffset": 52}]), "buffer view 1 goes beyond its buffer"),
    (glb(bufferViews=[{**VIEWS[0], "byteStride": 8}, VIEWS[1]]), "an accessor goes beyond buffer view 0"),
    (glb(bufferViews=[{**VIEWS[0], "buffer": 1}, VIEWS[1]]), "it has no buffer 1"),
    (glb(buffers=[{"byteLength": 96, "uri": "/etc/passwd"}]), "buffer 0 is in another file"),
    (glb(buffers=[{"byteLength": 96, "uri": "https://example.org/x.bin"}]), "buffer 0 is in another file"),
    (glb(buffers=[{"byteLength": 96, "uri": "data:;base64," + "A" * 127}]), "buffer 0 is cut off"),
    (glb(buffers=[{"byteLength": 96, "uri": "data:;base64," + "A" * 64}]), "buffer view 1 goes beyond its buffer"),
    (glb(extensionsRequired=["KHR_draco_mesh_compression"]), "it requires the extension 'KHR_draco_mesh_compression', which is not known"),
    (glb()[:-96] + struct.pack("<f", NAN) + glb()[-92:], "accessor 0 has a number that is not finite"),
])  # fmt: skip
def test_what_is_not_sound_is_named(content: bytes, message: str) -> None:
    with pytest.raises(GlbError) as found:
        triangles(content)
    assert message in str(found.value)


def test_a_deep_tree_is_read() -> None:
    nodes = [{"children": [i + 1]} for i in range(20_000)]
    assert len(triangles(glb(nodes=[*nodes, {"mesh": 0}]))) == 4


def test_parts_that_stand_often_are_made_one_by_one() -> None:
    """A file of some kB may ask for any number of triangles: who takes them can stop."""
    content = glb(nodes=[{"mesh": 0}] * 90_000, scenes=[{"nodes": list(range(90_000))}])
    assert len(next(read_glb(content).triangles())) == 4
