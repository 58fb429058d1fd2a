"""The glTF files: what moves is where the table says, and the validator of the standard has nothing to say."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from cutjoint.topology.reading import read_model_text
from cutjoint.view import meshes
from cutjoint.view.drawing import draw
from cutjoint.view.gltf import write_gltf
from cutjoint.view.motions import along, product, quaternions_of, rotated, rotation_to, shortest
from cutjoint.view.records import Drawing, Mesh, Node, Part
from cutjoint.view.views import _placed, show_start
from tests.conftest import MODELS, needs_cpp
from tests.view.conftest import Shown, call
from tests.view.files import Gltf, read_csv

#: Numbers of 32 bits have steps of 4e-6 m at the 50 m that the vehicle drives.
CLOSE = 1e-5
VALIDATOR = "gltf-validator@2.0.0-dev.3.10"

VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2]))).then((report) => console.log(JSON.stringify(report.issues)));
"""


@pytest.fixture(scope="module")
def validator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("validator")
    if which("npm") is None or which("node") is None:
        pytest.skip("needs npm and node")
    installed = subprocess.run(
        ["npm", "install", "--silent", "--ignore-scripts", VALIDATOR], cwd=folder, capture_output=True, text=True, timeout=120
    )
    if installed.returncode:
        pytest.skip("npm cannot install gltf-validator here")
    (folder / "validate.js").write_text(VALIDATE, encoding="utf-8")
    return folder / "validate.js"


@needs_cpp
@pytest.mark.parametrize(("run", "bodies"), [
    ("press", ("crank", "rod", "slider")), ("iltis", ("chassis", "front_left.carrier", "rear_right.tie_rod")),
])  # fmt: skip
def test_keyframes_are_where_the_table_says(run: str, bodies: tuple[str, ...], request: pytest.FixtureRequest) -> None:
    shown: Shown = request.getfixturevalue(run)
    gltf, table = Gltf.read(shown.glb), read_csv(shown.table)
    for body in bodies:
        t, places = gltf.track(body, "translation")
        rows = np.searchsorted(table["t"], t - 1e-4)
        assert np.abs(table["t"][rows] - t).max() < 1e-6 * max(1.0, t[-1])
        expected = np.stack([table[f"{body}.{axis}"][rows] for axis in "xyz"], axis=1)
        assert np.abs(places - expected).max() < CLOSE


@needs_cpp
@pytest.mark.heavy
def test_the_attitude_in_space_is_the_tables(iltis: Shown) -> None:
    """Of a chassis that pitches, rolls and yaws."""
    gltf, table = Gltf.read(iltis.glb), read_csv(iltis.table)
    t, (x, y, z, w) = (part.T if part.ndim == 2 else part for part in gltf.track("chassis", "rotation"))
    rows = np.searchsorted(table["t"], t - 1e-4)
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    assert np.ptp(pitch) > 0.1
    assert np.abs(np.abs(pitch) - np.abs(table["chassis.pitch"][rows])).max() < 1e-6


@needs_cpp
def test_the_attitude_is_the_tables(press: Shown) -> None:
    """The crank turns about y."""
    gltf, table = Gltf.read(press.glb), read_csv(press.table)
    t, (x, y, z, w) = (part.T if part.ndim == 2 else part for part in gltf.track("crank", "rotation"))
    angle = table["pin.angle"][np.searchsorted(table["t"], t - 1e-4)]
    assert np.ptp(angle) > 0.5
    assert np.abs([x, z]).max() < 1e-6
    assert np.abs((w + 1j * y) ** 2 - np.exp(1j * angle)).max() < 1e-6


