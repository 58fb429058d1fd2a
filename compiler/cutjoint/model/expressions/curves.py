"""Curves and surfaces through points, as piecewise expressions with linear extrapolation.

Curves: piecewise linear, or monotone cubics. Surfaces over a grid: bilinear, or bicubic with the slopes of parabolas through three adjacent
points, so that derivatives are continuous.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import sympy

from cutjoint.model.expressions.operations import choice
from cutjoint.model.records import Scalar


def polyline(x: Scalar, points: Sequence[float], ordinates: Sequence[Scalar]) -> Scalar:
    """Straight lines from point to point; ``points`` rise strictly."""
    secants = [(b - a) / (q - p) for (p, q), (a, b) in zip(pairwise(points), pairwise(ordinates), strict=True)]
    pieces = [_cubic(x, p, a, slope) for p, a, slope in zip(points, ordinates, secants, strict=False)]
    inner = zip(pieces[:-1], points[1:-1], strict=True)
    return choice(*(_below(x, limit, piece) for piece, limit in inner), (pieces[-1], sympy.true))


def monotone_cubic(x: Scalar, points: Sequence[float], ordinates: Sequence[Scalar]) -> Scalar:
    """A curve through points that is monotone where they are, with a continuous derivative; linear outside.
    Piecewise cubic Hermite with the slopes of Fritsch and Butland, A Method for Constructing Local Monotone Piecewise Cubic Interpolants
    (SIAM J. Sci. Stat. Comput. 5, 1984). ``points`` rise strictly; ``ordinates`` may be expressions."""
    return _hermite(x, points, ordinates, _slopes(points, ordinates))


def _hermite(x: Scalar, points: Sequence[float], ordinates: Sequence[Scalar], slopes: Sequence[Scalar]) -> Scalar:
    """Cubics with given slopes at their points; linear outside."""
    branches = [_below(x, points[0], _cubic(x, points[0], ordinates[0], slopes[0]))]
    for k, (p, q) in enumerate(pairwise(points)):
        h = q - p
        secant = (ordinates[k + 1] - ordinates[k]) / h
        second, third = (3 * secant - 2 * slopes[k] - slopes[k + 1]) / h, (slopes[k] + slopes[k + 1] - 2 * secant) / h**2
        branches.append(_below(x, q, _cubic(x, p, ordinates[k], slopes[k], second, third)))
    return choice(*branches, (_cubic(x, points[-1], ordinates[-1], slopes[-1]), sympy.true))


def _below(x: Scalar, limit: float, value: Scalar) -> tuple[Scalar, Scalar]:
    return value, sympy.StrictLessThan(x, sympy.Float(limit), evaluate=False)


def _cubic(x: Scalar, start: float, *coefficients: Scalar) -> Scalar:
    """A polynomial of x - start in Horner's form."""
    step = x - sympy.Float(start) if start else x
    value = _coefficient(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = _coefficient(coefficient) + step * value
    return value


def _coefficient(value: Scalar) -> Scalar:
    return sympy.Float(value) if isinstance(value, float | int) else value


def _slopes(points: Sequence[float], ordinates: Sequence[Scalar]) -> list[Scalar]:
    steps = [b - a for a, b in pairwise(points)]
    secants = [(b - a) / h for (a, b), h in zip(pairwise(ordinates), steps, strict=True)]
    if len(secants) == 1:
        return [secants[0], secants[0]]
    inner = [_butland(steps[k : k + 2], secants[k : k + 2]) for k in range(len(secants) - 1)]
    return [_end_slope(steps[:2], secants[:2]), *inner, _end_slope(steps[:-3:-1], secants[:-3:-1])]


def _butland(steps: Sequence[float], secants: Sequence[Scalar]) -> Scalar:
    is_monotone = _is_positive(secants[0] * secants[1])
    if is_monotone is False:
        return 0.0
    left, right = steps[0] + 2 * steps[1], 2 * steps[0] + steps[1]
    first, second = (_either(is_monotone, secant, sympy.Integer(1)) for secant in secants)  # divisors where the curve turns, too
    return _either(is_monotone, (left + right) / (right / second + left / first), 0.0)


def _is_positive(value: Scalar) -> Any:
    """Return whether a value is above zero: True or False of numbers, a condition of expressions."""
    return sympy.StrictGreaterThan(value, 0, evaluate=False) if getattr(value, "free_symbols", ()) else bool(value > 0)


def _end_slope(steps: Sequence[float], secants: Sequence[Scalar]) -> Scalar:
    """The three-point slope at an end, limited so that the curve stays monotone."""
    slope = ((2 * steps[0] + steps[1]) * secants[0] - steps[0] * secants[1]) / (steps[0] + steps[1])
    first, most = secants[0], 3 * secants[0]
    agrees, is_monotone = _is_positive(slope * first), _is_positive(first * secants[1])
    is_steep = _is_positive((slope - most) * first)  # where slope and first agree in sign
    return _either(agrees, _either(is_monotone, slope, _either(is_steep, most, slope)), 0.0)


def _either(condition: Any, yes: Scalar, no: Scalar) -> Scalar:
    """The one value where a condition holds, else the other."""
    if isinstance(condition, bool):
        return yes if condition else no
    return choice((yes, condition), (no, sympy.true))


def surface(x: Scalar, xs: Sequence[float], y: Scalar, ys: Sequence[float], rows: Sequence[Sequence[float]], *, is_linear: bool) -> Scalar:
    """The surface over a grid: ``rows`` has for each of ``xs`` the values at all ``ys``; both rise strictly."""
    if is_linear:
        return polyline(x, xs, [polyline(y, ys, row) for row in rows])
    return _parabolic(x, xs, [_parabolic(y, ys, row) for row in rows])


def _parabolic(x: Scalar, points: Sequence[float], ordinates: Sequence[Scalar]) -> Scalar:
    """Cubics with the slopes of parabolas: linear in the ordinates, which may be expressions."""
    return _hermite(x, points, ordinates, _parabolic_slopes(points, ordinates))


def _parabolic_slopes(points: Sequence[float], ordinates: Sequence[Scalar]) -> list[Scalar]:
    steps = [b - a for a, b in pairwise(points)]
    secants = [(b - a) / h for (a, b), h in zip(pairwise(ordinates), steps, strict=True)]
    if len(secants) == 1:
        return [secants[0], secants[0]]
    inner = [(steps[k + 1] * secants[k] + steps[k] * secants[k + 1]) / (steps[k] + steps[k + 1]) for k in range(len(secants) - 1)]
    start = secants[0] + (secants[0] - secants[1]) * (steps[0] / (steps[0] + steps[1]))
    end = secants[-1] + (secants[-1] - secants[-2]) * (steps[-1] / (steps[-1] + steps[-2]))
    return [start, *inner, end]
