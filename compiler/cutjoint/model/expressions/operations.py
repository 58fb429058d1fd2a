"""Operations on terms: expressions with their dimensions, their values if constant, and their sizes.

Constants are tried in plain floats before SymPy sees them, so that nothing overflows or grows without bound.
Functions with non-smooth points (min, max, abs, sign, where) become cases, so that derivatives are exact.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import sympy

from cutjoint import ops
from cutjoint.elements.terms import Scalar
from cutjoint.model.expressions.choices import Choice, Extent, measure
from cutjoint.model.expressions.units import Dimension

MAX_SIZE = 5000  #: nodes after expansion
MAX_DERIVED = 25_000  #: nodes of a second derivative, about
MAX_POWER = 12
MAX_INTEGER = 2**53
MAX_EXACT = 2**256  #: numerators and denominators of fractions that stay exact
MAX_IRRATIONAL = 30  #: operations of irrational constants that stay exact
MAX_ROOT = 100  #: denominators of exponents that stay exact
MAX_DEGREE = 1000  #: exponents within each other, multiplied
MAX_ROOTS = 6  #: fractional powers within each other
#: Comparisons: SymPy's and the plain one.
RELATIONS: Mapping[type[ast.cmpop], tuple[Any, Callable[[float, float], bool]]] = {
    ast.Lt: (sympy.StrictLessThan, operator.lt),
    ast.LtE: (sympy.LessThan, operator.le),
    ast.Gt: (sympy.StrictGreaterThan, operator.gt),
    ast.GtE: (sympy.GreaterThan, operator.ge),
}
MANY = -1


class Exponential(sympy.Function):  # type: ignore[misc]
    """exp of a sum with a decimal number, anything else SymPy's. SymPy takes such a number out of the exponent, exp(x - 800.5) =
    exp(-800.5) exp(x): of its factors one may overflow and one vanish where the whole has a value."""

    nargs = 1

    @classmethod
    def eval(cls, argument: Scalar) -> Scalar | None:
        """SymPy's function where it leaves the exponent whole."""
        if argument.is_Add and any(part.is_Float for part in argument.args):
            return None
        return sympy.exp(argument)

    def fdiff(self, argindex: int = 1) -> Scalar:
        """The derivative, which is the function itself."""
        return self

    def _eval_is_extended_real(self) -> bool | None:
        return self.args[0].is_extended_real  # type: ignore[no-any-return]

    def _eval_is_extended_positive(self) -> bool | None:
        return self.args[0].is_extended_real  # type: ignore[no-any-return]

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        power = f"e^{{{printer.doprint(self.args[0])}}}"
        return power if exp is None else rf"\left({power}\right)^{{{exp}}}"

    def _sympystr(self, printer: Any) -> str:
        return f"exp({printer.doprint(self.args[0])})"


