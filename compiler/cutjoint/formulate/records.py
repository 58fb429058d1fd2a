"""The results of a formulation: the functions of the mechanism as blocks, and the layout of their inputs and outputs.

Functions of systems that Newton's iteration solves, in whatever coordinates: runtime/include/cutjoint/lagrangian/any_system.hpp.

The function ``energy`` of all formulations has the kinetic energy T (J), and the power P (W) of all forces. Without numerical errors dT/dt
= P. Weight, applied forces, guides and drives have power; time-independent constraints have none, and the power of penalties and loop
stabilisation is a numerical error, which P excludes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from cutjoint.formulate.layout import Chart, Closure, Slot, StateLayout
from cutjoint.model.records import EmbeddedLoop, Output, Parameter, Scene, Span
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology

if TYPE_CHECKING:
    from cutjoint.sparse.plan import Plan

CLOSE = "close_"  #: the prefix of the functions that evaluate open loops, for the fit of embedded loops
POSES = "poses"  #: the function of poses (`recursive/poses.py`)
SAMPLE = "sample"  #: the function of controllers
FORCE_RESIDUAL = "residual_of_forces"  #: the function of the residual of forces at given accelerations
CHECKS = ("energy",)  #: functions that only check a run
NAMES = ("kinetic", "power")  #: the results of the function
_STATE = ("const Real* q", "const Real* v", "const Real* vdot")
_MOTION = (*_STATE, "const Real* lambda", "Real penalty")
_RESIDUALS = ("Real* force_residual", "Real* residual")
#: The arguments of each function, results last.
_ARGUMENTS: Mapping[str, tuple[str, ...]] = {
    "initial_coordinates": ("const Real* relative_q", "const Real* relative_v", "Real* q", "Real* v"),
    "dynamic_residual": (*_MOTION, *_RESIDUALS),
    "linearise": (*_MOTION, "const Weights<Real>& weights", *_RESIDUALS, "Real* tangent"),
    "constraint_residual": (*_STATE, "Real* residual", "Real* rate", "Real* curvature"),
    "apply_jacobian_transposed": ("const Real* q", "const Real* w", "Real* force"),
    "apply_jacobian": ("const Real* q", "const Real* vdot", "Real* change"),
    "report": (*_STATE, "const Real* lambda", "Real* column"),
    "energy": (*_STATE, "const Real* lambda", "Real* energy"),
}
LOAD_ARGUMENTS = ("const Real* parameters", "const Road<Real>* roads")  #: the arguments of the generated ``load``
EQUATION_ARRAYS = ("lambda", "w", "residual", "rate", "curvature", "change")  #: the arrays that have an element for each equation


@dataclass(frozen=True, kw_only=True)
class IndicatorPlace:
    """The origin of an event indicator: the element and its line in the model file.
    For a position along a road, ``road`` is its tyre and ``across`` the number of the indicator of the lateral position; otherwise ""
    and -1. If ``is_continuous``, forces are continuous there and only their derivatives jump."""

    element: str
    place: str
    road: str
    across: int
    is_continuous: bool


@dataclass(frozen=True, kw_only=True)
class DomainPlace:
    """A place where a law may be undefined: the quantity that must be in its domain, the element and its line in the model file.
    Inside the domain the margin is non-negative, or positive if ``strict``. ``remedy`` is the index among the margins of a factor: with
    friction coefficients scaled below it, all joint loads are defined."""

    function: str
    element: str
    place: str
    strict: bool
    remedy: int | None = None


@dataclass(frozen=True, kw_only=True)
class Column:
    """One reported quantity and its unit."""

    name: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class Function:
    """One generated function: named result columns over the program's inputs.
    Inputs are symbols; those that all formulations share are ``t``, ``motion`` (0 while the equilibrium is sought, else 1) and
    ``parameters``. ``arguments`` are the C++ function's, results last; :attr:`Equations.slots` says which symbol stands where."""

    name: str
    arguments: tuple[str, ...]
    results: Mapping[str, Block]

    def __repr__(self) -> str:
        return f"<Function {self.name}({', '.join(self.arguments)}): {len(self.results)} results>"


