"""Parameters and inputs that a model file does not name.

Tunable constants become parameters named after their places, which a run may change without compiling. External wrenches on bodies and
markers are inputs, and so is terrain from a host under wheels.
"""

from collections.abc import Iterator, MutableMapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

from cutjoint.elements.forces.body_load import BodyLoad
from cutjoint.elements.forces.on_road import TERRAIN, OnRoad
from cutjoint.model.document.source import Path
from cutjoint.model.errors import ModelError, Problem, nearest
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import parameter_symbol
from cutjoint.model.expressions.units import Dimension
from cutjoint.model.records import Binding, Body, Marker, Model, Parameter, Scalar, Span, Vector

_AXES = "xyz"  #: the names of components of points and directions
#: The units of the inputs of an external wrench, by the ends of their names.
WRENCH_UNITS = {**dict.fromkeys(("fx", "fy", "fz"), "N"), **dict.fromkeys(("tx", "ty", "tz"), "N*m")}


@dataclass
class TunableNumbers:
    """Opens the numbers whose names match one of the ``patterns``, with * for any text, and notes the names of all.
    ``instances`` are patterns of instances that are tunable as a whole: of numbers that stand there, not of defaults."""

    patterns: list[str] = field(default_factory=list)
    instances: list[str] = field(default_factory=list)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)

    def takes(self, name: str, *, is_default: bool = False) -> bool:
        """Record a number's name and return whether a pattern makes it tunable."""
        self.names.add(name)
        return any(fnmatchcase(name, pattern) for pattern in (*self.patterns, *(() if is_default else self.instances)))

    def tunable(
        self, name: str, term: Term, expected: Dimension | None, span: Span, values: MutableMapping[Scalar, float], *,
        is_default: bool = False,
    ) -> Term:  # fmt: skip
        """The parameter in place of a number, in ``values`` too; the number itself where it is not tunable."""
        if term.number is None or not self.takes(name, is_default=is_default):
            return term
        known = self.parameters.get(name)
        if known is None or (known.span, known.value) != (span, term.number):
            known = self._add(name if known is None else f"{name}_{len(self.parameters)}", term.number, expected or term.dimension, span)
            values[known.symbol] = known.value
        return Term(known.symbol, term.dimension or expected)

    def _add(self, name: str, value: float, dimension: Dimension | None, span: Span) -> Parameter:
        unit = "" if dimension is None else str(dimension)
        added = Parameter(name=name, symbol=parameter_symbol(name), value=value, unit=unit, binding=Binding.PARAM, span=span)
        self.parameters[name] = added
        return added

    def problems(self, requested: Sequence[str], span: Span) -> list[Problem]:
        """The patterns that match no number."""
        idle = [pattern for pattern in requested if not any(fnmatchcase(name, pattern) for name in self.names)]
        words = "no constant that could be tunable is called"
        return [Problem(span, "model", f"{words} '{pattern}'", nearest(pattern, self.names, "such as")) for pattern in idle]


def number_name(element: str, keys: Path, *, in_triple: bool) -> str:
    """The name of a number of an element, such as ``arm.mass`` or ``hub.at.x``."""
    *fields, last = keys or ("",)
    component = _AXES[last] if in_triple and isinstance(last, int) and last < len(_AXES) else str(last)
    return ".".join(filter(None, (element, *map(str, fields), component)))


# Forces and ground from outside


def with_inputs(model: Model, *, external_wrenches: Sequence[str] = (), terrain: Sequence[str] = ()) -> Model:
    """The model `with_external_wrenches` and `with_terrain`."""
    return with_terrain(with_external_wrenches(model, external_wrenches), terrain)


def with_terrain(model: Model, patterns: Sequence[str]) -> Model:
    """The model whose wheels that match a pattern (* for any text) have inputs for terrain in addition to the road's.
    Each has the inputs ``NAME.terrain_height`` (m), ``NAME.terrain_slope`` and ``NAME.terrain_bank``, 0 by default, which are added, and
    ``NAME.friction``, a factor of value 1. Raises ModelError: a pattern matches no wheel."""
    wheels = [force.name for force in model.forces if isinstance(force, OnRoad)]
    if idle := [pattern for pattern in patterns if not any(fnmatchcase(name, pattern) for name in wheels)]:
        words = [(f"terrain '{pattern}'", nearest(pattern, wheels, "such as")) for pattern in idle]
        message = "the model has no force of kind 'tyre' or 'wheel' of this name"
        raise ModelError([Problem(span=model.span, element=element, message=message, hint=hint) for element, hint in words])
    parameters, forces = [*model.parameters], []
    for force in model.forces:
        if isinstance(force, OnRoad) and any(fnmatchcase(force.name, pattern) for pattern in patterns):
            terrain = {end: _input(f"{force.name}.{end}", unit, force.span, float(end == "friction")) for end, unit in TERRAIN.items()}
            parameters += terrain.values()
            force = force.with_added_terrain({end: height.symbol for end, height in terrain.items()})
        forces.append(force)
    return replace(model, parameters=tuple(parameters), forces=tuple(forces))


def _input(name: str, unit: str, span: Span, value: float = 0.0) -> Parameter:
    return Parameter(name=name, symbol=parameter_symbol(name), value=value, unit=unit, binding=Binding.INPUT, span=span)


def with_external_wrenches(model: Model, names: Sequence[str]) -> Model:
    """The model with a force (N) and a torque (N m), in global axes, on each named body or marker.
    On a body they act at its centre of mass. They are the inputs ``NAME.wrench.fx`` to ``NAME.wrench.tz``, 0 by default. Raises
    ModelError: the model has no such body or marker, or a name is given twice."""
    places: dict[str, Body | Marker] = {**{x.name: x for x in model.bodies}, **{x.name: x for x in model.markers}}
    if problems := list(_faults(model, names, places)):
        raise ModelError(problems)
    parameters, forces = [*model.parameters], [*model.forces]
    for name in names:
        place = places[name]
        added = [_input(f"{name}.wrench.{end}", unit, place.span) for end, unit in WRENCH_UNITS.items()]
        parameters += added
        x, y, z, *torque = (parameter.symbol for parameter in added)
        forces += [_load(f"{name}.wrench", place, (x, y, z)), _load(f"{name}.torque", place, tuple(torque), is_torque=True)]
    return replace(model, parameters=tuple(parameters), forces=tuple(forces))


def _faults(model: Model, names: Sequence[str], places: dict[str, Body | Marker]) -> Iterator[Problem]:
    used_names = {force.name for force in model.forces}
    for number, name in enumerate(names):
        fault = ""
        if name not in places:
            fault, hint = "the model has no body or marker of this name", nearest(name, places)
        elif name in names[:number]:
            fault, hint = "is given twice", "write it once"
        elif used_names & {f"{name}.wrench", f"{name}.torque"}:
            fault, hint = "the model has a force of its own that is called so", "give that another name"
        if fault:
            yield Problem(span=model.span, element=f"external wrench on '{name}'", message=fault, hint=hint)


def _load(name: str, place: Body | Marker, components: Vector, *, is_torque: bool = False) -> BodyLoad:
    at, body = (place.point, place.body) if isinstance(place, Marker) else (place.centre_of_mass, place.name)
    return BodyLoad(
        name=name, body=body, point=None if is_torque else at, axes="global", components=components, moving_only=False, active=True,
        span=place.span,
    )  # fmt: skip
