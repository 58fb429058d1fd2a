"""`cutjoint view` and `cutjoint simulate --view`: their files, and their refusals."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.analysis.body_poses import find_poses
from cutjoint.cli import main
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.model.records import ShapeKind
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model, read_model_text
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.files import Array, Gltf, read_csv

PRESS = MODELS / "press.yaml"

#: A crane whose guided slide follows an input, with shapes in an instance and its mirror image; z is not up.
CRANE = """
cutjoint: 1
name: crane
gravity: [0, -9.81, 0]
parameters: {reach: {value: 0.5, unit: m, binding: input}, arm: {value: 0.4, unit: m, binding: param}}
bodies: {trolley: {shapes: [{box: [0.4, 0.2, 0.3], at: [0, 2, 0], mass: 10}]}}
joints: {rail: {kind: prismatic, bodies: [ground, trolley], at: [0, 2, 0], axis: [1, 0, 0], guide: reach + 0.1*t}}
submodels:
  weight:
    connectors: [carrier]
    bodies:
      bob:
        shapes:
          - {rod: {from: [0, 2, 0.2], to: [0, 1, 0.2]}, mass: 1}
          - {cylinder: {radius: 0.1, length: 0.3}, at: [0, 1, 0.2], axis: [0, 1, 0], mass: 2}
          - {sphere: 0.05, at: [0, 1, 0.2], mass: 0.5, hole: true}
    joints: {pivot: {kind: spherical, bodies: [carrier, bob], at: [0, 2, 0.2]}}
instances:
  front: &front {use: weight, connect: {carrier: trolley}}
  back: {<<: *front, mirror: z}
outputs: [trolley.x, front.bob.x, front.bob.y, front.bob.z, back.bob.x, back.bob.z]
scenes:
  carry: {end: 0.5, output_step: 0.05, numerics: {dt: 0.01}, inputs: {reach: "0.5 + 0.2*sin(5*t)"}, rates: {front.pivot.wx: 1}}
"""


@pytest.fixture
def crane(tmp_path: Path) -> Path:
    file = tmp_path / "crane.yaml"
    file.write_text(CRANE, encoding="utf-8")
    return file


#: A body that a spring pushes away, ten times as far in each 10 us.
AWAY = """
cutjoint: 1
name: away
gravity: [0, 0, 0]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, ball], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {push: {kind: point_spring, bodies: [ground, ball], from: [-1, 0, 0], to: [0, 0, 0], law: 1e9*(0.5-length)}}
outputs: [ball.x]
scenes: {run: {end: 0.0035, output_step: 0.0001}}
"""


@needs_cpp
def test_a_run_is_drawn_as_far_as_a_picture_goes(browser: Page, tmp_path: Path) -> None:
    (tmp_path / "away.yaml").write_text(AWAY, encoding="utf-8")
    files = ("--out", tmp_path / "run.csv", "--view", tmp_path / "run.html")
    call("simulate", tmp_path / "away.yaml", "--scene", "run", "--no-error", *files)
    table = read_csv(tmp_path / "run.csv")
    assert table["ball.x"][-1] > 1e40
    browser.open(tmp_path / "run.html")
    subtitle = browser.run("document.getElementById('subtitle').textContent")
    reported = re.search("drawn up to ([0-9.]+) s, where a body is 1e[+]18 m away", subtitle)
    assert reported
    assert float(reported[1]) == table["t"][np.argmax(table["ball.x"] > 1e18)]
    assert browser.complaints == []


@needs_cpp
def test_what_starts_too_far_away_is_refused(tmp_path: Path) -> None:
    (tmp_path / "away.yaml").write_text(AWAY.replace("axis: [1, 0, 0]}", "axis: [1, 0, 0], guide: 1e20*(1+t)}"), encoding="utf-8")
    message = call("view", tmp_path / "away.yaml", "--out", tmp_path / "pose.html", status=1)
    assert "pose.html: a body starts further than 1e+18 m away, and no picture shows that; mind units" in message


@needs_cpp
@pytest.mark.parametrize("changes", [(), ("--set", "reach=0.7")], ids=["the scene's", "held"])
def test_poses_follow_guides_and_inputs(crane: Path, changes: tuple[str, ...]) -> None:
    table, glb = crane.with_suffix(".csv"), crane.with_suffix(".glb")
    call("simulate", crane, "--out", table, "--no-error", "--view", glb, *changes)
    columns, gltf = read_csv(table), Gltf.read(glb)
    for body, axes in {"trolley": "x", "front.bob": "xyz", "back.bob": "xz"}.items():
        t, places = gltf.track(body, "translation")
        assert t == pytest.approx(columns["t"], abs=1e-6)
        for axis in axes:
            assert np.abs(places[:, "xyz".index(axis)] - columns[f"{body}.{axis}"]).max() < 1e-6
    assert gltf.document["nodes"][0]["rotation"] == [0, 0, 0, 1], "y is up in the model and in the file"


#: A bob on a rod without mass, which natural coordinates span by two points.
HUNG = """
cutjoint: 1
name: hung
gravity: [0, 0, -9.81]
bodies:
  rod: {massless: true}
  bob: {mass: 2, centre_of_mass: [1, 0, -0.2], inertia: [0.02, 0.03, 0.04]}
