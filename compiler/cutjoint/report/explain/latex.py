"""SymPy -> LaTeX that survives Markdown, and numbers for tables.

GitHub takes backslashes before punctuation and underscores behind brackets for Markdown's own, inside ``$$`` too.  So rows end in
``\\cr``, underscores follow letters, and a parameter's name is text with spaces.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import sympy
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from cutjoint.formulate.inputs import input_parameters, input_symbols
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.records import Model, Scalar, Vector

#: Digits of a number in the text.
DIGITS = 7

#: Matrices whose LaTeX is longer are printed by means of their common subexpressions, and not at all where that does not help.
LONG, TOO_LONG = 1500, 4000

#: A smaller number in a kernel is what rounding has left of a unit vector's zero.
NOISE = 1e-14

Symbols = Mapping[Scalar, str]


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _print_Float(self, e: Any) -> str:
        return number(float(e), times=r" \cdot 10^{{{}}}")

    def _print_Piecewise(self, e: Any) -> str:
        rows = r" \cr ".join(f"{self._print(value)} & {self._condition(when)}" for value, when in e.args)
        return rf"\begin{{cases}} {rows} \end{{cases}}"

    def _condition(self, when: Any) -> str:
        return r"\text{otherwise}" if when == sympy.true else rf"\text{{if }} {self._print(when)}"

    def _print_MatrixBase(self, e: Any) -> str:
        return matrix([[self._print(e[i, j]) for j in range(e.cols)] for i in range(e.rows)])


class _Text(StrPrinter):  # type: ignore[misc]
    def _print_Float(self, e: Any) -> str:
        return number(float(e), times="e{}")


def number(x: float, *, times: str) -> str:
    """A number rounded to DIGITS digits; ``times`` is what follows the mantissa of a very large or small one."""
    value = float(f"{x:.{DIGITS}g}")
    if value == 0.0 or 1e-4 <= abs(value) < 1e9:
        return str(int(value)) if value == int(value) else repr(value)
    mantissa, _, exponent = f"{value:.{DIGITS - 1}e}".partition("e")
    return mantissa.rstrip("0").rstrip(".") + times.format(int(exponent))


def latex(expression: Scalar, symbols: Symbols) -> str:
    """An expression or matrix; ``symbols`` has the LaTeX of its symbols."""
    e = sympy.sympify(expression)
    settings = {"symbol_names": dict(symbols), "fold_func_brackets": True, "itex": True, "ln_notation": True}
    return str(_Latex(settings).doprint(e))


def matrix(rows: Iterable[Sequence[str]]) -> str:
    """A matrix of LaTeX."""
    return r"\begin{bmatrix} " + r" \cr ".join(" & ".join(row) for row in rows) + r" \end{bmatrix}"


def column(vector: Sequence[Scalar], symbols: Symbols) -> str:
    """A column of expressions."""
    return matrix([latex(x, symbols)] for x in vector)


def lines(equations: Iterable[str]) -> str:
    """Equations below each other, aligned at their ``&``."""
    return r"\begin{aligned} " + r" \cr ".join(equations) + r" \end{aligned}"


def equations(named: Sequence[tuple[str, Any]], symbols: Symbols) -> tuple[str, ...]:
    """Formulas of named matrices.

    A zero matrix is 0 and a unit matrix 1, such ones stand together at the end; long matrices share a list of common subexpressions;
    what stays too long is left out with the number of its operations.
    """
    plain = [f"{name} = {value}" for name, m in named if (value := _plain(m))]
    rest = [(name, m) for name, m in named if not _plain(m)]
    long = [name for name, m in rest if len(latex(m, symbols)) > LONG]
    definitions, reduced = _share([m for name, m in rest if name in long])
    extended = {**symbols, **{s: f"x_{{{i}}}" for i, (s, _) in enumerate(definitions, 1)}}
    if sum(len(latex(e, extended)) for e in (*(e for _, e in definitions), *reduced)) > TOO_LONG:
        shown = [_left_out(name, m) if name in long else f"{name} = {latex(m, symbols)}" for name, m in rest]
    else:
        shorter = dict(zip(long, reduced, strict=True))
        shown = [lines(f"{extended[s]} &= {latex(e, extended)}" for s, e in definitions)] if definitions else []
        shown += [f"{name} = {latex(shorter.get(name, m), extended)}" for name, m in rest]
    return (*shown, *([r", \quad ".join(plain)] if plain else []))


def without_noise(m: Any) -> Any:
    """A kernel's matrix without what rounding has left."""
    return m.xreplace({x: sympy.Integer(0) for x in m.atoms(sympy.Float) if abs(x) < NOISE})


