"""The N-four-bar as a model file for any N, and its exact motion on the parallelogram branch."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from tests.conftest import MODELS


def four_bar_text(windows: int, *, offset: float = 0.0) -> str:
    """The text of models/four_bar.yaml with N windows, its ground pins moved along x by ``offset``."""
    head, _, tail = (MODELS / "four_bar.yaml").read_text().partition("instances:\n")
    _, _, rest = tail.partition("markers:\n")
    bar = "  {name}: {{use: bar, connect: {{base: {base}}}, with: {{x_from: {a}, y_from: {b}, x_to: {c}, y_to: {d}}}}}\n"
    cranks = "".join(
        bar.format(name=f"crank_{i}", base="ground", a=i + offset, b=0, c=i + offset, d=1) for i in range(windows + 1)
    )
    couplers = "".join(
        bar.format(name=f"coupler_{i}", base=f"crank_{i - 1}.bar", a=i - 1 + offset, b=1, c=i + offset, d=1)
        for i in range(1, windows + 1)
    )
    cuts = "".join(
        f"  closure_{i}: {{kind: revolute, bodies: [coupler_{i}.bar, crank_{i}.bar], at: [{i + offset}, 1, 0], "
        "axis: [0, 0, 1], cut: true}\n"
        for i in range(1, windows + 1)
    )
    rates = ", ".join(f"crank_{i}.pin.angle_rate: -1" for i in range(windows + 1))
    rest = rest.replace("crank_0.pin.angle_rate: -1, crank_1.pin.angle_rate: -1, crank_2.pin.angle_rate: -1", rates)
    rest = rest.replace("at: [0, 1, 0]", f"at: [{offset}, 1, 0]")
    return f"{head}instances:\n{cranks}{couplers}\njoints:\n{cuts}\nmarkers:\n{rest}"


def exact_tip(windows: int, t: np.ndarray) -> np.ndarray:
    """x and y of B_0, shape (n, 2): th'' = c sin th from the vertical, th' = 1, solved to 1e-12."""
    n = windows
    c = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    solution = solve_ivp(
        lambda _, s: [s[1], c * np.sin(s[0])], (0, float(t[-1])), [0, 1], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=t
    )
    return np.stack([np.sin(solution.y[0]), np.cos(solution.y[0])], axis=1)