class ExpressionError(ValueError):
    """Text that is not a valid expression.  ``hint`` is the remedy."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


@dataclass(frozen=True)
class Term:
    """An expression with its known properties.

    ``dimension`` is None when it is not known: bare numbers fit everywhere.  ``number`` is the value of a
    constant, None when the expression has symbols.  ``size`` counts the nodes of the expression, ``degree`` is
    that of a polynomial with the same powers within each other, ``roots`` counts fractional powers within each other.
    ``memory_of`` is the function of which it is the memory, "" of a number.
    """

    value: Scalar
    dimension: Dimension | None = None
    number: float | None = None
    size: int = 1
    degree: float = 1
    roots: int = 0
    memory_of: str = ""


def constant(value: int | float, dimension: Dimension | None = None) -> Term:
    """A number: integers stay exact, others are floats to the last bit. Raises ExpressionError when it is out of range."""
    if isinstance(value, int):
        if abs(value) > MAX_INTEGER:
            raise ExpressionError("a whole number is too large to be exact", "write it with a decimal point")
        return Term(sympy.Integer(value), dimension, float(value))
    if not math.isfinite(value):
        raise ExpressionError("a number is not finite")
    return Term(sympy.Integer(0) if value == 0 else sympy.Float(value), dimension, value)


def negative(term: Term) -> Term:
    """The term with its sign reversed."""
    return _apply("-", operator.neg, operator.neg, [term], term.dimension)


def binary(sign: ast.operator, a: Term, b: Term) -> Term:
    """A sum, product or power of two terms.  Raises ExpressionError."""
    match sign:
        case ast.Add():
            return _apply("+", operator.add, operator.add, [a, b], _common([a, b]))
        case ast.Sub():
            return _apply("-", operator.sub, operator.sub, [a, b], _common([a, b]))
        case ast.Mult():
            dimension = a.dimension * b.dimension if a.dimension and b.dimension else None
            return _apply("*", operator.mul, operator.mul, [a, b], dimension)
        case ast.Div():
            if b.number == 0:
                raise ExpressionError("division by zero")
            dimension = a.dimension / b.dimension if a.dimension and b.dimension else None
            return _apply("/", operator.truediv, operator.truediv, [a, b], dimension)
        case ast.Pow():
            return _power(a, b)
        case ast.BitXor():
            raise ExpressionError("'^' is not a power", "use **")
    raise ExpressionError("an operator is not allowed in an expression", "use + - * / **")


def _power(a: Term, b: Term) -> Term:
    if b.number is None:
        raise ExpressionError("an exponent must be a number", "use exp and log for other powers")
    if abs(b.number) > MAX_POWER:
        raise ExpressionError(f"the exponent {b.number:g} is larger than {MAX_POWER} in absolute value")
    exponent = _exponent(b)
    base = replace(a, degree=a.degree * max(abs(b.number), 1), roots=a.roots + (not exponent.is_Integer))
    _check_powers(base)
    dimension = a.dimension ** Fraction(b.number).limit_denominator(100) if a.dimension else None
    return _apply("**", lambda x, _: x**exponent, operator.pow, [base, b], dimension)


def _check_powers(term: Term) -> None:
    """Raises ExpressionError for powers within powers for which SymPy makes numbers of endless length, or takes endless time."""
    if term.number is not None:
        return
    if term.degree > MAX_DEGREE:
        raise ExpressionError(f"powers within each other multiply to more than {MAX_DEGREE}", "write smaller exponents")
    if term.roots > MAX_ROOTS:
        raise ExpressionError(f"more than {MAX_ROOTS} roots or fractional powers stand within each other", "write one power in their place")


def _exponent(term: Term) -> Scalar:
    """A whole number, a fraction with a small denominator, or a float; SymPy takes exponential time for powers of powers with others."""
    assert term.number is not None
    if term.number == int(term.number):
        return sympy.Integer(int(term.number))
    is_simple = term.value.is_Rational and term.value.q <= MAX_ROOT
    return term.value if is_simple else sympy.Float(term.number)


def _apply(
    name: str, symbolic: Callable[..., Scalar], numeric: Callable[..., Any], terms: list[Term], dimension: Dimension | None = None
) -> Term:
    """Apply an operation.  Constants are tried in floats first: values that overflow there never reach SymPy."""
    size = 1 + sum(term.size for term in terms)
    numbers = [term.number for term in terms if term.number is not None]
    if len(numbers) < len(terms):
        degrees = [term.degree for term in terms if term.number is None]
        degree, roots = sum(degrees) if name in ("*", "/") else max(degrees), max(term.roots for term in terms)
        value = _short_numbers(symbolic(*(term.value for term in terms)))
        if value is not sympy.nan:  # it may follow from a failed term
            for part in (value, *(value.args if value.is_Mul else ())):
                require_real(part)
            if value.is_number:  # the variables have cancelled, as in x/x: it is tried in floats as other constants are
                number = _numeric(name, lambda: float(value), [])
                return Term(_short_constant(value, number, size), dimension, number, size)
        return Term(value, dimension, None, size, degree, roots)
    number = _numeric(name, numeric, numbers)
    if number == 0:
        return Term(sympy.Integer(0), dimension, 0.0)
    value = _short_constant(_short_numbers(symbolic(*(term.value for term in terms))), number, size)
    if value == 0:  # exactly, where floats leave a last digit, as of sin(pi)
        return Term(sympy.Integer(0), dimension, 0.0)
    return Term(value, dimension, number, size)


def require_real(value: Scalar) -> None:
    """Raises ExpressionError when a value without symbols is infinite, undefined or complex, as 1/(x - x) and acos(2*x/x) are."""
    if value in (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I) or (value.is_number and _is_complex(value)):
        hint = "look for a division by zero and roots of what is negative"
        raise ExpressionError("a part of the expression has no finite real value", hint)


def _is_complex(value: Scalar) -> bool:
    """Return whether a number is not real; decided by its digits where its assumptions do not say, as of roots of a tangent."""
    if value.is_extended_real is not None:
        return not value.is_extended_real
    real, imaginary = (abs(part) for part in value.evalf().as_real_imag())
    return bool(imaginary > 1e-12 * real)


def _short_constant(value: Scalar, number: float, size: int) -> Scalar:
    """A constant, as a float where it is irrational and long: SymPy takes exponential time for its digits."""
    return value if size <= MAX_IRRATIONAL or value.is_Rational else sympy.Float(number)


def _short_numbers(result: Scalar) -> Scalar:
    """The result of one operation with its long fractions as floats.
    One operation on short fractions makes fractions of a few thousand digits at most, which stand at the top of the result: as a term,
    as a factor of one, or as an exponent. The next operation must not meet them."""
    top = (result, *result.args, *(inner for part in result.args for inner in part.args))
    long = {part: sympy.Float(part) for part in top if part.is_Rational and max(abs(part.p), part.q) > MAX_EXACT}
    return result.xreplace(long) if long else result


def _numeric(name: str, numeric: Callable[..., Any], numbers: list[float]) -> float:
    shown = ", ".join(f"{number:g}" for number in numbers)
    try:
        number = numeric(*numbers)
    except ZeroDivisionError:
        raise ExpressionError("division by zero") from None
    except (OverflowError, ValueError):
        number = math.nan
    if isinstance(number, complex) or not math.isfinite(number):
        raise ExpressionError(f"'{name}'{' of ' * bool(shown)}{shown} has no finite real value")
    return float(number)


def _common(terms: list[Term]) -> Dimension | None:
    """The dimension shared by all terms.  Raises ExpressionError when two known ones differ."""
    known = [term.dimension for term in terms if term.dimension is not None]
    if len(set(known)) > 1:
        raise ExpressionError(f"{known[0]} and {next(d for d in known if d != known[0])} cannot be added or compared")
    return known[0] if len(known) == len(terms) else None


def smooth(name: str, terms: list[Term]) -> Term:
    """A differentiable function of terms.  Raises ExpressionError."""
    symbolic, numeric = SMOOTH[name]
    dimension = None
    if name == "atan2":
        return _apply(name, _atan2, numeric, terms)
    if name == "sqrt":
        dimension = terms[0].dimension ** Fraction(1, 2) if terms[0].dimension else None
        terms = [replace(terms[0], roots=terms[0].roots + 1)]
        _check_powers(terms[0])
    return _apply(name, symbolic, numeric, terms, dimension)


def _atan2(y: Scalar, x: Scalar) -> Scalar:
    if any(part.free_symbols or part.has(sympy.Piecewise) for part in (y, x)):
        return sympy.atan2(y, x, evaluate=False)
    return sympy.Float(math.atan2(float(y), float(x)))


def compare(sign: ast.cmpop, a: Term, b: Term) -> Scalar:
    """A condition, true or false at once for constants.  Raises ExpressionError."""
    if type(sign) not in RELATIONS:
        raise ExpressionError("a condition compares with < <= > >= only")
    _common([a, b])
    relation, numeric = RELATIONS[type(sign)]
    if a.number is not None and b.number is not None:
        return sympy.true if numeric(a.number, b.number) else sympy.false
    if a.value.has(sympy.nan) or b.value.has(sympy.nan):  # it follows from a failed term, and SymPy joins no conditions of it
        return sympy.true
    return relation(a.value, b.value, evaluate=False)


def join_conditions(conditions: list[Scalar], *, all_of: bool = True) -> Scalar:
    """The conjunction of conditions, or their disjunction."""
    join, decisive, neutral = (sympy.And, sympy.false, sympy.true) if all_of else (sympy.Or, sympy.true, sympy.false)
    if decisive in conditions:
        return decisive
    open_ones = [condition for condition in conditions if condition is not neutral]
    return join(*open_ones, evaluate=False) if len(open_ones) > 1 else (open_ones or [neutral])[0]


def where(condition: Scalar, yes: Term, no: Term, size: int) -> Term:
    """The one term where the condition holds, else the other; ``size`` is the condition's."""
    dimension = _common([yes, no])
    if condition in (sympy.true, sympy.false):
        chosen = yes if condition is sympy.true else no
        return Term(chosen.value, dimension, chosen.number, chosen.size)
    degree, roots = max(yes.degree, no.degree), max(yes.roots, no.roots)
    return Term(choice((yes.value, condition), (no.value, sympy.true)), dimension, None, 1 + size + yes.size + no.size, degree, roots)


