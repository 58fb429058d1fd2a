"""Mechanisms by which estimated errors are judged: dead centres, massless rods, and what acts on them: friction, stops, drives.

Each mechanism runs under each law, whose numbers are drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Point = Sequence[float]

#: Parameters of all models: what a law takes, and the speed of the start.
_HEAD = """cutjoint: 1
name: {name}
gravity: [0, 0, -9.81]
parameters:
  speed: {{value: 6, binding: param}}
  friction: {{value: 4, binding: param}}
  width: {{value: 0.01, binding: param}}
  stiffness: {{value: 200, binding: param}}
"""
_TURNING = """bodies:
  crank: {{mass: 2, centre_of_mass: [0, 0, 0.05], inertia: [0.03, 0.05, 0.03]}}
{bodies}
joints:
  pin: {{kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}}
{joints}
forces:
  drag: {{kind: joint_force, joint: {held}, law: "LAW"}}
outputs: [pin.angle, pin.angle_rate, {outputs}, drag.force]
scenes: {{turn: {{end: 2, output_step: 10 ms, rates: {{pin.angle_rate: speed}}}}}}
"""


def _turning(name: str, bodies: str, joints: str, held: str, outputs: str) -> str:
    return _HEAD.format(name=name) + _TURNING.format(bodies=bodies, joints=joints, held=held, outputs=outputs)


def _pin(name: str, bodies: str, at: Point) -> str:
    return f"  {name}: {{kind: revolute, bodies: [{bodies}], at: {list(at)}, axis: [0, 1, 0]}}\n"


def _rail(name: str, bodies: str, at: Point, axis: Point) -> str:
    return f"  {name}: {{kind: prismatic, bodies: [{bodies}], at: {list(at)}, axis: {list(axis)}}}\n"


_SLIDER = "  slider: {mass: 3, centre_of_mass: [0.3, 0, 0]}"
_ROD = "  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.001, 0.008, 0.008]}\n"
_LINK = "  rod: {massless: true, centre_of_mass: [0.15, 0, 0.05]}\n"
_CRANK = (
    _pin("elbow", "crank, rod", (0, 0, 0.1)) + _pin("wrist", "rod, slider", (0.3, 0, 0))
    + _rail("rail", "ground, slider", (0.3, 0, 0), (1, 0, 0))
)  # fmt: skip
#: A crank whose pin slides in a yoke: both dead centres are far from singular.
_YOKE = _turning(
    "yoke",
    "  block: {mass: 0.2, centre_of_mass: [0, 0, 0.1], inertia: [0.0001, 0.0001, 0.0001]}\n  yoke: {mass: 3, centre_of_mass: [0.1, 0, 0]}",
    _pin("peg", "crank, block", (0, 0, 0.1)) + _rail("slot", "yoke, block", (0, 0, 0.1), (0, 0, 1))
    + _rail("rail", "ground, yoke", (0.1, 0, 0), (1, 0, 0)),
    "rail", "yoke.x, yoke.vx",
)  # fmt: skip
#: Crank and rocker, coupled by a rod without mass, with the drag at the rocker, which turns back twice a turn.
_ROCKER = _turning(
    "rocker",
    "  rod: {massless: true, centre_of_mass: [0.15, 0, 0.2]}\n"
    "  rocker: {mass: 2, centre_of_mass: [0.3, 0, 0.15], inertia: [0.02, 0.02, 0.01]}",
    _pin("elbow", "crank, rod", (0, 0, 0.1)) + _pin("knee", "rod, rocker", (0.3, 0, 0.3)) + _pin("foot", "ground, rocker", (0.3, 0, 0)),
    "foot", "foot.angle, rocker.vx",
)  # fmt: skip
#: Two pendulums one below the other, with the drag between them.
_PENDULUMS = _turning(
    "pendulums", "  lower: {mass: 1, centre_of_mass: [0, 0, -0.4], inertia: [0.01, 0.01, 0.001]}",
    _pin("knee", "crank, lower", (0, 0, -0.2)), "knee", "knee.angle, lower.vx",
).replace("centre_of_mass: [0, 0, 0.05]", "centre_of_mass: [0, 0, -0.15]")  # fmt: skip

_RODS: Sequence[tuple[Point, Point]] = (
    ((0.12, 0.35, 0.45), (0.05, 0.62, 0.43)), ((-0.15, 0.36, 0.46), (-0.06, 0.61, 0.44)), ((0.16, 0.3, 0.2), (0.06, 0.64, 0.17)),
    ((-0.2, 0.32, 0.22), (-0.05, 0.65, 0.18)), ((-0.15, 0.38, 0.3), (-0.14, 0.63, 0.31)),
)  # fmt: skip


def _rods() -> str:
    """A wheel's carrier on five rods without mass and a strut, which has the law besides its spring."""
    bodies, joints = "", ""
    for i, ends in enumerate(_RODS):
        start, end = np.array(ends[0]), np.array(ends[1])
        middle, along = ((start + end) / 2).tolist(), end - start
        first = np.array([0, -along[2], along[1]])
        axes = f"axis: {first.tolist()}, axis_2: {np.cross(along, first).tolist()}"
        bodies += f"  rod_{i}: {{massless: true, centre_of_mass: {middle}}}\n"
        joints += f"  in_{i}: {{kind: universal, bodies: [ground, rod_{i}], at: {list(ends[0])}, {axes}}}\n"
        joints += f"  out_{i}: {{kind: spherical, bodies: [carrier, rod_{i}], at: {list(ends[1])}}}\n"
    return (
        f"{_HEAD.format(name='rods')}bodies:\n  carrier: {{mass: 20, centre_of_mass: [0, 0.7, 0.3], inertia: [0.5, 0.9, 0.5]}}\n{bodies}"
        f"joints:\n{joints}forces:\n  drag: {{kind: point_spring, bodies: [ground, carrier], from: [0, 0.45, 0.75], to: [0, 0.6, 0.3],\n"
        f'         law: "2e4*(length - 0.5) - 20*(LAW)"}}\n'
        f"outputs: [carrier.x, carrier.y, carrier.z, carrier.vz, drag.force]\nscenes: {{drop: {{end: 2, output_step: 10 ms}}}}\n"
    )  # fmt: skip


