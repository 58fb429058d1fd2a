"""Texts of expressions: valid ones from a grammar, mutations of these, and garbage; and Python's own value of them."""

from __future__ import annotations

import ast
import math
import random
import re
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

VARIABLES = ("length", "rate", "t")
UNITS = (
    "kg", "g", "t", "m", "km", "dm", "cm", "mm", "s", "ms", "min", "h", "Hz", "N", "kN", "MN", "J", "kJ", "W", "kW", "Pa", "kPa", "MPa",
    "bar", "rad", "mrad", "deg",
)  # fmt: skip
SMOOTH = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "sqrt", "exp", "log")
NUMBERS = (
    "0", "1", "2", "3", "7", "12", "0.5", ".5", "(1/3)", "1e-3", "2.5e2", "1e-300", "1e200", "1e300", "1e308", "5e-324",
    "9007199254740991", "pi",
)  # fmt: skip
GARBAGE = (
    "",
    " ",
    "(",
    ")",
    "((",
    "*/",
    "//",
    "/*",
    '"',
    "'",
    "\\",
    "{{",
    "}}",
    "{% raw %}",
    "${x}",
    "$(x)",
    "\n",
    "\t",
    "#",
    ";",
    ":=",
    "lambda",
    "**",
    "^",
    "%",
    "@",
    "<",
    "==",
    "!=",
    "not",
    "and",
    "in",
    "if",
    "else",
    "True",
    "None",
    "nan",
    "inf",
    "1e999",
    "0x10",
    "1j",
    "1_000",
    "[0]",
    ".real",
    "__import__('os')",
    "eval",
    "é",
    "π",
    "\x00",
    "\u202e",
    "x" * 70,
    "9" * 400,
    "-" * 70,
    ",",
    "where",
    "min()",
    "5 m",
    "3 kg*m",
    "~",
    "`",
    "f''",
)


def write(rng: random.Random, depth: int) -> str:
    """A valid text, with at most ``depth`` levels."""
    if depth <= 0 or rng.random() < 0.1:
        return rng.choice(VARIABLES) if rng.random() < 0.6 else rng.choice(NUMBERS)
    form = rng.choice(_FORMS)
    return form(rng, lambda: write(rng, depth - 1))


_Part = Callable[[], str]


def _condition(rng: random.Random, part: _Part) -> str:
    kind = rng.randrange(5)
    sign = rng.choice(("<", "<=", ">", ">="))
    if kind == 0:
        return f"({part()}) {sign} {part()} and {part()} < {rng.choice(NUMBERS)}"
    if kind == 1:
        return f"({part()}) {sign} {part()} or {part()} > {part()}"
    if kind == 2:
        return f"{rng.choice(NUMBERS)} < ({part()}) {sign} {part()}"
    return f"({part()}) {sign} ({part()})"


_FORMS: tuple[Callable[[random.Random, _Part], str], ...] = (
    lambda rng, part: f"({part()}){rng.choice('+-*/')}({part()})",
    lambda rng, part: f"{part()} {rng.choice('+-*/')} {part()} {rng.choice('+-*/')} {part()}",
    lambda rng, part: f"-({part()})",
    lambda rng, part: f"({part()})**{rng.choice(('2', '3', '0.5', '-1', '-0.5', '12', '(1/3)', '0', '1'))}",
    lambda rng, part: f"{rng.choice(SMOOTH)}({part()})",
    lambda rng, part: f"atan2({part()}, {part()})",
    lambda rng, part: f"{rng.choice(('abs', 'sign'))}({part()})",
    lambda rng, part: f"{rng.choice(('min', 'max'))}({', '.join(part() for _ in range(rng.randint(1, 4)))})",
    lambda rng, part: f"where({_condition(rng, part)}, {part()}, {part()})",
)


