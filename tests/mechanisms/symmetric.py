"""Mechanisms with a plane of symmetry: joints of most kinds and every force, in the plane and in pairs."""

from __future__ import annotations

import json
from typing import Any

#: A frame that is free to move carries a mast with a pod, a keel that can only swing sideways, and an arm with a hand on either side.
CARRIAGE = """
cutjoint: 1
name: carriage
gravity: [0.5, 0, -9.81]
parameters:
  stiffness: {value: 300, unit: N/m, binding: param}
  steer: {value: 0, binding: input}
bodies:
  frame: {mass: 10, centre_of_mass: [0.1, 0, 0.2], inertia: [1, 2, 2.5, 0, 0.1, 0]}
  mast: {mass: 2, centre_of_mass: [0.1, 0, 0.8], inertia: [0.2, 0.2, 0.1]}
  pod: {mass: 1, centre_of_mass: [0.2, 0, 1.2], inertia: [0.05, 0.06, 0.07]}
  keel: {mass: 1, centre_of_mass: [0, 0, -0.3], inertia: [0.1, 0.1, 0.02]}
  rudder: {massless: true}
joints:
  frame_free: {kind: free, bodies: [ground, frame], at: [0.1, 0, 0.2]}
  mast_hinge: {kind: revolute, bodies: [frame, mast], at: [0, 0, 0.5], axis: [0, -1, 0]}
  pod_ball: {kind: spherical, bodies: [mast, pod], at: [0, 0, 1.1]}
  keel_hinge: {kind: revolute, bodies: [frame, keel], at: [0, 0, 0], axis: [1, 0, 0]}
  rudder_slide: {kind: prismatic, bodies: [frame, rudder], at: [0, 0, 0], axis: [0, 1, 0], guide: 0.1*steer}
  brace: {kind: distance, bodies: [ground, pod], at: [0.3, 0, 2.5], to: [0.3, 0, 1.3], cut: true}
forces:
  tether: {kind: point_spring, bodies: [ground, frame], from: [0, 0, 3], to: [0, 0, 0.4], law: "stiffness*(length - 2.2) + 4*rate"}
  drag: {kind: load, body: frame, at: [0.3, 0, 0.1], force: ["3 - 2*vx", "-y", "40 - vz"]}
  lift: {kind: axial_force, bodies: [frame, pod], origin: [0, 0, 0.5], point: [0.2, 0, 1.2], axis: [0, 0, 1], law: "5 - 30*travel"}
  seat: {kind: bushing, bodies: [mast, pod], at: [0, 0, 1.1], stiffness: [0, 0, 0, 20, 30, 20], damping: [0, 0, 0, 1, 1, 1]}
  drive: {kind: joint_force, joint: frame_free, coordinate: x, law: "2 - 40*position - 3*rate"}
  lean: {kind: joint_force, joint: mast_hinge, law: "1 - 50*position - rate"}
  keel_spring: {kind: joint_force, joint: keel_hinge, law: "-5*position"}
  idle: {kind: load, body: frame, at: [0, 0, 0], force: [0, 100, 0], active: false}
submodels:
  side:
    connectors: [frame, mast]
    bodies:
      arm: {mass: 1.5, centre_of_mass: [0.15, 0.5, 0.05], inertia: [0.1, 0.02, 0.1, 0.01, 0, 0.005]}
      hand: {mass: 0.5, centre_of_mass: [0.2, 0.8, 0], inertia: [0.02, 0.01, 0.03]}
    joints:
      shoulder:
        {kind: revolute, bodies: [frame, arm], at: [0.2, 0.3, 0.1], axis: [3, 0, 4],
         spring: {stiffness: 40, damping: 1, free_position: 0.2}}
      wrist: {kind: spherical, bodies: [arm, hand], at: [0.2, 0.7, 0.1]}
      stay: {kind: distance, bodies: [mast, arm], at: [0, 0.1, 0.9], to: [0.2, 0.6, 0.1], cut: true}
    forces:
      cord: {kind: point_spring, bodies: [ground, hand], from: [0.1, 0.6, 2], to: [0.2, 0.8, 0], law: "30*(length - 1.5) + rate"}
      mount:
        {kind: bushing, bodies: [arm, hand], at: [0.2, 0.7, 0.1], x: [1, 2, 2], z: [2, 1, -2], stiffness: [0, 0, 0, 9, 8, 7],
         damping: [0, 0, 0, 1, 1, 1]}
      twist: {kind: load, body: hand, torque: ["0.1 - wx", "0.2*wz", "0.1*wy"], axes: body}
      wind: {kind: load, body: arm, at: [0.2, 0.5, 0], force: [1, "2 - vy", "y"]}
    reactions:
      stay_pull: {joint: stay, axes_of: arm, direction: [0.2, 0.5, -0.8]}
    markers:
      finger: {body: hand, at: [0.3, 0.9, 0]}
instances:
  left: {use: side, connect: {frame: frame, mast: mast}}
  right: {use: side, connect: {frame: frame, mast: mast}, mirror: y}
reactions:
  brace_push: {joint: brace, axes_of: pod, direction: [1, 0, 0]}
scenes:
  run:
    end: 0.3
    positions: {frame_free.x: 0, frame_free.y: 0, left.shoulder.angle: 0, right.shoulder.angle: 0}
    rates: {frame_free.vx: 0.5, frame_free.vy: 0}
    inputs: {steer: 0*t}
    switches: {idle: false}
    numerics:
      {dt: 0.001, solver_tolerance: 1.0e-11, penalty: 1.0e+5, multiplier_updates: 20, methods: {recursive: {solver_tolerance: 1.0e-9}}}
"""


