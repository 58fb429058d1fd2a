"""Wheels that turn on the road: the library's tyres beside tables of other implementations, at rest and in motion, by all methods.

tests/data/tyres has invented tyres, and every seventh (of those with scale factors every second) row of the forces that others computed:
OpenTire (MIT) and MFeval_julia (MIT) of Magic Formula 5.2, MFeval_julia of 6.2.  These add 1e-6 N, and 1e-6 m/s to the speed in cos(alpha).
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from cutjoint.compile.options import CompileOptions
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.formulate.test_implicit import make_system, verify_tangent
from tests.physics.simulation import compile_scene, completed, read_reference

DATA = Path(__file__).parents[1] / "data" / "tyres"

#: A table's file, its formula, the wheel that has the formula's coefficients, and the motion that the formula is given.
TABLES = {
    "mf52": ("magic_formula_52", "wheel_mf52", ("kappa", "alpha", "gamma", "load", "vx")),
    "mf62": ("magic_formula_62", "wheel_mf62", ("kappa", "alpha", "gamma", "load", "vx", "spin", "pressure")),
    "mf62s": ("magic_formula_62", "wheel_mf62", ("kappa", "alpha", "gamma", "load", "vx", "spin", "pressure")),
}
TOLD = ("Fx", "Fy", "Mx", "My", "Mz", "sigma_x", "sigma_y", "Re")


def of_formula(name: str) -> str:
    """A model that has a formula with the coefficients of a file, and inputs for the motion."""
    formula, wheel, motion = TABLES[name]
    part, of_wheel = (yaml.safe_load((library_folder() / f"{file}.yaml").read_text()) for file in (formula, wheel))
    used = set(re.findall(r"\w+", " ".join(map(str, part["signals"].values()))))
    parameters = [name for name in of_wheel["parameters"] if name in used]
    defaults = {name: value for name, value in of_wheel["defaults"].items() if name in used}
    given = ", ".join(f"{x}: {x}" for x in motion)
    inputs = "\n".join(f"  {x}: {{value: 1, binding: input}}" for x in motion)
    outputs = ", ".join(f"bench.f.{x}.value" for x in TOLD)
    return f"""
cutjoint: 1
name: tables
gravity: [0, 0, 0]
parameters:
{inputs}
bodies: {{rest: {{mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}}}
joints: {{pin: {{kind: revolute, bodies: [ground, rest], at: [0, 0, 0], axis: [0, 0, 1]}}}}
submodels:
  bench:
    parameters: [{", ".join(dict.fromkeys((*parameters, *motion)))}]
    defaults: {{{", ".join(f"{k}: {v}" for k, v in defaults.items())}}}
    submodels: {{f: {{include: library/{formula}}}}}
    instances: {{f: {{use: f, with: {{{given}}}}}}}
instances:
  bench: {{use: bench, with: {{{given}}}, properties: {name}.tir}}
outputs: [{outputs}]
scenes: {{run: {{end: 1, output_step: 1, numerics: {{dt: 1}}}}}}
"""


@pytest.mark.parametrize("name", TABLES)
def test_forces_are_those_of_the_tables(name: str) -> None:
    table = read_reference(DATA / f"{name}.csv")
    table["spin"] = (1 + table["kappa"]) * table["vx"] / table["Re"]
    model = read_model_text(of_formula(name), "m.yaml", folder=DATA)
    rows = np.arange(len(table["kappa"]), dtype=float)
    inputs = {x: {"t": rows, "value": table[x], "interpolation": "linear"} for x in TABLES[name][2]}
    run = completed(simulate(compile_scene(model, model.scenes["run"]), inputs=inputs, end=rows[-1], error=False))
    for quantity in TOLD:
        expected, within = table[quantity], 1e-6 if quantity == "Mz" else 1e-9
        assert run[f"bench.f.{quantity}.value"] == pytest.approx(expected, rel=0, abs=within * np.abs(expected).max())


CORNER = """
cutjoint: 1
name: corner
gravity: [%s, 0, %s]
parameters:
  brake: {value: 0, unit: N*m, binding: input}
  pull: {value: 0, unit: N, binding: input}
bodies:
  cart: {mass: 20, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  carrier: {mass: 330, centre_of_mass: [0, 0, 0.3], inertia: [5, 8, 6]}
joints:
  slide: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0.3], axis: [1, 0, 0]}
  lift: {kind: prismatic, bodies: [cart, carrier], at: [0, 0, 0.3], axis: [0, 0, 1]}
forces:
  pulling: {kind: load, body: carrier, at: [0, 0, 0.3], force: [pull, 0, 0]}
  damper: {kind: joint_force, joint: lift, law: -2000*rate}
submodels:
  wheel: {include: library/wheel_mf%s}
instances:
  w: {use: wheel, connect: {carrier: carrier}, with: {x: 0, y: 0, z: 0.3, brake: brake}, properties: mf%s.tir}
outputs: [cart.x, cart.vx, w.rolling.contact.Fx, w.rolling.contact.Fz, w.rolling.contact.spin, w.rolling.bearing.angle, w.rolling.flows.value]
scenes:
  run: {end: 6, output_step: 0.05, %s}
"""

LEVEL, SLOPE = ("0", "-9.81"), ("-9.81*0.19611613513818404", "-9.81*0.98058067569092")
STOP = """numerics: {dt: 0.001}, rates: {slide.displacement_rate: 20, w.rolling.bearing.angle_rate: 64}, states: {w.rolling.rolled: 1},
    inputs: {brake: {table: {t: [0, 0.5, 0.6, 9], value: [0, 0, 700, 700]}, interpolation: linear}}"""


@cache
def corner(kind: str, gravity: tuple[str, str], scene: str) -> Model:
    return read_model_text(CORNER % (*gravity, kind, kind, scene), "m.yaml", folder=DATA)


def run(model: Model, method: str = "recursive", **choices: object) -> Trajectory:
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method=method))
    return completed(simulate(artifact, error=False, **choices))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["52", "62"])
def test_the_tangent_of_a_wheel(kind: str) -> None:
    model = corner(kind, LEVEL, STOP)
    assert verify_tangent(make_system(model, model.scenes["run"]), 4) > 0


def test_all_methods_brake_alike() -> None:
    """A wheel brakes from 20 m/s without locking: the trapezoidal rule's error at 1 ms is all in which methods differ."""
    model = corner("62", LEVEL, STOP)
    exact = run(model, integrator="dop853", tolerance=1e-10)
    assert exact["cart.vx"][-1] < 14
    for method in METHODS:
        found = run(model, method, integrator="trapezoidal")
        assert found["cart.x"] == pytest.approx(exact["cart.x"], abs=2e-4)
        assert found["w.rolling.contact.Fx"][20:] == pytest.approx(exact["w.rolling.contact.Fx"][20:], abs=2.0)
