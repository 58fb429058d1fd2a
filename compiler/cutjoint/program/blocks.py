"""The block IR: typed, immutable, hash-consed matrix expressions.

Grammar (shapes in parentheses, a scalar is a (1, 1) block)::

    block := const(values)                  a matrix of numbers
           | symbol(name, binding)          an input of the program
           | call(function; scalar ...)     a scalar function, see FUNCTIONS; lookups carry their table's name
           | add | sub (a, b)  | neg(a)     elementwise, equal shapes
           | scale(s, a)                    scalar times block
           | mul(a, b)                      matrix product
           | transpose(a)
           | symmetrise(a)                  a + a^T
           | sandwich(a, m)                 a m a^T, m symmetric
           | gram(y, d)                     y^T diag(d) y, d a column
           | weigh(d, y)                    diag(d) y
           | mirror(a)                      the upper triangle of a, for an a that is symmetric but not by construction
           | skew(p)                        p~, with p~ x = p x x
           | stack(grid; a ...)             blocks beside and above each other
           | take(rows, columns; a)         a sub-block
           | ldl_factor(m) | ldl_pivots(m)  m = L D L^T: the unit triangle L, and the column of 1/D
           | forward(l, b) | backward(l, b) L^-1 b and L^-T b
           | lane_const(values per lane)    a matrix of numbers for each lane
           | gather(a ...)                  one block for each lane
           | lane(k; a)                     the value of a in lane k
           | lane_sum(a)                    the sum of all lanes

A block is uniform or has lanes: as many values of its shape side by side, one for each member of a class of equal parts.  An operation on a
block with lanes has lanes; its uniform arguments count for all of them.  Equal expressions are one object, so that comparing them is
comparing identities.  A block carries its symmetry by construction, the latest binding time of its arguments, and the section (a body,
joint or force) that introduced it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Any

from cutjoint.ops import OPERATIONS
from cutjoint.package.errors import EquationsError

#: Scalar functions and their arity; a comparison yields 1.0 or 0.0 and may only feed ``where``, ``and`` and ``or``.
FUNCTIONS = {
    **{row.name: row.arity for row in OPERATIONS.values() if row.partials or row.name == "where"},
    "road_height": 2, "road_slope": 2, "road_height_dx": 2, "road_slope_dx": 2,
    **{f"road_{lookup}": 2 for lookup in ("surface", "surface_x", "surface_y", "surface_xx", "surface_xy", "surface_yy")},
    **{f"road_{lookup}": 2 for lookup in ("friction", "friction_x", "friction_y")},
}  # fmt: skip
#: The beginnings of the names of lookups of a road's surface, "road_surface_xy" its derivative by x and y; and of its friction.
SURFACE = ("road_surface", "road_friction")
#: The beginning of the names of functions that a user supplies, "supplied.name" with and "opaque.name" without partial derivatives; a
#: number behind the name, "supplied.name.0", is that of the argument by which it is differentiated.
SUPPLIED = ("supplied.", "opaque.")


class BindingTime(IntEnum):
    """The time at which a value is known; a block is known when the latest of its arguments is."""

    CONST = 0  #: in the compiler
    PARAM = 1  #: when parameters are loaded
    STEP = 2  #: when a step begins (functions of time)
    ITERATION = 3  #: at each evaluation


@dataclass(frozen=True, kw_only=True)
class SuppliedCall:
    """A call of a function that a user supplies, encoded in its name.
    ``by`` is the argument by which it is differentiated, None of its value. "name:1:3:16" is result 1 of 3, with ``memory`` of 16 values
    behind the arguments; without ``results`` it is an update, whose ``result`` is a value of the memory."""

    name: str
    has_partials: bool
    by: int | None
    result: int = 0
    results: int = 1
    memory: int = 0

    @classmethod
    def read(cls, function: str) -> SuppliedCall:
        """The call that a name encodes."""
        kind, spelled, *by = function.split(".")
        name, *numbers = spelled.split(":")
        result, results, memory = map(int, numbers) if numbers else (0, 1, 0)
        return cls(name=name, has_partials=kind == "supplied", by=int(by[0]) if by else None, result=result, results=results, memory=memory)

    @property
    def is_plain(self) -> bool:
        """True for one result and no memory."""
        return self.results == 1 and self.memory == 0


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the program that a reader knows: one body, joint, cut joint or force.
    ``stage`` is the sweep it belongs to, ``equation`` the formula that it implements, ``source`` the place in the model file, ``turn``
    the reason of a repeated sweep, "" for the first one."""

    stage: str
    element: str
    equation: str
    source: str
    turn: str = ""

    @property
    def title(self) -> str:
        """One line for a heading."""
        title = f"{self.stage}: {self.element}" if self.element else self.stage
        return f"{title}, {self.turn}" if self.turn else title


