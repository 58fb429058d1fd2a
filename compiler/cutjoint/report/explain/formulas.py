r"""Blocks -> LaTeX: the equations that are computed, under the names that the program gives them.

GitHub takes backslashes before punctuation and underscores behind brackets for Markdown's own, inside ``$$`` too.  So rows end in
``\cr``, underscores follow letters, and names are text with spaces.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS, discrete_state_name, input_parameters, input_symbols, tunable_parameters
from cutjoint.formulate.records import Equations
from cutjoint.program.blocks import SUPPLIED, BindingTime, Block, SuppliedCall, is_identity, is_zero
from cutjoint.program.lower import reachable_blocks
from cutjoint.report.explain.views import number

#: The binding of printed terms: a sum, a product of vectors, a product, one term.
_SUM, _VECTORS, _PRODUCT, _ONE = range(4)

#: Unnamed blocks with more letters that are used more than once get names x_1, x_2, ...
_SHORT = 40

#: A smaller number is what rounding has left of a unit vector's zero.
_NOISE = 1e-14

#: The LaTeX of the program's symbols whose letters do not say it.
_LETTERS = {
    "Phi": r"\Phi", "Phid": r"\dot \Phi", "Phidd": r"\ddot \Phi", "constraint": r"\Phi", "lambda": r"\lambda", "push": r"\mu",
    "penalty": r"\alpha", "Zdd": r"\ddot Z", "zdd": r"\ddot z", "vdot": r"\dot v", "bv": r"\dot b", "displacement": "g", "speed": r"\dot g",
    "Mc": "M^c", "Fc": "F^c", "Bc": "B^c", "node": "r", "node_rate": r"\dot r", "node_acceleration": r"\ddot r",
}  # fmt: skip

#: Functions of scalars.
_CALLS = {
    "div": (r"\frac{{{}}}{{{}}}", _PRODUCT), "sqrt": (r"\sqrt{{{}}}", _ONE), "abs": (r"\lvert {} \rvert", _ONE),
    "where": (r"\begin{{cases}} {1} & \text{{if }} {0} \cr {2} & \text{{otherwise}} \end{{cases}}", _PRODUCT),
    "lt": (r"{} \lt {}", _SUM), "le": (r"{} \le {}", _SUM), "not": (r"\neg ({})", _SUM),
    "and": (r"\left({}\right) \text{{ and }} \left({}\right)", _SUM), "or": (r"\left({}\right) \text{{ or }} \left({}\right)", _SUM),
    **{name: (rf"\{name} \left({{}}\right)", _ONE) for name in ("sin", "cos", "tan", "exp")},
}  # fmt: skip

#: Matrix operations: their LaTeX, the binding that their arguments need, and their own.
_OPERATIONS = {
    "neg": ("-{}", (_VECTORS,), _SUM), "transpose": ("{}^T", (_ONE,), _PRODUCT), "skew": (r"\tilde {{{}}}", (_ONE,), _ONE),
    "mirror": ("{}", (_SUM,), _SUM), "symmetrise": ("{0} + {0}^T", (_ONE,), _SUM),
    "sandwich": ("{0} {1} {0}^T", (_ONE, _PRODUCT), _PRODUCT),
    "gram": (r"{0}^T \text{{diag}}({1}) {0}", (_ONE, _SUM), _PRODUCT), "weigh": (r"\text{{diag}}({}) {}", (_SUM, _PRODUCT), _PRODUCT),
    "forward": ("{}^{{-1}} {}", (_ONE, _PRODUCT), _PRODUCT), "backward": ("{}^{{-T}} {}", (_ONE, _PRODUCT), _PRODUCT),
    "ldl_factor": (r"\text{{L}}({})", (_SUM,), _ONE), "ldl_pivots": (r"\text{{D}}^{{-1}}({})", (_SUM,), _ONE),
}  # fmt: skip


def words(name: str) -> str:
    """A name as text."""
    return rf"\text{{ {re.sub('[_.*]', ' ', name)} }}"


def matrix(rows: Iterable[Sequence[str]]) -> str:
    """A matrix of LaTeX."""
    return r"\begin{bmatrix} " + r" \cr ".join(" & ".join(row) for row in rows) + r" \end{bmatrix}"


class Formulas:
    """The named blocks that some results need, and their formulas over each other and the program's inputs.

    ``names`` has the LaTeX of each block with a name; ``defined`` are the blocks with a formula, each behind those that it needs.
    """

    def __init__(self, equations: Equations, results: Iterable[Block]) -> None:
        b, model = equations.builder, equations.topology.model
        roots = tuple(results)
        reached = sorted(reachable_blocks(roots), key=lambda block: block.number)
        self._arrays = {
            "parameters": [p.name for p in tunable_parameters(model)],
            INPUTS: [name for p in input_parameters(model) for name in (p.name, *map(str, input_symbols(p)[1:]))],
            DISCRETE_STATES: [discrete_state_name(value).partition(":")[0] for value in model.discrete_states],
        }  # fmt: skip
        self._taken = Counter[str]()
        self._symbols = {quantity.symbol for quantity in b.quantities}
        self.names: dict[Block, str] = {}
        labels: dict[Block, str] = {}
        for quantity, block in b.quantities.items():
            labels.setdefault(block, self._indexed(quantity.symbol, *quantity.parts, *map(str, quantity.which)))
        for block, letter in b.letters.items():
            labels.setdefault(block, self._indexed(letter, b.sections[block.section].element))
        for block, label in b.labels.items():
            labels.setdefault(block, words(label.text))
        for block in reached:
            if (name := self._input(block) or ("" if block.op == "const" else labels.get(block, ""))):
                self.names[block] = name if block.op in ("symbol", "take") and not labels.get(block) else self._unique(name)
        self.defined = [block for block in reached if block in self.names and not self._input(block)]
        uses = Counter(argument for block in reached for argument in block.args) + Counter(roots)
        parted = {block.args[0] for block in reached if block.op == "take"}
        for block in reached:
            often = block.binding is not BindingTime.CONST and uses[block] > 1
            if block.op != "symbol" and block not in self.names and (block in parted or (often and len(self.define(block)) > _SHORT)):
                self._taken["x"] += 1
                self.names[block] = f"x_{{{self._taken['x']}}}"
                self.defined.append(block)
        self.defined.sort(key=lambda block: block.number)

    def _unique(self, name: str) -> str:
        self._taken[name] += 1
        return name if self._taken[name] == 1 else _marked(name, f"({self._taken[name]})")

    def _input(self, block: Block) -> str:
        """The name of an input of the program, "" of anything else."""
        data: Any = block.data
        if block.op == "take" and (array := self._arrays.get(str(block.args[0].data), [])):
            return words(array[data[0][0]])
        if block.op != "symbol":
            return ""
        array = self._arrays.get(data, [])
        symbol, _, element = data.partition(":")
        return words(array[0]) if len(array) == 1 else self._indexed(symbol, element)

    def _indexed(self, symbol: str, *parts: str) -> str:
        """A symbol of the program with the elements that it belongs to, and a prime for each time that it is computed again."""
        stem = symbol.lstrip("r")
        primes = len(symbol) - len(stem) if stem in self._symbols and symbol not in _LETTERS else 0
        stem = stem if primes else symbol
        index = " ".join(part for part in parts if part) + "'" * primes
        own = None if stem in _LETTERS else re.fullmatch(r"(\w)_?(\d+|[a-z]|\\\w+|\{\w+\})", stem)
        letter = _LETTERS.get(stem, own[1] if own else stem if len(stem) == 1 or stem[0] == "\\" else "")
        if not letter:
            return words(f"{stem} {index}".rstrip())
        marks = " ".join([*([own[2].strip("{}")] if own else []), *([words(index)] if index else [])])
        return letter + (f"_{{{marks}}}" if marks else "")

    def show(self, block: Block, least: int = _SUM) -> str:
        """A block by its name or as an expression, in brackets where it does not hold together."""
        text, holds = self._term(block)
        return text if holds >= least else rf"\left({text}\right)"

    def _term(self, block: Block) -> tuple[str, int]:
        return (self.names[block], _ONE) if block in self.names else self._print(block)

    def define(self, block: Block) -> str:
        """The expression of a block that has a name."""
        return self._print(block)[0]

    def _print(self, block: Block) -> tuple[str, int]:
        args = block.args
        match block.op:
            case "const":
                return (text := _constant(block)), (_SUM if text.startswith("-") else _ONE)
            case "transpose" if args[0].op == "transpose" and args[0] not in self.names:
                return self._term(args[0].args[0])
            case "sandwich" if args[0].op == "transpose" and args[0] not in self.names:
                inner = self.show(args[0].args[0], _ONE)
                return f"{inner}^T {self.show(args[1], _PRODUCT)} {inner}", _PRODUCT
            case "add" | "sub":
                return self._sum(block), _SUM
            case "scale" | "mul":
                return self._product(block)
            case "stack":
                data: Any = block.data
                n = len(data[1])
                if len(args) == 1:
                    return self._term(args[0])
                return matrix(self._cells([args[i : i + n] for i in range(0, len(args), n)])), _ONE
            case "take":
                return self._part(block), _ONE
            case "call":
                return self._call(block)
        text, needed, holds = _OPERATIONS[block.op]
        return text.format(*(self.show(x, least) for x, least in zip(args, needed, strict=True))), holds

    def _cells(self, rows: Sequence[Sequence[Block]]) -> Iterator[list[str]]:
        """The cells of a matrix of blocks; zeros and units say their size where no other cell of their row or column does."""
        plain = [all(is_zero(x) or is_identity(x) for x in column) for column in zip(*rows, strict=True)]
        for row in rows:
            alone = all(is_zero(x) or is_identity(x) for x in row)
            yield [self._cell(x, zero=alone or none, unit=alone and none) for x, none in zip(row, plain, strict=True)]

    def _cell(self, x: Block, *, zero: bool, unit: bool) -> str:
        if x.shape == (1, 1) or not ((zero and is_zero(x)) or (unit and is_identity(x))):
            return self.show(x)
        return f"0_{{{x.shape[0]},{x.shape[1]}}}" if is_zero(x) else f"1_{{{x.shape[0]}}}"

    def _sum(self, block: Block) -> str:
        first, second = block.args
        left, right = self.show(first), self.show(second, _SUM if block.op == "add" else _VECTORS)
        if right == "0" or (left == "0" and block.op == "add"):
            return left if right == "0" else right
        if block.op == "add" and right.startswith("-"):
            return f"{left} - {right.removeprefix('-').lstrip()}"
        return f"{left} {'+' if block.op == 'add' else '-'} {right}"

    def _product(self, block: Block) -> tuple[str, int]:
        first, second = block.args
        if any(is_zero(x) or (x.op == "transpose" and is_zero(x.args[0])) for x in block.args):
            return "0", _ONE
        named = first in self.names
        if first.op == "skew" and not named and second.shape[1] == 1:
            return rf"{self.show(first.args[0], _ONE)} \times {self.show(second, _ONE)}", _VECTORS
        if first.op == "transpose" and block.shape == (1, 1) and not named:
            return rf"{self.show(first.args[0], _ONE)} \cdot {self.show(second, _ONE)}", _VECTORS
        left, right = self.show(first, _PRODUCT), self.show(second, _PRODUCT)
        if "0" in (left, right):
            return "0", _ONE
        if left == "1":
            return self._term(second)
        return (rf"{left} \cdot {right}" if right[0].isdigit() else f"{left} {right}"), _PRODUCT

    def _part(self, block: Block) -> str:
        (inner,), spans = block.args, block.data
        marks = [
            str(first + 1) if last == first + 1 else f"{first + 1}:{last}"
            for (first, last), size in zip(spans, inner.shape, strict=True) if size > 1  # type: ignore[call-overload]
        ]  # fmt: skip
        return _marked(self.show(inner, _ONE), ",".join(marks))

    def _call(self, block: Block) -> tuple[str, int]:
        function, args = block.data[0], [self.show(x) for x in block.args]  # type: ignore[index]
        if function == "pow":
            return f"{self.show(block.args[0], _ONE)}^{{{args[1]}}}", _PRODUCT
        if function.startswith(SUPPLIED):
            return _supplied(SuppliedCall.read(function), args), _ONE
        if function not in _CALLS:
            return rf"{words(function)} \left({', '.join(args)}\right)", _ONE
        text, holds = _CALLS[function]
        return text.format(*args), holds


def _supplied(call: SuppliedCall, args: list[str]) -> str:
    """A call of a function of the user: its memory is one argument."""
    result = str(call.result + 1) if call.results > 1 else ""
    by = "" if call.by is None else f"by {call.by + 1}"
    shown = args[: len(args) - call.memory + 1] if call.memory else args
    return rf"{words(' '.join(filter(None, (call.name, result, by))))} \left({', '.join(shown)}\right)"


def _marked(name: str, mark: str) -> str:
    """A name with one more index."""
    if name.endswith(" }"):
        return f"{name[:-2]}, {mark} }}"
    return f"{name[:-1]},{mark}}}" if name.endswith("}") else f"{name}_{{{mark}}}"


def _constant(block: Block) -> str:
    if is_zero(block):
        return "0"
    if is_identity(block) and block.shape != (1, 1):
        return r"\mathbf{1}"
    rows = [[number(x if abs(x) > _NOISE else 0.0, times=r" \cdot 10^{{{}}}") for x in row] for row in block.data]  # type: ignore[attr-defined]
    return rows[0][0] if block.shape == (1, 1) else matrix(rows)
