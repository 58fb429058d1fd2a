"""Wheels that turn on the road: the library's tyres beside tables of other implementations, at rest and in motion, by all methods.

tests/data/tyres has invented tyres, and every seventh (of those with scale factors every second) row of the forces that others computed:
OpenTire (MIT) and MFeval_julia (MIT) of Magic Formula 5.2, MFeval_julia of 6.2.  These add 1e-6 N, and 1e-6 m/s to the speed in cos(alpha).
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from cutjoint.compile.options import CompileOptions
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.formulate.test_implicit import verify_tangent
from tests.formulate.test_natural import Hills
from tests.formulate.test_signals import WithStates
from tests.physics.simulation import compile_scene, completed, read_reference

DATA = Path(__file__).parents[1] / "data" / "tyres"

#: A table's file, its formula, the wheel that has the formula's coefficients, and the motion that the formula is given.
TABLES = {
    "mf52": ("magic_formula_52", "wheel_mf52", ("kappa", "alpha", "gamma", "load", "vx")),
    "mf62": ("magic_formula_62", "wheel_mf62", ("kappa", "alpha", "gamma", "load", "vx", "spin", "pressure")),
    "mf62s": ("magic_formula_62", "wheel_mf62", ("kappa", "alpha", "gamma", "load", "vx", "spin", "pressure")),
}
KINDS = ("52", "62")
REPORTED = ("Fx", "Fy", "Mx", "My", "Mz", "sigma_x", "sigma_y", "Re")


def of_formula(name: str, also: Sequence[str] = (), more: str = "") -> str:
    """A model that has a formula with the coefficients of a file, and inputs for the motion; with further motion and values."""
    formula, wheel, motion = TABLES[name]
    motion = (*motion, *also)
    part, of_wheel = (yaml.safe_load((library_folder() / f"{file}.yaml").read_text()) for file in (f"formulas/{formula}", wheel))
    used = set(re.findall(r"\w+", " ".join(map(str, part["signals"].values()))))
    parameters = [name for name in of_wheel["parameters"] if name in used]
    defaults = {name: value for name, value in of_wheel["defaults"].items() if name in used}
    given = ", ".join(f"{x}: {x}" for x in motion)
    inputs = "\n".join(f"  {x}: {{value: 1, binding: input}}" for x in motion)
    outputs = ", ".join(f"bench.f.{x}.value" for x in REPORTED)
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
    submodels: {{f: {json.dumps({key: value for key, value in part.items() if key != 'cutjoint'})}}}
    instances: {{f: {{use: f, with: {{{given}}}}}}}
instances:
  bench: {{use: bench, with: {{{more}{given}}}, properties: {name}.tir}}
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
    for quantity in REPORTED:
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
  w: {use: wheel, connect: {carrier: carrier}, with: {x: 0, y: 0, z: 0.3, brake: brake%s}, properties: mf%s.tir}
outputs: [cart.x, cart.vx, w.rolling.contact.Fx, w.rolling.contact.Fz, w.rolling.contact.spin, w.rolling.flows.value]
scenes:
  run: {%s}
"""

#: Values that files of the older formula lack.
MASSES = {"52": ", MASS: 20, IXX: 0.6, IYY: 1", "62": ""}
LEVEL, SLOPE = ("0", "-9.81"), ("-9.81*0.19611613513818404", "-9.81*0.98058067569092")
STOP = """end: 6, output_step: 0.05, numerics: {dt: 0.001},
    rates: {slide.displacement_rate: 20, w.rolling.bearing.angle_rate: 64}, states: {w.rolling.rolled: 1},
    inputs: {brake: {table: {t: [0, 0.5, 0.6, 9], value: [0, 0, 700, 700]}, interpolation: linear}}"""


@cache
def corner(kind: str, gravity: tuple[str, str], scene: str, more: str = "") -> Model:
    return read_model_text(CORNER % (*gravity, kind, MASSES[kind] + more, kind, scene), "m.yaml", folder=DATA)


