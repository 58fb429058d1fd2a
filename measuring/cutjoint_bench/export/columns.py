"""Outputs -> columns of a peer's table."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.model.records import Body, Marker, Model, Output
from cutjoint_bench.export.laws import Numbers
from cutjoint_bench.export.records import Column, Mechanism

#: The quantities of bodies and markers that peers report.
MOTION = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz")


def known_outputs(model: Model, outputs: Sequence[Output]) -> tuple[Output, ...]:
    """The outputs that peers report, which are motions of bodies and markers; the places of all bodies with mass if there are none."""
    known = tuple(output for output in outputs if _moving(model, output) is not None)
    bodies = (body for body in model.bodies if body.mass != 0)
    return known or tuple(Output(element=body.name, quantity=q, span=body.span) for body in bodies for q in "xyz")


def make_columns(model: Model, mechanism: Mechanism, numbers: Numbers, outputs: Sequence[Output]) -> tuple[Column, ...]:
    """The columns of outputs.

    Raises:
        ModelError: an output that peers do not report.
    """
    unknown = [output for output in outputs if _moving(model, output) is None]
    if unknown:
        raise ModelError(_refusal(output) for output in unknown)
    return tuple(_column(model, mechanism, numbers, output) for output in outputs)


def _refusal(output: Output) -> Problem:
    return Problem(
        span=output.span, element=f"output '{output.column}'", message="other simulators do not report it",
        hint=f"ask for {' '.join(MOTION[:6])} of bodies and markers and {' '.join(MOTION[6:])} of bodies",
    )  # fmt: skip


def _moving(model: Model, output: Output) -> Body | Marker | None:
    """The body or marker whose motion an output is."""
    elements: tuple[Body | Marker, ...] = (*model.bodies, *model.markers)
    element = next((e for e in elements if e.name == output.element), None)
    known = MOTION if isinstance(element, Body) else MOTION[:6]
    return element if output.quantity in known else None


def _column(model: Model, mechanism: Mechanism, numbers: Numbers, output: Output) -> Column:
    element = _moving(model, output)
    assert element is not None
    if isinstance(element, Body):
        place = mechanism.places[element.name]
        point = place.centre
    else:
        place = mechanism.places[element.body]
        point = place.point(numbers.triple(element.point))
    return Column(name=output.column, body=place.of, point=point, quantity=output.quantity, unit=unit_of(model, output))
