"""Initial coordinates, attitudes and speeds of joints, steady starts, aims of a start, and values of first-order states.

Attitudes come as rotation vectors, Euler angles or quaternions.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import sympy

from cutjoint.elements.joint import ATTITUDE
from cutjoint.elements.joints import JOINTS
from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.document.values import Attitude, Number
from cutjoint.model.elements.controllers import unit_text
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.operations import Term, choice
from cutjoint.model.expressions.parse import quantities_read
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES, is_angular_speed, is_place
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import ANGULAR_SPEED, LENGTH, NONE, SPEED, Dimension, fault_of_hertz, measure, unit_written
from cutjoint.model.ranges import fault_of_state
from cutjoint.model.records import COORDINATES, SPEEDS, Aim, Binding, FirstOrderState, Joint, Parameter, Scalar, Signal, Trim, Unknown

# Attitudes

UNIT_BOUND = 1e-3  #: the largest difference of a quaternion's length from one

#: Four expressions, scalar first.
Quaternion: TypeAlias = tuple[Scalar, ...]
_DIMENSIONS: Mapping[str, Dimension] = {"m": LENGTH, "m/s": SPEED, "rad": NONE, "rad/s": ANGULAR_SPEED}
#: The components of a joint that each section of a scene may give, by the joint's kind.
_COMPONENTS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "positions": {kind: (*COORDINATES[kind], *(("attitude",) if joint.has_attitude else ())) for kind, joint in JOINTS.items()},
    "rates": SPEEDS,
}

def read_attitude(where: Element, attitude: Attitude, keys: Path) -> Quaternion:
    """The quaternion of an attitude, its length one within `UNIT_BOUND` at the parameters' values.
    Source: Shuster 1993, "A survey of attitude representations", J. Astronaut. Sci. 41."""
    if attitude.quaternion is not None:
        return _given(where, attitude.quaternion, (*keys, "quaternion"))
    if attitude.rotation_vector is not None:
        return _about(_angles(where, attitude.rotation_vector, (*keys, "rotation_vector")))
    assert attitude.euler is not None
    assert attitude.order is not None
    turns = (_about_axis(axis, angle) for axis, angle in zip(attitude.order, _angles(where, attitude.euler, (*keys, "euler")), strict=True))
    first, second, third = turns
    return _product(_product(first, second), third)


def fault_of_quaternion(values: Sequence[float]) -> str:
    """The fault in a quaternion's length and its remedy; "" without a fault, and of NaN."""
    length = math.hypot(*values)
    if not abs(length - 1) > UNIT_BOUND:
        return ""
    return f"the quaternion has the length {length:g}; write one of length 1, within {UNIT_BOUND:g}"


def normalised(positions: Mapping[str, float], joints: Iterable[str]) -> dict[str, float]:
    """Initial coordinates by "joint.component" with the quaternions of some joints at length one."""
    scaled = dict(positions)
    for joint in joints:
        keys = [f"{joint}.{name}" for name in ATTITUDE]
        length = math.hypot(*(scaled[key] for key in keys))
        scaled |= {key: scaled[key] / length for key in keys}
    return scaled


def _given(where: Element, quaternion: Sequence[Number], keys: Path) -> Quaternion:
    components = tuple(where.scalar(value, NONE, (*keys, i)) for i, value in enumerate(quaternion))
    message, _, hint = fault_of_quaternion([where.value(c) for c in components]).partition("; ")
    if message:
        where.fail(f"{keys[0]}: '{keys[1]}': {message}", hint, keys)
    return components


def _angles(where: Element, angles: Sequence[Number], keys: Path) -> tuple[Scalar, ...]:
    found = []
    for i, value in enumerate(angles):
        angle = where.scalar(value, NONE, (*keys, i))
        if fault := fault_of_state(where.value(angle), is_angle=True):
            where.fail(f"{keys[0]}: '{keys[1]}': {fault}", "", (*keys, i))
            angle = FAILED
        found.append(angle)
    return tuple(found)


