"""The equations of the implicit formulation."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.formulate.records import Chart, SystemEquations


@dataclass(frozen=True, kw_only=True, repr=False)
class ImplicitEquations(SystemEquations):
    """The index-3 formulation in relative coordinates: those of ``start``, with its charts and cut joints.

    Inputs by symbol: ``q:joint``, ``v:joint``, ``vdot:joint``, ``turn:joint`` (of a ball), ``lambda:joint``, ``w:joint``, ``penalty``,
    ``weights``.
    """

    @property
    def charts(self) -> tuple[Chart, ...]:
        """The charts of the start."""
        return self.start.charts

    @property
    def unknowns(self) -> int:
        """The speeds."""
        return self.start.speeds

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """A name for each element of q."""
        return self.start.coordinate_names

    @property
    def speed_names(self) -> tuple[str, ...]:
        """A name for each element of v."""
        return self.start.speed_names

    @property
    def equation_names(self) -> tuple[str, ...]:
        """A name for each cut-joint equation."""
        return self.start.equation_names

    @property
    def coordinate_elements(self) -> tuple[str, ...]:
        """The joint of each element of q."""
        return self.start.coordinate_elements

    @property
    def speed_elements(self) -> tuple[str, ...]:
        """The joint of each element of v."""
        return self.start.speed_elements

    @property
    def equation_elements(self) -> tuple[str, ...]:
        """The cut joint or gear of each equation."""
        return self.start.equation_elements

    @property
    def row_names(self) -> tuple[str, ...]:
        """A name for each speed."""
        return self.start.speed_names
