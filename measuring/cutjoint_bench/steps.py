"""Steps and sample intervals as short fractions."""

from fractions import Fraction
from math import lcm


def exact(seconds: float) -> Fraction:
    """The short fraction that a step was written as."""
    return Fraction(repr(seconds)).limit_denominator(10**9)


def common_step(dt: float, row: float) -> float:
    """The shortest time that is a whole number of steps and of rows."""
    a, b = exact(dt), exact(row)
    return float(Fraction(lcm(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator))
