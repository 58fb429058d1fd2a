"""Chebyshev and trigonometric series as arrays of coefficients: values, derivatives, coefficients from values."""

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


def chebyshev_series(values: Array) -> Array:
    """Coefficients (n, m) of the polynomials through values (n, m) at the Chebyshev nodes."""
    n = len(values)
    x = np.cos(np.pi * (np.arange(n) + 0.5) / n)[::-1]
    table = chebyshev.chebvander(x, n - 1)
    found = table.T @ values * (2 / n)
    found[0] /= 2
    return np.asarray(found)


def chebyshev_integral(derivatives: Array, half: float) -> Array:
    """Coefficients (n + 1, m) of the integrals of derivatives (n, m) at Chebyshev nodes, without constants.
    The interval has half length ``half``."""
    whole = np.zeros((len(derivatives) + 1, derivatives.shape[1]))
    whole[1:] = chebyshev.chebint(chebyshev_series(derivatives), scl=half)[1:]
    return whole


def set_constants(whole: Array, places: Array, x: Array) -> None:
    """Set the constants of Chebyshev series (n, m) by values (nodes, m) at places from -1 to 1."""
    whole[0] = np.mean(places - chebyshev.chebval(x, whole).T, axis=0)


def harmonics(q: Array, size: int) -> Array:
    """1, cos q, sin q, cos 2q, sin 2q, ... as columns (n, size)."""
    order = np.arange(1, size // 2 + 1)
    basis = np.ones((len(q), size))
    basis[:, 1::2], basis[:, 2::2] = np.cos(np.outer(q, order)), np.sin(np.outer(q, order))
    return basis


def fourier_integral(places: Array, derivatives: Array, nodes: Array, growth: float) -> Array:
    """Coefficients (2 n + 1, 1) of a trigonometric series through values and derivatives (nodes, 1), besides the growth with q."""
    n = len(nodes)
    order = np.arange(1, n // 2)
    cosine, sine = (2 / n * f(np.outer(order, nodes)) @ derivatives for f in (np.cos, np.sin))
    whole = np.zeros((2 * len(order) + 1, 1))
    whole[1::2], whole[2::2] = -sine / order[:, np.newaxis], cosine / order[:, np.newaxis]
    whole[0] = np.mean(places - growth * nodes[:, np.newaxis] - harmonics(nodes, len(whole)) @ whole)
    return whole
