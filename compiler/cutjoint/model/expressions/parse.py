"""Expressions in model files: a whitelist over Python's syntax tree, from text to SymPy.

Text is never evaluated as code.  Its length, depth, numbers and expanded size are bounded.
"""

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain

import sympy

from cutjoint.model.errors import nearest
from cutjoint.model.expressions import operations
from cutjoint.model.expressions.choices import bottom_up
from cutjoint.model.expressions.functions import call_supplied
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.units import Dimension, Quantity, UnitError, read_measure
from cutjoint.model.records import Scalar, SuppliedFunction
from cutjoint.model.text import is_number

#: The places of quantities, as a remedy for one that stands elsewhere.
READERS = "laws of forces, signals, rates of states and controllers may have it"
MAX_LENGTH = 2000  #: characters of a text
MAX_DEPTH = 60  #: nested operations
_BARE = Term(sympy.Integer(0))
_MEASURE = re.compile(r"(?<![\w.])[0-9.]+\s*[A-Za-z]|\)\s*[A-Za-z]+$")  #: a number with a unit behind it
_COMMA = re.compile(r"\s*[-+]?[0-9]+,[0-9]+\s*(?![^A-Za-z])")  #: a number in the decimals of some countries
_CHAINS: tuple[tuple[type[ast.operator], ...], ...] = ((ast.Add, ast.Sub), (ast.Mult, ast.Div))


def variable(name: str) -> Scalar:
    """The symbol of a law's variable, such as ``length`` or ``t``."""
    return sympy.Symbol(name, real=True)


POSITION = variable("position")  #: the coordinate of a joint that a law follows from


def parameter_symbol(name: str) -> Scalar:
    """The symbol of a parameter; no variable of a law starts with ``p_``."""
    return sympy.Symbol(f"p_{name}", real=True)


def quantity_symbol(element: str, quantity: str) -> Scalar:
    """The symbol of a quantity of an element, such as ``arm.vz``; no other symbol starts with ``@``."""
    return sympy.Symbol(f"@{element}.{quantity}", real=True)


def sample_symbol(controller: str, signal: str) -> Scalar:
    """The symbol of a controller's signal as computed at a sample; no other symbol starts with ``$``."""
    return sympy.Symbol(f"${controller}.{signal}", real=True)


def quantities_read(expression: Scalar) -> list[tuple[str, str]]:
    """The elements and quantities whose symbols an expression has, sorted."""
    names = sorted(str(symbol) for symbol in getattr(expression, "free_symbols", ()))
    found = (name.removeprefix("@").rpartition(".") for name in names if name.startswith("@"))
    return [(element, quantity) for element, _, quantity in found]


def samples_read(expression: Scalar) -> list[str]:
    """The signals of controllers, "controller.signal", that an expression has as they are computed, sorted."""
    names = sorted(str(symbol) for symbol in getattr(expression, "free_symbols", ()))
    return [name.removeprefix("$") for name in names if name.startswith("$")]


@dataclass(frozen=True)
class Names(Mapping[str, Term]):
    """The names of an expression that may read quantities.
    ``terms`` are terms by name. ``quantity`` finds names with a dot, and those of states and signals, ``own``, where the expression stands.
    ``functions`` may be called besides the built-in ones. ``units`` are the dimensions of variables, whose terms fit everywhere."""

    terms: Mapping[str, Term]
    own: frozenset[str]
    quantity: Callable[[str], Term]
    functions: Mapping[str, SuppliedFunction] = field(default_factory=dict)
    units: Mapping[str, Dimension | None] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Term:
        return self.quantity(name) if self._is_quantity(name) else self.terms[name]

    def __contains__(self, name: object) -> bool:
        return name in self.terms or self._is_quantity(str(name))

    def __iter__(self) -> Iterator[str]:
        return chain(self.terms, sorted(self.own))

    def __len__(self) -> int:
        return len(self.terms) + len(self.own)

    def _is_quantity(self, name: str) -> bool:
        return "." in name or (name in self.own and name not in self.terms)


def with_terms(names: Mapping[str, Term], further: Mapping[str, Term]) -> Mapping[str, Term]:
    """The names with further ones."""
    return replace(names, terms={**names.terms, **further}) if isinstance(names, Names) else {**names, **further}


