"""A wheel of the library makes no energy: its torque is the force times the rolling radius, and all that slips loses."""

from __future__ import annotations

import re
from functools import cache
from itertools import product

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from tests.physics.simulation import compile_scene, completed, simulate

RADIUS = 0.3
_READ = ("Fx", "Fy", "Fz", "My", "Mz", "vx", "vy", "spin", "camber", "loaded_radius")
#: A wheel whose carrier follows a prescribed path; its spin alone is free.
BENCH = """
cutjoint: 1
name: bench
gravity: [0, 0, 0]
parameters:
  speed: {value: 10, binding: param}
  drift: {value: 0, binding: param}
  lean: {value: 0, binding: param}
  sunk: {value: 0.02, binding: param}
  torque: {value: 0, binding: param}
bodies:
  slide: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  cross: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  hub: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
joints:
  ahead: {kind: prismatic, bodies: [ground, slide], at: [0, 0, 0.3], axis: x, guide: speed*t}
  aside: {kind: prismatic, bodies: [slide, cross], at: [0, 0, 0.3], axis: y, guide: drift*t}
  press: {kind: prismatic, bodies: [cross, hub], at: [0, 0, 0.3], axis: z, guide: -sunk}
submodels: {wheel: {include: library/wheel_brush}}
instances:
  w:
    use: wheel
    connect: {carrier: hub}
    with:
      {x: 0, y: 0, z: 0.3, radius: 0.3, mass: 20, spin_inertia: 1, cross_inertia: 0.5, stiffness: 2e5, slip_stiffness: 1e5,
       cornering_stiffness: 5e4, drive: torque, camber: lean, linear: LINEAR}
outputs: [OUTPUTS]
scenes: {roll: {end: 1.5, output_step: 0.5}}
"""


@cache
def bench(linear: int) -> Artifact:
    outputs = ", ".join(f"w.rolling.contact.{name}" for name in _READ)
    model = read_model_text(BENCH.replace("LINEAR", str(linear)).replace("OUTPUTS", outputs), "bench.yaml")
    return compile_scene(model, find_scene(model, None), CompileOptions(method="recursive-newton"))


def of(run: Trajectory, name: str) -> np.ndarray:
    return np.asarray(run[f"w.rolling.contact.{name}"])


def power(run: Trajectory) -> np.ndarray:
    """Of the road's force and moment on the wheel, which turns about its axis alone, where the carrier goes straight."""
    at, lean, spin = of(run, "loaded_radius"), of(run, "camber"), of(run, "spin")
    turning = of(run, "My") * np.cos(lean) + of(run, "Mz") * np.sin(lean) - at * of(run, "Fx")
    return np.asarray(of(run, "Fx") * of(run, "vx") + of(run, "Fy") * of(run, "vy") + turning * spin)


@pytest.mark.parametrize(("linear", "speed"), [(0, 10.0), (0, -10.0), (1, 10.0)])
def test_a_tyre_never_makes_energy(linear: int, speed: float) -> None:
    for torque, drift, lean, sunk in product((-300.0, 0.0, 300.0), (0.0, 0.5), (0.0, 0.1), (0.01, 0.03)):
        given = {"speed": speed, "torque": torque, "drift": drift, "lean": lean, "sunk": sunk}
        run = completed(simulate(bench(linear), error=False, parameters=given))
        assert power(run)[-1] <= 1e-9, given
        assert of(run, "Fx")[-1] == pytest.approx(torque / RADIUS, abs=1e-4), given  # force times rolling radius


#: Constants of the Calspan tyre of the Iltis.
CALSPAN = {
    "A0": 2625, "A1": 14.47, "A2": 12930, "A3": 2.29, "A4": 18175, "B1": -4.64e-5, "B3": 1.216, "B4": 2.18e-11, "SN": 1.0274,
    "AF1": -1.71e-5, "AF2": 1.71e-5,
}  # fmt: skip
#: Its words in a file, and a force in place of the wheel whose own has no spin.
TURNING = ", ".join(f"{name}: {value}" for name, value in CALSPAN.items())
STANDING = f"""forces:
  t: {{kind: tyre, body: hub, centre: [0, 0, 0.3], axis: [0, cos(lean), -sin(lean)], radius: 0.3, stiffness: 2e5, calspan: {{{TURNING}}}}}
outputs: [t.Fy, t.slip, t.Fz]"""


