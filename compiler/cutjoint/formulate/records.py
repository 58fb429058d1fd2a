"""What a formulation hands on: the functions of the mechanism as blocks, and the layout of their inputs and outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.model.records import Output, Parameter, Scene
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class Chart:
    """How one joint's coordinates follow its speeds.

    ``scalars`` coordinates start at ``q``, their rates at ``v``; a ball adds a quaternion (scalar first) after them whose
    angular velocity, in the inner body's axes, follows the rates.
    """

    joint: str
    q: int
    v: int
    scalars: int
    ball: bool
    coordinate_names: tuple[str, ...]
    speed_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Closure:
    """The equations of one cut joint: rows ``first`` to ``first + len(names)`` of the residual."""

    joint: str
    first: int
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One reported quantity and its unit."""

    name: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class Function:
    """One generated function: named result columns over the program's inputs.

    Inputs by symbol name: ``q:joint``, ``v:joint``, ``vdot:joint``, ``lambda:joint`` (a cut joint's multipliers), ``t``, ``motion`` (0
    where the mechanism is held at rest, else 1), ``parameters``, ``numerics`` (penalty, damping ratio, frequency).
    Results: ``vdot:joint``, ``correction:joint``, ``residual:joint``, ``rate:joint``, ``column:name``.
    """

    name: str
    results: Mapping[str, Block]


@dataclass(frozen=True, kw_only=True)
class Equations:
    """The symbolic mechanics of one model in one scene.

    ``parameters`` are those that stay open until the binary loads them, ``roads`` the tyres in the order of their road tables,
    ``columns`` the outputs with their units.
    """

    topology: Topology
    scene: Scene
    builder: Builder
    charts: tuple[Chart, ...]
    closures: tuple[Closure, ...]
    parameters: tuple[Parameter, ...]
    roads: tuple[str, ...]
    outputs: tuple[Output, ...]
    columns: tuple[Column, ...]
    functions: tuple[Function, ...]

    @property
    def coordinates(self) -> int:
        """Length of q."""
        return sum(c.scalars + 4 * c.ball for c in self.charts)

    @property
    def speeds(self) -> int:
        """Length of v."""
        return sum(len(c.speed_names) for c in self.charts)

    @property
    def speed_names(self) -> tuple[str, ...]:
        """A name for each element of v."""
        return tuple(f"{c.joint}.{s}" for c in self.charts for s in c.speed_names)

    @property
    def equation_names(self) -> tuple[str, ...]:
        """A name for each cut-joint equation."""
        return tuple(f"{c.joint}.{n}" for c in self.closures for n in c.names)
