"""The order of names, forces and signals by their dependencies, and algebraic loops.

A signal follows from the quantities of its expression, a force from those of its laws. States, motions and discrete states of controllers
depend on the past only.
"""

from collections.abc import Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from cutjoint.model.errors import Problems
from cutjoint.model.expressions.choices import bottom_up
from cutjoint.model.expressions.parse import quantities_read, samples_read
from cutjoint.model.records import Force, Model, Scalar, Signal

MAX_LEVELS = 150  #: the deepest nesting of operations, those of the signals and forces that an expression reads included


def in_order(uses: Mapping[str, Iterable[str]]) -> tuple[list[str], list[list[str]]]:
    """The names, each after those that it uses, and the cycles: in each a name uses the next one, and the last one the first.
    A cycle begins with the one of its names that is first in ``uses``; the names of cycles are left out of the order."""
    place = {name: i for i, name in enumerate(uses)}
    graph = {name: sorted(others, key=place.__getitem__) for name, others in uses.items()}
    circles: list[list[str]] = []
    while True:
        try:
            return list(TopologicalSorter(graph).static_order()), circles
        except CycleError as error:
            circle = error.args[1][:0:-1]
            first = min(range(len(circle)), key=lambda i: place[circle[i]])
            circles.append(circle[first:] + circle[:first])
            found = {name for each in circles for name in each}
            graph = {name: [x for x in others if x not in found] for name, others in graph.items() if name not in found}


def forces_in_order(model: Model) -> tuple[Force, ...]:
    """The forces, each after those whose quantities its law reads; in the file's order if none reads any."""
    forces = {force.name: force for force in model.forces}
    uses = _uses(model.forces, model.signals)
    if not any(uses.values()):
        return model.forces
    return tuple(forces[name] for name in in_order(uses)[0] if name in forces)


def seeing_forces(model: Model) -> frozenset[str]:
    """The forces that depend on more than their bodies: through quantities of motion in their laws, signals or other forces, or loads."""
    states = {element.name for group in (model.states, model.controllers) for element in group}
    signals = {signal.name: signal.value for signal in model.signals}
    forces = {force.name: force for force in model.force_elements}
    sees: dict[str, bool] = {}
    uses = _uses(model.force_elements, model.signals)
    for name in in_order(uses)[0]:
        expressions = forces[name].expressions if name in forces else (signals[name],)
        read = {element for expression in expressions for element, _ in quantities_read(expression)}
        by_load = name in forces and forces[name].by_load
        sees[name] = by_load or any(element in forces or sees.get(element, element not in states) for element in read)
    return frozenset(name for name, value in sees.items() if value and name in forces)


class SignalOrder:
    """The signals among ``signals``, by symbol, that others depend on."""

    def __init__(self, signals: Mapping[Scalar, Signal]) -> None:
        self._signals = signals
        self._by_name = {signal.name: signal for signal in signals.values()}
        self._reads: dict[str, list[str]] = {}

    def below(self, symbol: Scalar) -> list[Signal]:
        """The signal of a symbol and the signals that it depends on, each after those that it reads."""
        uses: dict[str, list[str]] = {}
        waiting = [self._signals[symbol].name]
        while waiting:
            name = waiting.pop()
            if name not in uses:
                if name not in self._reads:
                    symbols = self._by_name[name].value.free_symbols & self._signals.keys()
                    self._reads[name] = sorted(self._signals[x].name for x in symbols)
                uses[name] = self._reads[name]
                waiting += uses[name]
        return [self._by_name[name] for name in in_order(uses)[0]]


def check_levels(forces: Sequence[Force], signals: Sequence[Signal], problems: Problems) -> None:
    """Report forces and signals whose expressions, with those that they read, are nested too deep."""
    both: tuple[Force | Signal, ...] = (*forces, *signals)
    elements, uses = {element.name: element for element in both}, _uses(forces, signals)
    levels: dict[str, int] = {}
    for name in in_order(uses)[0] if any(uses.values()) else ():
        element, below = elements[name], max((levels.get(other, 0) for other in uses[name]), default=0)
        expressions = (element.value,) if isinstance(element, Signal) else element.expressions
        levels[name] = below + max((_levels(expression) for expression in expressions), default=0)
        if below <= MAX_LEVELS < levels[name] and below:
            message = f"its expression is nested {levels[name]} levels deep with the signals and forces that it reads"
            problems.add(element.span, f"{_kind(element)} '{name}'", message, f"at most {MAX_LEVELS}: read fewer of them in a row")


def _levels(expression: Scalar) -> int:
    """The nesting depth of operations; a sum or a product of n counts n - 1."""
    found: dict[Scalar, int] = {}
    for part in bottom_up(expression):
        own = max(len(part.args) - 1, 1) if part.args else 0
        found[part] = own + max((found[x] for x in part.args if x in found), default=0)
    return found.get(expression, 0)


def check_loops(forces: Sequence[Force], signals: Sequence[Signal], problems: Problems) -> None:
    """Report forces and signals that depend on themselves."""
    both: tuple[Force | Signal, ...] = (*forces, *signals)
    elements = {element.name: element for element in both}
    for circle in in_order(_uses(forces, signals))[1]:
        first, *others = (elements[name] for name in (*circle, circle[0]))
        chain = ", which reads ".join(f"{_kind(element)} '{element.name}' ({element.span.seen_from(first.span)})" for element in others)
        label = f"{_kind(first)} '{first.name}'"
        remedy = (
            f"a state breaks it: one whose rate reads '{first.name}', and which '{circle[-1]}' reads instead of '{first.name}'; "
            f"so does a controller that samples '{first.name}'"
        )
        problems.add(first.span, label, f"an algebraic loop: it reads {chain}", remedy)


def _kind(element: Force | Signal) -> str:
    return "signal" if isinstance(element, Signal) else "force"


def _uses(forces: Iterable[Force], signals: Iterable[Signal]) -> dict[str, list[str]]:
    """The forces and signals that each of them depends on, in the file's order."""
    expressions = {force.name: force.expressions for force in forces} | {signal.name: (signal.value,) for signal in signals}
    measured = {force.name: force.measured for force in forces}
    return {
        name: [
            element for expression in of
            for element, quantity in (*quantities_read(expression), *((sample, "") for sample in samples_read(expression)))
            if element in expressions and quantity not in measured.get(element, ())
        ]
        for name, of in expressions.items()
    }  # fmt: skip
