"""Laws: every form becomes an expression with the right values."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, RegularGridInterpolator

from cutjoint.model.expressions.curves import monotone_cubic
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable

from .pendulum import read

LENGTH, RATE, POSITION, T = (variable(name) for name in ("length", "rate", "position", "t"))
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'


def joint_law(law: str):
    return read('"-0.1*rate"', law).forces[0].law


def spring_law(law: str):
    spring = f"spring: {{kind: point_spring, bodies: [ground, arm], from: [0, 0, 1], to: tip, law: {law}}}"
    return read(DRAG, spring).forces[0].law


def test_expressions_and_numbers() -> None:
    assert joint_law("3") == 3
    assert joint_law('"2*rate + t"') == 2 * RATE + T
    assert float(joint_law("5 kN*m")) == 5000


def test_polynomials_are_in_horners_form() -> None:
    law = joint_law("{polynomial: [1, 2, 0, 4], of: position}")
    assert law == 1 + POSITION * (2 + 4 * POSITION * POSITION)
    assert sympy.count_ops(joint_law("{polynomial: [1.5, 2.5, 3.5, 4.5], of: rate}")) == 6


def test_piecewise_laws() -> None:
    law = joint_law(
        '{of: rate, piecewise: [{below: -1, polynomial: [-7]}, {below: 1, polynomial: [0, 2]}, {expression: "rate**2 + t"}]}'
    )
    for rate, expected in ((-2.0, -7.0), (-1.0, -2.0), (0.5, 1.0), (1.0, 4.0), (2.0, 7.0)):
        assert evaluate(law, {RATE: rate, T: 3.0}) == expected
    assert joint_law("{of: rate, piecewise: [{polynomial: [5]}]}") == 5


def test_limits_may_be_parameters() -> None:
    law = joint_law("{of: position, piecewise: [{below: arm_mass/arm_mass, polynomial: [1]}, {polynomial: [2]}]}")
    assert evaluate(law, {POSITION: 0.5}) == 1
    law = spring_law("{of: length, piecewise: [{below: arm_length, polynomial: [1]}, {polynomial: [2]}]}")
    symbol = sympy.Symbol("p_arm_length", real=True)
    assert evaluate(law, {LENGTH: 1.4, symbol: 1.5}) == 1
    assert evaluate(law, {LENGTH: 1.6, symbol: 1.5}) == 2


def test_sums() -> None:
    law = spring_law("{sum: [{polynomial: [0, 3], of: length}, rate, {sum: [1, 2]}]}")
    assert law == 3 * LENGTH + RATE + 3


def test_springs_pull_and_joints_are_drawn_back() -> None:
    law = spring_law("{stiffness: 100 N/m, damping: 5, free_length: 20 cm}")
    assert evaluate(law, {LENGTH: 0.5, RATE: 2.0}) == pytest.approx(100 * 0.3 + 5 * 2)
    law = joint_law("{stiffness: 100, damping: 5, free_position: 0.2}")
    assert evaluate(law, {POSITION: 0.5, RATE: 2.0}) == pytest.approx(-(100 * 0.3 + 5 * 2))
    assert joint_law("{damping: 5}") == -5 * RATE


X = [0.0, 0.5, 1.0, 2.0, 3.5, 4.0]
Y = [0.0, 1.0, 1.0, 4.0, 3.0, -2.0]


@pytest.mark.parametrize("values", [Y, [0.0, 1.0, -9.0, -9.5, 3.0, -20.0], [1.0, 0.9, -20.0, 0.0, 0.0, 0.1]])
def test_tables_are_pchip_curves(values: list[float]) -> None:
    law = monotone_cubic(LENGTH, X, values)
    oracle = PchipInterpolator(X, values)
    for x in np.linspace(X[0], X[-1], 101):
        assert evaluate(law, {LENGTH: float(x)}) == pytest.approx(float(oracle(x)), abs=1e-12)


def test_tables_keep_monotone_data_monotone() -> None:
    values = [0.0, 0.1, 0.1, 5.0, 5.1, 100.0]
    law = monotone_cubic(LENGTH, X, values)
    curve = [evaluate(law, {LENGTH: float(x)}) for x in np.linspace(-1, 5, 301)]
    assert all(b >= a - 1e-12 for a, b in itertools.pairwise(curve))


def test_tables_go_on_straight() -> None:
    law = monotone_cubic(LENGTH, X, Y)
    oracle = PchipInterpolator(X, Y).derivative()
    for outside, end in ((-2.0, X[0]), (7.0, X[-1])):
        expected = Y[X.index(end)] + float(oracle(end)) * (outside - end)
        assert evaluate(law, {LENGTH: outside}) == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(40))
def test_cubics_follow_values_that_are_symbols(seed: int) -> None:
    """SciPy's interpolant through the values of the symbols: rising, turning, flat and steep at the ends."""
    values = np.random.default_rng(seed).integers(-3, 4, len(X)) * 1.5
    symbols = sympy.symbols(f"y:{len(X)}", real=True)
    fixed = seed % 3  # every so many is a number
    given = [float(value) if fixed and i % (fixed + 1) else symbol for i, (value, symbol) in enumerate(zip(values, symbols, strict=True))]
    law, oracle = monotone_cubic(LENGTH, X, given), PchipInterpolator(X, values)
    known = dict(zip(symbols, values.tolist(), strict=True))
    for x in np.linspace(X[0], X[-1], 41):
        assert evaluate(law, {LENGTH: x, **known}) == pytest.approx(float(oracle(x)), abs=1e-12)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_values_of_tables_may_be_expressions(interpolation: str) -> None:
    length = sympy.Symbol("p_arm_length", real=True)
    rows = ("[[0, 3, 1*arm_length], [1, 2, 5]]", "[[0, 3, 1.7], [1, 2, 5]]")
    over_both, over_one = f"length: [0, 1], rate: {RATES}", "length: [0, 1, 3]"
    moved, wanted = (spring_law(f"{{table: {{{over_both}, value: {row}}}, interpolation: {interpolation}}}") for row in rows)
    curve, other = (
        spring_law(f"{{table: {{{over_one}, value: [0, {value}, 5]}}, interpolation: {interpolation}}}") for value in ("2*arm_length", 3.4)
    )
    for x, r in itertools.product(np.linspace(-0.5, 3.5, 9), np.linspace(-1.5, 1.5, 9)):
        at = {LENGTH: x, RATE: r, length: 1.7}
        assert evaluate(moved, at) == pytest.approx(evaluate(wanted, at), abs=1e-13)
        assert evaluate(curve, at) == pytest.approx(evaluate(other, at), abs=1e-13)