def wings_text(axis: str) -> str:
    """A free body with a wing on either side of the plane across "x", "y" or "z", hinged in the same sense."""
    along = "xyz".index(axis) - 1

    def turned(*components: float) -> list[float]:
        """A vector of the model whose plane is y = 0, with its axes called by other names."""
        return [components[(i - along) % 3] for i in range(3)]

    def wing(side: int) -> dict[str, Any]:
        return {"mass": 2, "centre_of_mass": turned(0.1, 0.6 * side, 0), "inertia": turned(0.2, 0.05, 0.2)}

    def hinge(side: int, body: str) -> dict[str, Any]:
        return {"kind": "revolute", "bodies": ["hull", body], "at": turned(0, 0.2 * side, 0), "axis": turned(-0.6, 0, -0.8)}

    ahead = "xyz"[turned(1, 0, 0).index(1)]
    angles = {"port_hinge.angle": 0.3, "starboard_hinge.angle": -0.3}
    rates = {"port_hinge.angle_rate": 0.7, "starboard_hinge.angle_rate": -0.7}
    return json.dumps({
        "cutjoint": 1, "name": "wings", "gravity": turned(1, 0, -9.81),
        "bodies": {
            "hull": {"mass": 5, "centre_of_mass": turned(0.1, 0, 0), "inertia": turned(1, 1.2, 1.4)},
            "port": wing(1), "starboard": wing(-1),
        },
        "joints": {
            "hull_free": {"kind": "free", "bodies": ["ground", "hull"], "at": turned(0.1, 0, 0)},
            "port_hinge": hinge(1, "port"), "starboard_hinge": hinge(-1, "starboard"),
        },
        "forces": {
            "port_spring": {"kind": "joint_force", "joint": "port_hinge", "law": "3 - 20*position - rate"},
            "starboard_spring": {"kind": "joint_force", "joint": "starboard_hinge", "law": "-3 - 20*position - rate"},
        },
        "scenes": {"fall": {
            "end": 1, "positions": {f"hull_free.{ahead}": 0.1, **angles},
            "rates": {f"hull_free.v{ahead}": 0.4, f"hull_free.w{axis}": 0.5, **rates},
        }},
    })  # fmt: skip
