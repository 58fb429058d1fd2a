"""Writes gains.h for observer.c: a Kalman filter and a linear quadratic regulator of the linearised crane of sway.yaml.

    python examples/observer_gains.py
"""

from pathlib import Path

import numpy as np
from scipy.linalg import expm, solve_discrete_are

import cutjoint

SAMPLE = 0.02  # s, the dt of sway.yaml
NOISE = 4e-3 / 12**0.5  # m, the standard deviation of an encoder that is off by 2 mm at most

near = cutjoint.load(Path(__file__).with_name("sway.yaml"), linearise=True).reset().linearise()
print("states:", ", ".join(near.states))
print("inputs:", ", ".join(near.inputs))

# A sample: x becomes F x + G u, with the force u of the motor.
whole = np.zeros((5, 5))
whole[:4, :4], whole[:4, 4:] = near.A, near.B
F, G = np.split(expm(SAMPLE * whole)[:4], [4], axis=1)

# The filter: disturbances change the speeds in each sample by 2 mm/s and 0.5 mrad/s (standard deviations).
C = np.array([[1.0, 0.0, 0.0, 0.0]])
P = solve_discrete_are(F.T, C.T, np.diag([0.0, 0.0, 2e-3, 0.5e-3]) ** 2, np.array([[NOISE**2]]))
gain = P @ C.T / (C @ P @ C.T + NOISE**2)

# The regulator: a metre weighs as much as 0.2 rad and 800 N.
Q, R = np.diag([1.0, 0.2**-2, 0.0, 0.0]), np.array([[800.0**-2]])
S = solve_discrete_are(F, G, Q, R)
feedback = np.linalg.solve(R + G.T @ S @ G, G.T @ S @ F)


def line(name, values):
    return f"static const double {name}[4] = {{{', '.join(map(repr, values.ravel().tolist()))}}};\n"


Path("gains.h").write_text("/* by observer_gains.py */\n" + line("gain", gain) + line("feedback", feedback), encoding="utf-8")
for name, matrix in (("filter", F - F @ gain @ C), ("regulator", F - G @ feedback)):
    print(f"{name}: slowest mode decays in {-SAMPLE / np.log(abs(np.linalg.eigvals(matrix)).max()):.1f} s")