joints:
  hook: {kind: universal, bodies: [ground, rod], at: [0, 0, 0], axis: [0, 1, 0], axis_2: [0, 0, 1]}
  eye: {kind: spherical, bodies: [rod, bob], at: [1, 0, 0]}
outputs: [bob.x, bob.y, bob.z, bob.yaw]
scenes: {swing: {end: 1.0, output_step: 0.02, numerics: {dt: 0.002}, rates: {hook.angle_2_rate: 1, eye.wx: 2}}}
"""


def track(gltf: Gltf, body: str, path: str, t: Array) -> Array:
    """Places of a node over time, also of one that does not move."""
    try:
        return gltf.track(body, path)[1]
    except KeyError:
        node = next(n for n in gltf.document["nodes"] if n["name"] == body)
        return np.tile(node[path], (t.size, 1))


@needs_cpp
@pytest.mark.parametrize("text", [CRANE, HUNG, PRESS.read_text(encoding="utf-8")], ids=["crane", "hung", "press"])
@pytest.mark.parametrize("how", [("augmented",), ("classical",), ("augmented", "--implementation", "generic")], ids=" ".join)
def test_natural_coordinates_show_the_same(text: str, how: tuple[str, ...], tmp_path: Path) -> None:
    """Two methods, and two ways from coordinates to poses; a rod that two points span may turn about itself as it likes."""
    model, shown = tmp_path / "model.yaml", {}
    model.write_text(text, encoding="utf-8")
    for method in (("recursive",), how):
        out = tmp_path / f"{method[0]}.glb"
        call("simulate", model, "--method", *method, "--out", tmp_path / f"{method[0]}.csv", "--no-error", "--view", out)
        shown[method[0]] = Gltf.read(out)
    t = read_csv(tmp_path / f"{how[0]}.csv")["t"]
    for body in read_model(model).bodies:
        for path, close in (("translation", 2e-4), ("rotation", 1e-3)):  # the methods' own errors at the scene's steps
            one, other = (track(shown[method], body.name, path, t) for method in ("recursive", how[0]))
            if path == "translation":
                assert np.abs(one - other).max() < close
            elif not body.is_massless:
                assert np.abs(np.sum(one * other, axis=1)).min() > 1 - close**2
    table = read_csv(tmp_path / f"{how[0]}.csv")
    for body in {name.rpartition(".")[0] for name in table if name.endswith(".z")}:
        drawn = track(shown[how[0]], body, "translation", t)
        assert np.abs(drawn[:, 2] - table[f"{body}.z"]).max() < 1e-6


@needs_cpp
def test_what_method_auto_has_run_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reduced model that it picks: of the press it may be a planar one."""
    monkeypatch.setenv("CUTJOINT_IMPLEMENTATION", "generated")
    text = PRESS.read_text(encoding="utf-8").replace("outputs: [", "outputs: [crank.x, crank.z, ")
    model, table, glb = tmp_path / "press.yaml", tmp_path / "run.csv", tmp_path / "run.glb"
    model.write_text(text, encoding="utf-8")
    call("simulate", model, "--method", "auto", "--accuracy", "1e-3", "--out", table, "--no-error", "--view", glb)
    columns, (t, places) = read_csv(table), Gltf.read(glb).track("crank", "translation")
    assert t == pytest.approx(columns["t"], abs=1e-6)
    for axis, name in ((0, "crank.x"), (2, "crank.z")):
        assert np.abs(places[:, axis] - columns[name]).max() < 1e-6