def run(model: Model, method: str = "recursive", **choices: object) -> Trajectory:
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method=method))
    return completed(simulate(artifact, error=False, **choices))  # type: ignore[arg-type]


@pytest.mark.parametrize(("kind", "more"), [*((kind, "") for kind in KINDS), ("62", ", turn_slip: 1")])
def test_the_tangent_of_a_wheel(kind: str, more: str) -> None:
    model = corner(kind, LEVEL, STOP, more)
    start = formulate_recursive(build_topology(model), model.scenes["run"], ())
    system = WithStates(formulate_implicit(start, ()), {name: Hills() for name in start.roads})
    for seed in (0, 1, 2, 4, 5):  # that of 3 has a kink within the step of the differences, and agrees at smaller ones
        assert verify_tangent(system, seed, moves=0.03) > 0


class Waves(Hills):
    """A road with a surface and a friction that change along x and y, and their derivatives."""

    def surface(self, x: float, y: float, by_x: int, by_y: int) -> float:
        return 0.02 * 1.3**by_x * 1.7**by_y * np.sin(1.3 * x + 0.4 + by_x * np.pi / 2) * np.cos(1.7 * y + by_y * np.pi / 2)

    def friction(self, x: float, y: float, by_x: int, by_y: int) -> float:
        return (by_x + by_y == 0) + 20 * self.surface(x, y, by_x, by_y)


def test_the_tangent_of_a_wheel_on_a_surface() -> None:
    model = corner("62", LEVEL, STOP + ", road: {surface: {iso8608: A}, friction: [{x: [0, 1], y: [0, 1], value: 0.5}]}")
    start = formulate_recursive(build_topology(model), model.scenes["run"], ())
    system = WithStates(formulate_implicit(start, ()), {name: Waves() for name in start.roads})
    for seed in (0, 1, 2):
        assert verify_tangent(system, seed, moves=0.03) > 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_friction_of_a_road_is_that_of_the_scaling_factors(kind: str) -> None:
    ends = STOP.replace("end: 6", "end: 2")
    scaled = run(corner(kind, LEVEL, ends, ", LMUX: 0.4, LMUY: 0.4"), integrator="dormand-prince", tolerance=1e-9)
    patch = ", road: {friction: [{x: [-9, 99], y: [-9, 9], value: 0.4}]}"
    found, whole = (run(corner(kind, LEVEL, ends + more), integrator="dormand-prince", tolerance=1e-9) for more in (patch, ""))
    assert found["cart.vx"] == pytest.approx(scaled["cart.vx"], abs=1e-6)
    assert np.abs(whole["cart.vx"] - scaled["cart.vx"]).max() > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_limits_hold_slip_and_load_of_the_formula(kind: str) -> None:
    """A locked wheel has the force of the slip and the load at which its file ends, on request."""
    ends = STOP.replace("end: 6", "end: 1.5").replace("700, 700", "5000, 5000")
    limits = ", KPUMIN: -0.2, FZMAX: 3000"
    found, whole = (
        run(corner(kind, LEVEL, ends, more + limits), integrator="dormand-prince", tolerance=1e-8)["w.rolling.contact.Fx"][-1]
        for more in (", limits: 1", "")
    )
    at = {"kappa": -0.2, "alpha": 0, "gamma": 0, "load": 3000, "vx": 10, "spin": 0, "pressure": 232000}
    model = read_model_text(of_formula(f"mf{kind}"), "m.yaml", folder=DATA)
    inputs = {name: at[name] for name in TABLES[f"mf{kind}"][2]}
    formula = completed(simulate(compile_scene(model, model.scenes["run"]), inputs=inputs, error=False))["bench.f.Fx.value"][-1]
    assert found == pytest.approx(formula, rel=1e-9)
    assert abs(whole - found) > 100


