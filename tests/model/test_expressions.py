"""Expressions: their grammar, their translation, and refusals."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
import sympy

from cutjoint.model.expressions.evaluate import evaluate, evaluate_runs
from cutjoint.model.expressions.operations import MAX_EXACT, ExpressionError, Term
from cutjoint.model.expressions.parse import read_term, variable
from cutjoint.model.expressions.units import LENGTH, MASS, SPEED

X, Y = variable("x"), variable("y")
NAMES = {
    "x": Term(X),
    "y": Term(Y),
    "length": Term(variable("length"), LENGTH),
    "speed": Term(variable("speed"), SPEED),
    "mass": Term(variable("mass"), MASS),
}


def refusal(text: str) -> tuple[str, str]:
    with pytest.raises(ExpressionError) as caught:
        read_term(text, NAMES)
    return caught.value.message, caught.value.hint


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2*x + 3", 2 * X + 3),
        ("-x**2", -(X**2)),
        ("+x - -y", X + Y),
        ("1/12", sympy.Rational(1, 12)),
        ("pi/2", sympy.pi / 2),
        ("x/y/2", X / Y / 2),
        ("x**2.0", X**2),
        ("sqrt(x)*exp(-x)", sympy.sqrt(X) * sympy.exp(-X)),
        ("atan2(y, x)", sympy.atan2(Y, X, evaluate=False)),
        ("x\n + y", X + Y),
    ],
)
def test_expressions_become_sympy(text: str, expected: sympy.Expr) -> None:
    assert read_term(text, NAMES).value == expected


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("min(x, 1)", {-1.0: -1.0, 2.0: 1.0}),
        ("max(x, 0, 1/2)", {-1.0: 0.5, 2.0: 2.0}),
        ("where(abs(x) < 1 and max(x, 0) < 0.5, 1, 2)", {-2.0: 2.0, -0.5: 1.0, 0.2: 1.0, 0.7: 2.0}),
        ("max(min(x, 1), -1, x/4)", {-8.0: -1.0, 0.0: 0.0, 3.0: 1.0, 8.0: 2.0}),
        ("abs(x - 1)", {-1.0: 2.0, 3.0: 2.0}),
        ("sqrt(x**2)", {-1.5: 1.5, 3.0: 3.0}),
        ("sign(x)", {-3.0: -1.0, 0.0: 0.0, 3.0: 1.0}),
        ("where(x < 0 and x > -2, 1, 2)", {-3.0: 2.0, -1.0: 1.0, 0.0: 2.0}),
        ("where(0 < x <= 1 or x > 5, x, -x)", {-3.0: 3.0, 1.0: 1.0, 2.0: -2.0, 6.0: 6.0}),
        ("where(abs(x) < 1 or sign(x) > 0, min(x, 3), 0)", {-2.0: 0.0, -0.5: -0.5, 2.0: 2.0, 4.0: 3.0}),
        ("tanh(x)*log(x)", {2.0: math.tanh(2) * math.log(2)}),
    ],
)
def test_kinks_keep_their_values(text: str, values: dict[float, float]) -> None:
    expression = read_term(text, NAMES).value
    for x, expected in values.items():
        assert evaluate(expression, {X: x}) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["min(x, 1)", "abs(x)", "where(x < 1, x**2, 1)", "sqrt(x**2)"])
def test_kinks_are_piecewise_with_exact_derivatives(text: str) -> None:
    expression = read_term(text, NAMES).value
    assert isinstance(expression, sympy.Piecewise)
    slope = sympy.diff(expression, X)
    assert not slope.has(sympy.Derivative, sympy.Heaviside)
    step = 1e-6
    for x in (-0.7, 0.3):
        secant = (evaluate(expression, {X: x + step}) - evaluate(expression, {X: x - step})) / (2 * step)
        assert float(slope.subs(X, x)) == pytest.approx(secant, abs=1e-8)


def test_numbers_keep_all_bits() -> None:
    for number in (0.1, 1 / 3, 5e-324, 1.7976931348623157e308):
        assert float(read_term(number, {}).value) == number
        assert float(read_term(repr(number), {}).value) == number


def test_quantities_become_si() -> None:
    angle = read_term("30 deg", {})
    assert float(angle.value) == pytest.approx(math.pi / 6)
    assert read_term("5 ms", {}).number == 0.005
    assert str(read_term("2 kN/mm", {}).dimension) == "N/m"
    assert read_term("3 1/s", {}).number == 3


def test_a_quotient_is_not_a_unit() -> None:
    assert read_term("11/x", NAMES).value == 11 / X


def test_dimensions_follow_products() -> None:
    assert str(read_term("mass*speed**2/length", NAMES).dimension) == "N"
    assert str(read_term("sqrt(length**2)", NAMES).dimension) == "m"
    assert read_term("2*length", NAMES).dimension is None
    assert refusal("length + mass") == ("m and kg cannot be added or compared", "")
    assert refusal("where(length < speed, 1, 2)")[0] == "m and m/s cannot be added or compared"


UNITS = "numbers in an expression have no units, write SI numbers: 20*pi/180; a unit has no parentheses, as in 5 N*s/m"
LISTED = "use numbers, names, + - * / **, comparisons inside where, and the listed functions"


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("x^2", "'^' is not a power", "use **"),
        ("z + 1", "unknown symbol 'z'", "symbols here: length, mass, pi, speed, x, y"),
        ("lenght", "unknown symbol 'lenght'", "did you mean 'length'?"),
        ("sine(x)", "unknown function 'sine'", "did you mean 'sin'?"),
        ("sin", "'sin' is a function", "write sin(...)"),
        ("sin(x, y)", "sin needs 1 argument, got 2", ""),
        ("min()", "min needs at least one argument, got 0", ""),
        ("x < 1", "a condition stands outside where", "write where(condition, value, other)"),
        ("1 if x else 2", "'if' is not allowed in an expression", "write where(condition, value, other)"),
        ("where(x, 1, 2)", "the first argument of where must be a condition",
         "write for example where(x < 0, a, b)"),
        ("where(x == 1, 1, 2)", "a condition compares with < <= > >= only", ""),
        ("x**y", "an exponent must be a number", "use exp and log for other powers"),
        ("x**13", "the exponent 13 is larger than 12 in absolute value", ""),
        ("x/(1 - 1)", "division by zero", ""),
        ("sqrt(-1)", "'sqrt' of -1 has no finite real value", ""),
        ("x // 2", "an operator is not allowed in an expression", "use + - * / **"),
        ("x y", "'x y' is not an expression", "write for example '2*pi*radius'"),
        ("20 deg*sin(x)", "'20 deg*sin(x)' is not an expression", UNITS),
        ("5 N/(m/s)", "'5 N/(m/s)' is not an expression", UNITS),
        ("3 kg*m2", "'3 kg*m2' is not an expression", UNITS),
        ("1/2 inch", "'1/2 inch' is not an expression", UNITS),
        ("sqrt(2) m", "'sqrt(2) m' is not an expression", UNITS),
        ("30\u00b0", "the expression has a character that does not belong there", "units have plain letters: deg, um, m/s^2, N*m"),
        ("9.81 m/s\u00b2", "the expression has a character that does not belong there", "units have plain letters: deg, um, m/s^2, N*m"),
        ("0,5", "'0,5' has a decimal comma", "write a decimal point"),
        ("0,5 m", "'0,5 m' has a decimal comma", "write a decimal point"),
        ("3 foo", "unknown unit 'foo'", "write for example '30 deg' or '5 N*s/m'"),
        ("1e999", "a number is not finite", ""),
        ("1_0*x", "'1_0' is not a number here", "write it in decimal digits, without underscores"),
        ("0x10", "'0x10' is not a number here", "write it in decimal digits, without underscores"),
        ("2 kg^0", "'kg^0' is not a unit: a power of zero has none", "write for example '30 deg' or '5 N*s/m'"),
    ],
)  # fmt: skip
def test_mistakes_are_named(text: str, message: str, hint: str) -> None:
    assert refusal(text) == (message, hint)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("x.__class__", "x.__class__"),
        ("(lambda: 1)()", "(lambda: 1)()"),
        ("[x for x in (1,)]", "[x for x in (1,)]"),
        ("x[0]", "x[0]"),
        ("'text'", "'text'"),
        ("True", "True"),
        ("None", "None"),
        ("sin(x=1)", "sin(x=1)"),
        ("sin(*x)", "*x"),
        ("(x := 1)", "(x := 1)"),
        ("f'{x}'", "f'{x}'"),
        ("await x", "await x"),
    ],
)
def test_code_is_refused(text: str, shown: str) -> None:
    assert refusal(text)[0].startswith(f"'{shown}' is not a")


@pytest.mark.parametrize("text", ["__import__('os')", "eval('1')", "open('f')", "().__class__.__bases__[0]", "x; import os"])
def test_attacks_are_refused(text: str) -> None:
    message, _ = refusal(text)
    assert "unknown function" in message or "is not a" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x" + "+x" * 1500, "the expression is longer than 2000 characters"),
        ("-" * 100 + "x", "the expression is nested deeper than 60 levels"),
        ("sin(" * 70 + "x" + ")" * 70, "the expression is nested deeper than 60 levels"),
        ("min(" * 30 + "x" + ",1)" * 30, "the expression expands to more than 5000 operations"),
        ("9**9**9", "the exponent 3.8742e+08 is larger than 12 in absolute value"),
        ("((9**12)**12)**12", "'**' of 2.57585e+137, 12 has no finite real value"),
        ("exp(exp(exp(10)))", "'exp' of 22026.5 has no finite real value"),
        ("1e300*x*1e300", "a number in the expression is out of range"),
        ("9" * 400, "a whole number is too large to be exact"),
        ("x # y", "the expression has a character that does not belong there"),
        ("\uff58 + 1", "the expression has a character that does not belong there"),
        ("x\x00", "the expression has a character that does not belong there"),
        ("(" * 300 + "x" + ")" * 300, None),
    ],
)
def test_bounds_hold_quickly(text: str, message: str | None) -> None:
    start = time.process_time()
    found, _ = refusal(text)
    assert message is None or found == message
    assert time.process_time() - start < 5


def test_long_sums_are_no_nesting() -> None:
    assert read_term("+".join(["x"] * 500), NAMES).value == 500 * X


def test_evaluation_of_what_has_no_value_is_nan() -> None:
    assert math.isnan(evaluate(1 / X, {X: 0.0}))
    assert math.isnan(evaluate(sympy.sqrt(X), {X: -1.0}))
    assert math.isnan(evaluate(X + Y, {X: 1.0}))


@pytest.mark.parametrize("text", [
    "x + 2*y - 1/3", "sqrt(x)*x**1.5", "asin(x/4) + acos(y/4) + atan(x) + atan2(y, x)", "exp(x - 80.5)*1e30 + log(x)", "sinh(x) + cosh(y)",
    "tanh(x)*tan(y)*cos(x) - sin(y)", "abs(x - y) + sign(y - 1)", "max(x, y, 1) - min(x, 2*y)", "where(x < y or y >= 0.5, x**2, pi)",
    "where(x < 1 and y > 1, 1/(x - 1), where(x >= 3, y, sqrt(x - 1)))", "x**-3",
])  # fmt: skip
def test_many_runs_have_the_values_of_single_ones(text: str) -> None:
    expression, columns = read_term(text, NAMES).value, {X: np.array([0.0, 0.3, 1.0, 2.0, 3.0, -1.5, 2.5]), Y: np.linspace(-1, 2, 7)}
    single = np.array([evaluate(expression, {X: float(x), Y: float(y)}) for x, y in zip(columns[X], columns[Y], strict=True)])
    many = evaluate_runs(expression, columns, 7)
    assert np.array_equal(np.isfinite(many), np.isfinite(single))
    np.testing.assert_allclose(many[np.isfinite(many)], single[np.isfinite(single)], rtol=1e-14)
    assert np.array_equal(evaluate_runs(read_term("x/7", NAMES).value, {X: 2.0}, 3), np.full(3, 2.0 / 7))


@pytest.mark.parametrize(
    "text",
    [
        "abs(abs(abs(abs(abs(x) - 1) - 0.5) - 0.25) - 0.2)",
        "max(max(max(max(y, x, 0.7), x*y, 0.7), 2*x, 0.7), x, 0.7)",
        "where(where(where(x < 1, y, 2) < y, x, 3) < max(x, y), min(x, y, 1), abs(y))",
        "max(" + ", ".join(f"{i}*x" for i in range(12)) + ")",
        "*".join(f"sin({i}*x)" for i in range(1, 15)),
    ],
)
def test_large_expressions_are_differentiated_twice_quickly(text: str) -> None:
    start = time.process_time()
    expression = read_term(text, NAMES).value
    assert not sympy.diff(expression, X, X).has(sympy.Derivative)
    assert time.process_time() - start < 3


@pytest.mark.parametrize("text", ["*".join(f"sin({i}*x)" for i in range(1, 100)), "sin(" * 55 + "x" + ")" * 55])
def test_derivatives_that_explode_are_refused(text: str) -> None:
    message, hint = refusal(text)
    assert message == "the second derivative of the expression expands to more than 25000 operations"
    assert hint == "write fewer factors in a product, and fewer functions within functions"


@pytest.mark.parametrize("form", ["{}", "atan({})", "atan2({}, 1)", "atan2(1, {})", "cosh({})", "exp({})", "0*({})", "({})**2", "1/({})"])
@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1/(x - x)", "division by zero"),
        ("(x - x)/(y - y)", "division by zero"),
        ("x + 0/(y - y)", "division by zero"),
        ("log(x - x)", "'log' of 0 has no finite real value"),
        ("acos(2*x/x)", "'acos' of 2 has no finite real value"),
        ("log(-x/x)", "'log' of -1 has no finite real value"),
        ("exp(exp(x/x + 1e300))", "'exp' of 1e+300 has no finite real value"),
        ("sqrt(-x**2)", "a part of the expression has no finite real value"),
    ],
)
def test_what_is_never_real_is_refused(form: str, text: str, wanted: str) -> None:
    message, hint = refusal(form.format(text))
    assert message == wanted
    assert hint == ("look for a division by zero and roots of what is negative" if "part" in wanted else "")


def test_choices_stay_as_they_are_written() -> None:
    expression = read_term("where(abs(x) < max(x, y), x, y)**0.5", NAMES).value
    assert expression.func is sympy.Pow
    assert expression.xreplace({X: -X}).xreplace({X: -X}) == expression
    assert str(read_term("abs(x)", NAMES).value) == "Piecewise((x, x >= 0), (-x, True))"


def nested(form: str, times: int, innermost: str) -> str:
    text = innermost
    for _ in range(times):
        text = form.replace("@", text)
    return text


LONG = [
    ("(@)**12 + 1/3", 7, "1/3"),
    ("(@)**12*1/3 + 1/7", 14, "1/3"),
    ("1/(@ + 1/9007199254740881)", 20, "1/3"),
    ("(@)*9007199254740881/9007199254740847", 25, "1/3"),
]


@pytest.mark.parametrize(("form", "times", "innermost"), LONG)
def test_long_fractions_become_floats(form: str, times: int, innermost: str) -> None:
    term = read_term(nested(form, times, innermost), {})
    assert term.number is not None
    assert float(term.value) == pytest.approx(term.number, rel=1e-14)
    assert all(max(abs(n.p), n.q) <= MAX_EXACT for n in term.value.atoms(sympy.Rational))


def test_short_fractions_stay_exact() -> None:
    assert read_term("(1/3)**12 + 1/7 - 2/21", {}).value == sympy.Rational(1, 3) ** 12 + sympy.Rational(1, 21)


@pytest.mark.parametrize(
    ("form", "times", "message"),
    [
        ("(@)**12 + 1/3", 8, "powers within each other multiply to more than 1000"),
        ("(3*@)**12", 20, "powers within each other multiply to more than 1000"),
        ("(@*@)**12", 3, "powers within each other multiply to more than 1000"),
        ("sin((@)**10)", 4, "powers within each other multiply to more than 1000"),
        ("(@)**(11/7)", 20, "more than 6 roots or fractional powers stand within each other"),
        ("sqrt(@)**3", 9, "more than 6 roots or fractional powers stand within each other"),
    ],
)
def test_powers_within_powers_are_bounded(form: str, times: int, message: str) -> None:
    assert refusal(nested(form, times, "x"))[0] == message
