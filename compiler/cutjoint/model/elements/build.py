"""Bodies, joints, sensors, states, signals and controllers: from the document's parts to records, not yet mirrored."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import sympy

from cutjoint.elements.joint import Fault, JointElement
from cutjoint.elements.joints import JOINTS
from cutjoint.model.document import body_parts, model_file
from cutjoint.model.document import element_parts as joint_parts
from cutjoint.model.document.values import LOST, Table
from cutjoint.model.elements.controllers import read_controller, require_free_name, unit_text
from cutjoint.model.elements.forces import joint_forces, read_force
from cutjoint.model.elements.friction import bristle_of
from cutjoint.model.elements.gears import read_gear
from cutjoint.model.elements.geometry import GLOBAL_AXES, coincide, perpendicular, read_axes, read_direction, read_point, unit
from cutjoint.model.elements.mass import read_mass
from cutjoint.model.expressions.laws import LawKind, dimension_of_table, read_law, read_lookup
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.scope import FAILED, Element, Scope, element
from cutjoint.model.expressions.units import ANGLE, INERTIA, LENGTH, MASS, TIME
from cutjoint.model.ranges import fault_of_state
from cutjoint.model.records import (
    VALUE,
    Body,
    Controller,
    FirstOrderState,
    Force,
    Gear,
    Joint,
    JointFriction,
    Marker,
    Reaction,
    Scalar,
    Signal,
    Vector,
    Visual,
)
from cutjoint.package.errors import plural

OPPOSITE = 1e-6  #: the least length of the sum of two unit vectors that are not opposite
#: The laws of guides by the unit of their coordinate.
GUIDES = {"rad": LawKind({"t": TIME}, ANGLE), "m": LawKind({"t": TIME}, LENGTH)}


@dataclass(frozen=True)
class Elements:
    """The elements of one scope."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    forces: tuple[Force, ...]
    reactions: tuple[Reaction, ...]
    markers: tuple[Marker, ...]
    gears: tuple[Gear, ...] = ()
    states: tuple[FirstOrderState, ...] = ()
    signals: tuple[Signal, ...] = ()
    controllers: tuple[Controller, ...] = ()

    def by_name(self) -> dict[str, Quantified]:
        """Every element by its name."""
        groups = (self.bodies, self.joints, self.gears, self.forces, self.reactions, self.markers, self.states, self.signals,
                  self.controllers)  # fmt: skip
        return {element.name: element for group in groups for element in group}


def read_elements(scope: Scope, part: model_file.Elements) -> Elements:
    """Read all elements of the model, or of a submodel in one instance's scope."""
    scope = replace(scope, points=read_points(scope, part))
    forces = (
        *(read_force(element(scope, "force", "forces", name), force) for name, force in part.forces.items()),
        *(f for name, joint in part.joints.items() for f in joint_forces(element(scope, "joint", "joints", name), joint)),
    )
    bristles = (bristle_of(force) for force in forces if isinstance(force, JointFriction))
    return Elements(
        tuple(_read_body(element(scope, "body", "bodies", name), body) for name, body in part.bodies.items()),
        tuple(_read_joint(element(scope, "joint", "joints", name), joint) for name, joint in part.joints.items()),
        forces,
        tuple(_read_reaction(element(scope, "reaction", "reactions", name), r) for name, r in part.reactions.items()),
        tuple(_read_marker(element(scope, "marker", "markers", name), m) for name, m in part.markers.items()),
        tuple(read_gear(element(scope, "gear", "gears", name), gear) for name, gear in part.gears.items()),
        (*(_read_state(element(scope, "state", "states", name), state) for name, state in part.states.items()), *bristles),
        tuple(_read_signal(element(scope, "signal", "signals", name), value) for name, value in part.signals.items()),
        tuple(read_controller(element(scope, "controller", "controllers", name), c) for name, c in part.controllers.items()),
    )


