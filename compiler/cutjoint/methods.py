"""The catalogue of methods, integrators, closures, linear solvers and number types: what each one needs and can do.

Choices, checks and messages follow from these records; no other module compares the name of one.  Other packages add integrators, solvers
and number types.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, TypeVar

from cutjoint.package.extensions import BENCH, DriverExtension, ExtensionPoint, Named

#: The method of a scene that lets `auto` choose model, method and step.
AUTO = "auto"


class Formulation(StrEnum):
    """The equations of a method, by the folder of ``formulate`` that derives them."""

    RECURSIVE = "recursive"  #: accelerations in relative coordinates, by elimination along the tree
    IMPLICIT = "implicit"  #: equations of motion in relative coordinates, with their exact tangent
    NATURAL = "natural"  #: equations of motion in natural coordinates, with their tangent


class Events(StrEnum):
    """What steps do where a force, guide or drive changes its formula."""

    LOCATED = "located"  #: steps end there
    CROSSED = "crossed"  #: steps pass over it


class Implementation(StrEnum):
    """How a model becomes a simulator."""

    GENERATED = "generated"  #: code made for the model
    INTERPRETED = "interpreted"  #: the same program as data for a simulator that is compiled once
    GENERIC = "generic"  #: a generic solver that interprets the model at run time

    @property
    def is_generic(self) -> bool:
        """Return whether the equations are written by hand, not derived by the compiler."""
        return self is Implementation.GENERIC


class Loops(StrEnum):
    """How loops with one degree of freedom are closed."""

    EXACT = "exact"  #: by loop equations
    EMBEDDED = "embedded"  #: by functions of one coordinate, accurate to a tolerance


@dataclass(frozen=True, kw_only=True)
class Method:
    """A formulation with its step solver.

    Attributes:
        closures: those that a scene can choose from; other methods have one treatment of cut joints, and start with PLAIN_CLOSURE.
        symmetric: the tangent of a step is symmetric.
        saddle_point: multipliers are unknowns too, which requires pivoting and the omission of dependent equations.
        events: steps can end at events.
        alternatives: methods to try where this one fails.
        default_updates: default number of multiplier updates of a method with settings of its own.
        has_generic: a generic solver supports it.
        fixed_cost: steps can have a fixed number of iterations, explicit ones of multiplier updates in each evaluation.
        batch: runs can be evaluated in lanes.
        supports_shaky: it simulates shaky structures, whose loops fix the pose to second order only.
        functions: it supports loop embedding.
        c99: exports can be C99.
    """

    name: str
    formulation: Formulation
    closures: tuple[str, ...] = ()
    symmetric: bool = False
    saddle_point: bool = False
    events: bool = False
    alternatives: tuple[str, ...] = ()
    default_updates: int | None = None
    has_generic: bool = False
    fixed_cost: bool = False
    batch: bool = False
    supports_shaky: bool = False
    functions: bool = False
    c99: bool = False

    @property
    def has_system(self) -> bool:
        """Return whether Newton's iteration solves a linear system in each step."""
        return self.formulation is not Formulation.RECURSIVE

    @property
    def iteration(self) -> str:
        """The generated function that each iteration of a step calls."""
        return "linearise" if self.has_system else "evaluate"

    def closure(
        self, wanted: str | None, implementation: Implementation = Implementation.GENERATED, *, usual: str | None = None
    ) -> "Closure":  # fmt: skip
        """The closure that a scene names, if the method has it; otherwise the ``usual`` one, that of the integrator."""
        if wanted in self.closures:
            return CLOSURES[wanted]
        can_choose = wanted is None and self.closures and not implementation.is_generic
        return CLOSURES[(usual or DEFAULT_CLOSURE) if can_choose else PLAIN_CLOSURE]


