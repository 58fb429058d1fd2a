"""The ground that a host, a law or an input puts under a wheel, beside the road of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.elements.forces.on_road import TERRAIN
from cutjoint.elements.forces.tyre import Tyre
from cutjoint.export.fmu.variables import make_interface
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.expressions.tunable import with_terrain
from cutjoint.model.read import read_model_text
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_model, compile_text, completed

MASS, STIFFNESS, RADIUS = 400.0, 4e5, 0.3

CALSPAN = "{A0: 4000, A1: 10, A2: 6000, A3: 1.7, A4: 4000, B1: -0.00008, B3: 1.0, B4: 0, SN: %s, AF1: 0, AF2: 0}"


def text(axis: str, joint: str, more: str, scene: str, grip: str = "0.85", outputs: str = "hub.x, hub.y, hub.z, wheel.Fz, wheel.Fy") -> str:
    """A wheel on a hub, which a joint carries."""
    return f"""
cutjoint: 1
name: rolling
gravity: [0, 0, -9.81]
parameters: {{height: {{value: 0, unit: m, binding: input}}}}
bodies:
  hub: {{mass: {MASS}, centre_of_mass: [0, 0, {RADIUS}]}}
  sledge: {{massless: true}}
  bridge: {{massless: true}}
joints: {joint}
forces:
  wheel:
    kind: tyre
    body: hub
    centre: [0, 0, {RADIUS}]
    axis: {axis}
    radius: {RADIUS}
    stiffness: {STIFFNESS}
    calspan: {CALSPAN % grip}
    {more}
outputs: [{outputs}]
scenes: {{roll: {{end: 1, output_step: 0.05, {scene}}}}}
"""


def slides(x: str, y: str) -> str:
    """Slides along x and y, or welds, and one up and down."""
    return f"""
  x: {{bodies: [ground, sledge], at: [0, 0, 0], {x}}}
  y: {{bodies: [sledge, bridge], at: [0, 0, 0], {y}}}
  lift: {{kind: prismatic, bodies: [bridge, hub], at: [0, 0, 0], axis: [0, 0, 1]}}"""


LIFT = slides("kind: fixed", "kind: fixed")
FREE = slides("kind: prismatic, axis: [1, 0, 0]", "kind: prismatic, axis: [0, 1, 0]")

#: A ramp from where the wheel begins.
RAMP = "road: {start: 0, profile: [{ramp: 100, rise: 10}]}"


def run(folder: Path, *arguments: str, **more: str) -> Trajectory:
    return completed(simulate(compile_text(folder, text(*arguments, **more)), integrator="dormand-prince", tolerance=1e-10))


def test_a_wheel_follows_a_wave_of_the_ground_as_its_equation_says(tmp_path: Path) -> None:
    """m z'' = -m g + k (R - z + h), h = a sin(w t), from rest in equilibrium: z - z0 = a (sin w t - w/p sin p t) / (1 - w^2/p^2)."""
    a, w, p = 0.001, 20.0, np.sqrt(STIFFNESS / MASS)
    start = f"inputs: {{height: {a}*sin({w}*t)}}, positions: {{lift.displacement: {-MASS * 9.81 / STIFFNESS}}}"
    found = run(tmp_path, "[0, 1, 0]", LIFT, "terrain_height: height", start)
    z = RADIUS - MASS * 9.81 / STIFFNESS + a * (np.sin(w * found.t) - w / p * np.sin(p * found.t)) / (1 - w**2 / p**2)
    assert np.abs(found["hub.z"] - z).max() < 1e-9


@pytest.mark.parametrize(("along", "axis", "slope"), [("x", "[0, 1, 0]", "terrain_slope"), ("y", "[-1, 0, 0]", "terrain_bank")])
def test_a_ground_that_falls_is_the_road_that_does(tmp_path: Path, along: str, axis: str, slope: str) -> None:
    """A ramp of the scene's road along x, and the same by height and slope; turned by a right angle, along y, by height and bank."""
    road = run(tmp_path, "[0, 1, 0]", FREE, "", "rates: {x.displacement_rate: 5, y.displacement_rate: 0.3}, " + RAMP)
    turned = along == "y"
    rates = f"x.displacement_rate: {-0.3 if turned else 5}, y.displacement_rate: {5 if turned else 0.3}"
    ground = run(tmp_path, axis, FREE, f"terrain_height: 0.1*hub.{along}\n    {slope}: 0.1", f"rates: {{{rates}}}")
    of_turned = {"hub.x": ground["hub.y"], "hub.y": -ground["hub.x"], "hub.z": ground["hub.z"], "wheel.Fy": ground["wheel.Fy"]}
    for column, values in of_turned.items():
        assert np.abs(road[column] - (values if turned else ground[column])).max() < 1e-7 * (1 + np.abs(road[column]).max()), column
    assert np.abs(road["wheel.Fy"]).max() > 100
    assert road["hub.z"][-1] > 0.5


