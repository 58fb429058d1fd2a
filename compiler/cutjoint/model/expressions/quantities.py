"""The quantities of each element, with units, for outputs and expressions, and the bodies to which an element belongs."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TypeAlias

from cutjoint.elements.gear import FORCE_UNITS
from cutjoint.elements.joint import rate_name
from cutjoint.elements.joints import JOINTS
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.parse import quantities_read
from cutjoint.model.records import (
    GROUND,
    VALUE,
    Body,
    Controller,
    FirstOrderState,
    Force,
    Gear,
    Joint,
    Marker,
    Model,
    Output,
    Reaction,
    RodForce,
    Scalar,
    Signal,
    Vector,
)

Element: TypeAlias = Body | Joint | Gear | Force | Reaction | RodForce | Marker | FirstOrderState | Signal | Controller

_MOTION: Mapping[str, str] = {
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
}

_ATTITUDE: Mapping[str, str] = dict.fromkeys(("roll", "pitch", "yaw"), "rad")

#: The pose of a body: its quantities with their units.
POSE: Mapping[str, str] = {**dict.fromkeys(("x", "y", "z"), "m"), **_ATTITUDE}

#: Quantities and units of each kind of element but joints and forces.  A body's x to az are of its centre of mass, in
#: global axes.
QUANTITIES: Mapping[type[Element], Mapping[str, str]] = {
    Body: {**_MOTION, **_ATTITUDE, **dict.fromkeys(("wx", "wy", "wz"), "rad/s")},
    Marker: _MOTION,
    Reaction: {"force": "N", "moment": "N*m"},
    RodForce: {"force": "N"},
}

#: The quantities of a reaction without a direction.
_WRENCH: Mapping[str, str] = {**dict.fromkeys(("Fx", "Fy", "Fz"), "N"), **dict.fromkeys(("Mx", "My", "Mz"), "N*m")}


#: Quantities and units of the tree joints of each kind: coordinates, then speeds.
JOINT_QUANTITIES: Mapping[str, Mapping[str, str]] = {kind: joint.units for kind, joint in JOINTS.items()}
#: The elements that may read quantities.
Reader: TypeAlias = Force | FirstOrderState | Signal | Controller


def quantities(element: Element) -> Mapping[str, str]:
    """The quantities of an element and their units; a cut joint has those that can be measured."""
    match element:
        case Joint(cut=True):
            shown = {name for c in element.element.measurable for name in (c, rate_name(c))}
            return {name: unit for name, unit in JOINT_QUANTITIES[element.kind].items() if name in shown}
        case Joint():
            return JOINT_QUANTITIES[element.kind]
        case Gear():
            return {"force": FORCE_UNITS.get(element.first.unit, "")}  # without a unit where its coordinate is wrong, which is noted
        case Reaction(direction=None):
            return _WRENCH
        case Force() | Controller():
            return element.quantities
        case FirstOrderState() | Signal():
            return {VALUE: element.unit}
    return QUANTITIES[type(element)]


class QuantityError(ValueError):
    """A name that is no quantity: a message and a hint; ``element`` is the full name of the element that it seems to mean."""

    def __init__(self, element: str, message: str, hint: str) -> None:
        super().__init__(message)
        self.element, self.message, self.hint = element, message, hint


def find_quantity(
    known: Mapping[str, Element], name: str, full: Callable[[str], str], prefix: str, broken: Iterable[str] = ()
) -> tuple[str, str]:  # fmt: skip
    """The full name of the element and the quantity that ``name`` means, "element.quantity".
    Names have a ``prefix``; elements that are ``broken`` may be meant too. Raises QuantityError: there is none."""
    local, _, quantity = name.rpartition(".")
    element = full(local)
    if element not in known:
        options = [other.removeprefix(prefix) for other in (*known, *broken) if other.startswith(prefix)]
        whole = f", such as {name}.{next(iter(quantities(known[full(name)])), '')}" if full(name) in known else ""
        hint = nearest(local, options, "elements") if local and not whole else f"write element.quantity{whole}"
        raise QuantityError(element, f"unknown element '{local or name}'", hint)
    allowed = quantities(known[element])
    if quantity not in allowed:
        bare = "a memory of a function is none" if isinstance(known[element], Controller) else "a joint without coordinates has none"
        hint = nearest(quantity, allowed, "quantities") or bare
        raise QuantityError(element, f"'{local}' has no quantity '{quantity}'", hint)
    return element, quantity


def is_angular_speed(known: Mapping[str, Element], name: str) -> bool:
    """Return whether ``name`` is the element.quantity of an angular speed."""
    element, _, quantity = name.rpartition(".")
    return element in known and quantities(known[element]).get(quantity) == "rad/s"


def is_place(element: Element, quantity: str) -> bool:
    """Return whether a quantity follows from the pose of the bodies alone, and not from a road."""
    if isinstance(element, Force):
        return quantity in element.measured and quantities(element)[quantity] in ("m", "rad") and not element.has_road
    return isinstance(element, Body | Marker | Joint) and quantities(element)[quantity] in ("m", "rad")


def follows_from_forces(element: Element, quantity: str) -> bool:
    """Return whether a quantity is an acceleration, a reaction or friction by one, which follow from all forces."""
    if isinstance(element, Force):
        return element.by_load
    return isinstance(element, Reaction | RodForce | Gear) or (isinstance(element, Body | Marker) and quantity in ("ax", "ay", "az"))


def readings_of(model: Model) -> tuple[Output, ...]:
    """The quantities of elements that laws, rates of states, signals and controllers read, as outputs."""
    own = {element.name for group in (model.states, model.signals, model.controllers) for element in group}
    found: dict[tuple[str, str], Output] = {}
    for element, expressions in _expressions(model):
        for name, quantity in (of for expression in expressions for of in quantities_read(expression) if of[0] not in own):
            found.setdefault((name, quantity), Output(element=name, quantity=quantity, span=element.span))
    return tuple(found.values())


def read_by(model: Model, output: Output) -> tuple[Output, ...]:
    """An output, or the quantities that its expression reads, as if they were outputs."""
    signals = {signal.name: signal for signal in model.signals}
    if not output.name:
        return (output,)
    found: dict[tuple[str, str], Output] = {}
    waiting = [output.element]
    while waiting:
        for name, quantity in quantities_read(signals[waiting.pop()].value):
            if name in signals:
                waiting.append(name)
            else:
                found.setdefault((name, quantity), Output(element=name, quantity=quantity, span=output.span))
    return tuple(found.values())


def reading_elements(model: Model) -> tuple[Reader, ...]:
    """The forces, states and signals that read quantities of bodies, markers, joints and forces, all signals and all controllers."""
    states = {state.name for state in model.states}
    return tuple(
        element for element, expressions in _expressions(model)
        if isinstance(element, Signal | Controller) or any(name not in states for e in expressions for name, _ in quantities_read(e))
    )  # fmt: skip


def _expressions(model: Model) -> Iterator[tuple[Reader, tuple[Scalar, ...]]]:
    """The expressions that may read quantities, by their elements."""
    yield from ((force, force.expressions) for force in model.force_elements)
    yield from ((state, (state.rate,)) for state in model.states)
    yield from ((signal, (signal.value,)) for signal in model.signals)
    yield from ((controller, controller.expressions) for controller in model.controllers)


def reaction_component(reaction: Reaction, quantity: str) -> tuple[bool, Vector]:
    """Return whether a quantity of a reaction is a moment, and its direction, fixed in the reaction's body."""
    if reaction.direction is not None:
        return quantity == "moment", reaction.direction
    return quantity.startswith("M"), GLOBAL_AXES["xyz".index(quantity[-1])]


