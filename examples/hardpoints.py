"""Take bump steer and jolts out of an axle by 20 hardpoints, with exact adjoint gradients."""

from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import cutjoint

MODEL = Path(__file__).resolve().parents[1] / "models" / "axle.yaml"
NAMES = [f"{point}.{axis}" for point in ("LF", "LR", "LB", "UF", "UR", "UB", "TI", "TO") for axis in "yz"]
NAMES += ["TI.x", "TO.x", "LB.x", "UB.x"]
BY = [f"{side}.{name}" for side in ("left", "right") for name in NAMES]
OUTPUTS = ["left.upright.yaw", "right.upright.yaw", "chassis.az"]  # rad, rad and m/s2, of which squares are summed with these weights:
WEIGHTS, STEPS, EVERY, REACH = np.array([1e6, 1e6, 1.0]), 800, 5, 0.015  # m by which a number may change

sim = cutjoint.load(MODEL, scene="bump", integrator="trapezoidal", adjoint=True, tunable=[f"*.{name}" for name in NAMES])
given = np.array([sim.parameters[name] for name in BY])
mirror = np.array([-1.0 if name.endswith(".y") else 1.0 for name in NAMES])
runs = 0


def cost(x):
    """The mean of weighed squares over a bump of the left wheel, from rest, and its derivatives by the changes of both sides alike."""
    global runs
    runs += 1
    both = REACH * np.vstack([x, x * mirror])
    sim.parameters.update(zip(BY, given + both.ravel(), strict=True))
    sim.reset(dt=1e-3)
    rest = sim.equilibrium_sensitivities([], BY)
    run = sim.adjoint_sensitivities(STEPS, OUTPUTS, BY, lambda _, y: 2 * WEIGHTS * y[None] / len(y), every=EVERY,
        initial_sensitivities=rest.states)
    left, right = run.derivatives[0].reshape(2, -1)
    return (WEIGHTS * run.values**2).sum() / len(run.values), REACH * (left + right * mirror), run


begin = np.zeros(len(NAMES))
first = cost(begin)
found = minimize(lambda x: cost(x)[:2], begin, jac=True, method="L-BFGS-B", bounds=[(-1, 1)] * len(NAMES), options={"maxiter": 40})
last = cost(found.x)
print(f"cost {first[0]:.4g} to {last[0]:.4g} in {runs} runs")
