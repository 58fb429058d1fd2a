"""Wheels on surfaces of roads: the same ground by expressions, the fields that C++ and Python read, friction by closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Patch
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.differentiate import partial_derivatives
from cutjoint.program.interpret import interpret_blocks
from cutjoint.run.results import Trajectory
from cutjoint.run.road_field import Field, Surface, surface_of
from cutjoint.run.roads import WheelRoad
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.mechanisms.random_models import NOWHERE
from tests.physics.simulation import compile_model, completed
from tests.view.conftest import call
from tests.view.files import Gltf

MASS, RADIUS = 400.0, 0.3

#: A bowl whose heights a surface of cubics has to rounding.
BOWL, SLOPE, BANK = "0.02*hub.x**2 - 0.01*hub.y**2 + 0.005*hub.x*hub.y", "0.04*hub.x + 0.005*hub.y", "0.005*hub.x - 0.02*hub.y"


def text(road: str, *, more: str = "", rates: str = "x: 3, y: 0.2", law: str = "[0, 0, 4e5*deflection + 2000*deflection_rate]") -> str:
    """A wheel that does not turn, on an upright hub that slides in all directions."""
    speeds = ", ".join(f"{rate.split(': ')[0]}.displacement_rate: {rate.split(': ')[1]}" for rate in rates.split(", "))
    return f"""
cutjoint: 1
name: rolling
gravity: [0, 0, -9.81]
bodies:
  hub: {{mass: {MASS}, centre_of_mass: [0, 0, {RADIUS}]}}
  sledge: {{massless: true}}
  bridge: {{massless: true}}
joints:
  x: {{kind: prismatic, bodies: [ground, sledge], at: [0, 0, 0], axis: [1, 0, 0]}}
  y: {{kind: prismatic, bodies: [sledge, bridge], at: [0, 0, 0], axis: [0, 1, 0]}}
  lift: {{kind: prismatic, bodies: [bridge, hub], at: [0, 0, 0], axis: [0, 0, 1]}}
forces:
  wheel:
    kind: wheel
    body: hub
    centre: [0, 0, {RADIUS}]
    axis: [0, 1, 0]
    radius: {RADIUS}
    force: {law}
    {more}
outputs: [hub.x, hub.y, hub.z, hub.vx, wheel.Fz, wheel.loaded_radius, wheel.road_friction]
scenes:
  roll: {{end: 1, output_step: 0.05, rates: {{{speeds}}}, road: {road}}}
