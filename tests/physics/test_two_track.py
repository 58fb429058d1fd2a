"""A car on four wheels that turn, by the library's contact patch and a brush tyre, beside a planar two-track model in NumPy.

The two-track model has the car's motion in the plane, four spins and eight shears; its loads are given, or those of a body that neither
rolls nor pitches.  Steady turns are compared with the closed forms of the single-track model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from tests.conftest import with_heavy
from tests.physics.simulation import compile_scene, completed

G, FRONT, REAR, HALF = 9.81, 1.2, 1.5, 0.75
WHEELS = {"fl": (FRONT, HALF), "fr": (FRONT, -HALF), "rl": (-REAR, HALF), "rr": (-REAR, -HALF)}
PLACES = np.array(list(WHEELS.values()))
BODY, KNUCKLE, WHEEL = 1200.0, 8.0, 20.0
YAW_INERTIA, KNUCKLE_INERTIA, CROSS, SPIN = 1800.0, 0.2, 0.6, 1.0
RADIUS, CENTRE, ROLLING, HEIGHT = 0.3, 0.29, 0.295, 0.5
SIGMA_X, SIGMA_Y, TRAIL, RESISTANCE, MU = 0.25, 0.4, 0.02, 0.01, 0.9
SPEED = 20.0

TYRE = f"""
  corner:
    connectors: [carrier]
    parameters: [x, y, load, pressed, damped, brake]
    submodels: {{rolling: {{include: library/rolling_wheel}}}}
    instances:
      on:
        use: rolling
        connect: {{carrier: carrier}}
        with:
          {{x: x, y: y, z: {CENTRE}, radius: {RADIUS}, mass: {WHEEL}, spin_inertia: {SPIN}, cross_inertia: {CROSS}, load: N,
           Fx: Cx*on.kappa*grip, Fy: -Cy*tan(on.alpha)*grip, Mx: 0, My: -resistance*{RADIUS}*N, Mz: {TRAIL}*Cy*tan(on.alpha)*grip,
           K_x: Cx, K_y: Cy, stiff_x: Cx/{SIGMA_X}, stiff_y: Cy/{SIGMA_Y}, stands_on: {ROLLING},
           sigma_x: {SIGMA_X}, sigma_y: {SIGMA_Y}, theta_x: Cx/(3*mu*N), theta_y: Cy/(3*mu*N), rolling_radius: {ROLLING},
           brake: brake, drive: 0, toe: 0, camber: 0}}
    signals:
      N: max(load + pressed*on.contact.deflection + damped*on.contact.deflection_rate, 1)
      Cx: 25*N*(1 - N/15000)
      Cy: 20*N*(1 - N/15000)
      share: sqrt((Cx*on.kappa)**2 + (Cy*tan(on.alpha))**2 + 1e-12)/(3*mu*N)
      grip: where(share < 1, 1 - share + share**2/3, 1/(3*share))
"""


def instance(name: str, load: str) -> str:
    carrier = f"knuckle_{name}" if name[0] == "f" else "chassis"
    x, y = WHEELS[name]
    return f"  {name}: {{use: corner, connect: {{carrier: {carrier}}}, with: {{x: {x}, y: {y}, {load}, brake: brake_{name[0]}}}}}"


def car(
    loads: Callable[[str], str], joint: str, scene: str, *, speed: float = SPEED, mu: float = MU, resistance: float = RESISTANCE
) -> str:
    """A model file with a tyre's load on each wheel, the chassis' joint and a scene that begins at a speed (m/s)."""
    x = (2 * (KNUCKLE + WHEEL) * FRONT - 2 * WHEEL * REAR) / -BODY  # the centre of all masses is at 0
    steered = {name: [*place, CENTRE] for name, place in WHEELS.items() if name[0] == "f"}
    knuckles = "\n".join(
        f"  knuckle_{name}: {{mass: {KNUCKLE}, centre_of_mass: {place}, inertia: [0.1, 0.1, {KNUCKLE_INERTIA}]}}"
        for name, place in steered.items()
    )
    turns = "\n".join(
        f"  steer_{name}: {{kind: revolute, bodies: [chassis, knuckle_{name}], at: {place}, axis: z}}" for name, place in steered.items()
    )
    rates = ", ".join(f"{name}.on.bearing.angle_rate: {speed / ROLLING!r}" for name in WHEELS)
    states = ", ".join(f"{name}.on.{state}: 1" for name in WHEELS for state in ("rolled", "held"))
    names = ", ".join(f"{name}.on.contact.{what}" for name in WHEELS for what in ("Fy", "spin", "vx"))
    return f"""