class ConstantError(EquationsError, ArithmeticError):
    """A constant of the equations is too large for a floating-point number.  The text has the place in the model file and the element."""

    def __init__(self, sections: Sequence[Section], number: int) -> None:
        section = sections[number]
        place = section.source or next((s.source for s in sections if s.source and s.element == section.element), "")
        what = f"'{section.element}': " if section.element else ""
        message = f"{what}a constant of its equations ({section.stage}) is too large for a floating-point number"
        super().__init__(f"{place + ': ' if place else ''}{message}; write smaller numbers")


@dataclass(frozen=True, slots=True)
class Quantity:
    """The meaning of a block: ``symbol`` as in the formulation's equations, and ``parts`` of the model.
    ``which`` tells apart several of one part, such as its first coordinate, and ``number`` is its place among blocks of the same name."""

    symbol: str
    parts: tuple[str, ...]
    which: tuple[str | int, ...]
    number: int


@dataclass(frozen=True, kw_only=True)
class Label:
    """The name of a block for readers.  ``rows`` and ``columns`` name its elements; three or six without names are axes."""

    text: str
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Block:
    """A node of the block IR; made by a :class:`Builder` only."""

    op: str
    args: tuple[Block, ...]
    data: Hashable
    shape: tuple[int, int]
    symmetric: bool
    binding: BindingTime
    section: int
    number: int
    lanes: int = 0

    def __repr__(self) -> str:
        return f"<{self.op} {self.shape[0]}x{self.shape[1]} #{self.number}>"


def surface_lookup(function: str) -> tuple[str, str]:
    """A lookup of `SURFACE` without, and the letters by which it is differentiated."""
    lookup = next(name for name in SURFACE if function.startswith(name))
    return lookup, function.removeprefix(lookup).removeprefix("_")


