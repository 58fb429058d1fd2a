"""Controllers: from the document to records.

At a sample, a controller computes its signals, in the order of their dependencies, and then its memory. Other elements read the discrete
states. A delay of n samples is a shift register of n values for each signal.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import sympy

from cutjoint.model.document import model_file
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.dependencies import in_order
from cutjoint.model.expressions.functions import update_supplied, words_of
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import quantity_symbol, sample_symbol, symbols_of, with_terms
from cutjoint.model.expressions.scope import FAILED_TERM, Element
from cutjoint.model.expressions.units import NONE, TIME, Dimension
from cutjoint.model.records import Controller, DiscreteState, Signal

MAX_STATES = 1000  #: the most discrete states of a controller, those of its delays included


def require_free_name(element: Element) -> None:
    """Note an element with the name of a parameter."""
    name = str(element.path[-1])
    if name in element.scope.names:
        element.fail(f"'{name}' is a parameter already", "choose another name")


def unit_text(dimension: Dimension | None) -> str:
    """The SI unit of a dimension, "" where it is none or not known."""
    return "" if dimension in (None, NONE) else str(dimension)


def read_controller(element: Element, part: model_file.Controller) -> Controller:
    """A controller; its expressions may read all quantities that outputs may have."""
    _require_names(element, part)
    every, offset, samples = _read_times(element, part)
    terms, order = _local_terms(element, part)
    signals = []
    for name in order:
        value, keys = _entry(part, name)
        term = terms[name]
        expression = element.scalar(value, None, keys, _names(element, terms))
        signals.append(
            Signal(
                name=f"{element.name}.{name}", symbol=sample_symbol(element.name, name), value=sympy.sympify(expression),
                unit=unit_text(term.dimension), span=element.scope.source.key_span((*element.path, "signals", name)),
            )
        )  # fmt: skip
    delayed = {name: list(_sampled_signal(element, part, name, samples, terms[name])) for name in part.signals}
    states = [values[0] for values in delayed.values()] + list(_memory(element, part, terms))
    states += [value for values in delayed.values() for value in values[1:]]
    if not part.memory and not part.signals:
        element.fail("it computes nothing", "give it signals or memory")
    if len(states) > MAX_STATES:
        element.fail(f"delay: it holds {len(states)} values", f"at most {MAX_STATES}: delay fewer signals, or by fewer samples", ("delay",))
    return Controller(
        name=element.name, every=every, offset=offset, signals=tuple(signals), discrete_states=tuple(states), span=element.span
    )  # fmt: skip


def dimension_of_sample(element: Element, part: model_file.Controller, value: str) -> Dimension | None:
    """The dimension of a signal or a memory of a controller."""
    return _local_terms(element, part)[0].get(value, FAILED_TERM).dimension


def _require_names(element: Element, part: model_file.Controller) -> None:
    """Note names that mean something else already, where its expressions stand or in itself."""
    require_free_name(element)
    for section, names in (("signals", part.signals), ("memory", part.memory)):
        for name in names:
            if name in element.scope.names:
                meaning = "a parameter"
            elif name in element.scope.own:
                meaning = "a state or a signal"
            elif section == "memory" and name in part.signals:
                meaning = "a signal of it"
            else:
                continue
            element.fail(f"'{name}' is {meaning} already", "choose another name", (section, name), at_key=True)


def _read_times(element: Element, part: model_file.Controller) -> tuple[float, float, int]:
    """Interval and first time of samples (s), and the samples by which signals are late."""
    every, offset, delay = (element.number(getattr(part, name), TIME, (name,)) for name in ("every", "offset", "delay"))
    if not every > 0 and not math.isnan(every):
        element.fail("every must be greater than zero", "write the time between two samples, such as every: 1 ms", ("every",))
        every = math.nan
    for name, time in (("offset", offset), ("delay", delay)):
        if time < 0:
            element.fail(f"{name} must not be negative", "", (name,))
    if not delay >= 0 or math.isnan(every):
        return every, offset, 0
    samples = round(min(delay / every, 1e9))
    if abs(samples * every - delay) > 1e-9 * every:
        lower = math.floor(delay / every)
        near = " or ".join(f"{n * every:.9g} s" for n in (lower, lower + 1))
        element.fail(
            f"delay: {delay:.9g} s is no multiple of every, {every:.9g} s",
            f"write {near}; there is no continuous delay, and a shorter every has finer ones", ("delay",),
        )  # fmt: skip
        return every, offset, 0
    if samples * max(len(part.signals), 1) > MAX_STATES:
        element.fail(f"delay: it is {samples} samples long", f"all delayed signals together hold at most {MAX_STATES} values", ("delay",))
        return every, offset, 0
    return every, offset, samples


def _entry(part: model_file.Controller, name: str) -> tuple[int | float | str, tuple[str | int, ...]]:
    """The expression of a signal, and the keys to it."""
    entry = part.signals[name]
    return (entry.value, ("signals", name, "value")) if isinstance(entry, model_file.SampledSignal) else (entry, ("signals", name))


def _names(element: Element, terms: Mapping[str, Term]) -> Mapping[str, Term]:
    """The names of its expressions: quantities at the instant of a sample, its own memory from before, and its signals."""
    return with_terms(replace(element.scope, sampled=True).reading("t"), terms)


def _local_terms(element: Element, part: model_file.Controller) -> tuple[dict[str, Term], list[str]]:
    """The terms of memory and of signals in its own expressions, and the signals, each behind those that it reads."""
    constants = element.scope.constants()
    terms = {name: Term(sample_symbol(element.name, name)) for name in part.signals}
    terms |= {
        name: memory_term(element.name, name, memory)
        if isinstance(memory, model_file.FunctionMemory)
        else Term(quantity_symbol(element.name, name), element.term(memory.start, ("memory", name, "start"), constants).dimension)
        for name, memory in part.memory.items()
    }
    uses = {name: [other for other in part.signals if other in symbols_of(_entry(part, name)[0])] for name in part.signals}
    order, circles = in_order(uses)
    for circle in circles:
        _note_circle(element, circle)
        terms |= dict.fromkeys(circle, FAILED_TERM)
    known = []
    for name in order:
        if any(terms.get(other) is FAILED_TERM for other in uses[name]):
            terms[name] = FAILED_TERM
            continue
        value, keys = _entry(part, name)
        term = element.term(value, keys, _names(element, terms))
        terms[name] = Term(sample_symbol(element.name, name), term.dimension) if term is not FAILED_TERM else FAILED_TERM
        known.append(name)
    return terms, known


def memory_term(controller: str, name: str, memory: model_file.FunctionMemory) -> Term:
    """The term of a function's memory in expressions."""
    return Term(quantity_symbol(controller, name), memory_of=memory.function)