def _about(vector: Sequence[Scalar]) -> Quaternion:
    """The quaternion of a rotation vector."""
    angle = sympy.sqrt(sum(c**2 for c in vector))
    if angle.has(FAILED):
        return (FAILED,) * 4
    share = choice((sympy.sin(angle / 2) / angle, angle > 0), (sympy.Rational(1, 2), sympy.true))
    return (sympy.cos(angle / 2), *(share * c for c in vector))


def _about_axis(axis: str, angle: Scalar) -> Quaternion:
    return (sympy.cos(angle / 2), *(sympy.sin(angle / 2) if axis == name else sympy.Integer(0) for name in "xyz"))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The quaternion product R(a) R(b): rotation b in the axes rotated by a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


# Coordinates and speeds


def read_states(where: Element, values: Mapping[str, Any], section: str, joints: Mapping[str, Joint]) -> dict[str, Scalar]:
    """Initial coordinates ("positions") or speeds ("rates") by "joint.component"; of an attitude the four of a quaternion."""
    states: dict[str, Scalar] = {}
    for key, value in values.items():
        name, _, component = key.rpartition(".")
        if not name:
            where.fail(f"{section}: '{key}' names no component", "write joint.component", (section, key), at_key=True)
        elif name not in joints:
            if not where.scope.directory.misses(name):
                hint = nearest(name, [*(j.name for j in joints.values() if not j.cut), *where.scope.broken("joints")], "joints")
                where.fail(f"{section}: unknown joint '{name}'", hint, (section, key), at_key=True)
        elif _has_state(where, joints[name], component, section) and _has_form(where, value, component, (section, key)):
            states |= _state(where, joints[name], component, value, (section, key))
    return states


def read_starts(where: Element, scene: model_file.Scene, states: Sequence[FirstOrderState]) -> dict[str, Scalar]:
    """Values of first-order states where a scene begins, by their places."""
    known, starts = {state.name: state for state in states}, dict[str, Scalar]()
    for name, value in scene.states.items():
        keys = ("states", name)
        if name in known:
            state = known[name]
            starts[state.entry] = start = where.scalar(value, measure(1.0, state.unit).dimension if state.unit else None, keys)
            if fault := fault_of_state(where.value(start), bounds=state.bounds):
                where.fail(f"states: '{name}': {fault}", "", keys)
        elif not where.scope.directory.misses(name):
            hint = nearest(name, known, "states") or "the model has no states"
            where.fail(f"states: unknown state '{name}'", hint, keys, at_key=True)
    return starts


def _has_state(where: Element, joint: Joint, component: str, section: str) -> bool:
    """Return whether a joint's initial state has a component that the scene may give; reports errors."""
    keys = (section, f"{joint.name}.{component}")
    kind = "cut" if joint.cut else joint.kind
    allowed = () if joint.cut else _COMPONENTS[section][joint.kind]
    if joint.guide is not None:
        message = f"{section}: the joint '{joint.name}' is guided"
        where.fail(message, "its guide gives its motion", keys, at_key=True)
    elif component not in allowed:
        hint = nearest(component, allowed, section) or f"a {kind} joint has no {section}"
        message = f"{section}: the {kind} joint '{joint.name}' has no '{component}'"
        where.fail(message, hint, keys, at_key=True)
    return joint.guide is None and component in allowed


def _has_form(where: Element, value: Any, component: str, keys: Path) -> bool:
    """Return whether an attitude is written as one, and a coordinate or a speed as a number."""
    if isinstance(value, Attitude) == (component == "attitude"):
        return True
    hint = "write {rotation_vector: ...}, {euler: ..., order: ...} or {quaternion: ...}" if component == "attitude" else "write a number"
    where.fail(f"{keys[0]}: '{keys[1]}' is {'an attitude' if component == 'attitude' else 'a number'}", hint, keys)
    return False


def _state(where: Element, joint: Joint, component: str, value: Any, keys: Path) -> dict[str, Scalar]:
    if isinstance(value, Attitude):
        quaternion = read_attitude(where, value, keys)
        return {f"{joint.name}.{name}": part for name, part in zip(ATTITUDE, quaternion, strict=True)}
    expected = _DIMENSIONS[JOINT_QUANTITIES[joint.kind][component]]
    state = where.scalar(value, expected, keys)
    if expected == ANGULAR_SPEED:
        _refuse_hertz(where, value, keys, str(keys[1]))
    if fault := fault_of_state(where.value(state), is_angle=expected == NONE):
        where.fail(f"{keys[0]}: '{keys[1]}': {fault}", "", keys)
    return {f"{joint.name}.{component}": state}


