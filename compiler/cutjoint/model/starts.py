"""Initial coordinates, attitudes and speeds of joints, as a scene gives them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cutjoint.elements.joint import ATTITUDE
from cutjoint.elements.joints import JOINTS
from cutjoint.model.attitudes import read_attitude
from cutjoint.model.errors import nearest
from cutjoint.model.quantities import JOINT_QUANTITIES
from cutjoint.model.ranges import fault_of_state
from cutjoint.model.records import COORDINATES, SPEEDS, Joint, JointKind, Scalar
from cutjoint.model.scope import Element
from cutjoint.model.source import Path
from cutjoint.model.units import ANGULAR_SPEED, LENGTH, NONE, SPEED, Dimension
from cutjoint.model.values import Attitude

_DIMENSIONS: Mapping[str, Dimension] = {"m": LENGTH, "m/s": SPEED, "rad": NONE, "rad/s": ANGULAR_SPEED}

#: What each section of a scene may give of a joint, by its kind.
_COMPONENTS: Mapping[str, Mapping[JointKind, tuple[str, ...]]] = {
    "positions": {kind: (*COORDINATES[kind], *(("attitude",) if joint.has_attitude else ())) for kind, joint in JOINTS.items()},
    "rates": SPEEDS,
}


def read_states(where: Element, values: Mapping[str, Any], section: str, joints: Mapping[str, Joint]) -> dict[str, Scalar]:
    """Initial coordinates ("positions") or speeds ("rates") by "joint.component"; of an attitude the four of a quaternion."""
    states: dict[str, Scalar] = {}
    for key, value in values.items():
        name, _, component = key.rpartition(".")
        if not name:
            where.fail(f"{section}: '{key}' names no component", "write joint.component", (section, key), at_key=True)
        elif name not in joints:
            if not where.scope.directory.misses(name):
                hint = nearest(name, [joint.name for joint in joints.values() if not joint.cut], "joints")
                where.fail(f"{section}: unknown joint '{name}'", hint, (section, key), at_key=True)
        elif _has_state(where, joints[name], component, section) and _has_form(where, value, component, (section, key)):
            states |= _state(where, joints[name], component, value, (section, key))
    return states


def _has_state(where: Element, joint: Joint, component: str, section: str) -> bool:
    """Return whether a joint's initial state has a component that the scene may give; note its faults."""
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
    if fault := fault_of_state(where.value(state), is_angle=expected == NONE):
        where.fail(f"{keys[0]}: '{keys[1]}': {fault}", "", keys)
    return {f"{joint.name}.{component}": state}