cutjoint: 1
name: car
gravity: [0, 0, -{G}]
parameters:
  mu: {{value: {mu}, binding: param}}
  resistance: {{value: {resistance}, binding: param}}
  brake_f: {{value: 0, unit: N*m, binding: input}}
  brake_r: {{value: 0, unit: N*m, binding: input}}
markers: {{middle: {{body: chassis, at: [0, 0, {HEIGHT}]}}}}
bodies:
  chassis: {{mass: {BODY}, centre_of_mass: [{x!r}, 0, {HEIGHT}], inertia: [400, 1600, {YAW_INERTIA}]}}
{knuckles}
joints:
  moves: {joint}
{turns}
submodels:{TYRE}
instances:
{chr(10).join(instance(name, loads(name)) for name in WHEELS)}
outputs: [middle.x, middle.y, chassis.yaw, chassis.wz, {names}]
scenes:
  run:
    {{{scene}, rates: {{moves.{f"displacement_2_rate: {-speed}" if "planar" in joint else f"vx: {speed}"}, {rates}}}, states: {{{states}}}}}
"""


@dataclass(frozen=True, kw_only=True)
class TwoTrack:
    """The planar model, with loads (N, one a wheel) that are given, or by the accelerations of a rigid body."""

    steer: Callable[[float], float] = lambda t: 0.0
    brakes: Callable[[float], tuple[float, float]] = lambda t: (0.0, 0.0)
    loads: np.ndarray | None = None
    level: float = CENTRE
    drift: float = 1e-4
    offset: float = field(default=(2 * (KNUCKLE + WHEEL) * FRONT - 2 * WHEEL * REAR) / -BODY)

    def mass(self) -> float:
        return BODY + 2 * KNUCKLE + 4 * WHEEL

    def steered(self, t: float) -> tuple[float, float, float]:
        """The steer angle with its rates, by differences of the law."""
        before, now, after = (self.steer(t + k * self.drift) for k in (-1, 0, 1))
        return now, (after - before) / (2 * self.drift), (after - 2 * now + before) / self.drift**2

    def forces(self, t: float, y: np.ndarray, loads: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rates of the shears, and forces along and across each wheel."""
        u, v, r = y[3:6]
        spin, sx, sy = y[6:].reshape(3, 4)
        angle = np.array([1, 1, 0, 0]) * self.steered(t)[0]
        vx0, vy0 = u - r * PLACES[:, 1], v + r * PLACES[:, 0]
        vx, vy = np.cos(angle) * vx0 + np.sin(angle) * vy0, np.cos(angle) * vy0 - np.sin(angle) * vx0
        rolls = ROLLING * spin
        carried = np.maximum(np.maximum(np.abs(vx), np.abs(rolls) / 2), np.abs(vy))
        dx, dy = rolls - vx - carried * sx / SIGMA_X, vy - carried * sy / SIGMA_Y
        kappa, slip = sx / SIGMA_X, sy / SIGMA_Y  # the tread's damping fades with speed, here to 1e-7 of that at rest
        cx, cy = (c * loads * (1 - loads / 15000) for c in (25, 20))
        share = np.hypot(cx * kappa, cy * slip) / (3 * MU * loads)
        grip = np.where(share < 1, 1 - share + share**2 / 3, 1 / np.maximum(3 * share, 1e-9))
        shorter = np.clip(9 * share**2, 1, 9)  # the path by which a patch follows that slides
        return shorter * dx, shorter * dy, cx * kappa * grip, -cy * slip * grip

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        u, v, r = y[3:6]
        angle, turn, turns = self.steered(t)
        angles = np.array([1, 1, 0, 0]) * angle
        c, s = np.cos(angles), np.sin(angles)
        brakes = np.repeat(self.brakes(t), 2)
        loads = np.full(4, self.mass() * G / 4) if self.loads is None else self.loads
        for _ in range(1 if self.loads is not None else 200):
            dx, dy, along, across = self.forces(t, y, loads)
            fx, fy = c * along - s * across, s * along + c * across
            spins = (-brakes - along * self.level - RESISTANCE * RADIUS * loads) / SPIN
            moment = np.sum(PLACES[:, 0] * fy - PLACES[:, 1] * fx - TRAIL * across)
            yaw = (moment - 2 * (KNUCKLE_INERTIA + CROSS) * turns) / self.inertia()
            if self.loads is not None:
                break
            found = self.rigid(y, fx, fy, spins, yaw, angles, turn, loads)
            change, loads = np.abs(found - loads).max(), found
            if change < 1e-9:
                break
        ax, ay = fx.sum() / self.mass() + r * v, fy.sum() / self.mass() - r * u
        place = [u * np.cos(y[2]) - v * np.sin(y[2]), u * np.sin(y[2]) + v * np.cos(y[2]), r]
        return np.concatenate([place, [ax, ay, yaw], spins, dx, dy])

    def inertia(self) -> float:
        """About z, of the whole."""
        wheels = np.sum((WHEEL + KNUCKLE * np.array([1, 1, 0, 0])) * (PLACES**2).sum(axis=1))
        return float(YAW_INERTIA + BODY * self.offset**2 + wheels + 4 * CROSS + 2 * KNUCKLE_INERTIA)

    def rigid(
        self, y: np.ndarray, fx: np.ndarray, fy: np.ndarray, spins: np.ndarray, yaw: float, angles: np.ndarray, turn: float,
        loads: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """Loads p + q x + s y by the balance of weight, pitch and roll about the centre of mass."""
        r, spin = y[5], y[6:10]
        others = np.array([1, 1, 0, 0]) * KNUCKLE + WHEEL
        centre = self.level + BODY * (HEIGHT - CENTRE) / self.mass()
        product = -BODY * self.offset * (HEIGHT - CENTRE + self.level - centre) - np.sum(others * PLACES[:, 0]) * (self.level - centre)
        s, c = np.sin(angles), np.cos(angles)
        turned = SPIN * spin * (r + np.array([1, 1, 0, 0]) * turn)
        roll = np.sum(-SPIN * spins * s - turned * c) + product * yaw
        pitch = np.sum(SPIN * spins * c - turned * s) + product * r**2
        resisting = -RESISTANCE * RADIUS * loads
        right = [self.mass() * G, roll - centre * fy.sum() + np.sum(resisting * s), -pitch - centre * fx.sum() + np.sum(resisting * c)]
        rows = np.array([np.ones(4), PLACES[:, 1], PLACES[:, 0]])
        basis = np.array([np.ones(4), PLACES[:, 0], PLACES[:, 1]]).T
        return np.asarray(basis @ np.linalg.solve(rows @ basis, right))

    def run(self, t: np.ndarray, breaks: tuple[float, ...] = ()) -> dict[str, np.ndarray]:
        """Place, yaw and its rate, spins at times; steps end at ``breaks``."""
        y = np.zeros(18)
        y[3], y[6:10] = SPEED, SPEED / ROLLING
        rows, ends = [], (*breaks, float(t[-1]))
        begin = 0.0
        for end in ends:
            inner = t[(t >= begin) & (t < end)] if end < t[-1] else t[t >= begin]
            found = solve_ivp(self.rates, (begin, end), y, t_eval=np.union1d(inner, [end]), rtol=1e-10, atol=1e-11, method="DOP853")
            rows.append(found.y[:, : len(inner)])
            y, begin = found.y[:, -1], end
        table = np.concatenate(rows, axis=1)
        spins = {f"{name}.on.contact.spin": table[6 + i] for i, name in enumerate(WHEELS)}
        return {"middle.x": table[0], "middle.y": table[1], "chassis.yaw": table[2], "chassis.wz": table[5], **spins}


#: Places within 0.3 s, to rest: x^3 (10 - 15 x + 6 x^2).
STEP = "0.05*min(t/0.3, 1)**3*(10 - 15*min(t/0.3, 1) + 6*min(t/0.3, 1)**2)"
OMEGA = 2 * np.pi * 0.7
DWELL = f"0.05*where(t < {0.75 / 0.7!r}, sin({OMEGA!r}*t), where(t < {0.75 / 0.7 + 0.5!r}, -1, sin({OMEGA!r}*(t - 0.5))))"
BRAKES = ", inputs: {brake_f: {table: {t: [0, 1, 1.5, 9], value: [0, 0, 500, 500]}, interpolation: linear}, brake_r: 100}"


def step(t: float) -> float:
    x = min(t / 0.3, 1.0)
    return 0.05 * x**3 * (10 - 15 * x + 6 * x**2)


def dwell(t: float) -> float:
    if t < 0.75 / 0.7:
        return float(0.05 * np.sin(OMEGA * t))
    return -0.05 if t < 0.75 / 0.7 + 0.5 else float(0.05 * np.sin(OMEGA * (t - 0.5)))


def braking(t: float) -> tuple[float, float]:
    return 500 * min(max((t - 1) / 0.5, 0.0), 1.0), 100.0


#: A manoeuvre: its steering law, its inputs, its end (s), the same in the model beside it, and the times at which a law has a kink.
MANOEUVRES: Mapping[str, tuple[str, str, float, Mapping[str, Any], tuple[float, ...]]] = {
    "step steer": (STEP, "", 2.5, {"steer": step}, (0.3,)),
    "sine with dwell": (DWELL, "", 1.9, {"steer": dwell}, (0.75 / 0.7, 0.75 / 0.7 + 0.5)),
    "braking in a turn": (STEP, BRAKES, 2.5, {"steer": step, "brakes": braking}, (0.3, 1.0, 1.5)),
}
LOADS = {"f": 4000.0, "r": 3200.0}
PLANE = "{kind: planar, bodies: [ground, chassis], at: [0, 0, 0.5], axis: z}"


def drive(text: str, tolerance: float = 1e-10) -> Trajectory:
    model, chosen = find_case(read_model_text(text, "car.yaml"), "run")
    artifact = compile_scene(model, chosen, CompileOptions(method="recursive"))
    return completed(simulate(artifact, integrator="dop853", tolerance=tolerance, error=False))


def scene(manoeuvre: str, more: str = "") -> str:
    law, inputs, end, *_ = MANOEUVRES[manoeuvre]
    return f'end: {end}, output_step: 0.05{more}, drive: {{steer_fl: "{law}", steer_fr: "{law}"}}{inputs}'


def plane(name: str) -> str:
    return f"load: {LOADS[name[0]]}, pressed: 0, damped: 0"


def deviations(found: Mapping[str, np.ndarray], expected: dict[str, np.ndarray]) -> dict[str, float]:
    """The largest differences, as shares of the largest value of each column."""
    return {name: float(np.abs(found[name] - values).max() / np.abs(values).max()) for name, values in expected.items()}


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
def test_a_car_in_the_plane(manoeuvre: str) -> None:
    """Steps of both are wrong by 1e-8; the tyres have two thirds of their friction."""
    found = drive(car(plane, PLANE, scene(manoeuvre)))
    *_, laws, breaks = MANOEUVRES[manoeuvre]
    expected = TwoTrack(loads=np.array([4000.0, 4000.0, 3200.0, 3200.0]), **laws).run(found.t, breaks)
    assert max(deviations(found, expected).values()) < 1e-7
    assert np.abs(found["fl.on.contact.Fy"]).max() > 0.5 * LOADS["f"]


FREE = "{kind: free, bodies: [ground, chassis], at: [0, 0, 0.5]}"


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
def test_a_car_on_stiff_tyres_is_the_rigid_one(manoeuvre: str) -> None:
    """Deviations from a body that neither rolls nor pitches are inverse to the stiffness, as roll, pitch and camber are: those of two
    stiffnesses lead to the limit.  Speeds have the tyres' vibrations besides."""
    runs = []
    for stiffness in (8e6, 32e6):
        load = f"load: 0, pressed: {stiffness}, damped: {0.6 * sqrt(stiffness * 330)}"
        runs.append(drive(car(lambda name, load=load: load, FREE, scene(manoeuvre, ", pose: equilibrium"))))  # type: ignore[misc]
    *_, laws, breaks = MANOEUVRES[manoeuvre]
    expected = TwoTrack(level=RADIUS, **laws).run(runs[0].t, breaks)
    limit = {name: (4 * runs[1][name] - runs[0][name]) / 3 for name in expected}
    found = deviations(limit, expected)
    assert max(found[name] for name in ("middle.x", "middle.y", "chassis.yaw")) < 1e-6
    assert max(found.values()) < 1e-5
    assert max(deviations(runs[1], expected).values()) > 1e-5  # it is the limit that is rigid


@pytest.mark.parametrize("driven", with_heavy([[10.0, 40.0], [10.0, 20.0, 30.0, 40.0]], [10.0, 20.0, 30.0, 40.0]))
def test_steady_turns_are_those_of_the_single_track_model(driven: list[float]) -> None:
    """Yaw gain V/(L + K V^2) and understeer gradient K = m/L (b/Cf - a/Cr), forces behind the wheels' centres by their trail."""
    steer, speeds, gains = 1e-4, [], []
    front, rear = (2 * 20 * load * (1 - load / 15000) for load in LOADS.values())
    base, mass = FRONT + REAR, TwoTrack().mass()
    gradient = mass / base * ((REAR + TRAIL) / front - (FRONT - TRAIL) / rear)
    for speed in driven:
        law = f"{steer}*min(t, 1)**3*(10 - 15*min(t, 1) + 6*min(t, 1)**2)"
        turn = f'end: 10, output_step: 1, drive: {{steer_fl: "{law}", steer_fr: "{law}"}}'
        found = drive(car(plane, PLANE, turn, speed=speed, mu=1e6, resistance=0))
        gains.append(found["chassis.wz"][-1] / steer)
        speeds.append((found["rl.on.contact.vx"][-1] + found["rr.on.contact.vx"][-1]) / 2)  # 1e-4 m/s less than at first
    assert gains == pytest.approx([v / (base + gradient * v**2) for v in speeds], rel=1e-7)
    slope, offset = np.polyfit(np.square(speeds), np.array(speeds) / gains, 1)
    assert slope == pytest.approx(gradient, rel=1e-6)
    assert offset == pytest.approx(base, rel=1e-6)