@dataclass(frozen=True, kw_only=True)
class LoopFit:
    """The fit of an embedded loop's functions when parameters are loaded.
    The ``function`` has ``slots`` of its own and ``rows`` rows; its coefficients begin at ``first``."""

    embedded_loop: EmbeddedLoop
    function: Function
    slots: Mapping[str, Slot]
    rows: int
    first: int

    @property
    def length(self) -> int:
        """The number of its coefficients, and its margin."""
        return sum(map(len, self.description()["start"])) + 1

    def description(self) -> dict[str, Any]:
        """Its tables, as core/mechanism/loop_fits.hpp reads them: coefficients of the model's own numbers, ``start``, by function."""
        f = self.embedded_loop.functions
        series = [one for found in f.series.values() for one in found]
        return {
            "rows": self.rows, "nodes": f.nodes, "is_periodic": f.is_periodic, "middle": f.range.middle, "half": f.range.half,
            "allowed": f.allowed,
            "growth": [one.growth for one in series], "start": [[row[0] for row in one.coefficients] for one in series],
        }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """An equation, of the element at ``span``, that is not enforced because others imply it in the only known pose; it is monitored."""

    name: str
    span: Span


@dataclass(frozen=True, kw_only=True)
class Equations:
    """The symbolic equations of one model in one scene, by any formulation.

    * ``parameters``: tunable ones, which the binary loads; ``roads``: tyres in the order of their road tables
    * ``columns``: outputs with units; ``state``: layout of the state; ``slots``: places of inputs and results
    * ``inputs``: parameters read at every step; ``input_values``: length of the array that ``scene_inputs`` fills, with discrete states
    * ``domains``, ``indicators``: descriptions of the results of ``domains`` and ``events``; ``left_out``: equations that guards monitor
    * ``load_arguments``: those of the generated ``load``; ``fits``: loop embeddings that depend on parameters
    """

    topology: Topology
    scene: Scene
    builder: Builder
    parameters: tuple[Parameter, ...]
    roads: tuple[str, ...]
    outputs: tuple[Output, ...]
    columns: tuple[Column, ...]
    functions: tuple[Function, ...]
    state: StateLayout
    slots: Mapping[str, Slot]
    load_arguments: tuple[str, ...]
    indicators: tuple[IndicatorPlace, ...] = ()
    domains: tuple[DomainPlace, ...] = ()
    inputs: tuple[Parameter, ...] = ()
    input_values: int = 0
    left_out: tuple[LeftOut, ...] = ()
    fits: tuple[LoopFit, ...] = ()

    def __repr__(self) -> str:
        sizes = f"{self.unknowns} unknowns, {len(self.equation_names)} equations of loops, {len(self.columns)} columns"
        return f"<{type(self).__name__} of '{self.topology.model.name}' in scene '{self.scene.name}': {sizes}>"

    def function(self, name: str) -> Function:
        """A function by name."""
        return next(f for f in self.functions if f.name == name)

    @property
    def discrete_states(self) -> int:
        """The number of discrete states of controllers."""
        return len(self.topology.model.discrete_states)

    @property
    def unknowns(self) -> int:
        """The number of unknowns of a step, multipliers not counted."""
        return len(self.state.v)

    @property
    def charts(self) -> tuple[Chart, ...]:
        """The charts of the joints; none of natural coordinates."""
        return self.state.charts

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """A name for each element of q."""
        return tuple(entry.name for entry in self.state.q)

    @property
    def speed_names(self) -> tuple[str, ...]:
        """A name for each element of v, the first-order states last."""
        return tuple(entry.name for entry in self.state.v)

    @property
    def angular(self) -> tuple[bool, ...]:
        """Whether each speed, first-order states left out, is one of an angle or a direction, not of a length."""
        joints = {joint.name: joint.element.units for joint in self.topology.model.joints}
        return tuple(joints[chart.joint][name] == "rad/s" for chart in self.charts for name in chart.speed_names)

    @property
    def equation_names(self) -> tuple[str, ...]:
        """A name for each constraint equation."""
        return tuple(entry.name for entry in self.state.equations)

    @property
    def mechanism(self) -> RecursiveEquations:
        """The recursive equations that find where a run begins."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True, repr=False)
class RecursiveEquations(Equations):
    """The recursive formulation: joint coordinates by charts, cut joints and gears by closures.
    Inputs by symbol: ``q:joint``, ``v:joint``, ``vdot:joint``, ``lambda:joint`` (multipliers of a cut joint), ``violation:joint``,
    ``numerics`` (penalty, damping ratio, frequency). Results: ``vdot:joint``, ``correction:joint``, ``residual:joint``, ``rate:joint``,
    ``dz:joint``, ``column:name``, ``value:number``. Vectors are resolved in the axes of the body ``axes``."""

    axes: str

    @property
    def closures(self) -> tuple[Closure, ...]:
        """The equations of each cut joint and gear."""
        return self.state.closures

    @property
    def coordinates(self) -> int:
        """Length of q."""
        return len(self.state.q)

    @property
    def speeds(self) -> int:
        """The number of the joints' speeds."""
        return self.state.speeds

    @property
    def mechanism(self) -> RecursiveEquations:
        """The equations themselves."""
        return self

    @property
    def starting(self) -> RecursiveEquations:
        """The equations without the functions that a start does not call."""
        return replace(self.crossing, functions=tuple(f for f in self.crossing.functions if f.name not in ("project", SAMPLE)))

    @property
    def crossing(self) -> RecursiveEquations:
        """The equations without the functions that steps over events, and their start, do not call."""
        weighs = self.topology.ends_on_massless or (self.scene.pose == "equilibrium" and self.scene.positions)
        weighs = weighs or any(f.name == POSES for f in self.functions)  # whose hosts may ask for the mass matrix
        unused = ("events",) if weighs else ("events", "energy")
        return replace(self, functions=tuple(f for f in self.functions if f.name not in unused), indicators=())