def nest(rng: random.Random) -> str:
    """One form within itself again and again, up to the limits of length."""
    form = rng.choice(
        (
            "abs({x}-{c})",
            "max({x}, rate*{c})",
            "min({x}, {c}, t)",
            "where({x} < {c}, rate, t)",
            "where(t < {c}, {x}, rate)",
            "sign({x}+{c})",
            "sin({x}*{c})",
            "exp(-({x}))",
            "1/({c}+{x})",
            "length/(rate+{x})",
            "atan2({x}, t)",
            "sqrt(({x})**2+{c})",
            "sqrt(({x})**2)",
            "({x}+{c})**12",
            "({x})**12 + 1/3",
            "1e200*({x})",
            "({x})*(length+{c})",
            "({x})*sin(length*{c})",
            "log(1+{x}*t)",
            "tanh({x}+rate)",
            "({x})**0.5*({c}+t)",
            "-({x})",
            "abs({x})*abs(length-{c})",
            "max({x},{c})*min(rate,{c})",
            "asin(sin({x}))",
            "({x})+length**3*{c}",
            "{c}+length*({x})",
        )
    )
    text = rng.choice(VARIABLES)
    for _ in range(rng.randint(1, 60)):
        longer = form.replace("{x}", text).replace("{c}", f"{rng.random():.3f}")
        if len(longer) > 2000:
            break
        text = longer
    return text


def mutate(rng: random.Random, text: str) -> str:
    """The text with a few passages deleted, doubled, exchanged or replaced by garbage."""
    for _ in range(rng.randint(1, 4)):
        i, j = sorted((rng.randint(0, len(text)), rng.randint(0, len(text))))
        j = min(j, i + 12)
        text = rng.choice(
            (
                text[:i] + text[j:],
                text[:i] + text[i:j] * 2 + text[j:],
                text[:i] + rng.choice(GARBAGE) + text[j:],
                text[:i] + rng.choice(NUMBERS) + text[i:],
                text[i:j] + text[:i] + text[j:],
            )
        )
    return text


def measure_text(rng: random.Random) -> str:
    """A number with a unit of up to three factors."""
    names = rng.choices(UNITS, k=rng.choice((1, 2, 3)))
    factors = [name + rng.choice(("", "", "^2", "**3", "^-1")) for name in names]
    return f"{rng.choice(('2.5', '-3e-3', '40'))} " + "".join(rng.choice("*/") * (k > 0) + factor for k, factor in enumerate(factors))


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def in_si(text: str) -> float | None:
    """Pint's value of a number with units of `UNITS`; None of other texts, and of units whose names Pint reads otherwise."""
    number, _, unit = text.partition(" ")
    try:
        if unit and set(re.findall("[A-Za-z]+", unit)) <= set(UNITS):
            return float(_registry().Quantity(float(number), unit).to_base_units().magnitude)
    except (ValueError, ArithmeticError):
        pass
    return None


def any_text(rng: random.Random) -> str:
    """A text of any of these kinds."""
    kind = rng.random()
    if kind < 0.1:
        return measure_text(rng)
    if kind < 0.6:
        return write(rng, rng.choice((1, 2, 2, 3, 3, 3, 4, 5)))
    if kind < 0.68:
        return nest(rng)
    if kind < 0.9:
        return mutate(rng, write(rng, rng.randint(1, 4)))
    return "".join(rng.choice((*GARBAGE, *VARIABLES, *NUMBERS, *SMOOTH)) for _ in range(rng.randint(0, 8)))


#: Changes of the numbers of a text and of its functions' values, relative and absolute, that show whether a value hangs on last digits.
_NEAR, _TINY = 1e-9, 1e-12
#: Numbers whose squares, which SymPy makes of the cosine of an arc's tangent, are still numbers.
_LARGEST = 1e150
#: Functions of which a number beyond the floats, infinite for Python on the way and not for SymPy, makes an ordinary wrong value.
_HIDING = ("asin", "acos", "atan", "sign", "where")
#: The name of `_power` in prepared texts.
_POWER = "_power"


def _moved(function: Callable[..., float], shift: float) -> Callable[..., float]:
    return lambda *x: float(function(*x)) * (1 + shift)


class _HangsOnDigitsError(ArithmeticError):
    """A value hangs on last digits.  It is no NaN, which `max` and comparisons would lose."""


def _angle(y: float, x: float) -> float:
    """`atan2` off its cut, where its value would hang on the sign of a zero."""
    if y == 0 and x < 0:
        raise _HangsOnDigitsError
    return math.atan2(y, x)


