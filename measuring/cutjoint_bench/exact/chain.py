"""The N-four-bar of the IFToMM benchmark library (A02): its model file and its exact motion.

N windows stand side by side: N + 1 cranks on ground pins, N couplers over them, bars of 1 m, all joints revolutes about z.  All cranks
start upright at -1 rad/s.  The pose in which all bars are in line is singular; a motion that goes on through it as a parallelogram is a
pendulum's, which elliptic functions give in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutjoint.run.results import Array
from cutjoint_bench.exact.elliptic import amplitude, argument, quarter_period

_TEXT = """\
cutjoint: 1
name: chain_{chain.windows}
gravity: [0, {chain.gravity!r}, 0]
submodels:
  bar:
    connectors: [base]
    parameters: [mass, x_from, y_from, x_to, y_to]
    points: {{start: [x_from, y_from, 0], end: [x_to, y_to, 0]}}
    bodies:
      bar:
        mass: mass
        centre_of_mass: {{midpoint: [start, end]}}
        inertia: {{principal: [0, mass/12, mass/12], x: {{from: start, to: end}}, z: [0, 0, 1]}}
    joints:
      pin: {{kind: revolute, bodies: [base, bar], at: start, axis: [0, 0, 1]}}
instances:
{bars}
joints:
{cuts}
markers: {{tip: {{body: crank_0.bar, at: [{chain.offset!r}, 1, 0]}}}}
outputs: [tip.x, tip.y, tip.vx, tip.vy, crank_0.pin.angle, crank_0.pin.angle_rate]
scenes:
  swing:
    end: 10
    output_step: 0.02
    rates: {{{rates}}}
    numerics: {{dt: 0.001{settings}}}
"""

_BAR = "  {name}: {{use: bar, connect: {{base: {base}}}, with: {{mass: {mass!r}, x_from: {a!r}, y_from: {b}, x_to: {c!r}, y_to: {d}}}}}"
_CUT = "  closure_{i}: {{kind: revolute, bodies: [coupler_{i}.bar, crank_{i}.bar], at: [{x!r}, 1, 0], axis: [0, 0, 1], cut: true}}"


@dataclass(frozen=True, kw_only=True)
class Chain:
    """An N-four-bar of ``windows``; ``offset`` (m) moves it along x, ``gravity`` (m/s2) is along y, ``coupler`` a coupler's mass in kg.

    With gravity upwards it swings about the upright and never gets near the singular pose.
    """

    windows: int
    offset: float = 0.0
    gravity: float = -9.81
    coupler: float = 1.0

    @property
    def drive(self) -> float:
        """c of th'' = c sin th, the equation of the cranks' angle from the upright, 1/s2."""
        cranks, couplers = self.windows + 1, self.windows * self.coupler
        return -self.gravity * (cranks / 2 + couplers) / (cranks / 3 + couplers)

    @property
    def multiplier_updates(self) -> int:
        """Corrections of the recursive method's multipliers a step: what a loop lacks reaches the ends of a long chain after several."""
        return 4 if self.windows < 5 else 8


def write_chain(chain: Chain, *, penalty: bool = True) -> str:
    """Its model file, whose loops a ``penalty`` that follows the step holds, or as the integrator does."""
    settings = f", penalty: 0.005/dt**2, frequency: 0.3/dt, multiplier_updates: {chain.multiplier_updates}" if penalty else ""
    pins = [chain.offset + i for i in range(chain.windows + 1)]
    bars = [_BAR.format(name=f"crank_{i}", base="ground", mass=1.0, a=x, b=0, c=x, d=1) for i, x in enumerate(pins)]
    for i in range(1, chain.windows + 1):
        bars.append(_BAR.format(name=f"coupler_{i}", base=f"crank_{i - 1}.bar", mass=chain.coupler, a=pins[i - 1], b=1, c=pins[i], d=1))
    return _TEXT.format(
        chain=chain, settings=settings, bars="\n".join(bars),
        cuts="\n".join(_CUT.format(i=i, x=pins[i]) for i in range(1, chain.windows + 1)),
        rates=", ".join(f"crank_{i}.pin.angle_rate: -1" for i in range(chain.windows + 1)),
    )  # fmt: skip


def chain_motion(chain: Chain, t: Array) -> dict[str, Array]:
    """Places (m) and velocities (m/s) of all bars on the parallelogram branch over the times (s), by ``body.quantity``."""
    angle, rate = crank_motion(chain, t)
    sine, cosine, still = np.sin(angle), np.cos(angle), np.zeros_like(t)
    crank = {"x": sine / 2, "y": cosine / 2, "z": still, "vx": rate * cosine / 2, "vy": -rate * sine / 2, "vz": still}
    columns = {f"crank_{i}.bar.{q}": c + (chain.offset + i) * (q == "x") for i in range(chain.windows + 1) for q, c in crank.items()}
    for i in range(1, chain.windows + 1):
        columns |= {f"coupler_{i}.bar.{q}": 2 * c + (chain.offset + i - 0.5) * (q == "x") for q, c in crank.items()}
    return columns


def crank_motion(chain: Chain, t: Array) -> tuple[Array, Array]:
    """The cranks' angle from the upright (rad, clockwise) and its rate (rad/s) over the times (s).

    Upright is the top of a turning pendulum, th = pi - 2 am(K - w t), or with gravity upwards the bottom of a swinging one,
    sin th/2 = k sn(t sqrt|c|).
    """
    c = chain.drive
    if c > 0:
        m, w = _turning(c)
        angle = np.pi - 2 * amplitude(quarter_period(m) - w * t, m)
        return angle, np.sqrt(1 + 4 * c * np.sin(angle / 2) ** 2)
    m = -1 / (4 * c)
    phase = amplitude(np.sqrt(-c) * t, m)
    return 2 * np.arcsin(np.sqrt(m) * np.sin(phase)), np.cos(phase)


def _turning(c: float) -> tuple[float, float]:
    """The parameter m of the elliptic functions, and w in rad/s."""
    return 4 * c / (1 + 4 * c), float(np.sqrt(1 + 4 * c)) / 2


def turn_of_cranks(chain: Chain) -> float:
    """The time of a turn, s."""
    m, w = _turning(chain.drive)
    return 2 * quarter_period(m) / w


def singular_times(chain: Chain) -> tuple[float, float]:
    """The times (s) of the first two poses in which all bars are in line; both come back a turn of the cranks later."""
    m, w = _turning(chain.drive)
    first = (quarter_period(m) - argument(np.pi / 4, m)) / w
    return first, turn_of_cranks(chain) - first
