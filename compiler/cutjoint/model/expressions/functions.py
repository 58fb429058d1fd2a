"""Functions that the user of a model supplies as C++: the model declares them, and its expressions call them.

A model file names functions and their arguments, never code. The code is given by the call that reads the model. A function only reads its
memory; its update computes the next memory at a controller's sample.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import sympy
from sympy.core.symbol import Str

from cutjoint.model.document import model_file
from cutjoint.model.document.source import Source, read_text
from cutjoint.model.errors import ModelError, Problem, Problems
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.units import Dimension, UnitError, described, measure
from cutjoint.model.records import Model, Scalar, Span, SuppliedFunction
from cutjoint.package.errors import MissingPartialsError
from cutjoint.package.locations import AnyPath

PREFIX = "cutjoint_"  #: the beginning of the C functions' names
_UPDATE = "_update"  #: the end of the name of the C function that writes a memory
MAX_MEMORY, MAX_RESULTS = 256, 16  #: the largest memory of a function, bytes, and the most results
_VALUE = -1  #: stands for the value where a number of an argument stands for a partial derivative
_LEFT = "// A host has the code of these functions.\n"
_HOST = """
struct cutjoint_host_function {
  void (*call)(void* host, const double* arguments, const void* memory, void* results, double* partials);
  void* host;
};
inline thread_local const cutjoint_host_function* cutjoint_host_functions = nullptr;
"""
SUPPLIED_FILE = "supplied.cpp"  #: the name of the file of generated code that has the code of the functions


class SuppliedCall(sympy.Expr):  # type: ignore[misc]
    """The value of a supplied function, or its partial derivative by an argument: name, argument, whether it has partials, arguments.

    Derivatives of a function without partials may be formed; only programs that contain them need its partials.
    With several results or a memory, the name is followed, after colons, by the result, the number of results, and the number of memory
    values at the end of the arguments.  An update has no results; its first number is that of the memory value that it writes.
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

    @property
    def _memory(self) -> int:
        return int(str(self.args[0]).split(":")[-1]) if ":" in str(self.args[0]) else 0

    @property
    def _shown_name(self) -> str:
        """The name as readers see it: of one with several results with the number of the result."""
        name, *numbers = str(self.args[0]).split(":")
        return f"{name}_{int(numbers[0]) + 1}" if numbers and int(numbers[1]) > 1 else name

    @property
    def _shown(self) -> tuple[Scalar, ...]:
        """The arguments as readers see them: a memory is one."""
        return self.arguments[: len(self.arguments) - max(self._memory - 1, 0)]

    def _eval_derivative(self, x: Scalar) -> Scalar:
        name, by, has_partials = self.args[:3]
        # a memory is a discrete state: it has no derivative
        derivatives = [argument.diff(x) for argument in self.arguments[: len(self.arguments) - self._memory]]
        if all(derivative == 0 for derivative in derivatives):
            return sympy.Integer(0)
        if by != _VALUE:
            raise MissingPartialsError(str(name), second=True)
        return sympy.Add(*(SuppliedCall(name, j, has_partials, *self.arguments) * d for j, d in enumerate(derivatives) if d != 0))

    def _text(self, printer: Any) -> str:
        name, by = self._shown_name, self.args[1]
        mark = "" if by == _VALUE else f"_{int(by) + 1}"
        return f"{name}{mark}({', '.join(map(printer.doprint, self._shown))})"

    _sympystr = _text

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        name = self._shown_name.replace("_", r"\_")
        mark = "" if self.args[1] == _VALUE else f"_{{,{int(self.args[1]) + 1}}}"
        power = "" if exp is None else f"^{{{exp}}}"
        return rf"\operatorname{{{name}}}{mark}{power}\left({', '.join(map(printer.doprint, self._shown))}\right)"


def read_functions(source: Source, problems: Problems, model: model_file.Document) -> dict[str, SuppliedFunction]:
    """The functions that a model declares, by name; an argument that stands twice is noted."""
    found = {}
    for name, part in model.functions.items():
        if len(set(part.arguments)) < len(part.arguments):
            place = source.value_span(("functions", name, "arguments"))
            problems.add(place, f"function '{name}'", "two arguments have one name", "rename one of them")
        span = source.key_span(("functions", name))
        for problem in _problems(source, name, part, model):
            problems.add(*problem)
        units = part.arguments if isinstance(part.arguments, dict) else {}
        results = part.results if isinstance(part.results, dict) else dict.fromkeys(part.results or (), "") or {"": part.unit or ""}
        found[name] = SuppliedFunction(
            name=name, arguments=tuple(part.arguments), partials=part.partials, span=span, units=units, results=results,
            memory=min(max(part.memory or 0, 0), MAX_MEMORY),
        )  # fmt: skip
    return found