def _sign(x: float) -> float:
    """The sign of what is not rounding: those of the tangent of pi and of t*t/abs(t) - t would hang on the last digit."""
    if abs(x) < _NEAR:
        raise _HangsOnDigitsError
    return (x > 0) - (x < 0)


def _power(x: float, exponent: float) -> float:
    """A power; no root near zero, where an underflow may have lost that the number is negative, nor of minus infinity."""
    if x < _TINY and exponent != int(exponent):
        raise _HangsOnDigitsError
    return float(x**exponent)


def _python(shift: float) -> Mapping[str, Any]:
    """Python's meanings of names, with functions that are off by a share ``shift``."""
    return {
        **{name: _moved(getattr(math, name), shift) for name in SMOOTH},
        "atan2": _moved(_angle, shift),
        "sqrt": _moved(lambda x: _power(x, 0.5), shift),
        _POWER: _power,
        "min": lambda *x: min(x),
        "max": lambda *x: max(x),
        "abs": lambda x: abs(float(x)),
        "sign": _sign,
        "where": lambda c, a, b: a() if c else b(),
        "pi": math.pi * (1 + shift),
        "__builtins__": {},
    }


_PYTHON: Mapping[float, Mapping[str, Any]] = {shift: _python(shift) for shift in (0.0, _NEAR, -_NEAR)}


class _Prepared(ast.NodeTransformer):
    """Branches of `where` become functions, so that only one is evaluated, and powers become calls; numbers are moved by up to ``shift``,
    no two alike.

    Exponents stay: a root of what is negative has no real value near a whole power.
    """

    def __init__(self, shift: float) -> None:
        self.shift = shift
        self.share = 0.0
        self.is_extreme = False

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "where":
            none = ast.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
            node.args[1:] = [ast.Lambda(args=none, body=branch) for branch in node.args[1:]]
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        node.left = self.visit(node.left)
        if isinstance(node.op, ast.Pow):
            return ast.Call(func=ast.Name(id=_POWER, ctx=ast.Load()), args=[node.left, node.right], keywords=[])
        node.right = self.visit(node.right)
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        """Numbers that are no exponents are floats: whole ones grow without bound."""
        if type(node.value) not in (int, float):
            return node
        number = float(node.value)
        self.is_extreme |= number != 0 and not 1 / _LARGEST < abs(number) < _LARGEST
        if not self.shift:
            return ast.Constant(value=number)
        self.share = (self.share + 0.618) % 2  # the golden section spreads them
        moved = self.shift * (self.share - 1)
        return ast.Constant(value=number * (1 + moved) + math.copysign(_TINY, moved))


def plain_function(text: str, shift: float = 0.0) -> Callable[[Mapping[str, float]], float]:
    """Python's value, over variables, of a text that reading has accepted; NaN where it has none.  A ``shift`` of `_PYTHON` moves it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            prepared = _Prepared(shift)
            tree = prepared.visit(ast.parse(text.replace("\n", " ").strip(), mode="eval"))
            code = compile(ast.fix_missing_locations(tree), "text", "eval")
    except (SyntaxError, OverflowError):  # a number with a unit; a number beyond the floats
        return lambda values: math.nan
    if prepared.is_extreme and any(name in text for name in _HIDING):
        return lambda values: math.nan

    def function(values: Mapping[str, float]) -> float:
        try:
            value = eval(code, {**_PYTHON[shift], **values})
            return float(value) if isinstance(value, int | float) else math.nan
        except (ArithmeticError, ValueError, TypeError):  # a complex number compared
            return math.nan

    return function


def steady_value(text: str) -> Callable[[Mapping[str, float]], float]:
    """Python's value of a text over variables; NaN where it has none, or where near variables and numbers give another one."""
    plain, *moved = (plain_function(text, shift) for shift in (0.0, _NEAR, -_NEAR))

    def function(values: Mapping[str, float]) -> float:
        wanted = plain(values)
        near = [f(values) for f in moved]
        near += [plain({**values, name: x + sign * _NEAR}) for name, x in values.items() for sign in (1, -1)]
        steady = all(math.isfinite(y) and abs(y) < 1e100 and abs(y - wanted) <= 1e-4 * abs(wanted) + 1e-7 for y in (wanted, *near))
        return wanted if steady else math.nan

    return function
