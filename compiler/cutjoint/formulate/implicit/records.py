"""What the implicit formulation hands on."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.formulate.records import SwitchPlace, SystemEquations


@dataclass(frozen=True, kw_only=True, repr=False)
class ImplicitEquations(SystemEquations):
    """The index-3 formulation in relative coordinates: those of ``start``, with its charts and cut joints.

    ``switches`` are the values of ``events``, in an order of their own.

    Inputs by symbol: ``q:joint``, ``v:joint``, ``vdot:joint``, ``turn:joint`` (of a ball), ``lambda:joint``, ``w:joint``, ``penalty``,
    ``weights``.
    """

    switches: tuple[SwitchPlace, ...]

    @property
    def unknowns(self) -> int:
        """The speeds."""
        return self.start.speeds

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """A name for each element of q."""
        return self.start.coordinate_names

    @property
    def equation_names(self) -> tuple[str, ...]:
        """A name for each cut-joint equation."""
        return self.start.equation_names

    @property
    def row_names(self) -> tuple[str, ...]:
        """A name for each speed."""
        return self.start.speed_names