def test_friction_is_a_factor_of_the_skid_number(tmp_path: Path) -> None:
    rolls = "rates: {x.displacement_rate: 5, y.displacement_rate: 2}"
    whole, ground, constant = (
        run(tmp_path, "[0, 1, 0]", FREE, more, rolls, grip=grip) for more, grip in (("", "0.85"), ("friction: 0.4", "0.85"), ("", "0.34"))
    )
    patch = run(tmp_path, "[0, 1, 0]", FREE, "", rolls + ", road: {friction: [{x: [-9, 99], y: [-9, 9], value: 0.4}]}")
    assert np.abs(ground["hub.y"] - constant["hub.y"]).max() < 1e-9
    assert np.abs(patch["hub.y"] - constant["hub.y"]).max() < 1e-9
    assert np.abs(whole["hub.y"] - constant["hub.y"]).max() > 0.1


@needs_cpp
def test_a_host_gives_it_before_each_step(tmp_path: Path) -> None:
    """A ground that jumps by h lets the wheel swing about its new place: h (1 - cos(p t))."""
    path, p = tmp_path / "wheel.yaml", np.sqrt(STIFFNESS / MASS)
    start = f"inputs: {{height: 0}}, positions: {{lift.displacement: {-MASS * 9.81 / STIFFNESS}}}"
    path.write_text(text("[0, 1, 0]", LIFT, "terrain_height: height", start, outputs="hub.z"))
    sim = cutjoint.load(path).reset(tolerance=1e-10)
    rest = sim.outputs["hub.z"]
    sim.inputs["height"] = 0.005
    for t in (0.02, 0.1, 0.5):
        sim.advance(t)
        assert sim.outputs["hub.z"] - rest == pytest.approx(0.005 * (1 - np.cos(p * t)), abs=1e-9)


@needs_cpp
def test_a_host_has_inputs_that_no_file_names(tmp_path: Path) -> None:
    """They are as those that a file names, to the last bit."""
    own = ("height", "along", "across", "grip")
    start, fields = "rates: {x.displacement_rate: 5}", "\n    ".join(map(": ".join, zip(TERRAIN, own, strict=True)))
    more = "along: {value: 0, binding: input}, across: {value: 0, binding: input}, grip: {value: 1, binding: input}"
    (tmp_path / "named.yaml").write_text(text("[0, 1, 0]", FREE, fields, start).replace("binding: input}}", f"binding: input}}, {more}}}"))
    (tmp_path / "bare.yaml").write_text(text("[0, 1, 0]", FREE, "", start))
    files = {"named.yaml": (), "bare.yaml": ["wh*"]}
    sims = [cutjoint.load(tmp_path / file, terrain=names, integrator="rk4").reset(dt=1e-3) for file, names in files.items()]
    for step in range(100):
        for end, name, value in zip(TERRAIN, own, (0.005 * np.sin(0.1 * step), 0.02, -0.01, 1 - 0.005 * step), strict=True):
            sims[0].inputs[name] = sims[1].inputs[f"wheel.{end}"] = value
        for sim in sims:
            sim.step()
    assert sims[0].outputs.array.tolist() == sims[1].outputs.array.tolist()
    assert sims[1].outputs["hub.y"] > 1e-4  # the ground falls to the left


