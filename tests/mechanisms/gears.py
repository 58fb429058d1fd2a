"""Geared mechanisms side by side in one model, each with its motion from equations by hand, which SciPy integrates.

* A rack with a pendulum on it drives a pinion, which turns many times.
* A planetary train with a heavy arm: the planet, whose centre of mass is off its axis, rolls in a fixed ring and drives the sun.
* A differential: two wheels turn about the axis of a housing that swings, and a spider between them turns them opposite ways.
* A guided wheel drives another one, which carries a pendulum on its rim.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
G = 9.81

TEXT = """
cutjoint: 1
name: gears
gravity: [0, 0, -9.81]
bodies:
  wheel: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.01, 0.02]}
  bar: {mass: 3, centre_of_mass: [0, 0, 0.1], inertia: [0.05, 0.06, 0.03]}
  bob: {mass: 1, centre_of_mass: [0, 0, -0.5], inertia: [0.01, 0.012, 0.008]}
  arm: {mass: 1.5, centre_of_mass: [0.1, 2, 0], inertia: [0.02, 0.03, 0.02]}
  planet: {mass: 0.8, centre_of_mass: [0.25, 2, 0], inertia: [0.004, 0.005, 0.004]}
  sun: {mass: 1, centre_of_mass: [0, 2, 0], inertia: [0.003, 0.004, 0.003]}
  housing: {mass: 4, centre_of_mass: [0, 4, -0.2], inertia: [0.08, 0.07, 0.06]}
  spider: {mass: 0.5, centre_of_mass: [0, 4, 0], inertia: [0.002, 0.002, 0.003]}
  left: {mass: 1, centre_of_mass: [-0.3, 4, 0], inertia: [0.02, 0.012, 0.012]}
  right: {mass: 1, centre_of_mass: [0.3, 4, 0], inertia: [0.03, 0.017, 0.017]}
  crank: {mass: 1, centre_of_mass: [0, 6, 0], inertia: [0.01, 0.01, 0.01]}
  disc: {mass: 1, centre_of_mass: [0.5, 6, 0], inertia: [0.01, 0.02, 0.01]}
  pendulum: {mass: 0.7, centre_of_mass: [0.65, 6, -0.4], inertia: [0.01, 0.015, 0.01]}
joints:
  pinion: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 1, 0]}
  rack: {kind: prismatic, bodies: [ground, bar], at: [0, 0, 0.1], axis: [1, 0, 0]}
  hinge: {kind: revolute, bodies: [bar, bob], at: [0, 0, 0.1], axis: [0, 1, 0]}
  carrier: {kind: revolute, bodies: [ground, arm], at: [0, 2, 0], axis: [0, 1, 0]}
  planet_pin: {kind: revolute, bodies: [arm, planet], at: [0.2, 2, 0], axis: [0, 1, 0]}
  sun_pin: {kind: revolute, bodies: [sun, arm], at: [0, 2, 0], axis: [0, -1, 0]}
  swing: {kind: revolute, bodies: [ground, housing], at: [0, 4, 0], axis: [1, 0, 0]}
  spider_pin: {kind: revolute, bodies: [housing, spider], at: [0, 4, 0], axis: [0, 0, 1]}
  left_pin: {kind: revolute, bodies: [housing, left], at: [-0.3, 4, 0], axis: [1, 0, 0], spring: {stiffness: 2}}
  right_pin: {kind: cylindrical, bodies: [housing, right], at: [0.3, 4, 0], axis: [1, 0, 0],
              spring: {stiffness: 100, damping: 1, coordinate: displacement}}
  drive: {kind: revolute, bodies: [ground, crank], at: [0, 6, 0], axis: [0, 1, 0], guide: "0.5*sin(3*t)"}
  driven: {kind: revolute, bodies: [ground, disc], at: [0.5, 6, 0], axis: [0, 1, 0]}
  rim: {kind: revolute, bodies: [disc, pendulum], at: [0.65, 6, 0], axis: [0, 1, 0]}
gears:
  mesh: {joints: [rack, pinion], ratio: 0.1 m/rad}
  ring: {joints: [planet_pin, carrier], ratio: -60/18}
  sun_mesh: {joints: [sun_pin.angle, planet_pin.angle], ratio: -18/24}
  left_mesh: {joints: [left_pin, spider_pin], ratio: 1}
  right_mesh: {joints: [right_pin.angle, spider_pin], ratio: -1}
  wheels: {joints: [driven, drive], ratio: -1.5}
outputs: [pinion.angle, rack.displacement, hinge.angle, carrier.angle, planet_pin.angle, sun_pin.angle, swing.angle, left_pin.angle,
          right_pin.angle, right_pin.displacement, spider_pin.angle, driven.angle, rim.angle, mesh.force]
