"""Functions that the user of a model supplies as C++: the model declares them, and its expressions call them.

A model file names functions and their arguments, never code.  The code comes with the call that reads the model.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import sympy
from sympy.core.symbol import Str

from cutjoint.model import document
from cutjoint.model.errors import ModelError, Problem, Problems
from cutjoint.model.operations import ExpressionError, Term
from cutjoint.model.records import Model, Scalar, Span, SuppliedFunction
from cutjoint.model.source import Source, read_text
from cutjoint.package.errors import MissingPartialsError
from cutjoint.package.locations import AnyPath

#: The beginning of the C functions' names.
PREFIX = "cutjoint_"

_VALUE = -1  #: stands for the value where a number of an argument stands for a partial derivative


class SuppliedCall(sympy.Expr):  # type: ignore[misc]
    """The value of a supplied function, or its partial derivative by an argument: name, argument, whether it has partials, arguments.

    Derivatives may be taken of one that has none: programs of which they are no part, such as those of the method recursive, go without.
    """

    is_commutative = True
    is_extended_real = True
    is_number = False  # though its arguments may be: no number is known for it

    def __new__(cls, name: Any, by: Any, has_partials: Any, *arguments: Scalar) -> Any:
        name = name if isinstance(name, Str) else Str(name)
        return sympy.Expr.__new__(cls, name, sympy.sympify(by), sympy.sympify(has_partials), *map(sympy.sympify, arguments))

    @property
    def function(self) -> str:
        """The name of the function as a program has it."""
        name, by, has_partials = self.args[:3]
        return f"{'supplied' if has_partials else 'opaque'}.{name}" + (f".{by}" if by != _VALUE else "")

    @property
    def arguments(self) -> tuple[Scalar, ...]:
        """The arguments of the function."""
        return self.args[3:]  # type: ignore[no-any-return]

    def _eval_derivative(self, x: Scalar) -> Scalar:
        name, by, has_partials = self.args[:3]
        slopes = [argument.diff(x) for argument in self.arguments]
        if all(slope == 0 for slope in slopes):
            return sympy.Integer(0)
        if by != _VALUE:
            raise MissingPartialsError(str(name), second=True)
        return sympy.Add(*(SuppliedCall(name, j, has_partials, *self.arguments) * slope for j, slope in enumerate(slopes) if slope != 0))

    def _text(self, printer: Any) -> str:
        name, by = self.args[:2]
        mark = "" if by == _VALUE else f"_{int(by) + 1}"
        return f"{name}{mark}({', '.join(map(printer.doprint, self.arguments))})"

    _sympystr = _text

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        name = str(self.args[0]).replace("_", r"\_")
        mark = "" if self.args[1] == _VALUE else f"_{{,{int(self.args[1]) + 1}}}"
        power = "" if exp is None else f"^{{{exp}}}"
        return rf"\operatorname{{{name}}}{mark}{power}\left({', '.join(map(printer.doprint, self.arguments))}\right)"


def read_functions(source: Source, problems: Problems, model: document.Document) -> dict[str, SuppliedFunction]:
    """The functions that a model declares, by name; an argument that stands twice is noted."""
    found = {}
    for name, part in model.functions.items():
        if len(set(part.arguments)) < len(part.arguments):
            place = source.value_span(("functions", name, "arguments"))
            problems.add(place, f"function '{name}'", "two arguments have one name", "rename one of them")
        span = source.key_span(("functions", name))
        found[name] = SuppliedFunction(name=name, arguments=part.arguments, partials=part.partials, span=span)
    return found


def call_supplied(function: SuppliedFunction, terms: list[Term]) -> Term:
    """The value of a function at terms.

    Raises:
        ExpressionError: there are more or fewer than it has arguments.
    """
    if len(terms) != len(function.arguments):
        count = len(function.arguments)
        words = f"{function.name} needs {count} argument{'s' * (count > 1)}, got {len(terms)}"
        raise ExpressionError(words, f"write {function.name}({', '.join(function.arguments)})")
    value = SuppliedCall(function.name, _VALUE, int(function.partials), *(term.value for term in terms))
    if any(term.value is sympy.nan for term in terms):
        return Term(sympy.nan)
    return Term(value, None, None, 1 + sum(term.size for term in terms), max(t.degree for t in terms), max(t.roots for t in terms))


def supply(model: Model, path: AnyPath) -> Model:
    """Copy a model with the code of its functions, the text of a C++ file.

    Raises:
        ModelError: the file cannot be read, the model declares no functions, or one of them is not in it.
    """
    if not model.functions:
        raise _error(model.span, "model", f"it declares no functions, and {path} is to have their code", "leave the file out")
    text = read_text(Path(path))
    missing = [f for f in model.functions if not re.search(rf"\b{PREFIX}{f.name}\b", text)]
    if missing:
        raise ModelError(tuple(
            Problem(span=f.span, element=f"function '{f.name}'", message=f"{path} has no {PREFIX}{f.name}", hint=f"write {signature_of(f)}")
            for f in missing
        ))  # fmt: skip
    return replace(model, code=text)


def require_code(model: Model) -> None:
    """Check that the code of all functions is there.

    Raises:
        ModelError: it is not.
    """
    if model.functions and not model.code:
        hint = "name a C++ file that has it by --functions, in Python by read_model(path, functions=...)"
        raise _error(model.functions[0].span, f"function '{model.functions[0].name}'", "its code is missing", hint)


def _error(span: Span, element: str, message: str, hint: str) -> ModelError:
    return ModelError((Problem(span=span, element=element, message=message, hint=hint),))


def signature_of(function: SuppliedFunction) -> str:
    """The C++ declaration of a function."""
    return f'extern "C" void {PREFIX}{function.name}(const double* arguments, double* result, double* partials)'


def code_file(model: Model) -> Mapping[str, str]:
    """The file of generated code that has the code of the functions, by its name; none of a model without."""
    if not model.functions:
        return {}
    require_code(model)
    declared = "".join(f"{signature_of(f)};  // ({', '.join(f.arguments)})\n" for f in model.functions)
    head = "// The functions that the model calls, as its user supplies them.\n\n"
    return {SUPPLIED_FILE: f'{head}{declared}\n#line 1 "functions"\n{model.code}'}


#: The name of that file.
SUPPLIED_FILE = "supplied.cpp"
