"""The reason that a run stopped, for the page of its last steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from cutjoint.model.quantities import bodies_of
from cutjoint.model.records import Joint, Model, Vector
from cutjoint.run.results import Trajectory
from cutjoint.view import meshes
from cutjoint.view.records import ALARM, Node, Part
from cutjoint.view.sizes import Placed, force_points


@dataclass(frozen=True, kw_only=True)
class Failure:
    """The reason and the place of a run's stop.

    ``row`` is the equation or coordinate with the worst residual, of an ``element`` at ``place``, a line of the model file; both are "" if
    the row is of no element.  ``bodies`` are the element's.
    """

    text: str
    advice: str
    row: str
    element: str
    place: str
    bodies: Sequence[str]


def find_failure(model: Model, run: Trajectory) -> Failure | None:
    """The reason that a run stopped; None of one that came to its end."""
    if run.failure is None:
        return None
    bodies, spans = bodies_of(model), {**{f.name: f.span for f in model.force_elements}, **model.constraint_spans}
    row = run.failure.element
    element = max((name for name in spans if row == name or row.startswith(f"{name}.")), key=len, default="")
    place = f"{Path(spans[element].file).name}:{spans[element].line}" if element else ""
    return Failure(
        text=run.failure.what, advice=run.failure.advice, row=row, element=element, place=place, bodies=list(bodies.get(element, ()))
    )  # fmt: skip


def mark(placed: Placed, element: str) -> Iterator[Node]:
    """Balls around the points of an element, none of a name that no element has."""
    radius = 2.2 * placed.sizes.joint
    for body, point in _points(placed.model, element):
        ball = Part(mesh=meshes.sphere(radius), colour=ALARM)
        yield Node(name=f"mark of {element}", parts=(ball,), translation=placed.place(body, point), about={"mark": element})


def _points(model: Model, element: str) -> Iterator[tuple[str, Vector]]:
    joints = {joint.name: joint for joint in model.joints}
    for body in (body for body in model.bodies if body.name == element):
        yield body.name, body.centre_of_mass
    for gear in (gear for gear in model.gears if gear.name == element):
        yield from (_joint_point(joints[name]) for name in dict.fromkeys(gear.joints))
    if element in joints:
        yield _joint_point(joints[element])
    for force in (force for force in model.forces if force.name == element):
        yield from force_points(force)


def _joint_point(joint: Joint) -> tuple[str, Vector]:
    return joint.base, joint.at