def test_all_methods_brake_alike() -> None:
    """A wheel brakes from 20 m/s without locking: errors of the trapezoidal rule are all in which methods differ (order 2, measured)."""
    model = corner("62", LEVEL, STOP)
    exact = run(model, integrator="dop853", tolerance=1e-10)
    assert exact["cart.vx"][-1] < 14
    for method in METHODS:
        found = run(model, method, integrator="trapezoidal", dt=2.5e-4)
        assert found["cart.x"] == pytest.approx(exact["cart.x"], abs=1e-4)
        assert found["w.rolling.contact.Fx"][20:] == pytest.approx(exact["w.rolling.contact.Fx"][20:], abs=0.4)


@pytest.mark.parametrize(("method", "dt"), [
    *(("recursive", dt) for dt in (5e-4, 1e-3, 7.5e-3)), *(("recursive-newton", dt) for dt in (1e-3, 7.5e-3)),
])  # fmt: skip
@pytest.mark.parametrize("kind", KINDS)
def test_a_braked_wheel_stays_on_a_slope_that_shakes(kind: str, method: str, dt: float) -> None:
    """At 20 % slope, shaken by 20 % of the weight at 1 Hz: after whole periods it is where it was, from the first one on within 1 um."""
    period = 3 if dt == 7.5e-3 else 1
    scene = f"end: 12, output_step: {period}, numerics: {{dt: {dt}}}, inputs: {{brake: 1500, pull: '720*sin(2*pi*t)'}}"
    found = run(corner(kind, SLOPE, scene), method, integrator="trapezoidal")["cart.x"]
    assert np.abs(found).max() < 0.01
    assert np.ptp(found[1:]) < 1e-6
    assert np.ptp(found[9 // period :]) < 1e-9


def shaken(kind: str, hertz: float, lifts: str = "0") -> dict[str, np.ndarray]:
    """Two periods of a braked wheel on the slope, shaken to and fro, and up and down: its power, and what of it is along the road (W)."""
    moved = ("vx", "loaded_radius", "deflection_rate", "My")
    text = CORNER.replace("outputs: [cart.x, ", f"outputs: [cart.x, {', '.join(f'w.rolling.contact.{name}' for name in moved)}, ")
    text = text.replace("bodies:\n", "  lifting: {value: 0, unit: N, binding: input}\nbodies:\n", 1)
    text = text.replace("[pull, 0, 0]", "[pull, 0, lifting]")
    inputs = f"brake: 1500, pull: '720*sin(2*pi*{hertz}*t)', lifting: '{lifts}'"
    scene = f"end: {2 + 2 / hertz}, output_step: 0.001, numerics: {{dt: 0.001}}, inputs: {{{inputs}}}"
    found = run(read_model_text(text % (*SLOPE, kind, MASSES[kind], kind, scene), "m.yaml", folder=DATA), integrator="trapezoidal")
    of = {name.removeprefix("w.rolling.contact."): found[name][2000:] for name in found}
    along = of["Fx"] * (of["vx"] - of["loaded_radius"] * of["spin"]) + of["My"] * of["spin"]
    return {"along": along, "power": along - of["Fz"] * of["deflection_rate"], "place": of["cart.x"]}


@pytest.mark.parametrize("hertz", [1, 5, 12])
@pytest.mark.parametrize("kind", KINDS)
def test_a_tyre_at_rest_does_no_work(kind: str, hertz: int) -> None:
    """The road's work over whole periods."""
    found = shaken(kind, hertz)
    assert found["along"].max() > 1  # the tread gives back what it has taken,
    assert found["along"][:-1].mean() < -0.1  # but for what its damping takes
    assert found["power"][:-1].mean() < -0.1


@pytest.mark.parametrize("kind", KINDS)
def test_a_tyre_at_rest_does_no_work_while_its_load_changes(kind: str) -> None:
    """Up and down a quarter of a period before and after to and fro: both lose what the damping takes, and the wheel does not walk."""
    ahead, behind = (shaken(kind, 0.25, f"{sign}1000*cos(2*pi*0.25*t)") for sign in ("", "-"))
    works = [0.001 * found["along"][4000:-1].sum() for found in (ahead, behind)]
    assert max(works) < -0.4
    assert works[0] == pytest.approx(works[1], rel=0.005)
    for found in (ahead, behind):
        assert abs(found["place"][-1] - found["place"][4000]) < 1e-8


def test_a_braked_wheel_is_parked_on_a_slope() -> None:
    """The equilibrium, in which brake and tread take the slope's share of the weight, and nothing moves afterwards."""
    scene = "end: 2, pose: equilibrium, numerics: {dt: 0.001, solver_tolerance: 1e-12}, inputs: {brake: 1500}"
    found = run(corner("62", SLOPE, scene), integrator="trapezoidal")
    weight = (20 + 330 + 9.4) * 9.81
    assert found["w.rolling.contact.Fx"] == pytest.approx(weight * 0.19611613513818404, rel=1e-9)
    assert np.abs(found["cart.x"]).max() < 1e-12


def test_a_wheel_rolls_from_a_pose_at_rest() -> None:
    """Under its load at once, without slip, and it goes on so: what it loses is its rolling resistance alone, (m l + I/Re) v' = My."""
    scene = "end: 1, output_step: 0.01, pose: equilibrium, rates: {slide.displacement_rate: 20, w.rolling.bearing.angle_rate: 20/%r}"
    rolling = ("w.formula.Re.value", "w.rolling.rolls_on.value", "w.rolling.contact.My", "w.rolling.contact.loaded_radius")
    text, radius = CORNER.replace("outputs: [", f"outputs: [{', '.join(rolling)}, "), 0.3
    for states, begins in (("", 0), (", states: {w.rolling.rolled: 1}", 1)):
        for _ in range(3):  # the radius of free rolling is one at speed
            model = read_model_text(text % (*LEVEL, "62", "", "62", scene % radius + states), "m.yaml", folder=DATA)
            found = run(model, integrator="trapezoidal", dt=1e-3)
            radius = float(found["w.formula.Re.value"][0])
        assert found["w.rolling.rolls_on.value"][0] == begins
        assert found["w.rolling.contact.Fz"] == pytest.approx((330 + 9.4) * 9.81, rel=0.06)  # a tyre is stiffer at speed
        _, _, moment, level = (found[name][10:].mean() for name in rolling)
        lost = moment / ((20 + 330 + 9.4) * level + 0.743 / radius) * 0.9
        assert found["cart.vx"][-1] - found["cart.vx"][10] == pytest.approx(lost, rel=0.02)
        assert found["cart.vx"][0] - found["cart.vx"][10] < 0.02


@pytest.mark.parametrize(("method", "dt"), [("recursive", 1e-3), ("recursive", 4e-3), ("recursive-newton", 7.5e-3)])
def test_a_wheel_brakes_to_rest(method: str, dt: float) -> None:
    """It stops where it is, and rocks on its tread: less than 2 um in the last second."""
    scene = STOP.replace("end: 6, output_step: 0.05", "end: 8, output_step: 0.006").replace("700", "900").replace("dt: 0.001", f"dt: {dt}")
    found = run(corner("62", LEVEL, scene), method, integrator="trapezoidal")
    rests = found["t"] > 7
    assert np.ptp(found["cart.x"][rests]) < 2e-6
    assert np.abs(found["w.rolling.contact.spin"][rests]).max() < 1e-4
    tread, speed = found["w.rolling.contact.Fx"], found["cart.vx"]
    brakes = (speed > 0.5) & (found["t"] > 0.7)
    assert tread[brakes].max() < 0


@pytest.mark.parametrize(("method", "dt"), [("recursive", 1e-3), ("recursive-newton", 7.5e-3)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_tread_stops_in_five_half_waves(kind: str, method: str, dt: float) -> None:
    """The force of the brake changes its sign five times at most until a hundred-thousandth of it is left."""
    scene = STOP.replace("end: 6, output_step: 0.05, numerics: {dt: 0.001}", f"end: 4.5, numerics: {{dt: {dt}}}").replace("700", "900")
    found = run(corner(kind, LEVEL, scene), method, integrator="trapezoidal")
    stops, force = int(np.argmax(found["cart.vx"] < 0)), found["w.rolling.contact.Fx"]
    changes = stops + np.flatnonzero(np.diff(np.sign(force[stops:])))
    most = np.abs(force[:stops]).max()
    assert sum(np.abs(force[after + 1 :]).max() > 1e-5 * most for after in changes) < 5
    assert np.abs(force[changes[0] :]).max() > 1e-2 * most


@pytest.mark.parametrize("kind", KINDS)
def test_a_braked_wheel_is_pushed_off_at_the_limit_of_friction(kind: str) -> None:
    """Within 0.05 % of the largest force that its formula has, which a sliding wheel goes through."""
    pull = "end: 40, output_step: 0.1, numerics: {dt: 0.002}, inputs: {brake: 5000, pull: {table: %s, interpolation: linear}}"

    def external_wrenches(force: float, before: float) -> Trajectory:
        table = f"{{t: [0, 10, 20, 40], value: [0, {before}, {force}, {force}]}}"
        return run(corner(kind, LEVEL, pull % table), "recursive-newton", integrator="trapezoidal")

    limit = -external_wrenches(4500, 0)["w.rolling.contact.Fx"].min()
    assert limit == pytest.approx(4000, rel=0.05)
    assert external_wrenches(0.9995 * limit, 0.99 * limit)["cart.x"].max() < 0.1
    assert external_wrenches(1.0005 * limit, 0.99 * limit)["cart.x"][-1] > 100


PAIR = """
cutjoint: 1
name: pair
gravity: [0, 0, -9.81]
bodies:
  sled: {mass: 10, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  slider: {mass: 10, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  cart: {mass: 330, centre_of_mass: [0, 0, 0.3], inertia: [50, 80, 60]}
joints:
  ahead: {kind: prismatic, bodies: [ground, sled], at: [0, 0, 0.3], axis: [1, 0, 0]}
  aside: {kind: prismatic, bodies: [sled, slider], at: [0, 0, 0.3], axis: [0, 1, 0]}
  lift: {kind: prismatic, bodies: [slider, cart], at: [0, 0, 0.3], axis: [0, 0, 1]}
submodels:
  wheel: {include: library/wheel_mf62}
instances:
  w: {use: wheel, connect: {carrier: cart}, with: {x: 0, y: 0.5, z: 0.3, toe: 0.03, camber: 0.02, drive: 80%s}, properties: mf62.tir%s}
outputs: [cart.y, cart.x, w.rolling.contact.Fy, w.rolling.contact.Mz, w.rolling.contact.camber]
scenes:
  run:
    {end: 2, output_step: 0.1, numerics: {dt: 0.001}, rates: {ahead.displacement_rate: 10, w.rolling.bearing.angle_rate: 32},
     states: {w.rolling.rolled: 1}}
"""


@pytest.mark.parametrize("more", ["", ", turn_slip: 1"])
def test_a_wheel_in_the_mirror_is_the_image(more: str) -> None:
    """As is a tyre of the right side on a wheel that is drawn there."""
    drawn = PAIR.replace("y: 0.5", "y: -0.5").replace("toe: 0.03, camber: 0.02", "toe: -0.03, camber: -0.02, TYRESIDE: -1")
    texts = (PAIR % (more, ""), PAIR % (more, ", mirror: y"), drawn % (more, ""))
    left, *others = (run(read_model_text(text, "m.yaml", folder=DATA)) for text in texts)
    assert np.abs(left["cart.y"]).max() > 0.5
    for right in others:
        for name in left:
            sign = 1 if name in ("t", "cart.x") else -1
            assert right[name] == pytest.approx(sign * left[name], rel=1e-9, abs=1e-9)
