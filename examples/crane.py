"""Carry a hanging load by two metres and stop without a swing: 120 forces of a cart, by SciPy with gradients from the run's end on."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import cutjoint

KNOTS, STEPS, LONG = 120, 480, 1.8  # s
ENDS = ["cart.x", "cart.vx", "rope.angle", "rope.angle_rate"]
GOAL = np.array([2.0, 0.0, 0.0, 0.0])  # m, m/s, rad, rad/s

sim = cutjoint.load(Path(__file__).with_name("crane.yaml"), integrator="rk4", adjoint=True)
times = np.linspace(0, LONG, KNOTS)
runs = 0


@lru_cache(2)
def run(forces):
    """The places and speeds at the end by the forces (N) at the knots of a line, and how they change with each."""
    global runs
    runs += 1
    sim.reset(dt=LONG / STEPS)
    trajectory = {"t": times, "value": np.frombuffer(forces), "interpolation": "linear"}
    found = sim.adjoint_sensitivities(STEPS, ENDS, ["push"], "end", every=STEPS, inputs={"push": trajectory})
    return found.objectives - GOAL, found.derivatives


found = minimize(
    lambda u: (u @ u / KNOTS, 2 * u / KNOTS), np.zeros(KNOTS), jac=True, method="SLSQP", bounds=[(-12, 12)] * KNOTS,
    constraints={"type": "eq", "fun": lambda u: run(u.tobytes())[0], "jac": lambda u: run(u.tobytes())[1]},
)  # fmt: skip
missed, _ = run(found.x.tobytes())
print(f"missed by {np.abs(missed).max():.1e}, with forces of {np.abs(found.x).max():.2f} N at most, in {runs} runs")