def _share(matrices: Sequence[Any]) -> tuple[list[tuple[Scalar, Scalar]], list[Any]]:
    if not matrices:
        return [], []
    definitions, reduced = sympy.cse(matrices, symbols=(sympy.Symbol(f"common_{i}") for i in range(1, 10**6)), order="canonical")
    return definitions, reduced


def _left_out(name: str, value: Any) -> str:
    count = sum(sympy.count_ops(x) for x in value)
    return rf"{name} = \text{{({count} operations, too long to print)}}"


def _plain(m: Any) -> str:
    if m.is_zero_matrix:
        return "0"
    return r"\mathbf{1}" if m.is_square and m == sympy.eye(m.rows) else ""


def variants(names: Sequence[str], formulas: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Every different tuple of formulas once; if there are several, with the names it belongs to."""
    owners: dict[tuple[str, ...], list[str]] = {}
    for name, lines in zip(names, formulas, strict=True):
        owners.setdefault(lines, []).append(name)
    if len(owners) < 2:
        return formulas[0]
    label = r"\text{{{}:}}"
    return tuple(f for lines, who in owners.items() for f in (label.format(", ".join(who).replace("_", " ")), *lines))


def sum_lines(name: str, law: Scalar, symbols: Symbols) -> str:
    """A formula whose cases stand below everything else."""
    cases = sorted((a for a in sympy.Add.make_args(law) if isinstance(a, sympy.Piecewise)), key=sympy.default_sort_key)
    rest = sympy.Add(*(a for a in sympy.Add.make_args(law) if a not in cases))
    if not cases or rest == 0:
        return f"{name} = {latex(law, symbols)}"
    return lines([f"{name} &= {latex(rest, symbols)}", *(rf"& \quad + {latex(a, symbols)}" for a in cases)])


def parameter_symbols(model: Model) -> dict[Scalar, str]:
    """The LaTeX of the model's parameters, of the rates and accelerations of its inputs, and of quantities that expressions read."""
    symbols = {p.symbol: rf"\text{{ {p.name.replace('_', ' ')} }}" for p in model.parameters}
    for value, rate, acceleration in map(input_symbols, input_parameters(model)):
        symbols |= {rate: rf"\dot {{{symbols[value]}}}", acceleration: rf"\ddot {{{symbols[value]}}}"}
    symbols |= {element.symbol: words(element.name) for group in (model.states, model.signals) for element in group}
    for controller in model.controllers:
        symbols |= {signal.symbol: f"{words(signal.name)}^{{+}}" for signal in controller.signals}
        symbols |= {value.symbol: words(str(value.symbol).removeprefix("@").partition(":")[0]) for value in controller.discrete_states}
    return symbols | {quantity_symbol(o.element, o.quantity): words(o.column) for o in readings_of(model)}


def quantity_letter(name: str) -> str:
    """The LaTeX of a quantity or a field: Fx has an index, words stay words."""
    return f"{name[:-1]}_{name[-1]}" if len(name) == 2 and name[-1] in "xyz" else name if len(name) == 1 else words(name)


def words(name: str) -> str:
    """A name as text."""
    return rf"\text{{ {name.replace('_', ' ').replace('.', ' ')} }}"


def text(expression: Scalar, model: Model) -> str:
    """An expression for a table."""
    e = sympy.sympify(expression)
    if e.is_number:
        return number(float(e), times="e{}")
    named = e.xreplace({p.symbol: sympy.Symbol(p.name) for p in model.parameters})
    return f"`{_Text().doprint(named)}`"


def place(vector: Vector, model: Model) -> str:
    """A vector for a table."""
    return f"({', '.join(text(x, model) for x in vector)})"
