"""Distance between two runs."""

from __future__ import annotations

import numpy as np

from cutjoint.run.results import Trajectory


def distance(one: Trajectory, other: Trajectory) -> float:
    """The farthest that columns in m are apart at the rows of the first, up to the end of the second.
    Infinite where a run did not end."""
    if one.failure is not None or other.failure is not None:
        return float("inf")
    both = one.t <= other.t[-1]  # a last step may go beyond the end of the scene
    lengths = [name for name, unit in one.units.items() if unit == "m"]
    return max(float(np.abs(one[c] - np.interp(one.t, other.t, other[c]))[both].max()) for c in lengths)