@dataclass(frozen=True, kw_only=True, repr=False)
class SystemEquations(Equations):
    """An index-3 formulation that Newton's iteration solves; see runtime/include/cutjoint/lagrangian/any_system.hpp.
    ``start`` are the recursive equations that find the initial state. The results ``tangent:row,column`` are the tangent's candidates, of a
    symmetric tangent the lower triangle; ``plan`` is its factorisation."""

    method: str
    start: RecursiveEquations
    plan: Plan | None = None

    @property
    def mechanism(self) -> RecursiveEquations:
        """The equations of the start."""
        return self.start

    @property
    def unknown_names(self) -> tuple[str, ...]:
        """A name for each unknown of a step, multipliers not counted."""
        return self.speed_names

    @property
    def row_names(self) -> tuple[str, ...]:
        """A name for each row of the tangent."""
        return self.unknown_names

    def with_tangent(self, places: Mapping[str, int]) -> Self:
        """The equations with a slot for each entry of the tangent that is not always zero."""
        slots = {name: Slot(array="tangent", offset=place, names=(name,)) for name, place in places.items()}
        return replace(self, slots={**self.slots, **slots})


def energy_results(b: Builder, kinetic: Block, power: Block) -> dict[str, Block]:
    """The results of the function, (1, 1) each."""
    return {"energy:kinetic": b.label(kinetic, "kinetic_energy"), "energy:power": b.label(power, "power")}


def energy_slots() -> Mapping[str, Slot]:
    """The places of the results."""
    return {f"energy:{name}": Slot(array="energy", offset=i, names=(name,)) for i, name in enumerate(NAMES)}


def system_functions(
    *, initial_coordinates: Mapping[str, Block], dynamic_residual: Mapping[str, Block], tangent: Mapping[str, Block],
    constraint_residual: Mapping[str, Block], apply_jacobian_transposed: Mapping[str, Block], apply_jacobian: Mapping[str, Block],
    report: Mapping[str, Block], energy: Mapping[str, Block],
) -> tuple[Function, ...]:  # fmt: skip
    """The functions with their results; ``linearise`` has those of the dynamic residual and of the tangent."""
    results = {
        "initial_coordinates": initial_coordinates, "dynamic_residual": dynamic_residual, "linearise": {**dynamic_residual, **tangent},
        "constraint_residual": constraint_residual, "apply_jacobian_transposed": apply_jacobian_transposed,
        "apply_jacobian": apply_jacobian, "report": report, "energy": energy,
    }  # fmt: skip
    return tuple(Function(name=name, arguments=arguments, results=results[name]) for name, arguments in _ARGUMENTS.items())