def read_points(scope: Scope, part: model_file.Elements) -> Mapping[str, Vector]:
    """The points, each able to use those above it; an instance may give the positions of points."""
    points: dict[str, Vector] = {}
    scope = replace(scope, points=points)
    for name, point in part.points.items():
        points[name] = scope.instance_points.get(name) or read_point(element(scope, "point", "points", name), point, ())
    return points


def _read_body(element: Element, body: body_parts.Body) -> Body:
    mass, centre, inertia, shapes = read_mass(element, body)
    visuals = () if body.visual is None else (_read_visual(element, body.visual),)
    return Body(name=element.name, mass=mass, centre_of_mass=centre, inertia=inertia, span=element.span, shapes=shapes, visuals=visuals)


def _read_visual(element: Element, visual: body_parts.Visual) -> Visual:
    nowhere = (sympy.Integer(0),) * 3
    is_global = visual.x is visual.y is visual.z is None
    return Visual(
        mesh=visual.mesh or "", colour=visual.colour or "", scale=float(visual.scale or 1),
        axes=GLOBAL_AXES if is_global else read_axes(element, visual, ("visual",)),
        at=nowhere if visual.at is None else read_point(element, visual.at, ("visual", "at")),
        span=element.scope.source.key_span((*element.path, "visual")),
    )  # fmt: skip


def _read_joint(element: Element, joint: joint_parts.Joint) -> Joint:
    base, follower = element.two_bodies(joint.bodies)
    kind = JOINTS[joint.kind]
    fields = {field.name: getattr(joint, field.name) for field in kind.fields}
    at, to = read_point(element, joint.at, ("at",)), None
    if "to" in fields:
        at, to = element.settle(at), element.settle(read_point(element, fields["to"], ("to",)))
    axes = {name: read_direction(element, fields[name], (name,)) for name in ("axis", "axis_2") if fields.get(name) is not None}
    is_sound = _check_fields(element, kind, {"at": at, **({} if to is None else {"to": to}), **axes})
    return Joint(
        name=element.name,
        kind=kind.kind,
        base=base,
        follower=follower,
        at=at,
        axes=_axes(kind, tuple(axes.values()), is_sound),
        to=to,
        pitch=element.scalar(fields["pitch"], LENGTH, ("pitch",)) if "pitch" in fields else None,
        cut=joint.cut,
        guide=_guide(element, joint),
        span=element.span,
        armature=_armature(element, kind, joint),
    )


def _armature(element: Element, kind: JointElement, joint: joint_parts.Joint) -> Scalar:
    armature = getattr(joint, "armature", None)
    if armature is None:
        return 0
    if joint.cut:
        element.fail("a cut joint has no armature", "leave out cut: true", ("cut",))
    (coordinate,) = kind.coordinates
    armature = element.scalar(armature, INERTIA if kind.units[coordinate] == "rad" else MASS, ("armature",))
    element.positive(element.value(armature), ("armature",))
    return armature


def _check_fields(element: Element, kind: JointElement, vectors: Mapping[str, Vector]) -> bool:
    """Report problems between fields by the checks of a kind; returns whether there are none."""
    is_sound = True
    for name, check in ((field.name, field.check) for field in kind.fields if field.name in vectors):
        if check is not None and _FAULTS[check.fault](element, vectors[check.other_field], vectors[name]):
            element.fail(f"{check.other_field} and {name} {check.fault}", check.hint, (name,))
            is_sound = False
    return is_sound


def _axes(kind: JointElement, axes: tuple[Vector, ...], is_sound: bool) -> tuple[Vector, ...]:
    if not kind.axis_is_bisector or len(axes) < 2:
        return axes
    x, y, z = (p + q for p, q in zip(*axes, strict=True))
    return (unit((x, y, z)) if is_sound else (FAILED, FAILED, FAILED),)