def _problems(
    source: Source, name: str, part: model_file.SuppliedFunction, model: model_file.Document
) -> Iterator[tuple[Span, str, str, str]]:
    """The problems of a declaration: units that are none of SI, names that stand twice, sizes out of range."""
    path = ("functions", name)
    label = f"function '{name}'"
    written = {("arguments", key): unit for key, unit in part.arguments.items()} if isinstance(part.arguments, dict) else {}
    if isinstance(part.results, dict):
        written |= {("results", key): unit for key, unit in part.results.items()}
    units: list[tuple[tuple[str, ...], str]] = [*written.items(), *([(("unit",), part.unit)] if part.unit is not None else [])]
    for keys, unit in units:
        place = source.value_span((*path, *keys))
        try:
            known = measure(1.0, unit)
        except UnitError as error:
            yield place, label, str(error), "write for example N*s/m"
            continue
        if known.value != 1.0:
            yield place, label, f"'{unit}' is no SI unit, and its code has numbers in SI units", f"write {known.dimension}"
    names = tuple(part.results or ())
    if len(set(names)) < len(names):
        yield source.value_span((*path, "results")), label, "two results have one name", "rename one of them"
    if len(names) > MAX_RESULTS:
        remedy = f"at most {MAX_RESULTS}: declare another function"
        yield source.value_span((*path, "results")), label, f"it has {len(names)} results", remedy
    if part.memory is not None and not 1 <= part.memory <= MAX_MEMORY:
        yield source.value_span((*path, "memory")), label, f"memory: {part.memory} bytes is out of range", f"write 1 to {MAX_MEMORY}"
    if part.memory is not None and f"{name}{_UPDATE}" in model.functions:
        hint = f"the update of its memory is {PREFIX}{name}{_UPDATE}; rename one of the two"
        yield source.key_span((*path,)), label, f"'{name}{_UPDATE}' is a function too", hint


def call_supplied(function: SuppliedFunction, terms: Sequence[Term], result: str = "", memory: Term | None = None) -> Term:
    """The value of a function at terms, or one of its results by name; ``memory`` is that of a controller.
    Raises ExpressionError: there are more or fewer than it has arguments, one has another unit, or there is no such result or memory."""
    if result not in function.results:
        calls = [f"{function.name}{'.' * bool(name)}{name}({', '.join(_parameters(function))})" for name in function.results]
        words = f"{function.name} has no result '{result}'" if result else f"{function.name} has several results"
        raise ExpressionError(words, f"write {' or '.join(calls)}")
    _check_arguments(function, terms, _parameters(function))
    if function.words and (memory is None or memory.memory_of != function.name):
        hint = f"give a controller memory: {{kept: {{function: {function.name}, arguments: [...]}}}}, and write its name there"
        raise ExpressionError(f"the last argument of {function.name} is its memory", hint)
    held = words_of(memory.value, function.words) if memory is not None else []
    number = list(function.results).index(result)
    name = function.name if function.is_plain else f"{function.name}:{number}:{len(function.results)}:{function.words}"
    value = SuppliedCall(name, _VALUE, int(function.partials), *(term.value for term in terms), *held)
    if any(term.value is sympy.nan for term in terms):
        return Term(sympy.nan)
    unit = function.results[result]
    size = 1 + sum(term.size for term in terms)
    degree, roots = max(t.degree for t in terms), max(t.roots for t in terms)
    return Term(value, _dimension(unit), None, size, degree, roots)


def update_supplied(function: SuppliedFunction, terms: Sequence[Term], memory: Scalar) -> list[Scalar]:
    """The next values of a memory, each four bytes of it, by the update of its function.
    Raises ExpressionError: it has no memory, there are more or fewer than it has arguments, or one has another unit."""
    if not function.words:
        raise ExpressionError(f"the function '{function.name}' has no memory", "declare its size in bytes: memory: 64")
    _check_arguments(function, terms, function.arguments)
    if any(term.value is sympy.nan for term in terms):
        return [sympy.Integer(0)] * function.words
    arguments = (*(term.value for term in terms), *words_of(memory, function.words))
    name = f"{function.name}{_UPDATE}"
    return [SuppliedCall(f"{name}:{word}:0:{function.words}", _VALUE, 0, *arguments) for word in range(function.words)]


