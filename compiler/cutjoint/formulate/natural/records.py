"""The equations of the Lagrangian formulations."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.elements.joint import rate_name
from cutjoint.formulate.natural.constraints import Constraint
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import NodeKind
from cutjoint.formulate.records import SystemEquations
from cutjoint.methods import METHODS


@dataclass(frozen=True, kw_only=True, repr=False)
class LagrangianEquations(SystemEquations):
    """An index-3 formulation in natural coordinates; ``method`` is "augmented" or "classical".

    Inputs by symbol: ``node:name``, ``node_rate:name``, ``node_acceleration:name``, ``lambda:constraint``, ``w:constraint``, ``penalty``,
    ``weights`` (damping, stiffness, constraint).  The results ``tangent:row,column`` are the tangent's candidates, of a symmetric
    tangent the lower triangle; their slots follow from its pattern.  ``start`` are the recursive equations that find where a run begins.
    """

    layout: Layout
    constraints: tuple[Constraint, ...]

    @property
    def unknowns(self) -> int:
        """The natural coordinates."""
        return len(self.coordinate_names)

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """A name for each element of q."""
        return tuple(
            n.name if n.kind is NodeKind.ANGLE else f"{n.name}.{axis}" for n in self.layout.coordinates for axis in "xyz"[: n.size]
        )

    @property
    def speed_names(self) -> tuple[str, ...]:
        """A name for each element of v, the rate of that of q."""
        named = (name.rpartition(".") for name in self.coordinate_names)
        return tuple(f"{of}.{rate_name(coordinate)}" for of, _, coordinate in named)

    @property
    def equation_names(self) -> tuple[str, ...]:
        """A name for each constraint equation."""
        return tuple(f"{c.element}.{name}" for c in self.constraints for name in c.names)

    @property
    def coordinate_elements(self) -> tuple[str, ...]:
        """The joint or body that each element of q has its name from, or the body that carries it where that is another element's."""
        known = self.topology.model.constraint_spans
        return tuple(
            n.title.element if n.title.element in known else n.body for n in self.layout.coordinates for _ in range(n.size)
        )

    @property
    def speed_elements(self) -> tuple[str, ...]:
        """The element of each entry of v."""
        return self.coordinate_elements

    @property
    def equation_elements(self) -> tuple[str, ...]:
        """The body, joint or gear of each equation."""
        return tuple(c.element for c in self.constraints for _ in c.names)

    @property
    def row_names(self) -> tuple[str, ...]:
        """A name for each row of the tangent."""
        return self.coordinate_names + (self.equation_names if METHODS[self.method].saddle_point else ())
