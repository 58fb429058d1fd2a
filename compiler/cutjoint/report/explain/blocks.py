r"""Blocks -> LaTeX: the expressions that are computed, over the names that the code gives them.

What a formula uses more than once and has no name is called x_1, x_2 and so on.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cutjoint.elements.interaction import Carrier
from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS, discrete_state_name, input_parameters, input_symbols, tunable_parameters
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Model
from cutjoint.program.blocks import BindingTime, Block, Builder, is_identity, is_zero
from cutjoint.report.explain.latex import NOISE, lines, matrix, number, words

#: How tightly what is printed holds together: a sum, a product of vectors, a product, one thing.
_SUM, _VECTORS, _PRODUCT, _ONE = range(4)

#: Longer expressions that are used more than once have names of their own.
_SHORT = 40

_SYMBOLS = {"lt": r"{} \lt {}", "le": r"{} \le {}", "and": r"{} \text{{ and }} {}", "or": r"{} \text{{ or }} {}", "not": r"\neg ({})"}


class Letters(Builder):
    """A builder for readers: it notes the letters of blocks, and its symbols are LaTeX."""

    def __init__(self) -> None:
        super().__init__()
        self.letters: dict[Block, str] = {}

    def letter(self, block: Block, name: str) -> Block:
        """Call a block by LaTeX; numbers and symbols stay what they are."""
        if block.op not in ("const", "symbol"):
            self.letters.setdefault(block, name)
        return block

    def free(self, name: str, n: int = 1, m: int = 1) -> Block:
        """A symbol of shape (n, m)."""
        return self._make("symbol", (), (n, m), data=name, binding=BindingTime.ITERATION)

    def take(self, a: Block, rows: tuple[int, int], columns: tuple[int, int] = (0, 1)) -> Block:
        """The sub-block, of a column of blocks the block itself."""
        if a.op == "stack":
            data: Any = a.data
            heights, widths = data
            ends = [sum(heights[: i + 1]) for i in range(len(heights))]
            if len(widths) == 1 and rows[1] in ends and rows[1] - rows[0] == heights[ends.index(rows[1])]:
                return a.args[ends.index(rows[1])]
        return super().take(a, rows, columns)

    def label(self, block: Block, name: str, *, rows: tuple[str, ...] = (), columns: tuple[str, ...] = ()) -> Block:
        """The beginning of the name that readers of code see."""
        return self.letter(block, name.partition("_")[0])

    def rate(self, block: Block) -> Block:
        """The derivative by time."""
        return self.zero(*block.shape) if is_zero(block) else self._make("rate", (block,), block.shape)


@dataclass(frozen=True)
class LetterFrame:
    """The rotation and the motion of a body in letters."""

    R: Block
    Z: Block
    root: str = ""


@dataclass(frozen=True)
class LetterBodies:
    """Kinematics and body system of one force, over letters: a point of a force is the name of its field."""

    builder: Letters
    shared: frozenset[str] = frozenset()
    added: list[tuple[str, Block]] = field(default_factory=list)
    rotors: Mapping[str, Any] = field(default_factory=dict)

    @property
    def frames(self) -> Mapping[str, LetterFrame]:
        """The frames of the bodies of a force, and of body i."""
        b = self.builder
        motions = {name: b.stack([[b.free("v_0", 3)], [b.free(rf"\omega_{{{name}}}", 3)]]) for name in (*Carrier, "i")}
        return {str(name): LetterFrame(b.free(f"R_{{{name}}}", 3, 3), Z) for name, Z in motions.items()}

    @property
    def translator(self) -> Translator:
        """Symbols are letters."""
        return Translator(self.builder, {}, lambda symbol: self.builder.free(str(symbol)))

    def point(self, body: str, name: str) -> Block:
        """A point, of both bodies two."""
        return self.builder.free(f"p_{{{name},{body}}}" if name in self.shared else f"p_{{{name}}}", 3)

    def direction(self, body: str, name: str) -> Block:
        """A direction."""
        return self.builder.free(f"e_{{{name}}}", 3)

    def absolute(self, body: str, point: Block) -> Block:
        """The point itself."""
        return point

    def velocity(self, body: str, point: Block) -> Block:
        """The velocity of the body's point there."""
        return self.builder.rate(point)

    def between(self, body: str, point: Block, other: str, other_point: Block) -> Block:
        """The displacement from the other point."""
        return self.builder.sub(point, other_point)

    def pole_step(self, base: str, follower: str) -> Block:
        """One pole for all."""
        return self.builder.zero(3)

    def in_global(self, vector: Block) -> Block:
        """Global axes throughout."""
        return vector

    from_global = in_global

    def add_force(self, body: str, wrench: Block) -> None:
        """Note what joins Q."""
        self.added.append((body, wrench))


def print_blocks(b: Letters, named: Iterable[Block], used: Iterable[tuple[str, Block]]) -> tuple[str, ...]:
    """The definitions of ``named`` blocks and of all that they and what is ``used`` need, then what ``used`` adds to the LaTeX before
    each."""
    used = tuple(used)
    names = _Names(b, [*named, *(block for _, block in used)])
    defined = [f"{letter} &= {names.define(block)}" for block, letter in names.in_order()]
    shown = [lines(defined)] if defined else []
    return (*shown, *(f"{left} {names.show(block)}".replace("+ -", "- ", 1) for left, block in used))


