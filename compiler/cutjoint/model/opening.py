"""Numbers of a model file that are opened: each becomes a parameter of the name of its place, which a run may change without a compiler."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from cutjoint.model.errors import Problem, nearest
from cutjoint.model.expressions import parameter_symbol
from cutjoint.model.operations import Term
from cutjoint.model.records import Binding, Parameter, Scalar, Span
from cutjoint.model.source import Path
from cutjoint.model.units import Dimension

#: The names of components of points and directions.
_AXES = "xyz"


@dataclass
class Opening:
    """Opens the numbers whose names match one of the ``patterns``, with * for any text, and notes the names of all."""

    patterns: list[str] = field(default_factory=list)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)

    def takes(self, name: str) -> bool:
        """Note a number's name and return whether a pattern opens it."""
        self.names.add(name)
        return any(fnmatchcase(name, pattern) for pattern in self.patterns)

    def opened(self, name: str, term: Term, expected: Dimension | None, span: Span, values: MutableMapping[Scalar, float]) -> Term:
        """The parameter in place of a number, in ``values`` too; the number itself where it is not opened."""
        if term.number is None or not self.takes(name):
            return term
        known = self.parameters.get(name)
        if known is None or (known.span, known.value) != (span, term.number):
            known = self._add(name if known is None else f"{name}_{len(self.parameters)}", term.number, term.dimension or expected, span)
            values[known.symbol] = known.value
        return Term(known.symbol, term.dimension or expected)

    def _add(self, name: str, value: float, dimension: Dimension | None, span: Span) -> Parameter:
        unit = "" if dimension is None else str(dimension)
        added = Parameter(name=name, symbol=parameter_symbol(name), value=value, unit=unit, binding=Binding.PARAM, span=span)
        self.parameters[name] = added
        return added

    def problems(self, asked: Sequence[str], span: Span) -> list[Problem]:
        """Patterns that no number has."""
        idle = [pattern for pattern in asked if not any(fnmatchcase(name, pattern) for name in self.names)]
        return [
            Problem(
                span=span, element="model", message=f"no number that could be opened is called '{pattern}'",
                hint=nearest(pattern, self.names, "such as"),
            )
            for pattern in idle
        ]  # fmt: skip


def number_name(element: str, keys: Path, *, in_triple: bool) -> str:
    """The name of a number of an element, such as ``arm.mass`` or ``hub.at.x``."""
    *fields, last = keys or ("",)
    component = _AXES[last] if in_triple and isinstance(last, int) and last < len(_AXES) else str(last)
    return ".".join(filter(None, (element, *map(str, fields), component)))
