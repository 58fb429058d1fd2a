"""SymPy -> block IR."""

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import sympy

from cutjoint.model.expressions.functions import SuppliedCall
from cutjoint.model.expressions.operations import Exponential
from cutjoint.model.records import Scalar
from cutjoint.ops import OPERATIONS, SMOOTH
from cutjoint.program.blocks import Block, Builder, is_identity

_CALLS: dict[Any, str] = {
    **{getattr(sympy, name): name for name in SMOOTH}, Exponential: "exp", sympy.Abs: "abs",
    sympy.StrictLessThan: "lt", sympy.LessThan: "le", sympy.Not: "not",
}  # fmt: skip

MAX_DEGREE = 20  #: polynomials up to this power of one factor are written in Horner's form


class Translator:
    """Turns expressions into scalar blocks; ``values`` gives the block of each symbol, ``read`` those of other symbols on demand."""

    def __init__(self, builder: Builder, values: Mapping[Scalar, Block], read: Callable[[Scalar], Block] | None = None) -> None:
        self._b = builder
        self._values = dict(values)
        self._known: dict[Any, Block] = dict(values)
        self._read = read

    def with_values(self, values: Mapping[Scalar, Block]) -> "Translator":
        """A translator that knows further symbols."""
        return Translator(self._b, {**self._values, **values}, self._read)

    def reading(self, read: Callable[[Scalar], Block]) -> "Translator":
        """A translator that reads symbols without a value."""
        return Translator(self._b, self._values, read)

    def scalar(self, expression: Scalar) -> Block:
        """One expression."""
        return self._scalar(sympy.sympify(expression))

    def matrix(self, matrix: Any) -> Block:
        """A SymPy matrix, element by element."""
        if matrix.is_square and matrix == sympy.eye(matrix.rows):
            return self._b.identity(matrix.rows)
        return self._b.stack([[self.scalar(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)])

    def _scalar(self, e: Any) -> Block:
        if e not in self._known:
            self._known[e] = self._translated(e)
        return self._known[e]

    def _translated(self, e: Any) -> Block:
        b = self._b
        if e.is_number:
            return b.number(float(e))
        if isinstance(e, sympy.Symbol):
            if self._read is None:
                raise KeyError(f"no value for symbol {e}")
            return self._read(e)
        if isinstance(e, sympy.Add):
            return self._polynomial(e) or b.total([self._scalar(a) for a in e.args])
        if isinstance(e, sympy.Mul):
            return self._product(e)
        if isinstance(e, sympy.Pow):
            return self._power(e)
        return self._piecewise(e) if isinstance(e, sympy.Piecewise) else self._call(e)

    def _polynomial(self, e: Any) -> Block | None:
        """Horner's scheme for a polynomial with constant coefficients in one symbol."""
        x = _polynomial_symbol(e)
        if x is None or _largest_degree(e) < 2 or sympy.degree(e, x) < 2:
            return None
        at = self._scalar(x)
        result = self._b.zero(1)
        for coefficient in sympy.Poly(e, x).all_coeffs():
            result = self._b.add(self._product_of(result, at), self._b.number(float(coefficient)))
        return result

    def _product_of(self, a: Block, b: Block) -> Block:
        if is_identity(a):
            return b
        return a if is_identity(b) else self._b.mul(a, b)

    def _product(self, e: Any) -> Block:
        if e.args[0] == -1:
            return self._b.neg(self._scalar(-e))
        numerator, denominator = sympy.fraction(e, exact=True)  # else exp(-x) is a division by exp(x), which overflows
        if denominator == 1:
            return reduce(self._product_of, [self._scalar(a) for a in e.args])
        return self._b.restrict(self._b.call("div", self._scalar(numerator), self._scalar(denominator)))

    def _power(self, e: Any) -> Block:
        base, exponent = e.args
        if exponent.is_number and exponent.is_negative:
            return self._b.restrict(self._b.call("div", self._b.number(1.0), self._scalar(base**-exponent)))
        if exponent == sympy.Rational(1, 2):
            return self._b.restrict(self._b.call("sqrt", self._scalar(base)))
        return self._b.restrict(self._b.call("pow", self._scalar(base), self._scalar(exponent)))

    def _piecewise(self, e: Any) -> Block:
        *cases, (last, condition) = e.args
        result = self._scalar(last)
        if condition != True:  # noqa: E712 - SymPy's true
            raise ValueError(f"no case of {e} holds where none of its conditions does")
        for value, when in reversed(cases):
            result = self._b.call("where", self._scalar(when), self._scalar(value), result)
        return result

    def _call(self, e: Any) -> Block:
        b = self._b
        if e in (sympy.true, sympy.false):
            return b.number(float(bool(e)))
        if isinstance(e, sympy.StrictGreaterThan | sympy.GreaterThan):
            return self._call(e.reversed)
        if isinstance(e, sympy.And | sympy.Or):
            name = "and" if isinstance(e, sympy.And) else "or"
            parts = [self._scalar(a) for a in sorted(e.args, key=sympy.default_sort_key)]
            return reduce(lambda u, v: b.call(name, u, v), parts)
        if isinstance(e, sympy.sign):
            return self._sign(self._scalar(e.args[0]))
        if isinstance(e, SuppliedCall):
            return b.call(e.function, *map(self._scalar, e.arguments))
        name = _CALLS.get(e.func, "")
        if not name:
            raise ValueError(f"{e.func} has no counterpart in the program")
        call = b.call(name, *[self._scalar(a) for a in e.args])
        return b.restrict(call) if OPERATIONS[name].margin else call

    def _sign(self, x: Block) -> Block:
        b, zero = self._b, self._b.number(0.0)
        below = b.call("where", b.call("lt", x, zero), b.number(-1.0), zero)
        return b.call("where", b.call("lt", zero, x), b.number(1.0), below)


def _polynomial_symbol(e: Any) -> Any:
    """The one symbol of a polynomial that is expanded or in Horner's form, so that its coefficients can be read off.
    No product has two sums and no sum has a power: these would be expanded and lose digits."""
    if e.is_number:
        return None
    if e.is_Symbol:
        return e
    if e.is_Pow:
        return e.base if e.base.is_Symbol and e.exp.is_Integer and 0 < e.exp <= MAX_DEGREE else None
    if not (e.is_Add or (e.is_Mul and sum(part.is_Add for part in e.args) <= 1)):
        return None
    found = {_polynomial_symbol(part) for part in e.args if not part.is_number}
    return found.pop() if len(found) == 1 else None


def _largest_degree(e: Any) -> int:
    """An upper bound of the degree of a polynomial in one symbol; without SymPy's polynomials, which take a hundred times as long."""
    if e.is_Mul:
        return sum(map(_largest_degree, e.args))
    if e.is_Add:
        return max(map(_largest_degree, e.args))
    return int(e.exp) if e.is_Pow and e.base.is_Symbol else int(e.is_Symbol)
