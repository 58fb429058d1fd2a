"""The catalogue of methods, integrators, closures, linear solvers and number types: what each one needs and can do.

Choices, checks and messages follow from these records; no other module compares the name of one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, TypeVar

#: The method of a scene that lets `auto` choose model, method and step.
AUTO = "auto"


class Formulation(StrEnum):
    """The equations of a method, by the folder of ``formulate`` that derives them."""

    RECURSIVE = "recursive"  #: accelerations in relative coordinates, by elimination along the tree
    IMPLICIT = "implicit"  #: the balance in relative coordinates with its exact tangent
    NATURAL = "natural"  #: the balance in natural coordinates with its tangent


class Events(StrEnum):
    """The treatment of changes of formula in forces, guides and drives by steps."""

    LOCATED = "located"  #: they end there
    CROSSED = "crossed"  #: they go over it


class Implementation(StrEnum):
    """The way from a model to a simulator."""

    GENERATED = "generated"  #: code made for the model
    INTERPRETED = "interpreted"  #: the same program as data for a simulator that is compiled once
    GENERIC = "generic"  #: the generic twin, which interprets the model at run time

    @property
    def is_twin(self) -> bool:
        """Return whether the equations are written by hand, not derived by the compiler."""
        return self is Implementation.GENERIC


@dataclass(frozen=True, kw_only=True)
class Twin:
    """The generic twin of a method; ``solver`` takes the place of the emitted factorisation, None for methods without a linear solver."""

    solver: str | None = None


@dataclass(frozen=True, kw_only=True)
class Method:
    """A formulation with its way to solve a step.

    ``closures`` are the ways to hold cut joints that a scene can choose from; others hold them in one way, and start with PLAIN_CLOSURE.
    ``symmetric`` is whether the tangent of a step is, ``saddle_point`` whether multipliers are unknowns beside the coordinates, so that
    pivots must be chosen and dependent equations left out.  ``events`` is whether steps can end at events.
    ``instead`` are methods that may go on where this one fails.
    ``default_updates`` is the number of multiplier updates of a method whose penalty and number of updates are those given for it alone,
    where none are given; the penalty then follows from masses and step.  ``fixed_cost`` is whether steps can have a fixed number of
    iterations, ``batch`` whether runs can be evaluated side by side, ``tangents`` whether a run can report the Jacobians of its
    accelerations, ``stands_alone`` whether it is compiled into folders that need nothing else.
    """

    name: str
    formulation: Formulation
    closures: tuple[str, ...] = ()
    symmetric: bool = False
    saddle_point: bool = False
    events: bool = False
    instead: tuple[str, ...] = ()
    default_updates: int | None = None
    twin: Twin | None = None
    fixed_cost: bool = False
    batch: bool = False
    tangents: bool = False
    stands_alone: bool = False

    @property
    def has_system(self) -> bool:
        """Return whether Newton's iteration solves a linear system in each step."""
        return self.formulation is not Formulation.RECURSIVE

    @property
    def iteration(self) -> str:
        """The generated function that each iteration of a step calls."""
        return "linearise" if self.has_system else "evaluate"

    def closure(self, wanted: str | None, implementation: Implementation = Implementation.GENERATED) -> Closure:
        """The closure of a scene, which is meant for the methods that have it; where none is wanted, the one that needs no penalty."""
        if wanted in self.closures:
            return CLOSURES[wanted]
        can_choose = wanted is None and self.closures and not implementation.is_twin
        return CLOSURES[DEFAULT_CLOSURE if can_choose else PLAIN_CLOSURE]


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """A rule of steps.

    ``methods`` are those whose equations it takes, ``closures`` those it can hold; ``twin`` is whether generic twins have it.  ``events``
    is the default of its steps, None where they cannot end at events.  An ``adaptive`` one takes steps as long as the tolerance allows.
    ``uses_solver`` is whether steps solve with the linear solver of a method that has one.  ``settings`` are those that it reads besides
    the method's, ``largest_penalty`` bounds a penalty that is not given for the method itself.  ``in_files`` is whether scenes and commands
    can ask for it, ``balances`` whether it balances work and energy beside the motion.
    """

    name: str
    methods: tuple[str, ...]
    closures: tuple[str, ...] = ("penalty",)
    twin: bool = False
    events: Events | None = Events.LOCATED
    adaptive: bool = False
    uses_solver: bool = False
    settings: tuple[str, ...] = ()
    largest_penalty: float | None = None
    fixed_cost: bool = False
    batch: bool = False
    tangents: bool = False
    in_files: bool = True
    balances: bool = True

    def takes(self, method: Method, implementation: Implementation) -> bool:
        """Return whether the integrator runs an implementation of a method."""
        return method.name in self.methods and (self.twin or not implementation.is_twin)


@dataclass(frozen=True, kw_only=True)
class Closure:
    """A way to hold cut joints.

    Its penalty follows from effective masses.  With ``penalty_of_each_cut`` each cut joint has its own, up to a bound if one is given, and
    needs no other stabilisation; else all have the same, that of the scene if it gives one.
    """

    name: str
    penalty_of_each_cut: bool = False
    twin: bool = False
    fixed_cost: bool = False


@dataclass(frozen=True, kw_only=True)
class Solver:
    """A linear solver; ``symmetric`` ones need a symmetric matrix, ``comparison`` ones are of SuiteSparse, some of them under the GPL."""

    name: str
    symmetric: bool = False
    comparison: bool = False

    def suits(self, method: Method) -> bool:
        """Return whether the solver solves the systems of a method."""
        return method.has_system and (method.symmetric or not self.symmetric)


