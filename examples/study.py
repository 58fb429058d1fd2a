"""A parameter study: how far the slider of the press goes, for a hundred springs at once.

    python examples/study.py
"""

from pathlib import Path

import numpy as np

import cutjoint

press = cutjoint.load(Path(__file__).parents[1] / "models" / "press.yaml").reset(dt=1e-3)
stiffness = np.linspace(500, 8000, 100)
rows = cutjoint.rollout(press, 2000, parameters={"stiffness": stiffness})
travel = np.ptp(rows[:, :, list(press.outputs).index("slider.x")], axis=1)
for i in range(0, len(stiffness), 20):
    print(f"{stiffness[i]:6.0f} N/m: {travel[i]:.4f} m")