def _refuse_hertz(where: Element, value: Number, keys: Path, name: str) -> None:
    """Note a number or a parameter in Hz in the place of an angular speed."""
    given = where.scope.source.data.get("parameters", {}).get(str(value), value)
    number, unit = (str(given.get("value")), given.get("unit")) if isinstance(given, dict) else (str(given), None)
    if fault := fault_of_hertz(unit or (number if unit_written(number) else "")):
        where.fail(f"{keys[0]}: '{name}'{'' if given is value else f': the parameter {value!r}'}: {fault}", "", keys)


def read_near(where: Element, scene: model_file.Scene, positions: Mapping[str, Scalar]) -> tuple[str, ...]:
    """The components of ``positions`` that are only initial guesses of a start."""
    found: list[str] = []
    for index, name in enumerate(scene.near):
        joint, _, component = name.rpartition(".")
        components = [f"{joint}.{e}" for e in ATTITUDE] if component == "attitude" else [name]
        if name not in scene.positions:
            hint = nearest(name, scene.positions, "positions") or "write it there too"
            where.fail(f"near: '{name}' is not among the positions", hint, ("near", index))
        found += [c for c in components if c in positions]
    if found and scene.assemble:
        where.fail("near: where 'assemble' is, all that has no position may move", "remove 'near' and its positions", ("near",))
    return tuple(found)


# Steady starts


def read_trim(
    where: Element, scene: model_file.Scene, known: Mapping[str, Quantified], signals: Mapping[str, Signal],
    parameters: Sequence[Parameter], inputs: Mapping[str, Scalar],
) -> Trim | None:  # fmt: skip
    """The unknowns and targets of ``trim``: joints and states are among those ``known``; ``inputs`` have the scene's laws."""
    if (trim := scene.trim) is None:
        return None
    if scene.pose == "equilibrium":
        where.fail("pose: a trim finds the pose of rest itself", "remove 'pose: equilibrium'", ("pose",))
    choices = _unknowns(where, known, parameters)
    for key in (key for key in trim.bounds if key not in trim.find):
        where.fail(f"trim: bounds: '{key}' is not to be found", "list it under 'find' too", ("trim", "bounds", key), at_key=True)
    find = []
    for index, name in enumerate(trim.find):
        keys = ("trim", "find", index)
        if (unknown := _chosen(where, name, choices, keys)) is None:
            continue
        if any(p.name == name and p.binding is Binding.CONST for p in parameters):
            where.fail(f"trim: find: the parameter '{name}' has binding const", "give it 'binding: param'", keys)
        if unknown.kind == "input" and getattr(inputs.get(name), "free_symbols", None):
            hint = "let it follow from a parameter with 'binding: param' and find that"
            where.fail(f"trim: find: the scene's law of the input '{name}' is no number", hint, keys)
        ends, unit = trim.bounds.get(name, ()), measure(1.0, unknown.unit).dimension if unknown.unit else NONE
        bounds = tuple(where.scalar(end, unit, ("trim", "bounds", name, i)) for i, end in enumerate(ends))
        for i, end in enumerate(ends if unknown.unit == "rad/s" else ()):
            _refuse_hertz(where, end, ("trim", "bounds", name, i), name)
        if bounds and where.value(bounds[0]) >= where.value(bounds[1]):
            where.fail(f"trim: bounds: those of '{name}' do not ascend", "write [least, largest]", ("trim", "bounds", name))
        find.append(replace(unknown, bounds=bounds, span=where.scope.source.value_span((*where.path, *keys))))
    changing = {name: unknown for name, unknown in choices.items() if unknown.kind in ("rate", "state")}
    unsteady = [_chosen(where, name, changing, ("trim", "unsteady", index)) for index, name in enumerate(trim.unsteady)]
    hold = tuple(read_aim(where, ("trim", "hold", key), number, known, signals) for key, number in trim.hold.items())
    return Trim(
        find=tuple(find), hold=hold, unsteady=tuple(unknown for unknown in unsteady if unknown is not None),
        span=where.scope.source.key_span((*where.path, "trim")),
    )  # fmt: skip


