"""The scalar IR: a hash-consed graph of real numbers with signs pulled outwards.

Constants are folded, zeros and ones vanish, sums and products are ordered, and a negation travels up to where an addition
absorbs it, so that ``a - b`` and ``b - a`` share one node.  Rounding is that of IEEE arithmetic on the
expression as written, but for ``a/c`` with a constant c, which becomes a product with 1/c, and for `Graph._of_arc_tangent`.
"""

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce

from cutjoint.ops import CONDITIONS, OPERATIONS
from cutjoint.program.blocks import BindingTime

_LARGEST = 1e300  #: beyond this square of x, sin(2 atan(x)) counts as 0; it is about 2/x, below 1e-149
FREE = frozenset({"const", "symbol", "neg", "lane_const", "gather", "lane"})  #: scalars that do not count as operations


class OverflowedConstantError(ArithmeticError):
    """A constant is too large for a floating-point number.  ``section`` is the number of the section that computes it."""

    def __init__(self, section: int) -> None:
        super().__init__(f"a constant of section {section} is not finite")
        self.section = section


@dataclass(frozen=True, slots=True)
class Scalar:
    """A node: its operation, the numbers of its arguments, and a constant's value, a symbol's name and index, or a table."""

    op: str
    args: tuple[int, ...]
    data: object
    binding: BindingTime
    section: int
    lanes: int


