"""The region in which a law is zero: margins that are not negative there, from the conditions of its cases."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce
from itertools import combinations
from typing import TypeAlias

import sympy

from cutjoint.model.operations import choice
from cutjoint.model.records import Scalar

#: The region in which all of some margins are not negative: () is everywhere, None nowhere that is known.
Region: TypeAlias = tuple[Scalar, ...] | None


def zero_region(law: Scalar) -> Region:
    """The region in which an expression is zero; it may be zero elsewhere too.  A region has an inside.

    A case is without effect where its value is zero, its condition does not hold, or an earlier one holds; a sum is zero where its terms
    are, a product where a factor is.
    """
    if law == 0:
        return ()
    if isinstance(law, sympy.Piecewise):
        return _cases(law)
    if law.is_Add:
        return _all_of(zero_region(term) for term in law.args)
    if law.is_Mul:
        return _any_of(zero_region(factor) for factor in law.args)
    if law.is_Pow and law.exp.is_positive:
        return zero_region(law.base)
    return None


def zero_region_of(laws: Iterable[Scalar]) -> Region:
    """The region in which several expressions are zero together."""
    return _all_of(zero_region(law) for law in laws)


def _cases(law: Scalar) -> Region:
    regions: list[Region] = []
    conditions: list[Scalar] = []
    for value, condition in law.args:
        earlier = [_holds(c, value) for c in conditions]
        regions.append(_any_of([zero_region(value), _fails(condition, value), *earlier]))
        conditions.append(condition)
    return _all_of(regions)


def _holds(condition: Scalar, value: Scalar) -> Region:
    """The region in which a condition holds; None if ``value`` is not zero on a border that the region leaves out."""
    if condition in (sympy.true, sympy.false):
        return () if condition == sympy.true else None
    if isinstance(condition, sympy.And | sympy.Or):
        join = _all_of if isinstance(condition, sympy.And) else _any_of
        return join(_holds(part, value) for part in condition.args)
    is_strict = isinstance(condition, sympy.StrictLessThan | sympy.StrictGreaterThan)
    return _beyond(condition.gts - condition.lts, is_strict, value)


def _fails(condition: Scalar, value: Scalar) -> Region:
    """The region in which a condition does not hold; None if ``value`` is not zero on a border that the region leaves out."""
    if condition in (sympy.true, sympy.false):
        return () if condition == sympy.false else None
    if isinstance(condition, sympy.And | sympy.Or):
        join = _any_of if isinstance(condition, sympy.And) else _all_of
        return join(_fails(part, value) for part in condition.args)
    is_strict = isinstance(condition, sympy.LessThan | sympy.GreaterThan)
    return _beyond(condition.lts - condition.gts, is_strict, value)


def _beyond(margin: Scalar, is_strict: bool, value: Scalar) -> Region:
    return None if is_strict and not _vanishes(value, margin) else (margin,)


def _vanishes(value: Scalar, margin: Scalar) -> bool:
    """Return whether a value without cases is zero wherever the margin is."""
    for x in sorted(margin.free_symbols, key=str):
        slope = sympy.diff(margin, x)
        if not value.has(sympy.Piecewise) and slope != 0 and x not in slope.free_symbols:
            return bool(sympy.simplify(value.subs(x, x - margin / slope)) == 0)
    return False


def _all_of(regions: Iterable[Region]) -> Region:
    margins: list[Scalar] = []
    for region in regions:
        if region is None:
            return None
        margins += [m for m in region if m not in margins]
    return None if any(_exclude(one, other) for one, other in combinations(margins, 2)) else tuple(margins)


def _exclude(one: Scalar, other: Scalar) -> bool:
    """Return whether two margins are positive together nowhere: a law that is zero at one place, as |x|, acts all around it."""
    if (one + other).has(sympy.Piecewise):
        return False
    total, share = sympy.expand(one + other), sympy.cancel(one / other)
    return bool(total.is_nonpositive or (share.is_number and share.is_negative))


def _any_of(regions: Iterable[Region]) -> Region:
    known = [region for region in regions if region is not None]
    if not known or () in known:
        return () if known else None
    if len(known) == 1:
        return known[0]
    return (reduce(_larger, dict.fromkeys(reduce(_smaller, region) for region in known)),)


def _extreme(relation: type) -> Callable[[Scalar, Scalar], Scalar]:
    return lambda one, other: choice((one, relation(one, other, evaluate=False)), (other, sympy.true))


_larger, _smaller = _extreme(sympy.StrictGreaterThan), _extreme(sympy.StrictLessThan)