def _unknowns(where: Element, known: Mapping[str, Quantified], parameters: Sequence[Parameter]) -> dict[str, Unknown]:
    kind = {binding: "input" if binding is Binding.INPUT else "parameter" for binding in Binding}
    found = {p.name: Unknown(name=p.name, kind=kind[p.binding], entry=p.name, unit=p.unit, span=where.span) for p in parameters}
    for element in known.values():
        if isinstance(element, FirstOrderState):
            found[element.name] = Unknown(name=element.name, kind="state", entry=element.entry, unit=element.unit, span=where.span)
        elif isinstance(element, Joint) and not element.cut and element.guide is None:
            for section, names in (("position", COORDINATES), ("rate", SPEEDS)):
                for name, entry in ((name, f"{element.name}.{name}") for name in names[element.kind]):
                    unit = JOINT_QUANTITIES[element.kind][name]
                    found[entry] = Unknown(name=entry, kind=section, entry=entry, unit="" if unit == "rad" else unit, span=where.span)
    return found


def _chosen(where: Element, name: str, choices: Mapping[str, Unknown], keys: Path) -> Unknown | None:
    if name not in choices and not where.scope.directory.misses(name.rpartition(".")[0] or name):
        hint = nearest(name, choices, "write one of")
        where.fail(f"trim: {keys[1]}: '{name}' is none that a start can have", hint, keys)
    return choices.get(name)


# Places that a start is to have


def read_aims(where: Element, scene: model_file.Scene, known: Mapping[str, Quantified], signals: Mapping[str, Signal]) -> tuple[Aim, ...]:
    """The places that ``assemble`` gives: by outputs with expressions, of ``signals``, or by expressions of quantities."""
    if scene.assemble and scene.pose == "equilibrium":
        where.fail("assemble: an equilibrium is where forces balance", "remove 'assemble', or hold 'positions'", ("assemble",))
    return tuple(read_aim(where, ("assemble", key), number, known, signals) for key, number in scene.assemble.items())


def read_aim(
    where: Element, keys: Path, number: Number, known: Mapping[str, Quantified], signals: Mapping[str, Signal], of: str = ""
) -> Aim:  # fmt: skip
    """An expression of quantities, or an output by one of ``signals``, and the value that it shall have; ``of``: by default the key."""
    key, section = of or str(keys[-1]), keys[0]
    if key in signals:
        term = Term(signals[key].symbol, measure(1.0, signals[key].unit).dimension if signals[key].unit else NONE)
    else:
        term = where.term(key, keys, where.scope.reading())
    value = where.scalar(number, term.dimension, keys)
    if is_angular_speed(known, key):
        _refuse_hertz(where, number, keys, key)
    read = list(_quantities_below(term.value, known, signals))
    others = (f"{name}.{quantity}" for name, quantity in read if name in known and not is_place(known[name], quantity))
    if section == "assemble" and (other := next(others, None)):
        hint = "write coordinates of joints, places and attitudes of bodies, lengths, or expressions of these"
        where.fail(f"assemble: '{other}' is no place", hint, keys, at_key=True)
    elif section != "accuracy" and not read and not term.value.has(FAILED):
        where.fail(f"{section}: '{key}' names no place", "write joint.coordinate, or an expression of such", keys, at_key=True)
    span = where.scope.source.key_span((*where.path, *keys))
    unit = unit_written(str(number)) or unit_text(term.dimension)
    size = measure(1.0, unit).value if unit and not value.has(FAILED) else 1.0
    return Aim(name=key, expression=sympy.sympify(term.value), value=sympy.sympify(value), unit=unit, size=size, span=span)


def _quantities_below(expression: Scalar, known: Mapping[str, Quantified], signals: Mapping[str, Signal]) -> Iterator[tuple[str, str]]:
    """The elements and quantities that an expression follows from, those of its signals in their place."""
    for name, quantity in quantities_read(expression):
        signal = signals.get(name, known.get(name))
        if isinstance(signal, Signal):
            yield from _quantities_below(signal.value, known, signals)
        else:
            yield name, quantity