def words_of(memory: Scalar, words: int) -> list[Scalar]:
    """The symbols of the values of a memory."""
    return [sympy.Symbol(f"{memory}:{word}", real=True) for word in range(words)]


def _parameters(function: SuppliedFunction) -> tuple[str, ...]:
    return (*function.arguments, "memory") if function.words else function.arguments


def _check_arguments(function: SuppliedFunction, terms: Sequence[Term], shown: Sequence[str]) -> None:
    if len(terms) != len(function.arguments):
        count = len(function.arguments)
        words = f"{function.name} needs {count} argument{'s' * (count > 1)}, got {len(terms)}"
        raise ExpressionError(words, f"write {function.name}({', '.join(shown)})")
    for name, term in zip(function.arguments, terms, strict=True):
        expected = _dimension(function.units.get(name, ""))
        if expected is not None and term.dimension not in (None, expected):
            raise ExpressionError(f"{name} of {function.name} needs {described(expected)}, got {described(term.dimension)}")


def _dimension(unit: str) -> Dimension | None:
    """The dimension of a declared unit, None of none or of one that is wrong, which is noted."""
    try:
        return measure(1.0, unit).dimension if unit else None
    except UnitError:
        return None


def supply(model: Model, path: AnyPath) -> Model:
    """Copy a model with the code of its functions, the text of a C++ file.
    Raises ModelError: the file cannot be read, the model declares no functions, or one of them is not in it."""
    if not model.functions:
        message = f"it declares no functions, and {path} is to have their code"
        raise ModelError([Problem(model.span, "model", message, "leave the file out")])
    text = read_text(Path(path))
    missing = [(f, name) for f in model.functions for name in signatures_of(f) if not re.search(rf"\b{name}\b", text)]
    if missing:
        described = ((f, f"{path} has no {name}", f"write {signatures_of(f)[name]}") for f, name in missing)
        raise ModelError(Problem(f.span, f"function '{f.name}'", *words) for f, *words in described)
    return replace(model, code=text)


def leave_to_host(model: Model) -> Model:
    """Copy a model whose functions have no code: hosts give each simulation pointers to it. Raises ModelError: it declares no functions."""
    if not model.functions:
        message = "it declares no functions, and a host is to have their code"
        raise ModelError([Problem(model.span, "model", message, "leave the option out")])
    return replace(model, code=_LEFT + "\n".join([_HOST, *_calls_of_host(model)]))


def functions_of_host(model: Model) -> tuple[str, ...]:
    """The names of the functions that a host gives to simulations, with updates of memories; none where they have code."""
    return tuple(name.removeprefix(PREFIX) for f in model.functions for name in signatures_of(f)) if model.code.startswith(_LEFT) else ()


def _calls_of_host(model: Model) -> Iterator[str]:
    """The C functions: each calls the function of the simulation that steps on this thread."""
    place = 0
    for function in model.functions:
        for signature in signatures_of(function).values():
            results = "next" if "void* next" in signature else "result" if "" in function.results else "results"
            memory, partials = "memory" if function.words else "nullptr", "nullptr" if results == "next" else "partials"
            at = f"cutjoint_host_functions[{place}]"
            yield f"{signature} {{ {at}.call({at}.host, arguments, {memory}, {results}, {partials}); }}"
            place += 1


def require_code(model: Model) -> None:
    """Check that the code of all functions is there. Raises ModelError: it is not."""
    if model.functions and not model.code:
        hint = "name a C++ file that has it by --functions, in Python by read_model(path, functions=...)"
        raise ModelError([Problem(model.functions[0].span, f"function '{model.functions[0].name}'", "its code is missing", hint)])


def signatures_of(function: SuppliedFunction) -> Mapping[str, str]:
    """The C++ declarations of a function, and of the update of its memory, by their names in C."""
    name = f"{PREFIX}{function.name}"
    result, memory = "result" if "" in function.results else "results", "const void* memory, " * bool(function.words)
    own = {name: f'extern "C" void {name}(const double* arguments, {memory}double* {result}, double* partials)'}
    update = {f"{name}{_UPDATE}": f'extern "C" void {name}{_UPDATE}(const double* arguments, const void* memory, void* next)'}
    return {**own, **(update if function.words else {})}


def templates_of(model: Model) -> tuple[SuppliedFunction, ...]:
    """The functions with a template over the number type as their code: partial derivatives follow from it."""
    pattern = r"\btemplate\s*<\s*(?:class|typename)\s+\w+\s*>\s*void\s+{}\s*\("
    return tuple(f for f in model.functions if re.search(pattern.format(PREFIX + f.name), model.code))