"""


def table(heights: np.ndarray, x: np.ndarray, y: np.ndarray, more: str = "") -> str:
    return f"{{surface: {{table: {{x: {x.tolist()}, y: {y.tolist()}, value: {heights.tolist()}}}{more}}}}}"


def bowl() -> str:
    x, y = np.linspace(-2, 6, 17), np.linspace(-2, 2, 9)
    return table(0.02 * x[:, None] ** 2 - 0.01 * y**2 + 0.005 * x[:, None] * y, x, y)


def run(folder: Path, model: str, integrator: str = "dormand-prince", steps: Mapping[str, float] = {}, **options: object) -> Trajectory:
    path = folder / "model.yaml"
    path.write_text(model, encoding="utf-8")
    return completed(simulate(compile_model(path, **options), integrator=integrator, tolerance=1e-10, **steps))


@pytest.mark.parametrize(
    ("method", "integrator", "tolerance"),
    [
        ("recursive", "dormand-prince", 1e-8), ("recursive-newton", "radau5", 1e-7),
        ("augmented", "trapezoidal", 1e-5),
    ],
)
def test_a_surface_is_the_ground_by_expressions(tmp_path: Path, method: str, integrator: str, tolerance: float) -> None:
    ground = f"terrain_height: {BOWL}\n    terrain_slope: {SLOPE}\n    terrain_bank: {BANK}"
    asked = run(tmp_path, text("{}", more=ground))
    steps = {"dt": 2.5e-4} if integrator == "trapezoidal" else {}
    found = run(tmp_path, text(bowl()), integrator, steps, method=method)
    for column in ("hub.x", "hub.y", "hub.z"):
        assert np.abs(found[column] - asked[column]).max() < tolerance, column
    assert np.abs(asked["hub.y"]).max() > 0.1


def winding(more: str = "") -> str:
    """A road along a line of forty cross sections that comes back to itself, uneven across."""
    random, heading = np.random.default_rng(4), np.linspace(-0.4, 5.6, 40)
    line = np.cumsum(0.1 * np.exp(1j * heading))
    numbers = {"x": line.real, "y": line.imag, "z": random.normal(0, 0.01, 40), "banking": random.normal(0, 0.05, 40)}
    numbers |= {"across": np.array([-0.4, 0, 0.1, 0.3]), "value": random.normal(0, 0.02, (40, 4))}
    lists = ", ".join(f"{name}: {values.tolist()}" for name, values in numbers.items())
    return f"{{surface: {{sections: {{{lists}}}, step: 0.1{more}}}}}"


@pytest.mark.parametrize("kind", ["cubic", "linear", "rough", "curved"])
def test_simulators_read_the_field_that_python_has(tmp_path: Path, kind: str) -> None:
    """The distance of an upright wheel's centre from the road in its plane, by height and normal; beyond the field's edges, too."""
    hills = 0.05 * np.random.default_rng(2).normal(size=(6, 5))
    road = table(hills, np.linspace(-0.4, 1.6, 6), np.linspace(-0.3, 0.5, 5), ", interpolation: linear" if kind == "linear" else "")
    others = {"rough": "{surface: {iso8608: E, seed: 5, width: 1}}", "curved": winding(", border: [4, 2], smooth: [0.2, 0]")}
    model = text(others.get(kind, road), rates="x: 3, y: 1")
    surface = surface_of(read_model_text(model, "roll.yaml").scenes["roll"].road)
    found = run(tmp_path, model)
    for x, y, z, distance in zip(*(found[c] for c in ("hub.x", "hub.y", "hub.z", "wheel.loaded_radius")), strict=True):
        n = np.array([-surface.height(x, y, 1, 0), -surface.height(x, y, 0, 1), 1.0])
        along = np.cross([0.0, 1.0, 0.0], n)
        up = np.cross(along / np.linalg.norm(along), [0.0, 1.0, 0.0])
        assert distance == pytest.approx((z - surface.height(x, y, 0, 0)) / (n @ up), abs=1e-12)


def test_friction_of_patches_brakes(tmp_path: Path) -> None:
    """A locked wheel on level ground: v v' = -mu g, on the patch by its factor; the edges' cubics have the mean of both factors."""
    law = f"[-0.8*road_friction*{MASS}*9.81, 0, {MASS}*9.81 + 4e5*(deflection - 0.01) + 40000*deflection_rate]"
    model = text("{friction: [{x: [1, 2], y: [-1, 1], value: 0.25, edge: 0.2}]}", rates="x: 7, y: 0", law=law)
    model = model.replace("rates:", "positions: {lift.displacement: -0.01}, rates:")
    found = run(tmp_path, model)
    x, v, behind = found["hub.x"], found["hub.vx"], found["hub.x"] > 2.1
    clear = np.minimum(np.abs(x - 1), np.abs(x - 2)) > 0.1
    assert np.allclose(found["wheel.road_friction"][clear], np.where((x > 1) & (x < 2), 0.25, 1.0)[clear])
    way = x - 0.75 * (2 - 1)  # of the patch a quarter counts
    assert np.abs(v**2 - (49 - 2 * 0.8 * 9.81 * way))[behind].max() < 1e-6
    assert behind.sum() > 5


def test_lookups_know_their_derivatives() -> None:
    """By differences of the surface itself, as those of a height and of both slopes, and of the friction."""
    hills = np.random.default_rng(8).normal(size=(6, 5))
    patches = (
        Patch(x=(0.2, 0.8), y=(-0.2, 0.5), friction=0.3, edge=0.4, span=NOWHERE),
        Patch(x=(0.5, 1), y=(0, 1), friction=2, edge=0.3, span=NOWHERE),
    )
    surface = Surface(field=Field(start=(0.0, -0.5), step=(0.2, 0.25), heights=hills), patches=patches)
    road, b, h = WheelRoad(left=[], right=[], disc=False, on_it=surface), Builder(), 1e-6
    x, y = (b.symbol(name, 1, BindingTime.ITERATION) for name in "xy")
    at = {"x": np.array([[0.53]]), "y": np.array([[0.07]])}
    for name in ("road_surface", "road_surface_x", "road_surface_y", "road_friction"):
        lookup = b.call(name, x, y, table="wheel")
        derivatives = partial_derivatives(b, lookup)
        values = interpret_blocks(derivatives, at, {"wheel": road})
        for derivative, axis in zip(derivatives, "xy", strict=True):
            ends = [
                interpret_blocks([lookup], {**at, axis: at[axis] + way}, {"wheel": road})[lookup].item() for way in (-h, h)
            ]  # fmt: skip
            assert values[derivative].item() == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-6)


def test_a_picture_shows_the_surface_and_its_patches(tmp_path: Path) -> None:
    """Points of the road are on it, and its triangles are seen from above."""
    model, page = tmp_path / "model.yaml", tmp_path / "pose.glb"
    model.write_text(text("{surface: {iso8608: E, seed: 5}, friction: [{x: [-0.5, 0.5], y: [-1, 1], value: 0.5}]}"), encoding="utf-8")
    call("view", model, "--out", page)
    surface, gltf = surface_of(read_model(model).scenes["roll"].road), Gltf.read(page)
    assert surface is not None
    (node,) = (n for n in gltf.document["nodes"] if n["name"] == "road")
    parts, colours = gltf.document["meshes"][node["mesh"]]["primitives"], set()
    for part in parts:
        points, normals = (gltf.numbers(part["attributes"][key]) for key in ("POSITION", "NORMAL"))
        faces = points[gltf.numbers(part["indices"]).astype(int).reshape(-1, 3)]
        turned = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        print(points[:3], normals[:3], turned[:3])
        for x, y, z in points[:: max(1, len(points) // 20)]:
            assert z == pytest.approx(surface.height(x, y, 0, 0), abs=1e-6)
        assert (turned[:, 2] > 0).all()
        assert (normals[:, 2] > 0.5).all()
        colours.add(part["material"])
    assert len(colours) == 4


@needs_cpp
@pytest.mark.heavy
@pytest.mark.parametrize("surface", ["iso8608: C, seed: 7", winding()[len("{surface: {") : -2]], ids=["rough", "curved"])
def test_folders_and_derivatives_have_the_surface(tmp_path: Path, surface: str) -> None:
    """The trajectory of a loaded library beside the interpreter's, and A by differences of its accelerations."""
    road = f"{{surface: {{{surface}}}, friction: [{{x: [1, 2], y: [-1, 1], value: 0.5}}]}}"
    (tmp_path / "model.yaml").write_text(text(road, law="[-100*road_friction, 0, 4e5*deflection + 4000*deflection_rate]"), encoding="utf-8")
    model = read_model(tmp_path / "model.yaml")
    table = completed(simulate(compile_interpreted(model, model.scenes["roll"]), integrator="rk4", dt=1e-3))
    sim = cutjoint.load(tmp_path / "model.yaml", linearise=True, integrator="rk4").reset(dt=1e-3)
    sim.advance(0.4)
    for name in ("hub.x", "hub.y", "hub.z"):
        assert sim.outputs[name] == pytest.approx(table[name][8], abs=1e-12)
    matrix, t, x, h = sim.linearise().A, sim.time, np.concatenate([sim.coordinates.array, sim.speeds.array]), 1e-6
    for column, way in zip(matrix[3:].T, h * np.eye(6), strict=True):
        ends = []
        for at in (x + way, x - way):
            sim.set_state(t, at[:3], at[3:])
            ends.append(sim.accelerations.array.copy())
        assert column == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-5, rel=1e-7)