@dataclass(frozen=True, kw_only=True)
class Steps:
    """The C++ class of an integrator's steps by one method, and its header.

    ``stages`` is the number of stage derivatives that an explicit one stores, with parts of its interpolant beyond five, ``finds_events``
    whether its steps can end at events, ``is_iterated`` whether a number of iterations can be set, ``adaptive`` whether tolerances can,
    ``by_residual`` whether sensitivities need the residual's derivatives in coupled stages, ``averages`` whether steps keep accelerations
    of their own (generalized-alpha).
    """

    header: str
    name: str
    stages: int = 0
    finds_events: bool = False
    is_iterated: bool = False
    adaptive: bool = False
    by_residual: bool = False
    averages: bool = False


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """A time integrator.

    Attributes:
        methods: those that it supports.
        order, about: for readers.
        steps: its C++ classes by method, empty for other packages.
        closures, closure: those that it supports, and the default.
        has_generic: generic solvers support it.
        events: its default, None if its steps cannot end at events.
        adaptive: it chooses steps by the tolerance.
        uses_solver: steps solve with the linear solver of a method that has one.
        settings: those that it reads besides the method's.
        largest_penalty: bound of a penalty that is not given for the method itself.
        balances_energy: it integrates work and energy too.
        c99: exports can be C99.
    """

    name: str
    methods: tuple[str, ...]
    order: str = ""
    about: str = ""
    steps: Mapping[str, Steps] = field(default_factory=dict)
    closures: tuple[str, ...] = ("penalty",)
    closure: str = "proximal"
    has_generic: bool = False
    events: Events | None = Events.LOCATED
    adaptive: bool = False
    uses_solver: bool = False
    settings: tuple[str, ...] = ()
    largest_penalty: float | None = None
    fixed_cost: bool = False
    batch: bool = False
    balances_energy: bool = True
    c99: bool = False

    def supports(self, method: Method, implementation: Implementation) -> bool:
        """Return whether the integrator supports an implementation of a method."""
        return method.name in self.methods and (self.has_generic or not implementation.is_generic)


@dataclass(frozen=True, kw_only=True)
class Closure:
    """A treatment of cut joints.

    Its penalty follows from effective masses. With ``penalty_of_each_cut`` each cut joint has its own, up to a bound if one is given, and
    needs no other stabilisation; else all share one, by default that of the scene. Each evaluation updates the multipliers ``refinements``
    times.
    """

    name: str
    penalty_of_each_cut: bool = False
    refinements: int = 0
    has_generic: bool = False
    fixed_cost: bool = False


@dataclass(frozen=True, kw_only=True)
class Solver:
    """A linear solver; ``symmetric`` ones need a symmetric matrix, ``double_only`` ones a matrix of doubles."""

    name: str
    symmetric: bool = False
    double_only: bool = False

    def suits(self, method: Method) -> bool:
        """Return whether the solver solves the systems of a method."""
        return method.has_system and (method.symmetric or not self.symmetric)


@dataclass(frozen=True, kw_only=True)
class Precision:
    """A number type of generated code.

    ``type`` is the C++ type, defined by a ``header`` of its extension if the language lacks it. Several numbers of a ``packed`` type fit
    into a register; ``flags`` are added to those of the compiler.
    """

    name: str
    type: str
    header: str = ""
    packed: bool = False
    flags: tuple[str, ...] = ()


R = TypeVar("R", bound=Named)


def _catalogue(*records: R) -> Mapping[str, R]:
    return {record.name: record for record in records}


class Catalogue(dict[str, R]):
    """The product's records by name, and those that other packages add by the entry point ``added``.

    Looking up one of these raises `MissingPackageError` if its package is not installed.
    """

    def __init__(self, *records: R, added: ExtensionPoint[DriverExtension[R]]) -> None:
        super().__init__(_catalogue(*records))
        self.added = added

    def __missing__(self, name: str) -> R:
        return self.added.load(name).record

    def names(self) -> list[str]:
        """All names, the product's first."""
        return [*self, *self.added.names()]


