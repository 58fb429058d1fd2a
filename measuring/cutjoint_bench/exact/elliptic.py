"""Jacobi's elliptic functions over arrays, by mpmath."""

from __future__ import annotations

import mpmath
import numpy as np

from cutjoint.run.results import Array


def quarter_period(m: float) -> float:
    """The complete elliptic integral of the first kind, K(m)."""
    return float(mpmath.ellipk(m))


def argument(angle: float, m: float) -> float:
    """The argument u whose amplitude is an angle: the incomplete integral of the first kind, F(angle, m)."""
    return float(mpmath.ellipf(angle, m))


def amplitude(u: Array, m: float) -> Array:
    """The continuous amplitude am(u, m): a multiple of 2 pi from the angle of cn and sn, near pi u/(2 K)."""
    sn, cn = (np.array([float(mpmath.ellipfun(name, x, m=m)) for x in u]) for name in ("sn", "cn"))
    angle = np.arctan2(sn, cn)
    mean = np.pi * u / (2 * quarter_period(m))
    return np.asarray(angle + 2 * np.pi * np.round((mean - angle) / (2 * np.pi)))