scenes:
  run:
    end: 2
    output_step: 0.05
    positions: {hinge.angle: 60 deg, swing.angle: 40 deg, left_pin.angle: 0.5}
    rates: {rack.displacement_rate: 2.5, carrier.angle_rate: 3}
    numerics: {solver_tolerance: 1e-10, dt: 1 ms}
"""

End = Mapping[str, Array]


def motion(t: Array) -> dict[str, Array]:
    """The columns of the model's outputs at the times of its run."""
    return {**_rack(t), **_planetary(t), **_differential(t), **_guided(t), "right_pin.displacement": 0 * t}


def _solved(rate: Callable[[float, Array], list[float]], start: list[float], t: Array) -> Array:
    return np.asarray(solve_ivp(rate, (0.0, t[-1]), start, t_eval=t, method="DOP853", rtol=1e-12, atol=1e-13).y)


def _rack(t: Array) -> dict[str, Array]:
    """Displacement x and the pendulum's angle; the pinion adds its inertia by the square of its turns a metre."""
    length, m, inertia, total = 0.6, 1.0, 0.012, 3 + 1 + 0.01 / 0.1**2

    def rate(_: float, y: Array) -> list[float]:
        _, a, v, w = y
        M = np.array([[total, -m * length * np.cos(a)], [-m * length * np.cos(a), m * length**2 + inertia]])
        return [v, w, *np.linalg.solve(M, [-m * length * np.sin(a) * w**2, -m * G * length * np.sin(a)])]

    # the pendulum and the bar with the pinion start with the impulse that gives the rack its speed
    y = _solved(rate, [0.0, np.pi / 3, 2.5, 0.0], t)
    force = np.array([0.01 / 0.1**2 * rate(0.0, column)[2] for column in y.T])
    return {"rack.displacement": y[0], "pinion.angle": y[0] / 0.1, "hinge.angle": y[1], "mesh.force": -force}


def _planetary(t: Array) -> dict[str, Array]:
    """The arm's angle a: planet and sun turn by k_p a and k_s a beside it."""
    k_p, k_s, R, e, m = -60 / 18, 18 / 24 * 60 / 18, 0.2, 0.05, 0.8
    constant = 0.03 + 1.5 * 0.1**2 + 0.004 * (1 + k_s) ** 2 + 0.005 * (1 + k_p) ** 2 + m * (R**2 + (e * (1 + k_p)) ** 2)
    mixed = 2 * m * R * e * (1 + k_p)

    def rate(_: float, y: Array) -> list[float]:
        a, w = y
        M, half_slope = constant + mixed * np.cos(k_p * a), -mixed * k_p * np.sin(k_p * a) / 2
        weight = -G * (1.5 * 0.1 * np.cos(a) + m * R * np.cos(a) + m * e * (1 + k_p) * np.cos((1 + k_p) * a))
        return [w, (-half_slope * w**2 - weight) / M]

    y = _solved(rate, [0.0, 3.0], t)
    return {"carrier.angle": y[0], "planet_pin.angle": k_p * y[0], "sun_pin.angle": k_s * y[0]}


def _differential(t: Array) -> dict[str, Array]:
    """The housing's angle h, and the spider's s."""
    M = np.array([[0.08 + 4 * 0.2**2 + 0.002 + 0.02 + 0.03, 0.02 - 0.03], [0.02 - 0.03, 0.003 + 0.02 + 0.03]])

    def rate(_: float, y: Array) -> list[float]:
        h, s = y[:2]
        return [*y[2:], *np.linalg.solve(M, [-4 * G * 0.2 * np.sin(h), -2 * s])]

    y = _solved(rate, [np.deg2rad(40), 0.5, 0.0, 0.0], t)
    return {"swing.angle": y[0], "left_pin.angle": y[1], "spider_pin.angle": y[1], "right_pin.angle": -y[1]}


def _guided(t: Array) -> dict[str, Array]:
    """The pendulum's absolute angle c, on a rim that turns by b."""
    radius, length, m, inertia = 0.15, 0.4, 0.7, 0.015

    def turn(t: float | Array) -> tuple[float | Array, ...]:
        return -0.75 * np.sin(3 * t), -2.25 * np.cos(3 * t), 6.75 * np.sin(3 * t)

    def rate(t: float, y: Array) -> list[float]:
        c, w = y
        b, v, a = turn(t)
        external_wrenches = radius * np.array([-np.sin(b) * a - np.cos(b) * v**2, -np.cos(b) * a + np.sin(b) * v**2])
        arm = length * np.array([-np.cos(c), np.sin(c)])
        return [w, -m * (external_wrenches @ arm + G * length * np.sin(c)) / (m * length**2 + inertia)]

    y = _solved(rate, [0.0, turn(0.0)[1]], t)
    return {"driven.angle": turn(t)[0], "rim.angle": y[0] - turn(t)[0]}