def choice(*branches: tuple[Scalar, Scalar]) -> Scalar:
    """The value of the first branch whose condition holds, left as written."""
    return Choice(*branches)


def check_extent(expression: Scalar, of_symbols: Mapping[Scalar, Extent] | None = None) -> None:
    """Raises ExpressionError when an expression, or one of its derivatives, is too large."""
    extent = measure(expression, of_symbols)
    if extent.nodes > MAX_SIZE:
        raise ExpressionError(f"the expression expands to more than {MAX_SIZE} operations")
    if extent.second > MAX_DERIVED:
        raise ExpressionError(
            f"the second derivative of the expression expands to more than {MAX_DERIVED} operations",
            "write fewer factors in a product, and fewer functions within functions",
        )


def _extreme(sign: ast.cmpop) -> Callable[[list[Term]], Term]:
    def extreme(terms: list[Term]) -> Term:
        if len(terms) == 1:
            return terms[0]
        half = (len(terms) + 1) // 2
        a, b = extreme(terms[:half]), extreme(terms[half:])
        if a.size + b.size > MAX_SIZE:
            raise ExpressionError(f"the expression expands to more than {MAX_SIZE} operations")
        return where(compare(sign, a, b), a, b, a.size + b.size)

    return extreme


def _absolute(terms: list[Term]) -> Term:
    (term,) = terms
    return where(compare(ast.GtE(), term, constant(0)), term, negative(term), term.size)


def _sign(terms: list[Term]) -> Term:
    (term,) = terms
    below = where(compare(ast.Lt(), term, constant(0)), constant(-1), constant(0), term.size)
    return where(compare(ast.Gt(), term, constant(0)), constant(1), below, term.size)


#: Functions with non-smooth points.
SPECIAL: Mapping[str, Callable[[list[Term]], Term]] = {
    "min": _extreme(ast.LtE()), "max": _extreme(ast.GtE()), "abs": _absolute, "sign": _sign,
}  # fmt: skip

#: Differentiable functions: SymPy's and the plain one.
SMOOTH: Mapping[str, tuple[Callable[..., Scalar], Callable[..., float]]] = {
    name: (Exponential if name == "exp" else getattr(sympy, name), getattr(math, name)) for name in ops.SMOOTH
}


#: The functions of expressions and the number of their arguments.
FUNCTIONS: Mapping[str, int] = {
    **{name: ops.OPERATIONS[name].arity for name in SMOOTH}, "abs": 1, "sign": 1, "min": MANY, "max": MANY, "where": 3,
}  # fmt: skip