def print_residuals(residual: Block, names: Sequence[str], model: Model) -> Iterator[tuple[tuple[str, ...], str]]:
    """The equations of a column of natural coordinates, each with its names: a vector's components have one text."""
    b, arrays = Letters(), dict[str, list[str]]({
        "parameters": [p.name for p in tunable_parameters(model)],
        INPUTS: [name for p in input_parameters(model) for name in (p.name, *map(str, input_symbols(p)[1:]))],
        DISCRETE_STATES: [discrete_state_name(value) for value in model.discrete_states],
    })  # fmt: skip
    rows = residual.args if residual.op == "stack" and len(residual.args) == len(names) else (residual,)
    for block in _Names(b, [residual]).reached:
        data: Any = block.data
        if block.op == "take" and (array := arrays.get(str(block.args[0].data), [])):
            b.letters[block] = words(array[data[0][0]])
        elif block.op == "symbol":
            array = arrays.get(data, [])
            b.letters[block] = words(array[0] if len(array) == 1 else data.removeprefix("node:"))
    for i, row in enumerate(rows):
        yield ((names[i],) if len(rows) > 1 or len(names) == 1 else tuple(names)), _Names(b, [row], divide=False).show(row)


class _Names:
    """The printer of some blocks over the letters of others."""

    def __init__(self, b: Letters, roots: list[Block], *, divide: bool = True) -> None:
        self._letters = dict(b.letters)
        uses, seen = Counter[Block](roots), set[Block]()
        todo = list(roots)
        while todo:
            block = todo.pop()
            if block not in seen:
                seen.add(block)
                uses.update(block.args)
                todo += block.args
        self.reached = sorted(seen, key=lambda block: block.number)
        count = 0
        for block in self.reached if divide else ():
            parted = block.op not in ("const", "symbol", "rate") and any(x.op == "take" and block in x.args for x in self.reached)
            if block not in self._letters and (parted or uses[block] > 1) and len(self.define(block)) > (0 if parted else _SHORT):
                count += 1
                self._letters[block] = f"x_{{{count}}}"

    def in_order(self) -> Iterator[tuple[Block, str]]:
        """The blocks with a letter, each behind those that it needs."""
        return ((block, self._letters[block]) for block in self.reached if block in self._letters)

    def show(self, block: Block, least: int = _SUM) -> str:
        """A block by its letter or as an expression, in brackets where it does not hold together."""
        if block in self._letters:
            return self._letters[block]
        text, holds = self._print(block)
        return text if holds >= least else rf"\left({text}\right)"

    def define(self, block: Block) -> str:
        """The expression of a block that has a letter."""
        return self._print(block)[0]

    def _print(self, block: Block) -> tuple[str, int]:
        args = block.args
        match block.op:
            case "const":
                return (text := self._constant(block)), (_SUM if text.startswith("-") else _ONE)
            case "symbol":
                return str(block.data), _ONE
            case "rate":
                inner = self.show(args[0], _ONE)
                return (rf"\dot {{{inner}}}" if args[0].op == "symbol" or args[0] in self._letters else rf"\frac{{d}}{{dt}} {inner}"), _ONE
            case "add" | "sub":
                return self._sum(block), _SUM
            case "neg":
                return f"-{self.show(args[0], _VECTORS)}", _SUM
            case "scale" | "mul":
                return self._product(block)
            case "transpose" if args[0].op == "neg" and args[0].args[0].op == "skew" and args[0] not in self._letters:
                return self.show(args[0].args[0]), _ONE
            case "transpose":
                return f"{self.show(args[0], _ONE)}^T", _ONE
            case "skew" if args[0].op == "scale" and args[0].args[0].op in ("symbol", "const") and args[0] not in self._letters:
                factor, vector = args[0].args
                return rf"{self.show(factor)} \tilde {{{self.show(vector, _ONE)}}}", _PRODUCT
            case "skew":
                return rf"\tilde {{{self.show(args[0], _ONE)}}}", _ONE
            case "mirror":
                return self._print(args[0]) if args[0] not in self._letters else (self._letters[args[0]], _ONE)
            case "symmetrise":
                a = self.show(args[0], _ONE)
                return f"{a} + {a}^T", _SUM
            case "sandwich":
                a = self.show(args[0], _ONE)
                return f"{a} {self.show(args[1], _PRODUCT)} {a}^T", _PRODUCT
            case "stack":
                if (chosen := _choice_of_columns(block)) is not None:
                    return self._cases(*chosen), _PRODUCT
                data: Any = block.data
                n = len(data[1])
                return matrix([[self.show(x) for x in args[i : i + n]] for i in range(0, len(args), n)]), _ONE
            case "take":
                return self._part(block), _ONE
            case "call":
                return self._call(block)
        raise NotImplementedError(block.op)

    def _constant(self, block: Block) -> str:
        if is_zero(block):
            return "0"
        if is_identity(block) and block.shape != (1, 1):
            return r"\mathbf{1}"
        rows = [[self._number(x) for x in row] for row in block.data]  # type: ignore[attr-defined]
        return rows[0][0] if block.shape == (1, 1) else matrix(rows)

    @staticmethod
    def _number(x: float) -> str:
        return number(x if abs(x) > NOISE else 0.0, times=r" \cdot 10^{{{}}}")

    def _sum(self, block: Block) -> str:
        first, second = block.args
        left, right = self.show(first), self.show(second, _SUM if block.op == "add" else _VECTORS)
        if right == "0":
            return left
        if block.op == "add" and right.startswith("-"):
            return f"{left} - {right.removeprefix('-').lstrip()}"
        return f"{left} {'+' if block.op == 'add' else '-'} {right}"

    def _product(self, block: Block) -> tuple[str, int]:
        first, second = block.args
        if first.op == second.op == "const" and block.shape == (1, 1):
            return (text := self._number(first.data[0][0] * second.data[0][0])), (_SUM if text.startswith("-") else _ONE)  # type: ignore[index]
        if first.op == "skew" and first not in self._letters and second.shape[1] == 1:
            return rf"{self.show(first.args[0], _ONE)} \times {self.show(second, _ONE)}", _VECTORS
        if first.op == "transpose" and block.shape == (1, 1):
            if first.args[0] is second:
                return rf"\lVert {self.show(second)} \rVert^2", _PRODUCT
            return rf"{self.show(first.args[0], _ONE)} \cdot {self.show(second, _ONE)}", _VECTORS
        is_quotient = first.op == "call" and first.data == ("div", None) and first not in self._letters
        if is_quotient and (first.args[0].op, first.args[0].data) == ("const", ((1.0,),)):
            return rf"\frac{{{self.show(second)}}}{{{self.show(first.args[1])}}}", _PRODUCT
        if first.op == "neg" and first not in self._letters:
            return f"-{self.show(first.args[0], _PRODUCT)} {self.show(second, _PRODUCT)}", _SUM
        left, right = self.show(first, _SUM if first.op == "const" else _PRODUCT), self.show(second, _PRODUCT)
        if left == right:
            return f"{self.show(first, _ONE)}^2", _PRODUCT
        return (rf"{left} \cdot {right}" if right[0].isdigit() else f"{left} {right}"), (_SUM if left.startswith("-") else _PRODUCT)

    def _part(self, block: Block) -> str:
        (inner,), spans = block.args, block.data
        mark = "".join(
            ("xyz"[first] if size == 3 else str(first + 1)) for (first, _), size in zip(spans, inner.shape, strict=True) if size > 1  # type: ignore[call-overload]
        )
        is_rate = inner.op == "rate" and inner not in self._letters
        name = self.show(inner.args[0] if is_rate else inner, _ONE)
        stem, _, index = name.partition("_")
        indexed = f"{stem}_{{{index.strip('{}')},{mark}}}" if index else f"{name}_{{{mark}}}"
        return rf"\dot {{{indexed}}}" if is_rate else indexed

    def _cases(self, *blocks: Block) -> str:
        when, yes, no = map(self.show, blocks)
        return rf"\begin{{cases}} {yes} & \text{{if }} {when} \cr {no} & \text{{otherwise}} \end{{cases}}"

    def _call(self, block: Block) -> tuple[str, int]:
        data: Any = block.data
        function = data[0]
        args = block.args
        if function == "div":
            return rf"\frac{{{self.show(args[0])}}}{{{self.show(args[1])}}}", _PRODUCT
        if function == "where":
            return self._cases(*args), _PRODUCT
        if function == "sqrt":
            inner = self.show(args[0])
            is_norm = inner.startswith(r"\lVert") and inner.endswith(r"\rVert^2") and inner.count("rVert") == 1
            return (inner.removesuffix("^2") if is_norm else rf"\sqrt{{{inner}}}"), _ONE
        if function in _SYMBOLS:
            return _SYMBOLS[function].format(*(self.show(x) for x in args)), _SUM
        if function == "abs":
            return rf"\lvert {self.show(args[0])} \rvert", _ONE
        if function == "pow":
            return f"{self.show(args[0], _ONE)}^{{{self.show(args[1])}}}", _PRODUCT
        if function in ("sin", "cos", "tan", "exp"):
            return rf"\{function} \left({self.show(args[0])}\right)", _ONE
        name = words(function) if "_" in function or "." in function else rf"\text{{{function}}}"
        return rf"{name} \left({', '.join(self.show(x) for x in args)}\right)", _ONE


def _choice_of_columns(block: Block) -> tuple[Block, Block, Block] | None:
    """The condition and the columns of one that is chosen by its components; None of any other."""
    if any(x.op != "call" or x.data != ("where", None) or x.args[0] is not block.args[0].args[0] for x in block.args):
        return None
    sides = zip(*(x.args[1:] for x in block.args), strict=True)
    columns = [{each.args[0] if each.op == "take" else each for each in side} for side in sides]
    if len(block.args) == 1 or {len(c) for c in columns} != {1}:
        return None
    yes, no = (c.pop() for c in columns)
    return block.args[0].args[0], yes, no
