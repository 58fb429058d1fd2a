"""Forces of a scene, their guards, and their laws as blocks: shared by all formulations."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import sympy

from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import Equations, Function, LeftOut
from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import EmbeddedLoop, Force, Guard, Model, Scalar, Scene
from cutjoint.program.blocks import BindingTime, Block, Builder


def is_active(force: Force, scene: Scene) -> bool:
    """Return whether the scene has the force switched on."""
    return scene.switches.get(force.name, force.active)


def guards_of(model: Model, scene: Scene) -> tuple[Guard | EmbeddedLoop, ...]:
    """The guards of active forces and of embedded loops, whose functions are valid on a range only."""
    ranges = (one for one in model.embedded_loops if not one.functions.is_periodic or one.drive or one.functions.open)
    return *forces_guarded(model, scene), *ranges


def guards_in(equations: Equations) -> tuple[Guard | EmbeddedLoop | LeftOut, ...]:
    """All guards of equations: of forces, of embedded loops, and of equations that are not enforced."""
    return *guards_of(equations.topology.model, equations.scene), *equations.left_out


def forces_guarded(model: Model, scene: Scene) -> tuple[Guard, ...]:
    """The guards of forces that the scene has switched on."""
    return tuple(guard for guard in model.guards if is_active(guard.force, scene))


def smallest_margin(laws: "Laws", guard: Guard, values: Mapping[str, Block]) -> Block:
    """The smallest margin of a guard; ``values`` are those of its law's variables."""
    b, margins = laws.b, (laws.scalar(margin, values) for margin in guard.margins)
    return reduce(lambda one, other: b.call("where", b.call("lt", one, other), one, other), margins)


def guard_function(margins: Mapping[str, Block]) -> tuple[Function, ...]:
    """The function ``guard``: q, v -> the smallest margin of each guarded force and embedded loop, by name; none without guards."""
    arguments = ("const Real* q", "const Real* v", "Real* margin")
    results = {f"margin:{name}": margin for name, margin in margins.items()}
    return (Function(name="guard", arguments=arguments, results=results),) if margins else ()


def margin_slots(model: Model, scene: Scene, left_out: Iterable[LeftOut] = ()) -> dict[str, Slot]:
    """The slots of the guards' margins."""
    names = [guard.name for guard in (*guards_of(model, scene), *left_out)]
    return {f"margin:{name}": Slot(array="margin", offset=i, names=("margin",)) for i, name in enumerate(names)}


def reported_variables(force: Force, values: Mapping[str, Block]) -> dict[str, Block]:
    """The variables of a law as reported quantities; a coordinate is reported by its joint."""
    return {} if force.joint_of else dict(values)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A quantity and its rate."""

    x: Block
    v: Block


@dataclass(frozen=True, kw_only=True)
class Lazy:
    """A quantity and its rate, as blocks that are made on first use."""

    place: Callable[[], Block]
    rate: Callable[[], Block]

    @property
    def x(self) -> Block:
        """The quantity."""
        return self.place()

    @property
    def v(self) -> Block:
        """Its rate."""
        return self.rate()


@dataclass(frozen=True, kw_only=True)
class LazyRotation(Lazy):
    """Small rotations, with their Jacobian (tr(S) 1 - S)/2 by the relative angular velocity, and the rows of S."""

    jacobian: Callable[[], Block]
    rows: Callable[[], Sequence[Sequence[Block]]]

    @property
    def by_rotation(self) -> Block:
        """The Jacobian."""
        return self.jacobian()

    @property
    def axes(self) -> Sequence[Sequence[Block]]:
        """The rows of S."""
        return self.rows()


@dataclass(frozen=True, kw_only=True)
class Laws:
    """The laws of a force as blocks of their variables: the part of `elements.interaction.Mechanics` that all methods share."""

    b: Builder
    translator: Translator
    road: frozenset[str] = frozenset()

    def scalar(self, expression: Scalar, values: Mapping[str, Block]) -> Block:
        return self.translator.with_values({variable(name): value for name, value in values.items()}).scalar(expression)

    def law(self, law: Scalar, values: Mapping[str, Block], position: str) -> dict[str, Block]:
        """A law's value and its partial derivatives by position and rate."""
        derivatives = {"stiffness": sympy.diff(law, variable(position)), "damping": sympy.diff(law, variable("rate"))}
        return {name: self.scalar(expression, values) for name, expression in {"force": law, **derivatives}.items()}

    def in_global(self, vector: Block) -> Block:
        """The components of a vector in global axes, which are those of most methods."""
        return vector

    def from_global(self, components: Block) -> Block:
        return components

    def in_motion(self, value: Block) -> Block:
        return self.b.scale(self.b.symbol("motion", 1, BindingTime.STEP), value)
