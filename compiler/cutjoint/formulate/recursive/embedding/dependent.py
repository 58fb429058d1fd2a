"""Dependent joints of an embedded loop: series in its independent coordinate q and, optionally, a guided coordinate u.

::

    s = sum of c_ij f_i(q) T_j(u)      s' = s_q q' + s_u u'      s'' = s_q q'' + s_qq q'^2 + 2 s_qu q' u' + s_uu u'^2 + s_u u''

f_i are Chebyshev polynomials on the range of q or, where q makes full turns, the cosines and sines of its multiples. All derivatives are
exact derivatives of one series, so that the equations of motion stay Lagrangian whatever its truncation error.

A ball joint has series for its Rodrigues parameters g, the tangent of half its angle times its axis: quaternion (1, g)/sqrt(1 + g^2),
angular velocity 2/(1 + g^2) (g' + g x g').
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from cutjoint.model.records import EmbeddedLoop, Interval, Joint, LoopFunctions, Series
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.series import Array, derivative, fourier_derivative

#: A guided coordinate with its rate and acceleration.
Drive: TypeAlias = tuple[Block, Block, Block]


@dataclass(frozen=True, kw_only=True)
class DependentMotion:
    """The motion of a dependent joint: coordinates, quaternion, speeds, accelerations without their terms in q'', as in `JointMotion`.
    ``derivative`` (k, 1) are the speeds by q'."""

    motion: tuple[tuple[Block, ...], tuple[Block, ...], tuple[Block, ...], tuple[Block, ...]]
    derivative: Block


@dataclass(frozen=True, kw_only=True)
class _Value:
    """A function of q and u: its value, its derivative by q, its rate, and its second time derivative without the term in q''."""

    place: Block
    derivative: Block
    rate: Block
    second_rate: Block


def dependent_motion(b: Builder, joint: Joint, embedded_loop: EmbeddedLoop, drive: Drive | None) -> DependentMotion:
    """The motion of a dependent joint of an embedded loop; ``drive`` has u with its rate and acceleration."""
    values = [
        _evaluate(b, embedded_loop, series, coefficients, drive)
        for series, coefficients in zip(embedded_loop.functions.series[joint.name], _tunable(b, embedded_loop, joint), strict=True)
    ]
    scalars = values[: len(joint.element.coordinates)]
    place, derivative = [x.place for x in scalars], [x.derivative for x in scalars]
    rate, second_rate = [x.rate for x in scalars], [x.second_rate for x in scalars]
    quaternion: tuple[Block, ...] = ()
    if joint.element.has_ball:
        quaternion, turned = _ball_motion(b, values[len(scalars) :])
        for whole, part in zip((derivative, rate, second_rate), turned, strict=True):
            whole += [b.element(part, i) for i in range(3)]
    which = joint.element.speeds if len(joint.element.speeds) > 1 else ("",)
    for blocks, symbol in ((rate, "v"), (derivative, "derivative"), (second_rate, "second_rate")):
        for block, name in zip(blocks, which, strict=True):
            b.name(block, symbol, joint.name, which=(name,) if name else ())
    return DependentMotion(motion=(tuple(place), quaternion, tuple(rate), tuple(second_rate)), derivative=b.column(derivative))


def _ball_motion(b: Builder, values: Sequence[_Value]) -> tuple[tuple[Block, ...], tuple[Block, Block, Block]]:
    """The quaternion of a ball; its angular velocity by q', the whole one, and the angular acceleration without q''."""
    names = ("place", "derivative", "rate", "second_rate")
    g, derivative, rate, second_rate = (b.column([getattr(x, name) for x in values]) for name in names)
    quaternion = quaternion_of(b, g)
    turned = [angular_velocity_of(b, g, x) for x in (derivative, rate, second_rate)]
    slowed = b.scale(b.mul(_share(b, g), b.dot(g, rate)), turned[1])
    return quaternion, (turned[0], turned[1], b.sub(turned[2], slowed))


def _share(b: Builder, g: Block) -> Block:
    return b.call("div", b.number(2.0), b.add(b.number(1.0), b.dot(g, g)))


def quaternion_of(b: Builder, g: Block) -> tuple[Block, Block, Block, Block]:
    """The quaternion of Rodrigues parameters (3, 1), scalar first."""
    root = b.call("sqrt", b.mul(b.number(0.5), _share(b, g)))
    x, y, z = (b.mul(root, b.element(g, i)) for i in range(3))
    return root, x, y, z


def angular_velocity_of(b: Builder, g: Block, rate: Block) -> Block:
    """The angular velocity (3, 1) of Rodrigues parameters and their rates (3, 1)."""
    return b.scale(_share(b, g), b.add(rate, b.cross(g, rate)))


def coefficients_of(functions: LoopFunctions) -> int:
    """The number of coefficients of all series."""
    return sum(len(row) for series in functions.series.values() for one in series for row in one.coefficients)


def fitted_inputs(embedded_loops: Iterable[EmbeddedLoop]) -> dict[str, Array]:
    """The coefficients of embedded loops with tunable geometry, and a margin, by their symbols, as `fitted` has them."""
    return {
        f"series:{a.independent}": np.array([*(row[0] for each in a.functions.series.values() for x in each for row in x.coefficients), 1])
        for a in embedded_loops if a.functions.open
    }  # fmt: skip


