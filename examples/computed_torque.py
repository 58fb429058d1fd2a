"""Computed torque: two motors of a five-bar, a closed loop, follow a motion, by the mass matrix and the force of the present pose.

    python examples/computed_torque.py [FILE]
"""

import sys
from pathlib import Path

import numpy as np

import cutjoint

file = sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("five_bar.urdf")
sim = cutjoint.load(file, linearise=True, poses=True)
sim.reset(dt=1e-3)
sim.choose_independent(["left.angle_rate", "right.angle_rate"])  # the motors' coordinates count, the loop gives the others
motors = list(sim.inputs)
kp, kd = 400.0, 40.0


def wanted(t: float) -> np.ndarray:
    """Angles of both motors, their rates and accelerations."""
    swing = np.array([[np.cos(4 * t) - 1, -4 * np.sin(4 * t), -16 * np.cos(4 * t)]])
    return np.array([[0.2], [-0.3]]) * swing


worst = 0.0
while sim.time < 2.0:
    z, rate = sim.states.array[:2], sim.states.array[2:]
    angle, speed, acceleration = wanted(sim.time).T
    for motor in motors:
        sim.inputs[motor] = 0.0
    mass, force = sim.equations_of_motion()
    torque = mass @ (acceleration + kd * (speed - rate) + kp * (angle - z)) - force
    for motor, value in zip(motors, torque, strict=True):
        sim.inputs[motor] = value
    worst = max(worst, float(np.abs(angle - z).max()))
    sim.step()
print(f"angles within {worst:.1e} rad of the motion for {sim.time:.1f} s, loop closed within {sim.last_step.violation:.0e} m")