@needs_cpp
@pytest.mark.parametrize("run", ["press", "iltis"])
def test_the_validator_has_nothing_to_say(run: str, validator: Path, request: pytest.FixtureRequest) -> None:
    command = ["node", validator, request.getfixturevalue(run).glb]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=validator.parent)
    issues = json.loads(found.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


@needs_cpp
@pytest.mark.parametrize("command", ["modes", "check"])
def test_the_validator_takes_motions(command: str, validator: Path, tmp_path: Path) -> None:
    call(command, MODELS / "press.yaml", "--view", tmp_path / "motions.glb")
    found = subprocess.run(["node", validator, tmp_path / "motions.glb"], capture_output=True, text=True, check=True, cwd=validator.parent)
    issues = json.loads(found.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


@needs_cpp
def test_the_page_of_ten_seconds_is_below_five_megabytes(iltis: Shown) -> None:
    assert iltis.page.stat().st_size < 5e6


@needs_cpp
def test_a_spring_reaches_from_end_to_end(press: Shown) -> None:
    gltf, table = Gltf.read(press.glb), read_csv(press.table)
    _, lengths = gltf.track("spring", "scale")
    assert np.abs(lengths[:, 2] - (0.8 - table["slider.x"])).max() < CLOSE
    assert np.all(lengths[:, :2] == 1)


def test_a_mechanism_without_bodies_is_empty() -> None:
    content = write_gltf(Drawing(name="none", t=np.zeros(1), nodes=(), up=np.array([0.0, 0.0, 1.0])))
    assert sorted(Gltf(content).document) == ["asset", "nodes", "scene", "scenes"]


def every_mesh() -> dict[str, Mesh]:
    x, z = np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 0.0, 1.0, 1.0])
    return {
        "box": meshes.box(1, 2, 3), "cylinder": meshes.cylinder(1, 2), "disc": meshes.disc(1, 2), "sphere": meshes.sphere(1.0),
        "coil": meshes.coil(0.1),
        "tyre": meshes.tyre(1.0), "rim": meshes.rim(1.0), "strip": meshes.strip(x, z, 1.0, 0.0),
        "between": meshes.between(np.zeros(3), np.ones(3), 0.1),
    }  # fmt: skip


@pytest.mark.parametrize(("name", "mesh"), every_mesh().items(), ids=every_mesh())
def test_faces_look_outwards(name: str, mesh: Mesh) -> None:
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    real = np.linalg.norm(across, axis=1) > 1e-9  # at poles a triangle has no area
    assert np.all(np.sum(across * mesh.normals[mesh.faces].mean(axis=1), axis=1)[real] > 0)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)


def test_turns() -> None:
    rng = np.random.default_rng(1)
    rotations = np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(50)])
    rotations *= np.linalg.det(rotations)[:, np.newaxis, np.newaxis]
    points = rng.standard_normal((50, 3))
    assert rotated(quaternions_of(rotations), points) == pytest.approx(np.einsum("nij,nj->ni", rotations, points))
    ways = np.concatenate([points, -points[-1:], [[0.0, 0.0, -1.0]]])
    z = np.tile([0.0, 0.0, 1.0], (len(ways), 1))
    assert rotated(along(ways), z) == pytest.approx(ways / np.linalg.norm(ways, axis=1, keepdims=True))
    assert rotated(shortest(z[0], np.array([0.0, 1.0, 0.0]))[np.newaxis], z[:1]) == pytest.approx(np.array([[0.0, 1.0, 0.0]]))


def test_a_product_is_one_turn_after_another() -> None:
    p, q = quaternions_of(np.array([rotation_to(np.array([1.0, 2.0, 3.0])), rotation_to(np.array([-1.0, 0.5, 0.2]))]))[:, np.newaxis]
    vector = np.array([[0.3, -0.4, 0.5]])
    assert rotated(product(p, q), vector) == pytest.approx(rotated(p, rotated(q, vector)))


