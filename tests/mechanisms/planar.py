"""Mechanisms that move in a plane though their joints would let them leave it."""

from __future__ import annotations

import numpy as np

#: A crank, a rod between balls, and a rocker in another plane; a plate on springs that swings from the rocker; a slider.  y is up.
SWING = """\
cutjoint: 1
name: swing
gravity: [0, -9.81, 0]
points: {A: [0, 0, 0], B: [0.3, 0.4, 0], C: [1.2, 0.6, 0], D: [1, 0, 0], E: [1.5, 0.2, 0], F: [2, 0, 0.25], G: [1.8, 0.5, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: [0.15, 0.2, 0.1], inertia: {principal: [0.01, 0.02, 0.03], x: [1, 1, 0], y: [0, 0, 1]}}
  rod: {mass: 0.7, centre_of_mass: [0.75, 0.5, 0], inertia: [0.003, 0.05, 0.05, -0.006, 0, 0]}
  rocker: {mass: 1.4, centre_of_mass: [1.1, 0.3, -0.2], inertia: [0.04, 0.02, 0.05, 0.001, 0.002, 0.003]}
  plate: {mass: 2, centre_of_mass: [1.5, 0.2, 0], inertia: [0.02, 0.05, 0.06, 0.004, 0, 0]}
  bob: {mass: 0.5, centre_of_mass: [1.8, 0.4, 0], inertia: [0.01, 0.02, 0.025, 0.001, 0, 0]}
joints:
  crank_pin: {kind: revolute, bodies: [ground, crank], at: A, axis: [0, 0, 1]}
  rocker_pin: {kind: revolute, bodies: [ground, rocker], at: D, axis: [0, 0, -1]}
  rod_start: {kind: spherical, bodies: [crank, rod], at: B}
  rod_end: {kind: spherical, bodies: [rod, rocker], at: C, cut: true}
  plate_free: {kind: free, bodies: [ground, plate], at: E}
  bob_slide: {kind: cylindrical, bodies: [plate, bob], at: G, axis: [0, 1, 0]}
forces:
  left:
    {kind: point_spring, bodies: [rocker, plate], from: [1.3, 0.3, 0.4], to: [1.4, 0.2, 0.1],
     law: {stiffness: 90, free_length: 0.3, damping: 1}}
  right:
    {kind: point_spring, bodies: [rocker, plate], from: [1.3, 0.3, -0.4], to: [1.4, 0.2, -0.1],
     law: {stiffness: 90, free_length: 0.3, damping: 1}}
  hold: {kind: point_spring, bodies: [ground, plate], from: [1.5, 1.2, 0], to: E, law: {stiffness: 60, free_length: 0.6}}
  stop: {kind: joint_force, joint: bob_slide, coordinate: displacement, law: "-200*position - 3*rate"}
  screwing: {kind: joint_force, joint: bob_slide, coordinate: angle, law: "-2*position - 0.1*rate"}
  push: {kind: load, body: rocker, at: C, force: ["5*sin(3*t)", 2, 40]}
outputs: [rod.x, rod.y, rod.z, rod.yaw, rod.wx, crank_pin.angle, rocker_pin.angle, rocker_pin.angle_rate, plate.x, plate.y, plate.z,
          plate.yaw, plate.roll, plate_free.x, plate_free.vy, plate_free.wz, bob.y, bob_slide.displacement, bob_slide.angle,
          bob_slide.displacement_rate, left.force, right.length, hold.force, stop.force, push.Fz]
scenes:
  fall:
    end: 0.5
    output_step: 0.01
    rates: {plate_free.wz: 0.5, plate_free.vx: 0.2, bob_slide.displacement_rate: 0.1}
    positions: {plate_free.x: 0.01}
    numerics: {dt: 0.0005, penalty: 1.0e+5, solver_tolerance: 1.0e-8}
"""


def random_tree(rng: np.random.Generator, count: int = 5) -> str:
    """A tree in the plane y = 0, of joints that keep bodies there and of others that need symmetry; springs, loads and speeds in it."""
    bodies, joints, forces, rates, outputs = [], [], [], [], []
    for i in range(count):
        x, z = (round(float(value), 3) for value in rng.uniform(-1, 1, 2))
        parent = f"b{rng.integers(0, i)}" if i and rng.random() < 0.8 else "ground"
        kinds = ["revolute", "spherical", "prismatic", "cylindrical", "universal"]
        kind = str(rng.choice([*kinds, "free"] if parent == "ground" else kinds))
        xx, zz, xz = rng.uniform(0.2, 0.3), rng.uniform(0.2, 0.3), rng.uniform(-0.05, 0.05)
        inertia = f"[{xx:.3f}, 0.4, {zz:.3f}, 0, {xz:.3f}, 0]"
        bodies.append(f"  b{i}: {{mass: {rng.uniform(1, 3):.3f}, centre_of_mass: [{x + 0.3}, 0, {z}], inertia: {inertia}}}")
        axis = {"revolute": ", axis: [0, -1, 0]", "universal": ", axis: [0, 1, 0], axis_2: [1, 0, 2]"}.get(kind, "")
        axis = ", axis: [1, 0, 2]" if kind in ("prismatic", "cylindrical") else axis
        joints.append(f"  j{i}: {{kind: {kind}, bodies: [{parent}, b{i}], at: [{x}, 0, {z}]{axis}}}")
        rates += [f"j{i}.{name}: {rng.uniform(-1, 1):.3f}" for name in _RATES[kind]]
        ends = f"from: [{z}, 0, 1.5], to: [{x}, 0, {z}]"
        forces.append(f"  s{i}: {{kind: point_spring, bodies: [ground, b{i}], {ends}, law: 30*length + rate}}")
        forces.append(f"  l{i}: {{kind: load, body: b{i}, at: [{x}, 0, {z}], force: [\"1 - vx\", \"-3*y - vy\", \"x\"], axes: body}}")
        outputs += [f"b{i}.{name}" for name in ("x", "y", "z", "pitch", "roll", "vx", "vz", "wx", "wy", "ax", "ay", "az")]
    lines = ["cutjoint: 1", "name: tree", "gravity: [1, 0, -9.81]", "bodies:", *bodies, "joints:", *joints, "forces:", *forces]
    return "\n".join([*lines, f"outputs: [{', '.join(outputs)}]", f"scenes: {{go: {{end: 1, rates: {{{', '.join(rates)}}}}}}}"]) + "\n"


_RATES = {
    "revolute": ("angle_rate",), "prismatic": ("displacement_rate",), "cylindrical": ("displacement_rate",), "universal": ("angle_1_rate",),
    "spherical": (), "free": ("vx", "vz", "wy"),
}  # fmt: skip