@dataclass(frozen=True, kw_only=True)
class Precision:
    """A number type of generated code.

    Of a ``packed`` one several fit a register; ``libraries`` is whether solvers of libraries have it, ``twin`` whether generic twins do;
    ``flags`` are added to those of the compiler.
    """

    name: str
    packed: bool = False
    libraries: bool = False
    twin: bool = False
    flags: tuple[str, ...] = ()


class _Named(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Named)


def _catalogue(*records: R) -> Mapping[str, R]:
    return {record.name: record for record in records}


#: The methods in the order of the documentation.
METHODS: Mapping[str, Method] = _catalogue(
    Method(
        name="recursive", formulation=Formulation.RECURSIVE, closures=("penalty", "proximal"), events=True, instead=("recursive-newton",),
        twin=Twin(), fixed_cost=True, batch=True, tangents=True, stands_alone=True,
    ),
    Method(
        name="augmented", formulation=Formulation.NATURAL, symmetric=True, instead=("recursive-newton",), default_updates=20,
        twin=Twin(solver="eigen-ldlt"), stands_alone=True,
    ),
    Method(
        name="classical", formulation=Formulation.NATURAL, saddle_point=True, instead=("augmented", "recursive-newton"),
        twin=Twin(solver="klu"),
    ),
    Method(
        name="recursive-newton", formulation=Formulation.IMPLICIT, events=True, instead=("recursive", "augmented"), default_updates=20,
        stands_alone=True,
    ),
)  # fmt: skip

#: The penalty that explicit integrators have at most: they correct multipliers until nothing of it is left, and a larger one would leave
#: fewer digits of the accelerations.
_EXPLICIT_PENALTY = 1e6

#: The trapezoidal rule; explicit Runge-Kutta methods with steps of equal length and with steps as long as the tolerance allows; implicit
#: ones of order 4, adaptive and with equal steps, and one of order 2 that damps what is fast; accurate solutions to measure them by:
#: extrapolation in relative coordinates (recursive) and a Runge-Kutta method of order 8 in natural coordinates (classical).
INTEGRATORS: Mapping[str, Integrator] = _catalogue(
    Integrator(
        name="trapezoidal", methods=tuple(METHODS), closures=("penalty", "proximal"), twin=True, events=Events.CROSSED, uses_solver=True,
        fixed_cost=True, batch=True, tangents=True,
    ),
    Integrator(
        name="rk4", methods=("recursive",), closures=("penalty", "proximal"), settings=("absolute_tolerance",),
        largest_penalty=_EXPLICIT_PENALTY,
    ),
    Integrator(
        name="dormand-prince", methods=("recursive",), closures=("penalty", "proximal"), adaptive=True, settings=("absolute_tolerance",),
        largest_penalty=_EXPLICIT_PENALTY,
    ),
    Integrator(
        name="sdirk4", methods=("recursive-newton",), adaptive=True, uses_solver=True, settings=("absolute_tolerance",)
    ),
    Integrator(name="sdirk4-fixed", methods=("recursive-newton",), uses_solver=True, settings=("absolute_tolerance",)),
    Integrator(
        name="generalised-alpha", methods=("recursive-newton",), events=Events.CROSSED, uses_solver=True, settings=("spectral_radius",)
    ),
    Integrator(
        name="reference", methods=("recursive", "classical"), closures=("penalty", "proximal"), events=None, in_files=False, balances=False
    ),
)  # fmt: skip

#: The ways to hold cut joints.
CLOSURES: Mapping[str, Closure] = _catalogue(
    Closure(name="penalty", twin=True, fixed_cost=True),
    Closure(name="proximal", penalty_of_each_cut=True, fixed_cost=True),
)

#: The emitted factorisation, and libraries.
SOLVERS: Mapping[str, Solver] = _catalogue(
    Solver(name="emitted"),
    Solver(name="eigen-ldlt", symmetric=True),
    Solver(name="eigen-lu"),
    Solver(name="cholmod", symmetric=True, comparison=True),
    Solver(name="klu", comparison=True),
    Solver(name="umfpack", comparison=True),
)

#: Numbers of 24, 53, 64 (80-bit registers, x86) and 113 bits.  Above -O1, GCC takes minutes for a long function on the registers' stack.
PRECISIONS: Mapping[str, Precision] = _catalogue(
    Precision(name="single", packed=True),
    Precision(name="double", packed=True, libraries=True, twin=True),
    Precision(name="extended", flags=("-O1",)),
    Precision(name="quad", flags=("-O1",)),
)

DEFAULT_METHOD = "recursive"
#: The integrator of equal steps.
DEFAULT_INTEGRATOR = "trapezoidal"
DEFAULT_CLOSURE = "proximal"
#: The closure of methods without a choice, of generic twins, and of batches whose scene names none.
PLAIN_CLOSURE = "penalty"
DEFAULT_SOLVER = "emitted"
DEFAULT_PRECISION = "double"


#: The method whose tangent is the linearisation of small motions.
LINEARISED = "recursive-newton"

#: The method whose equations start every run, so that its settings hold the cut joints there.
START = "recursive"


def names_of(catalogue: Mapping[str, R], condition: Callable[[R], bool]) -> tuple[str, ...]:
    """The names of the records of a catalogue that meet a condition."""
    return tuple(name for name, record in catalogue.items() if condition(record))


def join_or(names: Iterable[str]) -> str:
    """Names for a sentence: "a", "a or b", "a, b or c"."""
    return _listed(names, "or")


def join_and(names: Iterable[str]) -> str:
    """Names for a sentence: "a", "a and b", "a, b and c"."""
    return _listed(names, "and")


def _listed(names: Iterable[str], conjunction: str) -> str:
    *others, last = names
    return f"{', '.join(others)} {conjunction} {last}" if others else last