#: The methods in the order of the documentation.
METHODS: Mapping[str, Method] = _catalogue(
    Method(
        name="recursive", formulation=Formulation.RECURSIVE, closures=("penalty", "proximal", "solved"), events=True,
        alternatives=("recursive-newton",), has_generic=True, fixed_cost=True, batch=True, functions=True,
        c99=True,
    ),
    Method(
        name="augmented", formulation=Formulation.NATURAL, symmetric=True, alternatives=("recursive-newton",), default_updates=20,
        has_generic=True, supports_shaky=True,
    ),
    Method(
        name="classical", formulation=Formulation.NATURAL, saddle_point=True, alternatives=("augmented", "recursive-newton"),
        has_generic=True,
    ),
    Method(
        name="recursive-newton", formulation=Formulation.IMPLICIT, events=True, alternatives=("recursive", "augmented"), default_updates=20,
        functions=True, c99=True,
    ),
)  # fmt: skip

#: Largest penalty of explicit integrators: they correct multipliers until the penalty has no effect, and a larger one costs digits of the
#: accelerations.
_EXPLICIT_PENALTY = 1e6

_ALL_CLOSURES = ("penalty", "proximal", "solved")
_NEWTON = Steps(header="cutjoint/core/newton/recursive_newton.hpp", name="RecursiveNewtonSteps<Mechanism, System>", is_iterated=True)


def _explicit(name: str, table: str, *, order: str, stages: int, about: str, adaptive: bool = True, **more: Any) -> Integrator:
    """An explicit Runge-Kutta method by its table of core/runge_kutta/tables.hpp."""
    of_table = f"ExplicitSteps<Mechanism, cutjoint::runge_kutta::{table}>"
    steps = Steps(header="cutjoint/core/stepping/explicit_steps.hpp", name=of_table, stages=stages, is_iterated=not adaptive)
    return Integrator(
        name=name, methods=("recursive",), order=order, about=about, steps={"recursive": steps}, closures=_ALL_CLOSURES, closure="solved",
        adaptive=adaptive, settings=("absolute_tolerance",), largest_penalty=_EXPLICIT_PENALTY, fixed_cost=not adaptive, **more,
    )  # fmt: skip


def _radau(name: str, *, about: str, adaptive: bool) -> Integrator:
    """Radau IIA of order 5."""
    of_length = f"RadauSteps<Mechanism, System, {str(adaptive).lower()}>"
    steps = Steps(header="cutjoint/core/stepping/implicit_steps.hpp", name=of_length, by_residual=True)
    return Integrator(
        name=name, methods=("recursive-newton",), order="5", about=about, steps={"recursive-newton": steps},
        adaptive=adaptive, uses_solver=True, settings=("absolute_tolerance",),
    )  # fmt: skip


#: One row for each integrator: runs, run files, drivers, exports, help and tables of docs follow from it by `make regenerate`.
INTEGRATORS: Catalogue[Integrator] = Catalogue(
    Integrator(
        name="trapezoidal", methods=tuple(METHODS), order="2", about="work bounded by iterations; loops stabilised or projected",
        steps={
            "recursive": Steps(header="cutjoint/core/stepping/fixed_point_steps.hpp", name="FixedPointSteps<Mechanism>", is_iterated=True),
            "augmented": Steps(header="cutjoint/core/newton/augmented.hpp", name="AugmentedSteps<Mechanism, System>"),
            "classical": Steps(header="cutjoint/core/newton/classical.hpp", name="ClassicalSteps<Mechanism, System>"),
            "recursive-newton": _NEWTON,
        },
        closures=_ALL_CLOSURES, has_generic=True, events=Events.CROSSED, uses_solver=True, fixed_cost=True, batch=True, c99=True,
    ),
    _explicit("rk4", "ClassicalTable", order="4", stages=5, adaptive=False, about="bounded work in a step", c99=True),
    _explicit("dormand-prince", "DormandPrinceTable", order="5(4)", stages=7, about="error: the difference of orders 5 and 4"),
    _explicit("dop853", "Dop853Table", order="8(5,3)", stages=20, about="error: the combined estimate of orders 5 and 3"),
    _radau("radau5", adaptive=True, about="L-stable; error: an embedded formula of order 3"),
    _radau("radau5-fixed", adaptive=False, about="L-stable"),
    Integrator(
        name="generalised-alpha", methods=("recursive-newton",), order="2", about="bounded work in a step; damps by `spectral_radius`",
        steps={"recursive-newton": replace(_NEWTON, name="GeneralisedAlphaSteps<Mechanism, System>", averages=True, is_iterated=False)},
        events=Events.CROSSED, uses_solver=True, settings=("spectral_radius",),
    ),
    added=ExtensionPoint(group="cutjoint.integrators", what="an integrator", packages={"reference": BENCH}),
)  # fmt: skip

