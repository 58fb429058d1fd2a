"""Descriptions of each kind of force by its action on points, directions and angles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from cutjoint.elements.force import AxisForce, Compliance, Interaction, LineForce, OnCoordinate, RoadContact, Wrench
from cutjoint.model.records import BodyLoad, Force, JointForce, Model
from cutjoint.report.explain import laws as tyre
from cutjoint.report.explain.forces import ForceDescription, describe

NOTES = (
    "A force on a point of a body works on the displacement of that point: $Q_p$ takes it, and a point that is no coordinate hands it on "
    "to the nodes that it combines, times their coefficients. A law $F$ over a scalar $s$ works on $s$: $Q$ takes $F$ times the gradient "
    "of $s$. A torque $T$ on a body works on the three directions $e_x$, $e_y$, $e_z$ of the body that are the global axes in the design "
    r"position: $Q_{e_i}$ takes $T \times e_i / 2$.",
)


def describe_natural(force: Force, model: Model) -> ForceDescription:
    """The description of a force; its law is that of every formulation."""
    description = describe(force, model)
    notes, actions = _ACTIONS[type(force.interaction)](force, model, description)
    return replace(description, notes=notes, actions=actions)


_Acts = tuple[tuple[str, ...], tuple[str, ...]]


def _stretch(force: Force, model: Model, description: ForceDescription) -> _Acts:
    return description.notes, (
        r"d = p_e - p_s, \quad \ell = \lVert d \rVert, \quad n = d / \ell, \quad \dot \ell = n \cdot \dot d",
        _pair("p_e", "p_s", "-", "F n"),
    )


def _pair(end: str, start: str, sign: str, force: str) -> str:
    """A force on one point, the opposite one on another."""
    other = "+" if sign == "-" else "-"
    return rf"{_gets(end, sign, force)}, \quad {_gets(start, other, force)}"


def _gets(node: str, sign: str, force: str) -> str:
    return rf"Q_{{{node}}} \leftarrow Q_{{{node}}} {sign} {force}"


def _along(end: str, start: str, travel: str) -> tuple[str, ...]:
    """A law over the way between two points along the axis a."""
    return (
        rf"d = {end} - {start}, \quad {travel} = a \cdot d, \quad \dot {travel} = a \cdot \dot d + d \cdot \dot a",
        rf"{_pair(end, start, '+', 'F a')}, \quad {_gets('a', '+', 'F d')}",
    )


def _travel(force: Force, model: Model, description: ForceDescription) -> _Acts:
    note = "$F$ pushes the follower's point $p$ along the axis $a$, which is fixed in the base like the origin $p_o$."
    return (note,), _along("p", "p_o", "s")


def _on_coordinate(force: JointForce, model: Model, description: ForceDescription) -> _Acts:
    joint = next(j for j in model.joints if j.name == force.joint)
    if joint.guide is not None:
        return ("A guided joint follows its guide; $F$ is reported and does nothing.",), ()
    if force.coordinate in joint.element.measures:
        return ("The angle $z$ is a coordinate of its own, on which $F$ works.",), (_gets("z", "+", "F"),)
    note = (
        "$F$ works on the displacement $z$ of the joint's point $p_f$ of the follower (of a free joint the outer body) from the "
        "base's point $p_b$, along the direction $a$ of the base."
    )
    return (note,), _along("p_f", "p_b", "z")


def _compliance(force: Force, model: Model, description: ForceDescription) -> _Acts:
    note = (
        "$E$ holds the axes $e_k$ carried by the base, $G$ the axes $g_k$ carried by the follower; $w$ leads from the base's point to the "
        r"follower's, $d$ are the displacements along and $\theta$ the small rotations about the axes $e_k$."
    )
    return (note,), (
        r"w = p_f - p_b, \quad d = E^T w, \quad S = E^T G, \quad \tilde \theta = (S - S^T) / 2",
        _pair("p_f", "p_b", "+", "E F"),
        r", \quad ".join((_gets("E", "+", r"w F^T - G \tilde M / 2"), _gets("G", "+", r"E \tilde M / 2"))),
    )


#: A torque T on the directions of its body.
_TORQUE = _gets("e_i", "+", r"T \times e_i / 2")


def _load(force: BodyLoad, model: Model, description: ForceDescription) -> _Acts:
    turned = r"E F, \quad E = [e_x, e_y, e_z]" if force.in_body else "F"
    if force.point is not None:
        return description.notes, (_gets("p", "+", turned),)
    spin = r"\omega = \sum\nolimits_{i} e_i \times \dot e_i / 2"
    return description.notes, (r", \quad ".join((f"T = {turned}", _TORQUE, spin)),)


def _contact(force: Force, model: Model, description: ForceDescription) -> _Acts:
    torque = r"T = (p - c) \times F + M_z n - I \frac{v \cdot e_x}{R} \dot y"
    action = r", \quad ".join(("F = F_z n + F_y e_y", torque, _gets("c", "+", "F"), _TORQUE))
    return (*description.notes, "$c$ is the wheel centre."), (*(a for a in description.actions if a != tyre.ACTION), action)


_ACTIONS: Mapping[type[Interaction], Callable[[Any, Model, ForceDescription], _Acts]] = {
    LineForce: _stretch, AxisForce: _travel, Compliance: _compliance, Wrench: _load, OnCoordinate: _on_coordinate, RoadContact: _contact,
}  # fmt: skip
