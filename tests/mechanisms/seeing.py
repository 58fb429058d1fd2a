"""A mechanism whose laws see all of it: signals, states, samples, a function in C++, friction by loads, in a tree and in a loop."""

from __future__ import annotations

import re
from dataclasses import replace

from cutjoint.methods import METHODS, Formulation
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model

_TREE = """
  a: {mass: 1, centre_of_mass: [0.3, 0.1, 0], inertia: [0.1, 0.2, 0.3]}
  b: {mass: 2, centre_of_mass: [0.8, 0.1, 0.2], inertia: [0.2, 0.2, 0.1]}
  c: {mass: 1.5, centre_of_mass: [1.2, 0.3, 0.2], inertia: [0.1, 0.3, 0.2]}
joints:
  ball: {kind: spherical, bodies: [ground, a], at: [0, 0, 0]}
  cross: {kind: universal, bodies: [a, b], at: [0.6, 0.1, 0], axis: [1, 0, 0], axis_2: [0, 1, 0]}
  tube: {kind: cylindrical, bodies: [b, c], at: [1, 0.2, 0.1], axis: [1, 1, 0]}"""
_CLOSING = "\n  close: {kind: cylindrical, bodies: [ground, c], at: [1.4, 0.3, 0.3], axis: [0, 1, 0.5], cut: true}"


def _text(*, closed: bool) -> str:
    return f"""
cutjoint: 1
name: seeing
gravity: [1, 2, -9.81]
parameters:
  wish: {{value: 0.3, unit: m/s, binding: input}}
  gain: {{value: 3, binding: param}}
functions:
  soft: {{arguments: [x, rate], partials: true}}
bodies:{_TREE}{_CLOSING * closed}
forces:
  first: {{kind: joint_friction, joint: cross, coordinate: angle_1, coefficient: 0.1, radius: 0.05, arm: 0.3, thrust_radius: 0.04}}
  slide: {{kind: joint_friction, joint: tube, coordinate: displacement, coefficient: 0.05, static: 0.1, stribeck_speed: 0.5, arm: 0.2}}
  second: {{kind: joint_force, joint: cross, coordinate: angle_2, law: "-20*position - soft(a.roll, b.wy) + drive"}}
  push: {{kind: joint_force, joint: tube, coordinate: displacement, law: "-80*position - rate + slow*soft(position, rate) + 4*held.u"}}
  rope: {{kind: point_spring, bodies: [ground, c], from: [1, 0, 1], to: [1.2, 0.3, 0.2], law: 20*length + gain*b.vy*a.yaw + fast}}
{"  shut: {kind: joint_friction, joint: close, coordinate: displacement, coefficient: 0.05, arm: 0.4}" * closed}
states:
  slow: {{start: 0.2, rate: "3*(drive - slow) + a.wx*fast"}}
  fast: {{start: 0.5, rate: "-8*fast + sin(slow)*c.vz + 0.1*second.force - soft(slow, fast)"}}
signals:
  drive: "gain*(wish - c.vx) + 2*b.pitch*slow + cut"
  cut: where(tube.displacement < 5, b.wz*cross.angle_1, 0)
controllers:
  held: {{every: 40 ms, signals: {{u: "c.x + 2*slow - gain*c.az/50"}}, memory: {{sum: {{start: 0.1, next: sum + u}}}}}}
outputs: [c.x, c.vz, drive.value, slow.value, fast.value, rope.force, held.u]
scenes:
  go: {{end: 1, output_step: 0.1}}
"""


SOFT = """
#include <cmath>
extern "C" void cutjoint_soft(const double* a, double* result, double* partials) {
  *result = 5 * std::sin(a[0]) + 2 * a[0] * a[1];
  if (partials) partials[0] = 5 * std::cos(a[0]) + 2 * a[1], partials[1] = 2 * a[0];
}
"""

#: Its code for numbers of 113 bits, in the namespace of the folder.
SOFT_IN_QUADS = """
template <>
quads::Quad supplied<quads::Quad>(Supplied, const quads::Quad (&a)[2]) {
  return quads::Quad(5) * sin(a[0]) + quads::Quad(2) * a[0] * a[1];
}
template <>
quads::Quad supplied_partial<quads::Quad>(Supplied, int by, const quads::Quad (&a)[2]) {
  return by ? quads::Quad(2) * a[0] : quads::Quad(5) * cos(a[0]) + quads::Quad(2) * a[1];
}
"""


def seeing(method: str, *, closed: bool) -> Model:
    """The model as a method takes it: a loop where it is closed, no friction in natural coordinates, which have no loads, no function
    for `classical`."""
    text = _text(closed=closed)
    if METHODS[method].formulation is Formulation.NATURAL:
        text = re.sub(r"  \w+: {kind: joint_friction.*\n", "", text)
    if method == "classical":
        text = re.sub(r"soft\(([^,()]+), ([^()]+)\)", r"(5*sin(\1) + 2*\1*\2)", text)
        return read_model_text(re.sub(r"functions:\n.*\n", "", text), "seeing.yaml")
    return replace(read_model_text(text, "seeing.yaml"), code=SOFT)