def test_tables_have_continuous_slopes() -> None:
    slope = sympy.diff(monotone_cubic(LENGTH, X, Y), LENGTH)
    for x in X:
        below, above = (float(slope.subs(LENGTH, x + step)) for step in (-1e-9, 1e-9))
        assert below == pytest.approx(above, abs=1e-6)


@pytest.mark.parametrize("values", [Y, [0, 1, 3, 2, 5, 5]])
def test_linear_tables_are_straight_from_point_to_point(values: list[float]) -> None:
    law = spring_law(f"{{table: {{length: {X}, value: {values}}}, interpolation: linear}}")
    inside = np.linspace(X[0], X[-1], 101)
    assert [evaluate(law, {LENGTH: x}) for x in inside] == pytest.approx(list(np.interp(inside, X, values)), abs=1e-14)
    for end, other, step in ((0, 1, -0.7), (-1, -2, 0.7)):
        slope = (values[end] - values[other]) / (X[end] - X[other])
        assert evaluate(law, {LENGTH: X[end] + step}) == pytest.approx(values[end] + step * slope)


#: Values over X and three rates.
RATES = [-1.0, 0.5, 1.0]
SURFACE = np.array([[np.sin(2 * x) + x * r - r * r for r in RATES] for x in X])


def surface_law(interpolation: str) -> sympy.Expr:
    return spring_law(f"{{table: {{length: {X}, rate: {RATES}, value: {SURFACE.tolist()}}}, interpolation: {interpolation}}}")


def test_linear_surfaces_are_bilinear() -> None:
    law, oracle = surface_law("linear"), RegularGridInterpolator((X, RATES), SURFACE)
    for x, r in itertools.product(np.linspace(X[0], X[-1], 23), np.linspace(-1, 1, 17)):
        assert evaluate(law, {LENGTH: x, RATE: r}) == pytest.approx(float(oracle((x, r))), abs=1e-13)