#: A car of four arms, with heights of the ground left, right and in front, and its slopes.
CAR = """
cutjoint: 1
name: car
gravity: [0, 0, -9.81]
parameters:
  left: &height {value: 0, unit: m, binding: param}
  right: *height
  front: *height
  bank: {value: 0, binding: param}
bodies: {chassis: {mass: 1200, centre_of_mass: [0, 0, 0.6], inertia: [300, 1500, 1600]}}
joints: {free: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.6]}}
submodels:
  corner:
    connectors: [chassis]
    parameters: [x, height]
    bodies: {hub: {mass: 40, centre_of_mass: [x, 0.7, 0.3], inertia: [1, 1, 1]}}
    joints: {arm: {kind: revolute, bodies: [chassis, hub], at: [x, 0.2, 0.35], axis: x}}
    forces:
      strut:
        {kind: point_spring, bodies: [chassis, hub], from: [x, 0.5, 0.8], to: [x, 0.6, 0.3], law: {stiffness: 30000, preload: -4000}}
      tyre: {kind: tyre, body: hub, centre: [x, 0.7, 0.3], axis: y, radius: 0.3, stiffness: 400000, calspan: %s,
             terrain_height: height, terrain_bank: bank}
instances:
  front_left: {use: corner, connect: {chassis: chassis}, with: {x: 1.2, height: left + front}}
  front_right: {use: corner, connect: {chassis: chassis}, with: {x: 1.2, height: right + front}, mirror: y}
  rear_left: {use: corner, connect: {chassis: chassis}, with: {x: -1.3, height: left}}
  rear_right: {use: corner, connect: {chassis: chassis}, with: {x: -1.3, height: right}, mirror: y}
outputs: [chassis.z]
scenes: {rest: {end: 1, pose: equilibrium, positions: {free.x: 0, free.y: 0}}}
"""


@needs_cpp
def test_a_car_comes_to_rest_wherever_the_ground_lifts_it() -> None:
    """Ground that is higher by 0.1 m lifts the car by that; ground that falls by 0.2 m over the track rolls it as springs let it."""
    model = read_model_text(CAR % CALSPAN % "0.85", "car.yaml")
    low, high = (cutjoint.find_equilibrium(model, parameters={"left": 0.2 + h, "right": h}).values for h in (0.0, 0.1))
    assert high["chassis.z"] - low["chassis.z"] == pytest.approx(0.1, abs=1e-6)
    assert high["chassis.roll"] == pytest.approx(low["chassis.roll"], abs=1e-6)
    assert 0.2 / 1.4 < low["chassis.roll"] < 0.2
    fallen = cutjoint.find_equilibrium(model, parameters={"left": 0.1, "right": -0.1, "front": 0.1, "bank": 0.1}).values
    assert 0.2 / 1.4 < fallen["chassis.roll"] < 0.2


def test_it_is_added_to_what_the_file_has() -> None:
    model = read_model_text(text("[0, 1, 0]", LIFT, "terrain_height: 2*height\n    friction: 0.5", "inputs: {height: 0}"), "rolling.yaml")
    (wheel,) = (f for f in with_terrain(model, ["*"]).forces if isinstance(f, Tyre))
    given = dict(zip(("p_height", *(f"p_wheel.{end}" for end in TERRAIN)), (0.1, 0.03, 0.2, 0.3, 0.8), strict=True))
    ground = {name: float(x.subs({symbol: given[str(symbol)] for symbol in x.free_symbols})) for name, x in wheel.terrain.items()}
    assert ground == pytest.approx({"terrain_height": 0.23, "terrain_slope": 0.2, "terrain_bank": 0.3, "friction": 0.4})


@pytest.mark.parametrize("pattern", ["whel", "hub"])
def test_wheels_that_are_none_are_reported(pattern: str) -> None:
    model = read_model_text(text("[0, 1, 0]", LIFT, "", "rates: {}"), "rolling.yaml")
    with pytest.raises(cutjoint.ModelError, match=f"terrain '{pattern}': the model has no force of kind 'tyre' or 'wheel' of this name"):
        with_terrain(model, ["*", pattern])