@dataclass
class Graph:
    """The scalar nodes, in an order in which arguments come first."""

    nodes: list[Scalar] = field(default_factory=list)
    _known: dict[tuple[str, tuple[int, ...], object], int] = field(default_factory=dict, repr=False)
    section: int = 0

    def copy(self) -> "Graph":
        """Copy the graph, to which more is added."""
        return Graph(nodes=list(self.nodes), _known=dict(self._known))

    def _make(
        self, op: str, args: tuple[int, ...], data: object = None, *, binding: BindingTime | None = None, lanes: int | None = None
    ) -> int:
        key = (op, args, data)
        number = self._known.get(key)
        if number is None:
            when = max((self.nodes[a].binding for a in args), default=BindingTime.CONST) if binding is None else binding
            number = len(self.nodes)
            width = max((self.nodes[a].lanes for a in args), default=0) if lanes is None else lanes
            self.nodes.append(Scalar(op, args, data, when, self.section, width))
            self._known[key] = number
        return number

    def const(self, value: float) -> int:
        """A number; minus zero becomes zero. Raises OverflowedConstantError: it is not finite."""
        if not math.isfinite(value):
            raise OverflowedConstantError(self.section)
        return self._make("const", (), float(value) + 0.0)

    def symbol(self, name: str, index: int, binding: BindingTime) -> int:
        """Element ``index`` of the input ``name``."""
        return self._make("symbol", (), (name, index), binding=binding)

    def lane_const(self, values: Sequence[float]) -> int:
        """A number per lane."""
        numbers = tuple(float(x) + 0.0 for x in values)
        if not all(map(math.isfinite, numbers)):
            raise OverflowedConstantError(self.section)
        if len(set(numbers)) == 1:
            return self.const(numbers[0])
        return self._make("lane_const", (), numbers, lanes=len(numbers))

    def gather(self, args: tuple[int, ...]) -> int:
        """One uniform scalar per lane."""
        if len(set(args)) == 1:
            return args[0]
        values = [self.value(a) for a in args]
        if all(v is not None for v in values):
            return self.lane_const([v for v in values if v is not None])
        if all(self.nodes[a].op == "neg" for a in args):
            return self.neg(self.gather(tuple(self.nodes[a].args[0] for a in args)))
        return self._make("gather", args, lanes=len(args))

    def lane(self, a: int, k: int) -> int:
        """The value of a in lane k."""
        node = self.nodes[a]
        if not node.lanes:
            return a
        if node.op == "gather":
            return node.args[k]
        if node.op == "lane_const":
            return self.const(self._numbers(a)[k])
        if node.op == "neg":
            return self.neg(self.lane(node.args[0], k))
        return self._make("lane", (a,), k, lanes=0)

    def lane_sum(self, a: int) -> int:
        """The sum of a's lanes."""
        node = self.nodes[a]
        if node.op == "neg":
            return self.neg(self.lane_sum(node.args[0]))
        if node.op in ("lane_const", "gather"):
            parts = [self.lane(a, k) for k in range(node.lanes)]
            return reduce(self.add, parts)
        return self._make("lane_sum", (a,), lanes=0)

    def _numbers(self, a: int, lanes: int = 1) -> tuple[float, ...]:
        """The values of a constant in each of so many lanes, if it has none itself; empty of anything else."""
        node = self.nodes[a]
        if node.op == "lane_const":
            assert isinstance(node.data, tuple)
            return node.data
        value = self.value(a)
        return () if value is None else (value,) * lanes

    def _folded(self, function: Callable[..., float], *args: int) -> int | None:
        """A function of constants; None if an argument is something else."""
        lanes = max((1, *(self.nodes[a].lanes for a in args)))
        constants = [self._numbers(a, lanes) for a in args]
        return self.lane_const([float(function(*each)) for each in zip(*constants, strict=True)]) if all(constants) else None

    def value(self, a: int) -> float | None:
        """The value of a constant, None of anything else."""
        node = self.nodes[a]
        return node.data if node.op == "const" and isinstance(node.data, float) else None

    def _negated(self, a: int) -> int | None:
        """x if a is -x or a negative constant -x."""
        node = self.nodes[a]
        if node.op == "neg":
            return node.args[0]
        numbers = self._numbers(a)
        return self.neg(a) if any(numbers) and all(x <= 0.0 for x in numbers) else None

    def neg(self, a: int) -> int:
        """-a."""
        if (folded := self._folded(operator.neg, a)) is not None:
            return folded
        node = self.nodes[a]
        return node.args[0] if node.op == "neg" else self._make("neg", (a,))

    def add(self, a: int, b: int) -> int:
        """a + b."""
        if (folded := self._folded(operator.add, a, b)) is not None:
            return folded
        u, v = self.value(a), self.value(b)
        if u == 0.0:
            return b
        if v == 0.0:
            return a
        minus_b = self._negated(b)
        if minus_b is not None:
            return self.sub(a, minus_b)
        minus_a = self._negated(a)
        if minus_a is not None:
            return self.sub(b, minus_a)
        return self._make("add", (min(a, b), max(a, b)))

    def sub(self, a: int, b: int) -> int:
        """a - b."""
        if (folded := self._folded(operator.sub, a, b)) is not None:
            return folded
        u, v = self.value(a), self.value(b)
        if v == 0.0:
            return a
        if u == 0.0:
            return self.neg(b)
        if a == b:
            return self.const(0.0)
        minus_b = self._negated(b)
        if minus_b is not None:
            return self.add(a, minus_b)
        minus_a = self._negated(a)
        if minus_a is not None:
            return self.neg(self.add(minus_a, b))
        return self.neg(self._known["sub", (b, a), None]) if ("sub", (b, a), None) in self._known else self._make("sub", (a, b))

    def mul(self, a: int, b: int) -> int:
        """a * b."""
        if (folded := self._folded(operator.mul, a, b)) is not None:
            return folded
        u, v = self.value(a), self.value(b)
        if u == 0.0 or v == 0.0:
            return self.const(0.0)
        if u == 1.0:
            return b
        if v == 1.0:
            return a
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_a is not None or minus_b is not None:
            product = self.mul(a if minus_a is None else minus_a, b if minus_b is None else minus_b)
            return product if minus_a is not None and minus_b is not None else self.neg(product)
        return self._make("mul", (min(a, b), max(a, b)))

    def div(self, a: int, b: int) -> int:
        """a / b."""
        if (numbers := self._numbers(b)) and all(map(_has_inverse, numbers)):
            return self.mul(a, self.lane_const([1.0 / x for x in numbers]))
        if self.value(a) == 0.0:
            return a
        minus_a, minus_b = self._negated(a), self._negated(b)
        if minus_a is not None or minus_b is not None:
            quotient = self.div(a if minus_a is None else minus_a, b if minus_b is None else minus_b)
            return quotient if minus_a is not None and minus_b is not None else self.neg(quotient)
        return self._make("div", (a, b))

    def call(self, function: str, args: tuple[int, ...], table: object = None) -> int:
        """Any other scalar function."""
        values, has_lanes = [self.value(a) for a in args], any(self.nodes[a].lanes for a in args)
        row = OPERATIONS.get(function)
        if row is not None and row.fold is not None and not (has_lanes and function in CONDITIONS):
            try:
                if (folded := self._folded(row.fold, *args)) is not None:
                    return folded
            except OverflowError:
                raise OverflowedConstantError(self.section) from None
            except ValueError:
                pass  # left to the run, where it gives NaN as IEEE arithmetic does
        if function == "where" and (values[0] is not None or args[1] == args[2]):
            return args[2] if values[0] == 0.0 else args[1]
        if (rational := self._of_arc_tangent(function, args[0])) is not None:
            return rational
        minus = self._negated(args[0]) if row and row.parity else None
        args = args if minus is None else (minus,)
        when = max((BindingTime.PARAM, *(self.nodes[a].binding for a in args)))  # unfolded calls are computed once
        made = self._make(function, args, table, binding=when if table is None else max(when, BindingTime.STEP))
        return self.neg(made) if minus is not None and row and row.parity < 0 else made

    def _of_arc_tangent(self, function: str, a: int) -> int | None:
        """cos(atan(x)) = 1/sqrt(1 + x^2) and sin(2 atan(x)) = 2 x/(1 + x^2), as tyres have them; None of anything else."""
        node = self.nodes[self.signless(a)]
        if function == "sin" and node.op == "mul" and 2.0 in map(self.value, node.args):
            (angle,) = (x for x in node.args if self.value(x) != 2.0)
            if self.nodes[angle].op == "atan":
                (x,) = self.nodes[angle].args
                below = self.add(self.const(1.0), self.mul(x, x))
                found = self.div(self.mul(self.const(2.0), x), below)  # for the largest numbers, a quotient of two infinities
                found = self.call("where", (self.call("lt", (self.const(_LARGEST), below)), self.const(0.0), found))
                return found if self.signless(a) == a else self.neg(found)
        if function == "cos" and node.op == "atan":
            (x,) = node.args
            return self.div(self.const(1.0), self.call("sqrt", (self.add(self.const(1.0), self.mul(x, x)),)))
        return None

    def power(self, a: int, exponent: int) -> int:
        """a to a whole power, by squaring."""
        if exponent < 0:
            return self.div(self.const(1.0), self.power(a, -exponent))
        if exponent == 0:
            return self.const(1.0)
        half = self.power(a, exponent // 2)
        square = self.mul(half, half) if exponent > 1 else self.const(1.0)
        return self.mul(square, a) if exponent % 2 else square

    def signless(self, a: int) -> int:
        """The argument of a negation, anything else itself: a negation costs nothing to repeat."""
        node = self.nodes[a]
        return node.args[0] if node.op == "neg" else a

    def reachable(self, roots: list[int]) -> list[int]:
        """The nodes that the roots depend on, arguments first."""
        wanted = set(roots)
        stack = list(roots)
        while stack:
            for a in self.nodes[stack.pop()].args:
                if a not in wanted:
                    wanted.add(a)
                    stack.append(a)
        return sorted(wanted)


def _has_inverse(x: float) -> bool:
    """Return whether 1/x is finite: it is not for zero and for the smallest numbers."""
    return x != 0.0 and math.isfinite(1.0 / x)