def thrust(load: float, lean: float, speed: float) -> float:
    """The largest power of a thrust D = -(C a + G g) along a slip a under it, v (G g)^2/(4 C), tan(a) by a beside."""
    C = CALSPAN["A0"] + CALSPAN["A1"] * load * (1 - load / CALSPAN["A2"])
    most = CALSPAN["A3"] * (1 - load / CALSPAN["A4"]) * load * abs(lean)
    return abs(speed) * most**2 / (4 * C) * (1 + (most / C) ** 2)


@cache
def calspan(turning: bool) -> Artifact:
    text = BENCH.replace("OUTPUTS", ", ".join(f"w.rolling.contact.{name}" for name in _READ))
    if turning:
        text = text.replace("wheel_brush", "wheel_calspan").replace("w.rolling", "w").replace("cornering_stiffness: 5e4", TURNING)
        text = text.replace(", linear: LINEAR", "")
    else:
        text = re.sub(r"submodels:.*outputs: \[[^]]*\]", STANDING, text, flags=re.DOTALL)
        text = text.replace("  torque: {value: 0, binding: param}\n", "")
    model = read_model_text(text, "bench.yaml")
    return compile_scene(model, find_scene(model, None), CompileOptions(method="recursive-newton" if turning else "recursive"))


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_a_driven_calspan_wheel_makes_no_energy_but_by_its_thrust_of_camber(speed: float) -> None:
    for torque, drift, lean, sunk in product((-300.0, 0.0, 300.0), (0.0, 0.05, 0.5), (0.0, 0.1), (0.01, 0.03)):
        given = {"speed": speed, "torque": torque, "drift": drift, "lean": lean, "sunk": sunk}
        run = completed(simulate(calspan(True), error=False, parameters=given)).columns
        read = {name: run[f"w.contact.{name}"][-1] for name in _READ}
        turning = read["My"] * np.cos(read["camber"]) + read["Mz"] * np.sin(read["camber"]) - read["loaded_radius"] * read["Fx"]
        made = read["Fx"] * read["vx"] + read["Fy"] * read["vy"] + turning * read["spin"]
        assert made <= thrust(read["Fz"], lean, speed) + 1e-9, given
        assert read["Fx"] == pytest.approx(torque / RADIUS, abs=1e-3), given


@pytest.mark.parametrize("lean", [0.0, 0.1])
def test_a_tyre_without_spin_makes_no_energy_but_by_its_thrust_of_camber(lean: float) -> None:
    """At 10 m/s, 4 kN and 0.1 rad at most 30 W, of 40 kW of load times speed; the largest is nearly met."""
    made, most = [], thrust(4000, lean, 10)
    for slip in np.linspace(-0.03, 0.03, 13):
        given = {"speed": 10.0, "drift": 10 * slip, "lean": lean, "sunk": 0.02}
        run = completed(simulate(calspan(False), error=False, parameters=given)).columns
        made.append(run["t.Fy"][-1] * 10 * slip)
    assert max(made) <= most + 1e-9
    assert max(made) >= 0.9 * most
    assert not lean or most == pytest.approx(29.9, abs=0.2)


MAGIC_FORMULA = """wheel_mf62}}
instances:
  w:
    use: wheel
    connect: {carrier: hub}
    with: {x: 0, y: 0, z: 0.3, MASS: 20, drive: torque, camber: lean, lossless: LINEAR}
    properties: library/road_tyre.tir
outputs"""


@pytest.mark.parametrize("lossless", [0, 1])
def test_check_reports_the_power_that_a_file_makes(lossless: int) -> None:
    text = re.sub(r"wheel_brush\}.*outputs", MAGIC_FORMULA, BENCH, flags=re.DOTALL).replace("LINEAR", str(lossless))
    found = re.findall(r"the tyre gains (\S+) %", " ".join(read_model_text(text.replace("OUTPUTS", "hub.x"), "m.yaml").notes))
    sinking = 4000 / 210000
    loaded, rolling = 0.316 - sinking, 0.316 - sinking * (0.25 * np.arctan(8) + 0.07)
    assert [float(x) for x in found] == ([] if lossless else [pytest.approx(100 * (1 - loaded / rolling), rel=0.02)])
