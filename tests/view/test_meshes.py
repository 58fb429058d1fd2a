"""Meshes of bodies from files: each stands where the model says, and what is wrong or hostile is refused at its line."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import ConvexHull

from cutjoint.cli import main
from cutjoint.model.errors import ModelError
from cutjoint.topology.reading import read_model_text
from cutjoint.view import meshes
from tests.conftest import MODELS, needs_cpp
from tests.view.conftest import call
from tests.view.files import Gltf
from tests.view.lever import CORNERS, MODEL, glb, obj, stl


def write(folder: Path, name: str) -> Path:
    model = folder / "lever.yaml"
    model.write_text(MODEL.replace("MESH", name), encoding="utf-8")
    return model


@pytest.mark.parametrize(("name", "content"), [("a.stl", stl()), ("parts/b.obj", obj()), ("c.GLB", glb())], ids=["stl", "obj", "glb"])
def test_a_mesh_stands_where_the_model_says(name: str, content: bytes, tmp_path: Path) -> None:
    model = write(tmp_path, name)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(content)
    call("view", model, "--out", tmp_path / "pose.glb")
    gltf = Gltf.read(tmp_path / "pose.glb")
    expected = CORNERS / 1000
    for body, image in (("left.arm", 1), ("right.arm", -1)):
        node = next(n for n in gltf.document["nodes"] if n["name"] == body)
        (part,) = gltf.document["meshes"][node["mesh"]]["primitives"]
        points, normals = (gltf.numbers(part["attributes"][key]) for key in ("POSITION", "NORMAL"))
        assert {tuple(p) for p in np.round(points, 5) + 0.0} == {tuple(p) for p in np.round(expected * [1, image, 1], 5) + 0.0}
        faces = points[gltf.numbers(part["indices"]).astype(int).reshape(-1, 3)]
        outward = faces.mean(axis=1) - points.mean(axis=0)
        assert np.all(np.sum(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]) * outward, axis=1) > 0)
        assert np.all(np.sum(normals.reshape(-1, 3, 3)[:, 0] * outward, axis=1) > 0)
        colour = gltf.document["materials"][part["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
        assert np.argmax(colour[:3]) == 1


def outside(folder: Path) -> None:
    (folder.parent / "outside.stl").write_bytes(stl())
    (folder / "a.stl").symlink_to(folder.parent / "outside.stl")


def loop(folder: Path) -> None:
    (folder / "a.stl").symlink_to(folder / "a.stl")


def many(folder: Path) -> None:
    """A file of a megabyte that asks for 400 000 triangles."""
    (folder / "a.glb").write_bytes(glb(nodes=[{"mesh": 0}] * 100_000, scenes=[{"nodes": list(range(100_000))}]))


PLACE = "lever.yaml:9:"


@pytest.mark.parametrize(("name", "prepare", "message"), [
    ("a.stl", lambda folder: None, "mesh 'a.stl' is not there; put it into"),
    ("a.stl", lambda folder: (folder / "a.stl").write_bytes(b"solid"), "has no triangles"),
    ("a.stl", lambda folder: (folder / "a.stl").write_bytes(stl(CORNERS * np.nan)), "has no triangles, or some that are not finite"),
    ("a.stl", lambda folder: (folder / "a.stl").write_bytes(stl(CORNERS * 1e12)), "has no triangles, or some that are not finite"),
    ("a.glb", lambda folder: (folder / "a.glb").write_bytes(b"glTF" * 9), "is no sound glTF: it does not begin as binary"),
    ("a.glb", lambda folder: (folder / "a.glb").write_bytes(glb(buffers=[{"byteLength": 96, "uri": "/etc/passwd"}])), "mesh 'a.glb' "),
    ("a.stl", lambda folder: (folder / "a.stl").write_bytes(stl(CORNERS * [1, 0, 0])), "mesh 'a.stl' has no triangle with an area"),
    ("a.obj", lambda folder: (folder / "a.obj").write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9"), "is no mesh that can be read"),
    ("a.obj", lambda folder: (folder / "a.obj").write_bytes(b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3"), "is no mesh that can be read"),
    ("a.glb", lambda folder: (folder / "a.glb").write_bytes(glb(nodes=[{"children": [0]}])), "glTF: node 0 stands at several places"),
    ("a.glb", lambda folder: (folder / "a.glb").write_bytes(glb(extensionsRequired=["\x1b[31m"])), "the extension '\\x1b[31m'"),
    ("a.glb", many, "has more than 200000 triangles; make it coarser"),
    ("a.stl", lambda folder: (folder / "a.stl").mkdir(), "is no file of 50 MB at most"),
    ("a.stl", outside, "is a link that leaves the model file's folder"),
    ("a.stl", loop, "mesh 'a.stl' is not there"),
])  # fmt: skip
def test_refusals(name: str, prepare: Callable[[Path], object], message: str, tmp_path: Path) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    model = write(folder, name)
    prepare(folder)
    result = CliRunner().invoke(main, ["view", str(model), "--out", str(tmp_path / "x.html")])
    assert result.exit_code == 1
    assert message in result.output
    assert PLACE in result.output
    assert "body 'left.arm'" in result.output
    assert "root:" not in result.output
    assert not (tmp_path / "x.html").exists()


@needs_cpp
def test_a_run_says_so_before_it_begins(tmp_path: Path) -> None:
    model = write(tmp_path, "a.stl")
    result = CliRunner().invoke(main, ["simulate", str(model), "--out", str(tmp_path / "x.csv"), "--view", str(tmp_path / "x.html")])
    assert result.exit_code == 1
    assert "body 'left.arm': mesh 'a.stl' is not there" in result.output
    assert "body 'right.arm': mesh 'a.stl' is not there" in result.output
    assert sorted(file.name for file in tmp_path.iterdir()) == ["lever.yaml"]


@pytest.mark.parametrize(("visual", "message"), [
    ("{mesh: ../a.stl}", "mesh '../a.stl' is not below the model file's folder; put it there, and name it from there"),
    ("{mesh: /etc/a.stl}", "is not below the model file's folder"),
    ("{mesh: 'C:a.stl'}", "is not below the model file's folder"),
    ("{mesh: 'a\\b.stl'}", "is not below the model file's folder"),
    ("{mesh: \"a\\nb.stl\"}", "is not below the model file's folder"),
    ("{mesh: a.gltf}", "mesh 'a.gltf' is of no kind that is known; name a file that ends in .glb, .stl, .obj"),
    ("{mesh: a.stl, scale: 0}", "scale is not between 1e-9 and 1e9"),
    ("{mesh: a.stl, scale: -1}", "scale is not between 1e-9 and 1e9"),
    ("{colour: red}", "'red' is no colour; write red, green and blue as \"#d9480f\", in quotes"),
    ("{scale: 2}", "needs a mesh, or a colour alone"),
    ("{mesh: a.stl, at: Q}", "'Q'"),
    ("{mesh: 3}", "mesh"),
    ("a.stl", "visual"),
])  # fmt: skip
def test_what_the_file_must_not_say(visual: str, message: str) -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    text = text.replace("slider: {mass: 3, centre_of_mass: B}", f"slider: {{mass: 3, centre_of_mass: B, visual: {visual}}}")
    with pytest.raises(ModelError) as found:
        read_model_text(text, "press.yaml")
    assert message in str(found.value)
    assert "body 'slider'" in str(found.value)
    assert "press.yaml:9:" in str(found.value)


def test_a_colour_alone_keeps_the_shape(tmp_path: Path) -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    text = text.replace("centre_of_mass: B}", 'centre_of_mass: B, visual: {colour: "#ff0000"}}')
    (tmp_path / "press.yaml").write_text(text, encoding="utf-8")
    call("view", tmp_path / "press.yaml", "--out", tmp_path / "red.glb")
    call("view", MODELS / "press.yaml", "--out", tmp_path / "plain.glb")
    drawn = Gltf.read(tmp_path / "red.glb").document
    node = next(n for n in drawn["nodes"] if n["name"] == "slider")
    material = drawn["meshes"][node["mesh"]]["primitives"][0]["material"]
    assert drawn["materials"][material]["pbrMetallicRoughness"]["baseColorFactor"] == [1, 0, 0, 1]
    plain = Gltf.read(tmp_path / "plain.glb").document
    assert [a["count"] for a in drawn["accessors"]] == [a["count"] for a in plain["accessors"]]


@pytest.mark.parametrize("number", [4, 8, 40, 200])
def test_a_hull_is_that_of_another_code(number: int) -> None:
    points = np.random.default_rng(number).normal(size=(number, 3))
    mesh = meshes.joined(meshes.hull(points, 1e-3))
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    known = ConvexHull(points)
    share = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 / known.volume  # sides look outwards
    assert share == pytest.approx(1.0, rel=1e-12) if number <= 40 else 0.95 < share <= 1.0
    if number <= 40:
        assert len(mesh.faces) == len(known.simplices)


def test_a_box_has_six_sides_and_a_flat_body_no_hull() -> None:
    corners = np.array(list(product((0.0, 2.0), (0.0, 1.0), (-1.0, 1.0))))
    sides = meshes.hull(corners, 1e-3)
    assert len(sides) == 6
    assert {len(side.points) for side in sides} == {4}
    assert meshes.hull(corners * [1, 1, 1e-5], 1e-3) == []


def test_normals_are_numbers_where_triangles_have_no_area() -> None:
    """Three corners of a face may lie on an edge: a pickup midway between a left and a right one; and rounding flattens slivers."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (0, 1, 0), (-1, 1, 0), (0, 0, 1.0)])
    for mesh in (*meshes.hull(corners, 1e-3), meshes.Mesh(points=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]))):
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
