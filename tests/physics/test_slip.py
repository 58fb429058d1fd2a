"""Slip that is prescribed: the brush tyre beside an integral over its patch, and slip of the moment beside that of the relaxed patch."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cutjoint.model.read import read_model_text
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene, completed
from tests.physics.test_wheels import DATA, LEVEL, corner

#: A wheel on a sled and a carrier, at 10 m/s and a given spin; it is turned by its toe.
RIG = """
cutjoint: 1
name: rig
gravity: [0, 0, -9.81]
bodies:
  sled: {{mass: 20, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}}
  carrier: {{mass: 330, centre_of_mass: [0, 0, 0.3], inertia: [5, 8, 6]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, sled], at: [0, 0, 0.3], axis: x}}
  lift: {{kind: prismatic, bodies: [sled, carrier], at: [0, 0, 0.3], axis: z}}
forces: {{damper: {{kind: joint_force, joint: lift, law: -9000*rate}}}}
submodels: {{wheel: {{include: library/{wheel}}}}}
instances:
  w: {{use: wheel, connect: {{carrier: carrier}}, with: {{x: 0, y: 0, z: 0.3, toe: {toe}, {given}}}{file}}}
outputs: [{outputs}]
scenes:
  run: {{end: {end}, output_step: 0.01, pose: equilibrium, states: {{w.rolling.rolled: 1}},
        drive: {{slide: 10*t, w.rolling.bearing: {spin}*t}}}}