class Builder:
    """Makes blocks, one object per expression, and records their labels (for readers only), quantities, and sections."""

    def __init__(self) -> None:
        self._nodes: dict[Hashable, Block] = {}
        self._section = 0
        self._mark = self._turn = ""
        self.restricted: dict[Block, Block | None] = {}
        self.sections: list[Section] = [Section(stage="inputs", element="", equation="", source="")]
        self.labels: dict[Block, Label] = {}
        self.letters: dict[Block, str] = {}
        self.quantities: dict[Quantity, Block] = {}
        self._counts: Counter[tuple[str, tuple[str, ...], tuple[str | int, ...]]] = Counter()

    @contextmanager
    def section(self, stage: str, element: str, equation: str, source: str) -> Iterator[None]:
        """Blocks first made inside belong to this section."""
        before = self._section
        self.sections.append(Section(stage=stage, element=element, equation=equation, source=source, turn=self._turn))
        self._section = len(self.sections) - 1
        try:
            yield
        finally:
            self._section = before

    @contextmanager
    def marked(self, mark: str, turn: str) -> Iterator[None]:
        """Names given inside begin with a mark, and headings end with ``turn``: the formulation repeats a part with other values."""
        before, self._mark, self._turn = (self._mark, self._turn), self._mark + mark, turn
        try:
            yield
        finally:
            self._mark, self._turn = before

    def restrict(self, block: Block, remedy: Block | None = None) -> Block:
        """Note that a law calls a function whose arguments must lie in its domain; ``remedy`` selects the advice for a violation."""
        if block.op == "call":
            self.restricted[block] = remedy
        return block

    def label(self, block: Block, name: str, *, rows: tuple[str, ...] = (), columns: tuple[str, ...] = ()) -> Block:
        """Name a block for readers, as the literature does; the first name stays."""
        self.labels.setdefault(block, Label(text=self._mark + name, rows=rows, columns=columns))
        return block

    def letter(self, block: Block, name: str) -> Block:
        """Note the LaTeX of a block for the formulas that `explain` prints; nothing that is generated has it."""
        self.letters.setdefault(block, name)
        return block

    def record(self, block: Block, symbol: str, *parts: str, which: tuple[str | int, ...] = ()) -> Block:
        """Record the `Quantity` of a block; corresponding blocks have equal records except for the parts."""
        key = (self._mark + symbol, parts, which)
        self.quantities[Quantity(*key, self._counts[key])] = block
        self._counts[key] += 1
        return block

    def name(
        self, block: Block, symbol: str, *parts: str, which: tuple[str, ...] = (), rows: tuple[str, ...] = (),
        columns: tuple[str, ...] = (),
    ) -> Block:  # fmt: skip
        """Give a block its meaning and its label."""
        text = "_".join((symbol, *parts, *which)).replace(".", "_")
        return self.label(self.record(block, symbol, *parts, which=which), text, rows=rows, columns=columns)

    def _make(
        self, op: str, args: tuple[Block, ...], shape: tuple[int, int], *, data: Hashable = None, symmetric: bool = False,
        binding: BindingTime | None = None, lanes: int | None = None,
    ) -> Block:  # fmt: skip
        key = (op, tuple(a.number for a in args), data, shape)
        found = self._nodes.get(key)
        if found is None:
            when = max((a.binding for a in args), default=BindingTime.CONST) if binding is None else binding
            width = _lanes_of(op, args) if lanes is None else lanes
            found = Block(op, args, data, shape, symmetric or shape == (1, 1), when, self._section, len(self._nodes), width)
            self._nodes[key] = found
        return found

    # Leaves

    def const(self, values: Sequence[Sequence[float]]) -> Block:
        """A matrix of numbers, given by rows. Raises ConstantError: one of them is not finite."""
        rows = tuple(tuple(float(x) + 0.0 for x in row) for row in values)
        if not all(isfinite(x) for row in rows for x in row):
            raise ConstantError(self.sections, self._section)
        n, m = len(rows), len(rows[0])
        symmetric = n == m and all(rows[i][j] == rows[j][i] for i in range(n) for j in range(i))
        return self._make("const", (), (n, m), data=rows, symmetric=symmetric)

    def number(self, value: float) -> Block:
        """A scalar constant."""
        return self.const([[value]])

    def zero(self, n: int, m: int = 1) -> Block:
        """The zero block of shape (n, m)."""
        return self.const([[0.0] * m] * n)

    def identity(self, n: int) -> Block:
        """The unit matrix of order n."""
        return self.const([[float(i == j) for j in range(n)] for i in range(n)])

    def symbol(self, name: str, n: int, binding: BindingTime) -> Block:
        """An input: a column of n numbers."""
        return self._make("symbol", (), (n, 1), data=name, binding=binding)

    # Elementwise

    def add(self, a: Block, b: Block) -> Block:
        """a + b."""
        _same_shape(a, b)
        if is_zero(a):
            return b
        if is_zero(b):
            return a
        return self._make("add", (a, b), a.shape, symmetric=a.symmetric and b.symmetric)

    def sub(self, a: Block, b: Block) -> Block:
        """a - b."""
        _same_shape(a, b)
        if is_zero(b):
            return a
        if is_zero(a):
            return self.neg(b)
        return self._make("sub", (a, b), a.shape, symmetric=a.symmetric and b.symmetric)

    def total(self, blocks: Sequence[Block]) -> Block:
        """The sum of one or more blocks, from the left."""
        result = blocks[0]
        for block in blocks[1:]:
            result = self.add(result, block)
        return result

    def neg(self, a: Block) -> Block:
        """-a."""
        if a.op == "neg":
            return a.args[0]
        return a if is_zero(a) else self._make("neg", (a,), a.shape, symmetric=a.symmetric)

    def scale(self, s: Block, a: Block) -> Block:
        """The scalar s times a."""
        if s.shape != (1, 1):
            raise ValueError(f"scale needs a scalar, got {s!r}")
        return a if is_zero(a) else self._make("scale", (s, a), a.shape, symmetric=a.symmetric)

    def call(self, function: str, *args: Block, table: str | None = None) -> Block:
        """A scalar function of scalars; ``table`` names the road of a lookup."""
        known = len(args) if function.startswith(SUPPLIED) else FUNCTIONS.get(function)
        if known != len(args) or any(a.shape != (1, 1) for a in args):
            raise ValueError(f"{function} does not take {args!r}")
        when = max((a.binding for a in args), default=BindingTime.CONST)
        if table is not None:
            when = max(when, BindingTime.STEP)  # roads are known once a mechanism is loaded
        return self._make("call", args, (1, 1), data=(function, table), binding=when)

    # Products

    def mul(self, a: Block, b: Block) -> Block:
        """The matrix product a b."""
        if a.shape[1] != b.shape[0]:
            raise ValueError(f"mul of {a!r} and {b!r}")
        if is_zero(a) or is_zero(b):
            return self.zero(a.shape[0], b.shape[1])
        if is_identity(a):
            return b
        return a if is_identity(b) else self._make("mul", (a, b), (a.shape[0], b.shape[1]))

    def sandwich(self, a: Block, m: Block) -> Block:
        """a m a^T of a symmetric m."""
        if not m.symmetric or a.shape[1] != m.shape[0]:
            raise ValueError(f"sandwich of {a!r} and {m!r}")
        n = a.shape[0]
        if is_zero(m):
            return self.zero(n, n)
        return m if is_identity(a) else self._make("sandwich", (a, m), (n, n), symmetric=True)

    def gram(self, y: Block, d: Block) -> Block:
        """y^T diag(d) y for a column d."""
        if d.shape != (y.shape[0], 1):
            raise ValueError(f"gram of {y!r} and {d!r}")
        n = y.shape[1]
        return self.zero(n, n) if is_zero(y) else self._make("gram", (y, d), (n, n), symmetric=True)

    def weigh(self, d: Block, y: Block) -> Block:
        """diag(d) y for a column d."""
        if d.shape != (y.shape[0], 1):
            raise ValueError(f"weigh of {d!r} and {y!r}")
        return y if is_zero(y) else self._make("weigh", (d, y), y.shape)

    def mirror(self, a: Block) -> Block:
        """The symmetric block of a's upper triangle."""
        return a if a.symmetric else self._make("mirror", (a,), a.shape, symmetric=True)

    def dot(self, a: Block, b: Block) -> Block:
        """a . b of two columns."""
        return self.mul(self.transpose(a), b)

    def cross(self, a: Block, b: Block) -> Block:
        """a x b of two 3-columns."""
        return self.mul(self.skew(a), b)

    # Shape

    def transpose(self, a: Block) -> Block:
        """a^T."""
        if a.symmetric or a.shape == (1, 1):
            return a
        if a.op == "transpose":
            return a.args[0]
        return self._make("transpose", (a,), (a.shape[1], a.shape[0]))

    def symmetrise(self, a: Block) -> Block:
        """a + a^T."""
        return a if is_zero(a) else self._make("symmetrise", (a,), a.shape, symmetric=True)

    def skew(self, p: Block) -> Block:
        """The 3x3 matrix p~ with p~ x = p x x."""
        return self.zero(3, 3) if is_zero(p) else self._make("skew", (p,), (3, 3))

    def stack(self, grid: Sequence[Sequence[Block]]) -> Block:
        """Blocks beside each other (inner sequences) and above each other (outer)."""
        heights = tuple(row[0].shape[0] for row in grid)
        widths = tuple(a.shape[1] for a in grid[0])
        args = tuple(a for row in grid for a in row)
        shape = (sum(heights), sum(widths))
        if all(is_zero(a) for a in args):
            return self.zero(*shape)
        return self._make("stack", args, shape, data=(heights, widths))

    def column(self, scalars: Sequence[Block]) -> Block:
        """A column of scalars."""
        return self.stack([[s] for s in scalars]) if scalars else self.zero(0)

    def take(self, a: Block, rows: tuple[int, int], columns: tuple[int, int] = (0, 1)) -> Block:
        """The sub-block of the half-open ranges of rows and columns."""
        shape = (rows[1] - rows[0], columns[1] - columns[0])
        if shape == a.shape:
            return a
        if is_zero(a):
            return self.zero(*shape)
        return self._make("take", (a,), shape, data=(rows, columns), symmetric=a.symmetric and rows == columns)

    def element(self, a: Block, i: int, j: int = 0) -> Block:
        """The scalar a_ij."""
        return self.take(a, (i, i + 1), (j, j + 1))

    # Lanes

    def lane_const(self, blocks: Sequence[Block]) -> Block:
        """One block of constants per lane."""
        data = tuple(_rows(block) for block in blocks)
        symmetric = all(block.symmetric for block in blocks)
        return self._make("lane_const", (), blocks[0].shape, data=data, symmetric=symmetric, lanes=len(blocks))

    def gather(self, blocks: Sequence[Block]) -> Block:
        """One uniform block of equal shape per lane."""
        symmetric = all(block.symmetric for block in blocks)
        return self._make("gather", tuple(blocks), blocks[0].shape, symmetric=symmetric, lanes=len(blocks))

    def lane(self, a: Block, k: int) -> Block:
        """The value of a in lane k."""
        return self._make("lane", (a,), a.shape, data=k, symmetric=a.symmetric, lanes=0) if a.lanes else a

    def lane_sum(self, a: Block) -> Block:
        """The sum of a block's lanes."""
        if is_zero(a):
            return a
        if not a.lanes:
            raise ValueError(f"lane_sum of {a!r}, which has no lanes")
        return self._make("lane_sum", (a,), a.shape, symmetric=a.symmetric, lanes=0)

    def again(self, block: Block, args: Sequence[Block]) -> Block:
        """Repeat an operation on other arguments."""
        if tuple(args) == block.args:
            return block
        return self._make(block.op, tuple(args), block.shape, data=block.data, symmetric=block.symmetric)

    @contextmanager
    def within(self, section: int) -> Iterator[None]:
        """Blocks first made inside belong to a section that exists already."""
        before, self._section = self._section, section
        try:
            yield
        finally:
            self._section = before

    # Symmetric positive definite systems

    def ldl(self, m: Block) -> tuple[Block, Block]:
        """L and 1/D of m = L D L^T, D without pivoting."""
        if not m.symmetric:
            raise ValueError(f"ldl of {m!r}, which is not symmetric")
        n = m.shape[0]
        return self._make("ldl_factor", (m,), m.shape), self._make("ldl_pivots", (m,), (n, 1))

    def forward(self, lower: Block, b: Block) -> Block:
        """L^-1 b."""
        return b if is_zero(b) else self._make("forward", (lower, b), b.shape)

    def backward(self, lower: Block, b: Block) -> Block:
        """L^-T b."""
        return b if is_zero(b) else self._make("backward", (lower, b), b.shape)


def _lanes_of(op: str, args: Sequence[Block]) -> int:
    """The number of lanes of an operation on blocks: that of its arguments, of which some may be uniform."""
    widths = {a.lanes for a in args if a.lanes}
    assert len(widths) <= 1, f"{op} of blocks with {sorted(widths)} lanes"
    return max(widths, default=0)


def is_zero(a: Block) -> bool:
    """Return whether a is the constant zero block."""
    return a.op == "const" and not any(x for row in _rows(a) for x in row)


def is_identity(a: Block) -> bool:
    """Return whether a is a constant unit matrix."""
    return a.op == "const" and a.shape[0] == a.shape[1] and all(x == (i == j) for i, row in enumerate(_rows(a)) for j, x in enumerate(row))


def _rows(a: Block) -> tuple[tuple[float, ...], ...]:
    rows: Any = a.data
    return tuple(rows)


def _same_shape(a: Block, b: Block) -> None:
    if a.shape != b.shape:
        raise ValueError(f"shapes differ: {a!r}, {b!r}")