def _note_circle(element: Element, circle: Sequence[str]) -> None:
    lines = {name: element.scope.source.key_span((*element.path, "signals", name)).line for name in circle}
    first = circle[0]
    chain = ", which reads ".join(f"'{name}' (line {lines[name]})" for name in (*circle[1:], first))
    local = str(element.path[-1])
    element.fail(
        f"signal '{first}' depends on itself at one sample: it reads {chain}",
        f"read '{local}.{first}', which is its value of the sample before, or a memory", ("signals", first), at_key=True,
    )  # fmt: skip


def _sampled_signal(element: Element, part: model_file.Controller, name: str, samples: int, term: Term) -> Iterator[DiscreteState]:
    """The discrete state of a signal, then the values of its delay, the latest first."""
    entry, dimension = part.signals[name], term.dimension
    start = (
        element.scalar(entry.start, dimension, ("signals", name, "start"))
        if isinstance(entry, model_file.SampledSignal)
        else sympy.Integer(0)
    )
    waiting = [quantity_symbol(element.name, f"{name}-{i}") for i in range(1, samples + 1)]
    unit, computed = unit_text(dimension), term.value  # which is that at a sample, unless it could not be read
    yield DiscreteState(
        name=name, symbol=quantity_symbol(element.name, name), start=start, next=waiting[-1] if waiting else computed, unit=unit
    )  # fmt: skip
    for symbol, before in zip(waiting, (computed, *waiting), strict=False):
        yield DiscreteState(name="", symbol=symbol, start=start, next=before, unit=unit)


def _memory(element: Element, part: model_file.Controller, terms: Mapping[str, Term]) -> Iterator[DiscreteState]:
    for name, memory in part.memory.items():
        if isinstance(memory, model_file.FunctionMemory):
            yield from _function_memory(element, name, memory, terms)
            continue
        dimension = terms[name].dimension
        yield DiscreteState(
            name=name, symbol=quantity_symbol(element.name, name), unit=unit_text(dimension),
            start=element.scalar(memory.start, None, ("memory", name, "start")),
            next=sympy.sympify(element.scalar(memory.next, dimension, ("memory", name, "next"), _names(element, terms))),
        )  # fmt: skip


def _function_memory(element: Element, name: str, memory: model_file.FunctionMemory, terms: Mapping[str, Term]) -> Iterator[DiscreteState]:
    """The discrete states of the memory of a function, zero before the first sample."""
    keys, functions = ("memory", name), element.scope.functions
    if memory.function not in functions:
        element.fail(f"there is no function '{memory.function}'", nearest(memory.function, functions, "functions"), (*keys, "function"))
        return
    symbol, names = terms[name].value, _names(element, terms)
    try:
        arguments = [element.term(value, (*keys, "arguments", i), names) for i, value in enumerate(memory.arguments)]
        following = update_supplied(functions[memory.function], arguments, symbol)
    except ExpressionError as error:
        element.fail(f"memory {name}: {error.message}", error.hint, (*keys, "arguments"))
        return
    for own, value in zip(words_of(symbol, len(following)), following, strict=True):
        yield DiscreteState(name="", symbol=own, start=sympy.Integer(0), next=value, unit="")
