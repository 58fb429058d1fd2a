"""Forces and torques that a host sets on bodies from outside: loads of inputs, which the model file need not name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from cutjoint.elements.forces.body_load import BodyLoad
from cutjoint.model.errors import ModelError, Problem, nearest
from cutjoint.model.expressions import parameter_symbol
from cutjoint.model.records import Binding, Body, Marker, Model, Parameter, Vector

#: The units of the inputs of a pushed body or marker, by the ends of their names.
PUSHES = {**dict.fromkeys(("fx", "fy", "fz"), "N"), **dict.fromkeys(("tx", "ty", "tz"), "N*m")}


def with_pushes(model: Model, names: Sequence[str]) -> Model:
    """The model with a force (N) at the centre of mass of each body that is named, or at a marker, and a torque (N m), in global axes.

    They are the inputs ``NAME.push.fx`` to ``NAME.push.tz``, of value 0 where nobody gives one.

    Raises:
        ModelError: the model has no such body or marker, or a name is given twice.
    """
    places: dict[str, Body | Marker] = {**{x.name: x for x in model.bodies}, **{x.name: x for x in model.markers}}
    if problems := list(_problems(model, names, places)):
        raise ModelError(problems)
    parameters, forces = [*model.parameters], [*model.forces]
    for name in names:
        place = places[name]
        added = [
            Parameter(
                name=f"{name}.push.{end}", symbol=parameter_symbol(f"{name}.push.{end}"), value=0.0, unit=unit, binding=Binding.INPUT,
                span=place.span,
            )
            for end, unit in PUSHES.items()
        ]  # fmt: skip
        parameters += added
        x, y, z, *torque = (parameter.symbol for parameter in added)
        forces += [_load(f"{name}.push", place, (x, y, z)), _load(f"{name}.twist", place, tuple(torque), is_torque=True)]
    return replace(model, parameters=tuple(parameters), forces=tuple(forces))


def _problems(model: Model, names: Sequence[str], places: dict[str, Body | Marker]) -> Iterator[Problem]:
    taken = {force.name for force in model.forces}
    for number, name in enumerate(names):
        fault = ""
        if name not in places:
            fault, hint = "the model has no body or marker of this name", nearest(name, places)
        elif name in names[:number]:
            fault, hint = "is given twice", "write it once"
        elif taken & {f"{name}.push", f"{name}.twist"}:
            fault, hint = "the model has a force of its own that is called so", "give that another name"
        if fault:
            yield Problem(span=model.span, element=f"push '{name}'", message=fault, hint=hint)


def _load(name: str, place: Body | Marker, components: Vector, *, is_torque: bool = False) -> BodyLoad:
    at, body = (place.point, place.body) if isinstance(place, Marker) else (place.centre_of_mass, place.name)
    return BodyLoad(
        name=name, body=body, point=None if is_torque else at, axes="global", components=components, moving_only=False, active=True,
        span=place.span,
    )  # fmt: skip
