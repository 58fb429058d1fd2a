"""Balances a pole on a cart: a linear quadratic regulator from the linearised model, stepping from Python.

    python examples/balance.py
"""

from pathlib import Path

import numpy as np
from scipy.linalg import solve_continuous_are

import cutjoint

sim = cutjoint.load(Path(__file__).with_name("cart_pole.yaml"), linearise=True)

# linearise about the upright pose
near = sim.reset(coordinates={"pin.angle": 0.0}).linearise()
Q, R = np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(1)
gain = np.linalg.solve(R, near.B.T @ solve_continuous_are(near.A, near.B, Q, R))

# start tilted and close the loop, one step at a time
sim.reset(coordinates={"pin.angle": 0.2})
while sim.time < 5.0:
    sim.inputs["push"] = (-gain @ (sim.states.array - near.x))[0]
    sim.step()
print(f"after {sim.time:.3f} s: cart at {sim.outputs['cart.x']:.2e} m, pole at {sim.outputs['pin.angle']:.2e} rad")