def through_parabolas(points: list[float], values: np.ndarray) -> Callable[[float], np.ndarray]:
    """A cubic with the slopes of parabolas through neighbours, straight beyond its ends."""
    slopes = np.gradient(values, points, axis=0, edge_order=2)
    spline = CubicHermiteSpline(points, values, slopes)
    return lambda x: spline(np.clip(x, points[0], points[-1])) + spline(np.clip(x, points[0], points[-1]), 1) * (
        x - np.clip(x, points[0], points[-1])
    )


def test_smooth_surfaces_are_cubics_along_both_variables() -> None:
    """Inside, on the lines of the grid and beyond them; the order of the variables does not matter."""
    law, along = surface_law("cubic"), through_parabolas(X, SURFACE)
    for x, r in itertools.product(np.linspace(X[0] - 0.5, X[-1] + 0.5, 23), np.linspace(-1.5, 1.5, 13)):
        expected = float(through_parabolas(RATES, along(x))(r))
        assert evaluate(law, {LENGTH: x, RATE: r}) == pytest.approx(expected, abs=1e-12)


def test_smooth_surfaces_have_continuous_slopes() -> None:
    law = surface_law("cubic")
    for symbol, other, points in ((LENGTH, RATE, X), (RATE, LENGTH, RATES)):
        slope = sympy.diff(law, symbol)
        for point in points:
            below, above = (evaluate(slope, {symbol: point + step, other: 0.3}) for step in (-1e-9, 1e-9))
            assert below == pytest.approx(above, abs=1e-6)


def test_two_points_make_a_line() -> None:
    law = spring_law("{table: {length: [1 m, 150 cm], value: [0, 1 kN]}}")
    for length in (0.5, 1.25, 2.0):
        assert evaluate(law, {LENGTH: length}) == pytest.approx(2000 * (length - 1))


def test_guides_and_inputs_are_laws_of_time() -> None:
    model = read("axis: [0, 1, 0]", "axis: [0, 1, 0], guide: {polynomial: [10 deg, 20 deg/s], of: t}")
    assert evaluate(model.joints[0].guide[0], {T: 2.0}) == pytest.approx(np.deg2rad(50))
    model = read("end: 2", "end: 2, inputs: {swing: {table: {t: [0, 1], value: [0, 3]}}}")
    assert evaluate(model.scenes["fall"].inputs["swing"], {T: 0.5}) == pytest.approx(1.5)
    guided = read("axis: [0, 1, 0]", 'axis: [0, 1, 0], guide: "swing*sin(t)"')
    assert guided.joints[0].guide[0] == sympy.Symbol("p_swing", real=True) * sympy.sin(T)


@pytest.mark.parametrize(
    ("times", "values", "words"),
    [
        ("[0, 1]", "[0, 3]", "its table ends at 1 s and is extrapolated linearly; the scene takes 0 to 2 s; extend the table"),
        ("[0.5, 2]", "[0, 3]", "its table begins at 0.5 s and is extrapolated linearly; the scene takes 0 to 2 s; extend the table"),
        ("[0, 2]", "[0, 3]", ""),
        ("[0, 0.5, 1]", "[0, 3, 3]", ""),
    ],
)
def test_a_table_over_part_of_a_scene_is_a_warning(times: str, values: str, words: str) -> None:
    model = read("end: 2", f"end: 2, inputs: {{swing: {{table: {{t: {times}, value: {values}}}}}}}")
    notes = [note for note in model.notes if "its table" in note]
    assert len(notes) == bool(words)
    assert not words or notes[0].endswith(words)


@pytest.mark.parametrize(("method", "count"), [("augmented", 1), ("classical", 1), ("recursive", 0), ("auto", 0)])
def test_a_method_without_embedded_loops_is_a_warning(method: str, count: int) -> None:
    """`loops: embedded` of a scene with such a method was left out silently."""
    model = read("end: 2", f"end: 2, method: {method}, numerics: {{loops: embedded}}")
    assert sum(f"the method {method} has exact loops only; write method: recursive" in note for note in model.notes) == count