def read_term(value: int | float | str, names: Mapping[str, Term]) -> Term:
    """A number, a number with a unit, or an expression over ``names``.  Raises ExpressionError."""
    if not isinstance(value, str):
        return operations.constant(value, value.dimension if isinstance(value, Quantity) else None)
    try:
        quantity = read_measure(value)
    except UnitError as error:
        raise ExpressionError(str(error), "write for example '30 deg' or '5 N*s/m'") from None
    if quantity is not None:
        return operations.constant(quantity.value, quantity.dimension)
    try:
        text = _one_line(value)
        parser = _Parser(names, text)
        term = parser.term(_syntax_tree(text), 0)
    except RecursionError:
        raise ExpressionError("the expression is nested too deep") from None
    if not has_finite_numbers(term.value):
        raise ExpressionError("a number in the expression is out of range")
    operations.check_extent(term.value)
    if not parser.has_failed:
        for part in bottom_up(term.value):
            operations.require_real(part)
    if term.value.has(sympy.Abs):
        value = term.value.replace(sympy.Abs, lambda x: operations.choice((x, sympy.GreaterThan(x, 0, evaluate=False)), (-x, sympy.true)))
        return replace(term, value=value)
    return term


def dimension_beside_units(value: int | float | str, names: Mapping[str, Term]) -> Dimension | None:
    """The dimension of a valid expression whose variables have theirs. None if no name in it has a dimension, or if it fits everywhere.
    Raises ExpressionError: the dimensions do not go together."""
    if not isinstance(names, Names) or not names.units or all(names.terms.get(name, _BARE).dimension is None for name in symbols_of(value)):
        return None
    variables = {name: Term(names.terms[name].value, unit) for name, unit in names.units.items() if name in names.terms}
    return read_term(value, with_terms(names, variables)).dimension


def symbols_of(value: int | float | str) -> frozenset[str]:
    """The names in an expression that stand for numbers; none of a number, of a measure or of what is no expression."""
    try:
        if not isinstance(value, str) or read_measure(value) is not None:
            return frozenset()
        tree = _syntax_tree(_one_line(value))
        called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        owners = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called | owners) - {"pi"}
    except (UnitError, ExpressionError, RecursionError):
        return frozenset()


def has_finite_numbers(expression: Scalar) -> bool:
    """Return whether all numbers in an expression fit floats."""
    return all(_is_finite(number) for number in expression.atoms(sympy.Number))


def _is_finite(number: Scalar) -> bool:
    """Return whether a number fits a float; NaN, the mark of a reported number, does."""
    try:
        return number is sympy.nan or math.isfinite(float(number))
    except OverflowError:
        return False


def _one_line(text: str) -> str:
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression is longer than {MAX_LENGTH} characters")
    if not text.isascii() or not text.replace("\n", " ").isprintable() or "#" in text:
        raise ExpressionError("the expression has a character that does not belong there", "units have plain letters: deg, um, m/s^2, N*m")
    if _COMMA.match(text):
        raise ExpressionError(f"'{_short(text)}' has a decimal comma", "write a decimal point")
    return text.replace("\n", " ").strip()


def _syntax_tree(text: str) -> ast.expr:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        if _MEASURE.search(text):
            hint = "numbers in an expression have no units, write SI numbers: 20*pi/180; a unit has no parentheses, as in 5 N*s/m"
        elif text.count("(") > text.count(")"):
            hint = "a parenthesis stays open; put an expression with commas in quotes, since a comma ends it within braces"
        else:
            hint = "write for example '2*pi*radius'"
        raise ExpressionError(f"'{_short(text)}' is not an expression", hint) from None


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