@needs_cpp
def test_a_wheel_whose_forces_read_its_contact_has_it_too(tmp_path: Path) -> None:
    """A wheel of kind `wheel` that signals give a load and a drag of 0.1 of friction: m x'' = -0.1 f m g in equilibrium."""
    start = "rates: {x.displacement_rate: 5}, positions: {x.displacement: 0}, pose: equilibrium"
    source = text("[0, 1, 0]", slides("kind: prismatic, axis: [1, 0, 0]", "kind: fixed"), "", start, outputs="hub.vx")
    tyre = source[source.index("    kind: tyre") : source.index("outputs:")]
    fields = ("kind: wheel", "body: hub", f"centre: [0, 0, {RADIUS}]", "axis: [0, 1, 0]", f"radius: {RADIUS}", "force: [drag, 0, load]\n")
    signals = f"signals:\n  load: max({STIFFNESS}*wheel.deflection, 0)\n  drag: -0.1*wheel.road_friction*load*min(max(wheel.vx, 0), 1)\n"
    path = tmp_path / "wheel.yaml"
    path.write_text(source.replace(tyre, "    " + "\n    ".join(fields) + signals))
    sim = cutjoint.load(path, terrain=["*"]).reset(tolerance=1e-10)
    sim.inputs["wheel.friction"] = 0.6
    sim.advance(0.5)
    assert sim.outputs["hub.vx"] == pytest.approx(5 - 0.1 * 0.6 * 9.81 * 0.5, abs=1e-8)


def test_it_is_an_input_of_fmus() -> None:
    model = read_model_text(text("[0, 1, 0]", LIFT, "terrain_height: height", "inputs: {height: 0}"), "rolling.yaml")
    generated = generate(model, model.scenes["roll"], model.scenes["roll"].outputs)
    assert isinstance(generated.equations, RecursiveEquations)
    interface = make_interface(generated.equations, make_standalone(generated).run_file)
    assert [v.name for v in interface.inputs] == ["height"]


def test_what_is_wrong_with_it_is_reported(tmp_path: Path) -> None:
    wrong = {
        "terrain_height: 3 kg": "terrain_height needs", "friction: 1 m": "friction needs",
        "terrain_slop: 0.1": "did you mean 'terrain_slope'",
    }  # fmt: skip
    for more, words in wrong.items():
        with pytest.raises(cutjoint.ModelError, match=words):
            compile_text(tmp_path, text("[0, 1, 0]", LIFT, more, "inputs: {height: 0}"))


@pytest.mark.parametrize("method", ["recursive-newton", "augmented"])
def test_all_methods_have_it(tmp_path: Path, method: str) -> None:
    more = "terrain_height: 0.1*hub.x - 0.05*hub.y\n    terrain_slope: 0.1\n    terrain_bank: -0.05\n    friction: 0.7"
    (tmp_path / "model.yaml").write_text(text("[0, 1, 0]", FREE, more, "rates: {x.displacement_rate: 5, y.displacement_rate: 0.3}"))
    runs = [
        completed(simulate(compile_model(tmp_path / "model.yaml", method=each), integrator="trapezoidal", dt=2e-4, error=False))
        for each in ("recursive", method)
    ]
    for column in ("hub.x", "hub.y", "hub.z", "wheel.Fz"):  # the same rule, each solved to its tolerance
        assert np.abs(runs[0][column] - runs[1][column]).max() < 1e-6 * (1 + np.abs(runs[0][column]).max()), column


def test_a_mirrored_wheel_has_the_ground_of_the_other_side() -> None:
    source = text("[0, 1, 0]", LIFT, "terrain_slope: 0.1\n    terrain_bank: 0.2\n    terrain_height: 0.3", "inputs: {height: 0}")
    parts = source[source.index("bodies:") : source.index("outputs:")].replace("\n", "\n    ").strip()
    wheel = f"submodels:\n  corner:\n    connectors: []\n    {parts}\n"
    head = source[: source.index("bodies:")]
    rest = "instances: {left: {use: corner, connect: {}}, right: {use: corner, connect: {}, mirror: y}}\noutputs: [left.hub.z]\n"
    model = read_model_text(f"{head}{wheel}{rest}scenes: {{roll: {{inputs: {{height: 0}}, end: 1}}}}\n", "rolling.yaml")
    found = {f.name: (f.terrain_height, f.terrain_slope, f.terrain_bank) for f in model.forces if isinstance(f, Tyre)}
    assert found == {"left.wheel": (0.3, 0.1, 0.2), "right.wheel": (0.3, 0.1, -0.2)}