#: Models whose drag has LAW in place of a law.
MECHANISMS: Mapping[str, str] = {
    "yoke": _YOKE, "crank": _turning("crank", _ROD + _SLIDER, _CRANK, "rail", "slider.x, slider.vx"),
    "light crank": _turning("light", _LINK + _SLIDER, _CRANK, "rail", "slider.x, slider.vx"),
    "rocker": _ROCKER, "pendulums": _PENDULUMS, "rods": _rods(),
}  # fmt: skip
#: Brakes: smooth, steep, and jumping where a motion turns back; with a stop that begins and ends to act.
LAWS: Mapping[str, str] = {
    "viscous": "-0.3*friction*rate",
    "steep": "-friction*tanh(rate/width)",
    "Coulomb": "-friction*sign(rate)",
    "steep, stop": "-friction*tanh(rate/width) - stiffness*max(0, position - 0.03)",
    "Coulomb, stop": "-friction*sign(rate) - stiffness*max(0, position - 0.03)",
}


@dataclass(frozen=True, kw_only=True)
class Draw:
    """A mechanism with a law, and the numbers of its runs."""

    name: str
    text: str
    parameters: Sequence[Mapping[str, float]]


def draws(count: int, seed: int) -> Iterator[Draw]:
    """Each mechanism under each law, with so many draws of parameters."""
    rng = np.random.default_rng(seed)
    for mechanism, text in MECHANISMS.items():
        for law, formula in LAWS.items():
            at = formula.replace("position - 0.03", "length - 0.52") if mechanism == "rods" else formula
            yield Draw(name=f"{mechanism}, {law}", text=text.replace("LAW", at), parameters=[_draw(rng) for _ in range(count)])


def _draw(rng: np.random.Generator) -> Mapping[str, float]:
    return {
        "speed": float(rng.uniform(4, 15)), "friction": float(10 ** rng.uniform(-1, 0.7)), "width": float(10 ** rng.uniform(-2.5, -0.5)),
        "stiffness": float(10 ** rng.uniform(1.5, 3.5)),
    }  # fmt: skip