def unit_of(model: Model, output: Output) -> str:
    """The unit of an output of a validated model."""
    return output.unit or quantities(reported_element(model, output))[output.quantity]


def reported_element(model: Model, output: Output) -> Element:
    """The element that an output is a quantity of."""
    return elements_of(model)[output.element]


def elements_of(model: Model) -> dict[str, Element]:
    """All elements that have quantities, by their names."""
    groups = (model.bodies, model.markers, model.reactions, model.force_elements, model.joints, model.gears, model.states, model.signals,
              model.controllers)  # fmt: skip
    return {element.name: element for group in groups for element in group}


def bodies_of(model: Model) -> dict[str, tuple[str, ...]]:
    """The bodies of every element by its name, the ground left out."""
    joints = {joint.name: joint for joint in model.joints}
    elements: list[Element] = [*model.joints, *model.gears, *model.force_elements, *model.reactions, *model.markers]
    found = {e.name: tuple(dict.fromkeys(b for b in _bodies(e, joints) if b != GROUND)) for e in elements}
    return {**{body.name: (body.name,) for body in model.bodies}, **found}


def _bodies(element: Element, joints: dict[str, Joint]) -> Iterator[str]:
    match element:
        case Marker():
            yield element.body
        case Force() if not element.joint_of:
            yield from element.bodies
        case Force():
            yield from _bodies(joints[element.joint_of], joints)
        case Reaction():
            yield from _bodies(joints[element.joint], joints)
        case Gear():
            yield from (body for name in element.joints for body in _bodies(joints[name], joints))
        case RodForce():
            yield from (body for name, _ in element.weights for body in _bodies(joints[name], joints))
        case Joint():
            yield from (element.base, element.follower)
