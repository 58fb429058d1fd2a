"""Swings a pole up on a cart: the pushes of 1.5 s are found by Gauss-Newton steps over exact derivatives of simulation steps.

    python examples/swing_up.py
"""

from pathlib import Path

import numpy as np

import cutjoint

STEPS, EFFORT = 75, 1e-4

sim = cutjoint.load(Path(__file__).with_name("cart_pole.yaml"), integrator="rk4", linearise=True)
sim.reset(dt=0.02, coordinates={"pin.angle": np.pi})  # hanging at rest
start, target = sim.states.array.copy(), np.zeros(4)  # cart and pole: places, then rates
pushes = 3 * np.cos(np.linspace(0, 2 * np.pi, STEPS))


def roll_out(pushes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The states at the end, and their derivatives by each push, (states, pushes)."""
    sim.set_states(start, time=0.0)
    by_pushes = np.zeros((len(start), STEPS))
    for k, push in enumerate(pushes):
        sim.inputs["push"] = push
        step = sim.step_derivatives()
        by_pushes = step.by_state @ by_pushes
        by_pushes[:, k] = step.by_input[:, 0]
    return sim.states.array.copy(), by_pushes


for _ in range(60):
    end, by_pushes = roll_out(pushes)
    rows = np.vstack([by_pushes, EFFORT * np.eye(STEPS)])
    change = np.linalg.lstsq(rows, np.concatenate([target - end, -EFFORT * pushes]), rcond=None)[0]
    pushes = pushes + change * min(1.0, 3.0 / np.abs(change).max())
print(f"missed by {np.abs(roll_out(pushes)[0] - target).max():.1e}, with pushes of {np.abs(pushes).max():.1f} N at most")
