"""Find a spring's rate and where a crank's pin is from a measured motion of the press, by exact derivatives of runs."""

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import cutjoint

MODEL = Path(__file__).resolve().parents[1] / "models" / "press.yaml"
BY, STEPS = ["stiffness", "A.z"], 1000
SCALES = np.array([2000.0, 0.1])  # N/m and m

sim = cutjoint.load(MODEL, integrator="rk4", linearise=True, tunable=["A.z"])
runs = 0


def run(x):
    """The trajectory of the slider and its derivatives, from the scene's start."""
    global runs
    runs += 1
    sim.parameters.update(zip(BY, x * SCALES, strict=True))
    sim.reset(dt=1e-3).choose_independent(["pin.angle_rate"])  # the start's angle and rate are the scene's, whatever the parameters
    return sim.forward_sensitivities(STEPS, ["slider.x"], BY, every=10)


measured = run(np.array([0.8, 1.1])).values[:, 0] + np.random.default_rng(0).normal(0, 1e-4, STEPS // 10 + 1)
runs = 0
found = least_squares(lambda x: run(x).values[:, 0] - measured, x0=[1.0, 1.0], jac=lambda x: run(x).derivatives[:, 0] * SCALES)
print(", ".join(f"{name} {value:.4g}" for name, value in zip(BY, found.x * SCALES, strict=True)) + f" in {runs} runs")