#: The steps of the core by the names of methods and integrators.
STEPS: Mapping[str, Mapping[str, Steps]] = {
    method: {
        name: replace(i.steps[method], adaptive=i.adaptive, finds_events=i.events is Events.LOCATED)
        for name, i in INTEGRATORS.items() if method in i.steps
    } for method in METHODS
}  # fmt: skip

#: Integrators of earlier versions, and their replacements.
FORMER_INTEGRATORS: Mapping[str, str] = {"sdirk4": "radau5", "sdirk4-fixed": "radau5-fixed"}

#: The treatments of cut joints.
CLOSURES: Mapping[str, Closure] = _catalogue(
    Closure(name="penalty", has_generic=True, fixed_cost=True),
    Closure(name="proximal", penalty_of_each_cut=True, refinements=1, fixed_cost=True),
    Closure(name="solved", penalty_of_each_cut=True, refinements=2, fixed_cost=True),
)

#: Of the names of `Implementation`: records of `run/additions.py`.
IMPLEMENTATIONS: ExtensionPoint[Any] = ExtensionPoint(
    group="cutjoint.implementations", what="an implementation", packages={"generic": BENCH}
)  # fmt: skip

#: The emitted factorisation, and libraries.
SOLVERS: Catalogue[Solver] = Catalogue(Solver(name="emitted"), added=ExtensionPoint(
    group="cutjoint.solvers", what="a linear solver",
    packages=dict.fromkeys(("eigen-ldlt", "eigen-lu", "cholmod", "klu", "umfpack"), BENCH),
))  # fmt: skip

PRECISIONS: Catalogue[Precision] = Catalogue(
    Precision(name="double", type="double", packed=True),
    added=ExtensionPoint(group="cutjoint.precisions", what="a number type", packages=dict.fromkeys(("single", "extended", "quad"), BENCH)),
)

DEFAULT_METHOD = "recursive"
#: The integrator of equal steps.
DEFAULT_INTEGRATOR = "trapezoidal"
DEFAULT_CLOSURE = "solved"
#: The closure of methods without a choice, of generic solvers, and of batches whose scene names none.
PLAIN_CLOSURE = "penalty"
DEFAULT_SOLVER = "emitted"
DEFAULT_PRECISION = "double"


#: The method whose tangent is the linearisation of small motions.
LINEARISED = "recursive-newton"

#: The method whose equations start every run, so that its settings apply to the cut joints there.
START = "recursive"


def find_additions(solver: str | None) -> tuple[str, ...]:
    """The requested solver, if another package adds it: such a simulator is compiled on demand."""
    return () if solver is None or solver in SOLVERS else (solver,)


def names_of(catalogue: Mapping[str, R], condition: Callable[[R], bool]) -> tuple[str, ...]:
    """The names of the records of a catalogue that meet a condition."""
    return tuple(name for name, record in catalogue.items() if condition(record))


def linearised_methods() -> tuple[str, ...]:
    """The methods whose C exports can have derivatives: those with relative coordinates."""
    return names_of(METHODS, lambda m: m.formulation is not Formulation.NATURAL)


def describe_steps(condition: Callable[[Steps], bool]) -> str:
    """The methods and integrators whose steps meet a condition, for a sentence."""
    found = {method: names_of(steps, condition) for method, steps in STEPS.items()}
    return ", or ".join(f"method {method} with {join_or(names)}" for method, names in found.items() if names)


def join_or(names: Iterable[str]) -> str:
    """Names for a sentence: "a", "a or b", "a, b or c"."""
    return _listed(names, "or")


def join_and(names: Iterable[str]) -> str:
    """Names for a sentence: "a", "a and b", "a, b and c"."""
    return _listed(names, "and")


def _listed(names: Iterable[str], conjunction: str) -> str:
    *others, last = names
    return f"{', '.join(others)} {conjunction} {last}" if others else last