@needs_cpp
def test_a_run_in_python_becomes_a_page(tmp_path: Path) -> None:
    artifact = cutjoint.compile_model(PRESS)
    run = cutjoint.simulate(artifact, parameters={"stiffness": 1000.0}, error=False, coordinates=True)
    glb, page = cutjoint.write_view(tmp_path / "run.glb", artifact, run, parameters={"stiffness": 1000.0}), tmp_path / "run.html"
    _, places = Gltf.read(glb).track("slider", "translation")
    assert np.abs(np.ptp(places[:, 0]) - np.ptp(run["slider.x"])) < 1e-5
    assert cutjoint.write_view(str(page), artifact, run) == page
    assert "press, turn" in page.read_text(encoding="utf-8")
    without = cutjoint.simulate(artifact, error=False)
    with pytest.raises(cutjoint.RunError, match=re.escape("write simulate(model, coordinates=True)")):
        cutjoint.write_view(page, artifact, without)


def test_bodies_keep_their_shapes() -> None:
    model = read_model_text(CRANE, "crane.yaml")
    trolley, front, back = model.bodies
    assert [shape.kind for shape in trolley.shapes] == [ShapeKind.BOX]
    assert [(s.kind, s.hole) for s in front.shapes] == [(ShapeKind.ROD, False), (ShapeKind.CYLINDER, False), (ShapeKind.SPHERE, True)]
    assert [p for s in back.shapes for p in s.points] == [(x, y, -z) for s in front.shapes for x, y, z in s.points]


def test_poses_at_the_design_position_are_the_file() -> None:
    model = read_model(PRESS)
    equations = derive_poses(build_topology(model), model.scenes["turn"])
    poses = find_poses(equations, np.zeros(2), np.zeros((2, 3)), {"stiffness": 2000.0})
    for pose in poses.values():
        assert pose.place(np.array([0.3, 0.0, 0.1])) == pytest.approx(np.tile([0.3, 0.0, 0.1], (2, 1)))
        assert pose.rotation.shape == (2, 3, 3)


@needs_cpp
def test_view_draws_the_start_of_a_scene(crane: Path) -> None:
    page, glb = crane.with_suffix(".html"), crane.with_suffix(".glb")
    call("view", crane, "--out", page, "--set", "reach=0.7")
    about = json.loads(re.search('id="about"[^>]*>(.*?)</script>', page.read_text(encoding="utf-8"))[1])  # type: ignore[index]
    assert (about["title"], about["scene"], about["rows"]) == ("crane", "carry", 1)
    assert about["bodies"] == ["trolley", "front.bob", "back.bob"]
    call("view", crane, "--out", glb, "--set", "reach=0.7")
    document = Gltf.read(glb).document
    places = {node["name"]: node["translation"] for node in document["nodes"] if "translation" in node}
    assert places["trolley"] == pytest.approx([0.7, 2, 0])
    assert "animations" not in document


@needs_cpp
def test_a_pose_as_designed_is_where_a_run_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes no simulator."""
    call("simulate", PRESS, "--out", tmp_path / "run.csv", "--no-error", "--end", "0.02", "--view", tmp_path / "run.glb")
    monkeypatch.setenv("CXX", "false")
    call("view", PRESS, "--out", tmp_path / "pose.glb")
    run, pose = (Gltf.read(tmp_path / f"{name}.glb") for name in ("run", "pose"))
    drawn = {node["name"]: node for node in pose.document["nodes"] if "name" in node}
    for body, path in (("crank", "rotation"), ("rod", "translation"), ("rod", "rotation"), ("slider", "translation")):
        still = [0, 0, 0, 1] if path == "rotation" else [0, 0, 0]
        assert drawn[body].get(path, still) == pytest.approx(run.track(body, path)[1][0], abs=1e-6)


@pytest.mark.parametrize(("arguments", "message"), [
    (("view", PRESS, "--out", "pose.png"), "pose.png: no such kind of file; write a name that ends in .html or .glb"),
    (("simulate", PRESS, "--out", "x.csv", "--view", "run.txt"),
     "run.txt: no such kind of file; write a name that ends in .html or .glb"),
    (("simulate", PRESS, "--out", "x.html"), "x.html: no such kind of file; write a name that ends in .csv, .parquet, .arrow or .npy"),
])  # fmt: skip
def test_refusals(arguments: tuple[object, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())
    assert list(tmp_path.iterdir()) == []


def test_simulate_alone_imports_nothing_of_it() -> None:
    script = "import sys, cutjoint.commands.simulate; print([name for name in sys.modules if name.startswith('cutjoint.view')])"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "[]\n"
