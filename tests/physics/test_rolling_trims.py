"""Trims of wheels that roll without torque, by the formulas of their files."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint import find_trim, read_model_text
from tests.conftest import DATA, with_heavy

G = 9.81

ROLLING = """
cutjoint: 1
name: rolls
gravity: [0, 0, -9.81]
parameters: {speed: {value: 15, unit: m/s, binding: param}, pull: {value: 0, unit: N, binding: input}}
bodies:
  sledge: {mass: 1, centre_of_mass: [0, 0, 0.31]}
  carrier: {mass: 350, centre_of_mass: [0, 0, 0.31], inertia: [1, 1, 1]}
joints:
  drives: {kind: prismatic, bodies: [ground, sledge], at: [0, 0, 0.31], axis: x}
  heave: {kind: prismatic, bodies: [sledge, carrier], at: [0, 0, 0.31], axis: z}
forces: {tow: {kind: load, body: sledge, at: [0, 0, 0.31], force: [pull, 0, 0]}}
submodels: {wheel: {include: library/wheel_KIND}}
instances:
  w: {use: wheel, connect: {carrier: carrier}, with: {x: 0, y: 0, z: 0.31, MASS: 10, IXX: 1, IYY: 1.5}, properties: FILE}
"""

GUIDED = "scenes: {run: {end: 1, trim: {find: [w.rolling.bearing.angle_rate]}}}"

FREE = """
scenes:
  run:
    end: 1
    positions: {drives.displacement: 0}
    rates: {drives.displacement_rate: speed}
    trim: {find: [pull, w.rolling.bearing.angle_rate]}
"""

#: By kind of wheel: R0, Fz0, Cz, breff, dreff, freff, QSY1 to 4 and the reference speed of its file.
TYRES = {
    "mf52": ("mf52.tir", (0.3168, 4230, 198064.21298115156, 8.15, 0.262, 0.0731, 0.0107, -0.00213, 0.00083, 4.1e-5, 16.4)),
    "mf62": ("library/road_tyre.tir", (0.316, 4000, 210000, 8, 0.25, 0.07, 0.01, 0, 0, 0, 16.7)),
}

HEAVY = (("mf52", -20.0), ("mf62", 40.0), ("mf62", 0.0))


@pytest.mark.parametrize(("kind", "v"), with_heavy([("mf52", 15.0), ("mf62", -0.5), *HEAVY], *HEAVY))
def test_a_wheel_without_torque_rolls(kind: str, v: float) -> None:
    """By the formulas of effective radius and rolling resistance (Pacejka, Tyre and Vehicle Dynamics, 2012, 4.E); at 0 m/s it stands."""
    file, (R0, Fz0, Cz, breff, dreff, freff, q1, q2, q3, q4, v0) = TYRES[kind]
    free, guided = (
        read_model_text(text.replace("KIND", kind).replace("FILE", file), "m.yaml", folder=DATA / "tyres")
        for text in (ROLLING + FREE, ROLLING.replace("axis: x}", "axis: x, guide: speed*t}") + GUIDED)
    )
    found = find_trim(guided, parameters={"speed": v})
    Fz, way = 360 * G, np.sign(v)
    Re = R0 - Fz0 / Cz * (dreff * np.arctan(breff * Fz / Fz0) + freff * Fz / Fz0)
    assert found.unknowns["w.rolling.bearing.angle_rate"] == pytest.approx(v / Re, rel=2e-3, abs=1e-12)
    assert found.states["w.rolling.rolled.value"] == pytest.approx(way, abs=1e-6)
    if v:
        pulled = find_trim(free, parameters={"speed": v})
        q = q1 + q3 * abs(v) / v0 + q4 * (v / v0) ** 4
        assert pulled.unknowns["pull"] == pytest.approx(way * R0 * Fz * q / (R0 - Fz / Cz + way * R0 * Fz / Fz0 * q2), rel=1e-6)
        assert found.states == pytest.approx(dict(pulled.states), rel=1e-6, abs=1e-9)