_FAULTS: Mapping[Fault, Callable[[Element, Vector, Vector], bool]] = {
    Fault.SAME_POINT: coincide,
    Fault.OPPOSITE: lambda element, a, b: math.hypot(*(element.value(p + q) for p, q in zip(a, b, strict=True))) < OPPOSITE,
    Fault.NOT_PERPENDICULAR: lambda element, a, b: not perpendicular(element, a, b),
}


def _read_state(element: Element, state: model_file.FirstOrderState) -> FirstOrderState:
    require_free_name(element)
    dimension = element.term(state.start, ("start",), element.scope.constants()).dimension
    rate = None if dimension is None else dimension / TIME
    nominal = 1.0 if state.nominal is None else element.number(state.nominal, dimension, ("nominal",))
    if not nominal > 0 and not math.isnan(nominal):
        element.fail("nominal must be greater than zero", "write how large the state usually is, such as nominal: 2 bar", ("nominal",))
    bounds = tuple(element.number(end, dimension, ("bounds", i)) for i, end in enumerate(state.bounds or ()))
    if bounds and bounds[0] >= bounds[1]:
        element.fail("its bounds do not ascend", "write [least, largest]", ("bounds",))
    initial = element.scalar(state.start, None, ("start",))
    if fault := fault_of_state(element.value(initial), bounds=bounds):
        element.fail(f"start: {fault}", "", ("start",))
    return FirstOrderState(
        name=element.name, symbol=quantity_symbol(element.name, VALUE), unit=unit_text(dimension), span=element.span,
        nominal=nominal, bounds=bounds, initial=initial,
        rate=read_lookup(element, state.rate, rate, ("rate",)),
    )  # fmt: skip


def _read_signal(element: Element, value: int | float | str | Table) -> Signal:
    require_free_name(element)
    if isinstance(value, Table):
        dimension = dimension_of_table(element, value)
        expression = read_lookup(element, value, dimension, ())
    else:
        names = element.scope.reading("t")
        term = element.scope.terms.get(element.name) or element.term(value, (), names)
        dimension, expression = term.dimension, element.scalar(value, None, (), names, term=term)
    symbol = quantity_symbol(element.name, VALUE)
    return Signal(name=element.name, symbol=symbol, value=sympy.sympify(expression), unit=unit_text(dimension), span=element.span)


def _guide(element: Element, joint: joint_parts.Joint) -> tuple[Scalar, ...] | None:
    """A law of time for each coordinate of a guided joint."""
    guide = getattr(joint, "guide", None)
    if guide is None:
        return None
    kind = JOINTS[joint.kind]
    coordinates = kind.coordinates
    laws, timed = guide if isinstance(guide, tuple) else (guide,), element.scope.timed()
    if joint.cut:
        element.fail("a cut joint has no coordinate to guide", "remove cut or guide", ("guide",))
    if len(laws) != len(coordinates) and LOST not in laws:
        message = f"guide has {plural(len(laws), 'law')}, a {joint.kind} joint {plural(len(coordinates), 'coordinate')}"
        element.fail(message, f"give one for each of {', '.join(coordinates)}", ("guide",))
    return tuple(
        read_law(element, law, GUIDES[kind.units[name]], ("guide", index) if isinstance(guide, tuple) else ("guide",), timed)
        for index, (name, law) in enumerate(zip(coordinates, laws, strict=False))
    )


def _read_reaction(element: Element, reaction: model_file.Reaction) -> Reaction:
    name, _ = element.joint(reaction.joint, ("joint",))
    direction = None if reaction.direction is None else read_direction(element, reaction.direction, ("direction",))
    body = element.body(reaction.axes_of, ("axes_of",))
    return Reaction(name=element.name, joint=name, body=body, direction=direction, span=element.span)


def _read_marker(element: Element, marker: model_file.Marker) -> Marker:
    body = element.body(marker.body, ("body",))
    return Marker(name=element.name, body=body, point=read_point(element, marker.at, ("at",)), span=element.span)
