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

# A sample: x becomes F x + G u + H w, with the force u of the motor and w: values of both corrections, then their rates.
whole = np.zeros((9, 9))
whole[:4, :4], whole[:4, 4:7], whole[5:7, 7:] = near.A, near.B, np.eye(2)
F, G, H = np.split(expm(SAMPLE * whole)[:4], [4, 5], axis=1)

# The filter: forces of 50 N and torques of 200 N m (standard deviations) disturb each sample.
C = np.array([[1.0, 0.0, 0.0, 0.0]])
disturbance = H[:, :2] @ np.diag([50.0, 200.0]) ** 2 @ H[:, :2].T
P = solve_discrete_are(F.T, C.T, disturbance, np.array([[NOISE**2]]))
correction = np.linalg.solve(H, F @ P @ C.T / (C @ P @ C.T + NOISE**2))  # H w is the correction of the state

# The regulator: a metre weighs as much as 0.2 rad and 800 N.
Q, R = np.diag([1.0, 0.2**-2, 0.0, 0.0]), np.array([[800.0**-2]])
S = solve_discrete_are(F, G, Q, R)
feedback = np.linalg.solve(R + G.T @ S @ G, G.T @ S @ F)


def line(name, values):
    return f"static const double {name}[4] = {{{', '.join(map(repr, values.ravel().tolist()))}}};\n"


Path("gains.h").write_text("/* by observer_gains.py */\n" + line("correction", correction) + line("feedback", feedback), encoding="utf-8")
for name, matrix in (("filter", F - H @ correction @ C), ("regulator", F - G @ feedback)):
    print(f"{name}: slowest mode decays in {-SAMPLE / np.log(abs(np.linalg.eigvals(matrix)).max()):.1f} s")