def test_what_does_not_move_has_no_track() -> None:
    part = Part(mesh=meshes.box(1, 1, 1), colour=(1.0, 0.0, 0.0))
    moving = np.linspace(0, 1, 5)[:, np.newaxis] * [1.0, 0.0, 0.0]
    nodes = (Node(name="still", parts=(part,), translation=np.ones((5, 3))), Node(name="moving", parts=(part,), translation=moving))
    content = write_gltf(Drawing(name="two", t=np.linspace(0, 1, 5), nodes=nodes, up=np.array([0.0, 0.0, 1.0])))
    gltf = Gltf(content)
    assert [c["target"] for c in gltf.document["animations"][0]["channels"]] == [{"node": 2, "path": "translation"}]
    assert len(gltf.document["accessors"]) == 5, "the mesh stands there once"


def test_a_tube_that_two_joints_hold_at_its_centre_is_no_disc() -> None:
    """The barrel of a hydraulic cylinder, whose pin and slide are at one point, is a ball of three bars' radius, and no disc of seven."""
    body = "{mass: 1, centre_of_mass: [%d, 0, 0], inertia: [1, 1, 1]}"
    model = read_model_text(
        f"cutjoint: 1\nname: cylinder\ngravity: [0, 0, 0]\nbodies: {{tube: {body % 0}, rod: {body % 1}}}\njoints:\n"
        "  pin: {kind: revolute, bodies: [ground, tube], at: [0, 0, 0], axis: z}\n"
        "  slide: {kind: prismatic, bodies: [tube, rod], at: [0, 0, 0], axis: x}\nscenes: {still: {end: 1}}\n", "cylinder.yaml",
    )  # fmt: skip
    shown = show_start(model, model.scenes["still"], {})
    (tube,) = (node for node in draw(_placed(shown, shown.poses, shown.t), shown.t).nodes if node.name == "tube")
    turning = read_model_text(
        f"cutjoint: 1\nname: rotor\ngravity: [0, 0, 0]\nbodies: {{tube: {body % 0}, rod: {body % 1}}}\njoints:\n"
        "  pin: {kind: revolute, bodies: [ground, tube], at: [0, 0, 0], axis: z}\n"
        "  slide: {kind: prismatic, bodies: [ground, rod], at: [0, 0, 0], axis: x}\nscenes: {still: {end: 1}}\n", "rotor.yaml",
    )  # fmt: skip
    shown = show_start(turning, turning.scenes["still"], {})
    (disc,) = (node for node in draw(_placed(shown, shown.poses, shown.t), shown.t).nodes if node.name == "tube")
    assert np.abs(disc.parts[0].mesh.points).max() > 2 * np.abs(tube.parts[0].mesh.points).max()


@pytest.mark.parametrize("shape", ["", ", shapes: [{cylinder: {radius: 0.2, length: 0.1}, at: [0, 0, 0], axis: [0, 0, 1], mass: 2}]"])
def test_a_body_that_turns_about_its_axis_shows_it(shape: str) -> None:
    """No rotation by a part of a turn brings its points back to where points were."""
    mass = "" if shape else "mass: 2, centre_of_mass: [0, 0, 0], inertia: [0.1, 0.1, 0.2]"
    model = read_model_text(
        f"cutjoint: 1\nname: rotor\ngravity: [0, 0, 0]\nbodies: {{disc: {{{mass}{shape.removeprefix(', ')}}}}}\n"
        "joints: {spin: {kind: revolute, bodies: [ground, disc], at: [0, 0, 0], axis: z}}\nscenes: {still: {end: 1}}\n", "rotor.yaml",
    )  # fmt: skip
    shown = show_start(model, model.scenes["still"], {})
    (disc,) = (node for node in draw(_placed(shown, shown.poses, shown.t), shown.t).nodes if node.name == "disc")
    points = disc.parts[0].mesh.points
    size = np.abs(points).max()
    for angle in np.radians(np.arange(9, 360, 9)):
        moved = points @ np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        away = np.linalg.norm(moved[:, None] - points[None], axis=2).min(axis=1)
        assert away.max() > 0.05 * size