"""
BRUSH = (
    "radius: 0.3, mass: 20, spin_inertia: 1, cross_inertia: 0.6, stiffness: 2e5, slip_stiffness: 8e4, cornering_stiffness: 5e4, "
    "friction: 0.9"
)
OUTPUTS = ", ".join(f"w.rolling.contact.{name}" for name in ("Fx", "Fy", "Fz", "Mz", "spin", "vx", "vy"))


def rolled(wheel: str, given: str, *, toe: float, spin: float, end: float = 1.0, file: str = "") -> Trajectory:
    text = RIG.format(outputs=OUTPUTS, wheel=wheel, given=given, toe=toe, spin=spin, end=end, file=file)
    model, scene = find_case(read_model_text(text, "m.yaml", folder=DATA), "run")
    return completed(simulate(compile_scene(model, scene), integrator="dormand-prince", tolerance=1e-8, error=False))


def over_the_patch(along: float, across: float, load: float, half: float = 0.06) -> tuple[float, float, float]:
    """Forces and moment of bristles that are bent from the front on, and slide where friction on a parabola of pressure is less."""
    x = half * (1 - 2 * (np.arange(200_000) + 0.5) / 200_000)
    width = 2 * half / len(x)
    bent = np.array([8e4 * along, -5e4 * across])[:, None] * (half - x) / (2 * half**2)
    limit, size = 0.9 * 0.75 * load / half * (1 - (x / half) ** 2), np.hypot(*bent)
    held = bent * np.minimum(1, limit / np.maximum(size, 1e-30))
    return float(held[0].sum() * width), float(held[1].sum() * width), float((x * held[1]).sum() * width)


@pytest.mark.parametrize(("toe", "spin"), [(0.02, 33.4), (-0.05, 32.5), (0.0, 35.0), (0.3, 30.0), (0.1, 33.3)])
@pytest.mark.parametrize("steady", [0, 1])
def test_a_brush_tyre(toe: float, spin: float, steady: int) -> None:
    """Within and beyond the slip at which all of it slides."""
    run = rolled("wheel_brush", f"{BRUSH}, steady: {steady}", toe=toe, spin=spin)
    end = {name.rpartition(".")[2]: run[name][-1] for name in run}
    slip, angle = (0.3 * end["spin"] - end["vx"]) / end["vx"], end["vy"] / end["vx"]
    assert (end["Fx"], end["Fy"], end["Mz"]) == pytest.approx(over_the_patch(slip, angle, end["Fz"]), rel=1e-5, abs=0.05)


def test_a_linear_tyre() -> None:
    run = rolled("wheel_brush", f"{BRUSH}, linear: 1", toe=0.2, spin=36.0)
    end = {name.rpartition(".")[2]: run[name][-1] for name in run}
    assert end["Fx"] == pytest.approx(8e4 * (0.3 * end["spin"] - end["vx"]) / end["vx"], rel=1e-6)
    assert end["Fy"] == pytest.approx(-5e4 * end["vy"] / end["vx"], rel=1e-6)


@pytest.mark.parametrize(("kind", "more"), [("52", ", MASS: 20, IXX: 0.6, IYY: 1"), ("62", "")])
def test_slip_of_the_moment_is_that_of_a_patch_in_the_end(kind: str, more: str) -> None:
    """It has at once what the relaxed patch comes to."""
    at_once, later = (
        rolled(f"wheel_mf{kind}", f"steady: {steady}{more}", toe=0.03, spin=34.0, file=f", properties: mf{kind}.tir") for steady in (1, 0)
    )
    for name in ("Fx", "Fy", "Mz"):
        column = f"w.rolling.contact.{name}"
        assert at_once[column][-1] == pytest.approx(later[column][-1], rel=1e-5)
        assert abs(later[column][0]) < 0.5 * abs(later[column][-1])
        assert at_once[column][0] == pytest.approx(at_once[column][-1], rel=0.2)


def test_the_warning_of_slip_of_the_moment_has_the_largest_step() -> None:
    """Explicit steps at 1 m/s are smooth up to it, and rough at twice as much."""
    scene = "end: 0.3, output_step: 0.002, rates: {slide.displacement_rate: 1, w.rolling.bearing.angle_rate: 1/0.3}, inputs: {brake: 20}"
    model = corner("62", LEVEL, f"{scene}, states: {{w.rolling.rolled: 1}}", ", steady: 1")
    most = float(re.search(r"steps of (\S+) s at most", " ".join(model.notes))[1])  # type: ignore[index]
    artifact = compile_scene(model, model.scenes["run"])
    for share, smooth in ((1, True), (2, False)):
        force = completed(simulate(artifact, error=False, integrator="rk4", dt=share * most))["w.rolling.contact.Fx"][50:]
        assert bool(np.abs(np.diff(force, 2)).max() < 0.1) is smooth


SPUN = """
cutjoint: 1
name: spun
gravity: [0, 0, -9.81]
parameters: {moment: {value: 0, unit: N*m, binding: input}}
bodies:
  sled: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
  knuckle: {mass: 330, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
joints:
  along: {kind: prismatic, bodies: [ground, sled], at: [0, 0, 0.3], axis: x}
  up: {kind: prismatic, bodies: [sled, knuckle], at: [0, 0, 0.3], axis: z}
submodels: {wheel: {include: library/wheel_mf62}}
instances: {w: {use: wheel, connect: {carrier: knuckle}, with: {x: 0, y: 0, z: 0.3, WHAT: moment}, properties: library/road_tyre.tir}}
outputs: [sled.vx, w.rolling.contact.spin, w.rolling.contact.Fx, w.rolling.slides_x.value]
scenes:
  s:
    end: 1.4
    output_step: 0.001
    pose: equilibrium
    positions: {along.displacement: 0}
    rates: {along.displacement_rate: SPEED, w.rolling.bearing.angle_rate: SPEED/0.31}
    states: {w.rolling.rolled: 1}
    inputs: {moment: {table: {t: [0, 0.2, 0.201, LAST, AFTER, 9], value: [0, 0, LARGEST, LARGEST, 0, 0]}, interpolation: linear}}
    numerics: {events: crossed}
"""


@pytest.mark.parametrize(("what", "speed", "last", "largest"), [("drive", 4, 0.35, 1200), ("brake", 20, 0.7, 2500)])
def test_a_wheel_that_has_slid_rolls_on(what: str, speed: int, last: float, largest: int) -> None:
    """A wheel that has spun, or locked, and is let go: the shear of its tread does not turn it past where it rolls, nor back."""
    text = SPUN
    for name, value in (("WHAT", what), ("SPEED", speed), ("LAST", last), ("AFTER", last + 0.001), ("LARGEST", largest)):
        text = text.replace(name, str(value))
    model = read_model_text(text, "m.yaml")
    run = completed(simulate(compile_scene(model, model.scenes["s"])))
    power = run["w.rolling.contact.Fx"] * run["w.rolling.slides_x.value"]
    lost, given = (np.trapezoid(np.maximum(sign * power, 0), run.t) for sign in (-1, 1))
    assert given < 0.02 * lost
    after = run.t > last + 0.1
    rolls = run["sled.vx"][after] / 0.31
    assert np.abs(run["w.rolling.contact.spin"][after] - rolls).max() < 0.6 * rolls.max()
