"""The N-four-bar as a model file for any N, and its exact motion on the parallelogram branch."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from cutjoint_bench.exact.chain import Chain, write_chain


def four_bar_text(windows: int, *, offset: float = 0.0) -> str:
    """An N-four-bar with N windows, its ground pins moved along x by ``offset``."""
    return write_chain(Chain(windows=windows, offset=offset))


def exact_tip(windows: int, t: np.ndarray) -> np.ndarray:
    """x and y of B_0, shape (n, 2): th'' = c sin th from the vertical, th' = 1, solved to 1e-12."""
    n = windows
    c = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    solution = solve_ivp(
        lambda _, s: [s[1], c * np.sin(s[0])], (0, float(t[-1])), [0, 1], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=t
    )
    return np.stack([np.sin(solution.y[0]), np.cos(solution.y[0])], axis=1)