class _Parser:
    """Turns a syntax tree into a :class:`Term`; every kind of node that it does not name is refused."""

    def __init__(self, names: Mapping[str, Term], text: str) -> None:
        self.names = names
        self.text = text
        self.has_failed = False  #: Whether a name stands for a value that could not be read

    def term(self, node: ast.expr, depth: int) -> Term:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"the expression is nested deeper than {MAX_DEPTH} levels")
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                result = self.number(node, value)
            case ast.Name(id=name):
                result = self.name(name)
            case ast.Attribute() if (dotted := _dotted(node)) is not None:
                result = self.quantity(dotted)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                result = operations.negative(self.term(operand, depth + 1))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                result = self.term(operand, depth + 1)
            case ast.BinOp():
                result = self.chain(node, depth)
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                result = self.call(name, args, depth)
            case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr=which), args=args, keywords=[]) if name in self.supplied:
                result = self.call_supplied(name, which, args, depth)
            case _:
                raise _refusal(node)
        if result.size > operations.MAX_SIZE:
            raise ExpressionError(f"the expression expands to more than {operations.MAX_SIZE} operations")
        if result.memory_of:
            hint = f"write it as the last argument of {result.memory_of}"
            raise ExpressionError(f"'{ast.unparse(node)}' is the memory of a function, and no number", hint)
        return result

    def chain(self, node: ast.BinOp, depth: int) -> Term:
        """A binary operation; a sum or product of any length, nested to the left in the tree, in one go."""
        level = next((group for group in _CHAINS if isinstance(node.op, group)), ())
        rest: list[tuple[ast.operator, ast.expr]] = [(node.op, node.right)]
        first = node.left
        while isinstance(first, ast.BinOp) and isinstance(first.op, level):
            rest.append((first.op, first.right))
            first = first.left
        result = self.term(first, depth + 1)
        for sign, right in reversed(rest):
            result = operations.binary(sign, result, self.term(right, depth + 1))
        return result

    def number(self, node: ast.Constant, value: int | float) -> Term:
        written = self.text[node.col_offset : node.end_col_offset]
        if not is_number(written):
            raise ExpressionError(f"'{_short(written)}' is not a number here", "write it in decimal digits, without underscores")
        return operations.constant(value)

    def name(self, name: str) -> Term:
        if name in self.names:
            return self.known(self.names[name])
        if name == "pi":
            return Term(sympy.pi, None, math.pi)
        if name in operations.FUNCTIONS:
            raise ExpressionError(f"'{name}' is a function", f"write {name}(...)")
        raise ExpressionError(f"unknown symbol '{name}'", nearest(name, [*self.names, "pi"], "symbols here"))

    def quantity(self, name: str) -> Term:
        if isinstance(self.names, Names):
            return self.known(self.names[name])
        raise ExpressionError(f"the quantity '{name}' cannot be used here", READERS)

    def known(self, term: Term) -> Term:
        self.has_failed = self.has_failed or term.value is sympy.nan
        return term

    def call(self, name: str, args: list[ast.expr], depth: int) -> Term:
        if name == "delay":
            hint = "a controller delays what it samples: {every: ..., delay: ..., signals: ...}"
            raise ExpressionError("there is no continuous delay", hint)
        if name in self.supplied:
            return self.call_supplied(name, "", args, depth)
        if name not in operations.FUNCTIONS:
            raise ExpressionError(f"unknown function '{name}'", nearest(name, [*operations.FUNCTIONS, *self.supplied], "functions"))
        count = operations.FUNCTIONS[name]
        if len(args) != count and not (count == operations.MANY and args):
            wanted = "at least one argument" if count == operations.MANY else f"{count} argument{'s' * (count > 1)}"
            raise ExpressionError(f"{name} needs {wanted}, got {len(args)}")
        if name == "where":
            condition, size = self.condition(args[0], depth + 1)
            return operations.where(condition, self.term(args[1], depth + 1), self.term(args[2], depth + 1), size)
        terms = [self.term(arg, depth + 1) for arg in args]
        return operations.SPECIAL[name](terms) if name in operations.SPECIAL else operations.smooth(name, terms)

    @property
    def supplied(self) -> Mapping[str, SuppliedFunction]:
        """The functions of the model's user that the expression may call."""
        return self.names.functions if isinstance(self.names, Names) else {}

    def call_supplied(self, name: str, result: str, args: list[ast.expr], depth: int) -> Term:
        function, memory = self.supplied[name], None
        if function.words and args and (dotted := _dotted(args[-1])) is not None:
            last = self.quantity(dotted) if "." in dotted else self.name(dotted)
            if last.memory_of:
                args, memory = args[:-1], last
        return call_supplied(function, [self.term(arg, depth + 1) for arg in args], result, memory)

    def condition(self, node: ast.expr, depth: int) -> tuple[Scalar, int]:
        """A condition and its size."""
        if depth > MAX_DEPTH:
            raise ExpressionError(f"the expression is nested deeper than {MAX_DEPTH} levels")
        match node:
            case ast.Compare(left=left, ops=signs, comparators=others):
                terms = [self.term(side, depth + 1) for side in (left, *others)]
                pairs = zip(signs, terms[:-1], terms[1:], strict=True)
                return operations.join_conditions([operations.compare(*pair) for pair in pairs]), sum(term.size for term in terms)
            case ast.BoolOp(op=ast.And() | ast.Or() as word, values=values):
                parts = [self.condition(value, depth + 1) for value in values]
                joined = operations.join_conditions([part for part, _ in parts], all_of=isinstance(word, ast.And))
                return joined, 1 + sum(size for _, size in parts)
        raise ExpressionError("the first argument of where must be a condition", "write for example where(x < 0, a, b)")


def _dotted(node: ast.expr) -> str | None:
    """A name with dots, None for what is no such name."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and not node.attr.startswith("_") and (owner := _dotted(node.value)) is not None:
        return f"{owner}.{node.attr}"
    return None


def _refusal(node: ast.expr) -> ExpressionError:
    match node:
        case ast.Compare() | ast.BoolOp():
            return ExpressionError("a condition stands outside where", "write where(condition, value, other)")
        case ast.IfExp():
            return ExpressionError("'if' is not allowed in an expression", "write where(condition, value, other)")
    return ExpressionError(
        f"'{_short(ast.unparse(node))}' is not allowed in an expression",
        "use numbers, names, + - * / **, comparisons inside where, and the listed functions",
    )
