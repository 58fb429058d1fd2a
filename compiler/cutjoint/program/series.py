"""Series of Chebyshev polynomials and of cosines and sines as arrays of coefficients: values, derivatives, coefficients from values."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


def derivative(coefficients: Array, half: float) -> Array:
    """The derivative (n, m) of Chebyshev series (n, m) on an interval of half the length ``half``, padded to the same length."""
    found = np.zeros_like(coefficients)
    if len(coefficients) > 1:
        found[:-1] = chebyshev.chebder(coefficients, scl=1 / half)
    return found


def fourier_derivative(coefficients: Array) -> Array:
    """The derivative (n, m) of trigonometric series (n, m) in the order 1, cos q, sin q, cos 2q, ..."""
    found = np.zeros_like(coefficients)
    order = np.arange(1, len(coefficients) // 2 + 1)[:, np.newaxis]
    found[1::2], found[2::2] = order * coefficients[2::2], -order * coefficients[1::2]
    return found
