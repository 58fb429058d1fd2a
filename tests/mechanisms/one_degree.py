"""Random mechanisms whose loops have one degree of freedom, as model texts."""

from __future__ import annotations

import numpy as np

BODY = "{{mass: {mass:.3f}, centre_of_mass: {{midpoint: [{a}, {b}]}}, inertia: [{i:.5f}, {i:.5f}, {i:.5f}]}}"


def four_bar(seed: int) -> str:
    """A plane four-bar on a free carrier, of which one link carries a pendulum, with a spring inside."""
    rng = np.random.default_rng(seed)
    points = {name: np.array([x, 0.0, z]) + 0.12 * rng.uniform(-1, 1, 3) * [1, 0, 1] for name, (x, z) in _PLANE.items()}
    joints = [
        "a: {kind: revolute, bodies: [base, crank], at: A, axis: [0, 1, 0]}",
        "b: {kind: revolute, bodies: [crank, rod], at: B, axis: [0, 1, 0]}",
        "c: {kind: revolute, bodies: [rod, rocker], at: C, axis: [0, 1, 0]}",
        "d: {kind: revolute, bodies: [base, rocker], at: D, axis: [0, 1, 0]}",
        "p: {kind: revolute, bodies: [rod, bob], at: C, axis: [1, 0, 0]}",
    ]
    links = {"crank": "AB", "rod": "BC", "rocker": "DC", "bob": "CE"}
    return _model(rng, points, links, joints)


def spatial(seed: int) -> str:
    """A crank and a rocker on skew axes, with a rod between a ball and a universal joint, on a free carrier."""
    rng = np.random.default_rng(seed)
    points = {name: np.array(place) + 0.1 * rng.uniform(-1, 1, 3) for name, place in _SPACE.items()}
    first, second = (np.array(axis) + 0.3 * rng.uniform(-1, 1, 3) for axis in ([0, 1, 0], [0, 1, 0.3]))
    rod = points["C"] - points["B"]
    across = np.cross(rod, [0, 0, 1])
    joints = [
        f"a: {{kind: revolute, bodies: [base, crank], at: A, axis: {_text(first)}}}",
        "b: {kind: spherical, bodies: [crank, rod], at: B}",
        f"c: {{kind: universal, bodies: [rod, rocker], at: C, axis: {_text(across)}, axis_2: {_text(np.cross(rod, across))}}}",
        f"d: {{kind: revolute, bodies: [base, rocker], at: D, axis: {_text(second)}}}",
        "p: {kind: spherical, bodies: [rocker, bob], at: C}",
    ]
    links = {"crank": "AB", "rod": "BC", "rocker": "DC", "bob": "CE"}
    return _model(rng, points, links, joints)


_PLANE = {"A": (0, 0), "B": (0.1, 0.4), "C": (0.8, 0.6), "D": (0.7, 0.0), "E": (0.9, 0.2)}
_SPACE = {"A": [0, 0, 0], "B": [0.1, 0.1, 0.35], "C": [0.8, 0.0, 0.6], "D": [0.7, 0.1, 0.0], "E": [0.9, 0.2, 0.3]}


def _model(rng: np.random.Generator, points: dict[str, np.ndarray], links: dict[str, str], joints: list[str]) -> str:
    """A model on a free base, which a spring holds, with a spring between crank and rocker."""
    bodies = [
        f"  {name}: {BODY.format(mass=rng.uniform(0.5, 2), a=ends[0], b=ends[1], i=rng.uniform(0.01, 0.03))}" for name, ends in
        links.items()
    ]
    newline = "\n"
    return f"""
cutjoint: 1
name: random
gravity: [0, 0, -9.81]
points:
{newline.join(f"  {name}: {_text(point)}" for name, point in points.items())}
bodies:
  base: {{mass: 20, centre_of_mass: [0.4, 0, -0.1], inertia: [1, 2, 2]}}
{newline.join(bodies)}
joints:
  free: {{kind: free, bodies: [ground, base], at: [0.4, 0, -0.1]}}
{newline.join(f"  {joint}" for joint in joints)}
forces:
  inside: {{kind: point_spring, bodies: [crank, rocker], from: B, to: C, law: {{stiffness: 300, damping: 1, free_length: 0.7}}}}
  hold: {{kind: point_spring, bodies: [ground, base], from: [0.4, 0.1, 1], to: [0.4, 0, 0],
         law: {{stiffness: 600, damping: 5, free_length: 0.5}}}}
reactions:
  pin: {{joint: c, axes_of: rocker}}
outputs: [base.x, base.z, base.roll, base.pitch, crank.x, rod.x, rod.z, rocker.z, bob.x, bob.z, bob.vx, rod.ax, inside.force,
          pin.Fx, pin.Fz]
scenes:
  fall: {{end: 0.12, output_step: 12 ms}}
"""


def _text(vector: np.ndarray) -> str:
    return "[" + ", ".join(f"{x:.12f}" for x in vector) + "]"