def _tunable(b: Builder, embedded_loop: EmbeddedLoop, joint: Joint) -> Iterator[Block | None]:
    """The coefficients of a joint's series where they are loaded with parameters."""
    functions, first = embedded_loop.functions, 0
    for name, found in functions.series.items():
        for series in found:
            size = len(series.coefficients)
            if name == joint.name:
                yield b.take(fitted(b, embedded_loop), (first, first + size)) if functions.open else None
            first += size


def fitted(b: Builder, embedded_loop: EmbeddedLoop) -> Block:
    """The coefficients of all series of an embedded loop with tunable geometry, concatenated, and the margin of its fit."""
    return b.symbol(f"series:{embedded_loop.independent}", coefficients_of(embedded_loop.functions) + 1, BindingTime.PARAM)


def _evaluate(b: Builder, embedded_loop: EmbeddedLoop, series: Series, tunable: Block | None, drive: Drive | None) -> _Value:
    q, rate = independent_motion(b, embedded_loop)
    c = np.array(series.coefficients)
    functions = embedded_loop.functions
    basis = _fourier_basis(b, q, len(c)) if functions.is_periodic else _basis(b, q, functions.range, len(c))
    b.label(basis, f"T_{embedded_loop.independent}".replace(".", "_"), rows=tuple(map(str, range(len(c)))))
    if tunable is not None:
        place, derivative, second_rate = (b.dot(_derived(b, tunable, functions, order), basis) for order in range(3))
    else:
        place, derivative, second_rate = (_value(b, c, functions, basis, drive, (order, 0)) for order in range(3))
    if series.growth:
        growth = b.number(series.growth)
        place, derivative = b.add(place, b.mul(growth, q)), b.add(derivative, growth)
    speed, bent = b.mul(derivative, rate), b.mul(second_rate, b.mul(rate, rate))
    if drive is not None:
        _, ud, udd = drive
        driven, mixed, across = (_value(b, c, functions, basis, drive, orders) for orders in ((0, 1), (1, 1), (0, 2)))
        crossed = b.mul(b.number(2.0), b.mul(mixed, b.mul(rate, ud)))
        speed = b.add(speed, b.mul(driven, ud))
        bent = b.total([bent, crossed, b.mul(across, b.mul(ud, ud)), b.mul(driven, udd)])
    return _Value(place=place, derivative=derivative, rate=speed, second_rate=bent)


def _value(b: Builder, c: Array, functions: LoopFunctions, basis: Block, drive: Drive | None, orders: tuple[int, int]) -> Block:
    """A derivative of given orders by q and u."""
    if drive is None or functions.drive_range is None:
        for _ in range(orders[0]):
            c = fourier_derivative(c) if functions.is_periodic else derivative(c, functions.range.half)
        return b.mul(b.const([list(c[:, 0])]), basis)
    for _ in range(orders[1]):
        c = derivative(c.T, functions.drive_range.half).T
    column = b.mul(b.const([list(row) for row in c]), _basis(b, drive[0], functions.drive_range, c.shape[1]))
    for _ in range(orders[0]):
        column = _derivatives(b, column, functions.range.half)
    return b.dot(column, basis)


def _derived(b: Builder, column: Block, functions: LoopFunctions, order: int) -> Block:
    """The coefficients of a derivative by q."""
    for _ in range(order):
        if functions.is_periodic:
            whole = fourier_derivative(np.eye(column.shape[0]))
            column = b.mul(b.const([list(row) for row in whole]), column)
        else:
            column = _derivatives(b, column, functions.range.half)
    return column


def _derivatives(b: Builder, column: Block, half: float) -> Block:
    """The derivative of a Chebyshev series on an interval of half the length ``half``: d_(k-1) = d_(k+1) + 2 k c_k, of d_0 the half."""
    n = column.shape[0]
    found = [b.zero(1)] * (n + 1)
    for k in range(n - 1, 0, -1):
        found[k - 1] = b.add(found[k + 1], b.mul(b.number(2 * k / half), b.element(column, k)))
    return b.column([b.mul(b.number(0.5), found[0]), *found[1:n]])


def independent_motion(b: Builder, embedded_loop: EmbeddedLoop) -> tuple[Block, Block]:
    """The independent coordinate of an embedded loop and its rate."""
    q, v = (b.symbol(f"{name}:{embedded_loop.independent}", 1, BindingTime.ITERATION) for name in ("q", "v"))
    return q, v


def _basis(b: Builder, q: Block, interval: Interval, size: int) -> Block:
    """Chebyshev polynomials on an interval as a column."""
    x = b.mul(b.number(1 / interval.half), b.sub(q, b.number(interval.middle)))
    twice = b.mul(b.number(2.0), x)
    found = [b.number(1.0), x]
    while len(found) < size:
        found.append(b.sub(b.mul(twice, found[-1]), found[-2]))
    return b.column(found[:size])


def _fourier_basis(b: Builder, q: Block, size: int) -> Block:
    """1, cos q, sin q, cos 2q, sin 2q, ... as a column of odd length."""
    cosine, sine = b.call("cos", q), b.call("sin", q)
    twice = b.mul(b.number(2.0), cosine)
    found = [b.number(1.0), cosine, sine]
    before = b.number(1.0), b.number(0.0)
    while len(found) < size:
        now = found[-2], found[-1]
        found += [b.sub(b.mul(twice, x), old) for x, old in zip(now, before, strict=True)]
        before = now
    return b.column(found[:size])
