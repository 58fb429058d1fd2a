"""Equations that hold in every motion, since the loop that they close moves in a plane.

Where all joints of a loop turn about one direction or slide across it, a hinge that closes the loop about that direction need only hold its
point: two equations in place of five.
"""

from __future__ import annotations

from dataclasses import replace

import sympy

from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import Binding, Joint, JointKind, Model, Scene, Vector
from cutjoint.reduce.records import Note, Outcome
from cutjoint.topology.build import build_topology

#: Sine of the angle within which directions given in digits count as parallel.
_PARALLEL = 1e-12

_TURNS = (JointKind.REVOLUTE, JointKind.PLANAR)


def drop_idle_equations(model: Model, scene: Scene) -> Outcome:
    """The pass: cut revolute joints of plane loops become points on their axes, where nobody asks for a reaction in the loop."""
    topology, outcome = build_topology(model), Outcome(model=model, scene=scene)
    values = {p.symbol: p.value for p in model.parameters if p.binding is Binding.CONST}
    joint_of = topology.joint_of
    for loop in topology.loops:
        cut = next(joint for joint in topology.cuts if joint.name == loop.cut)
        if cut.kind is not JointKind.REVOLUTE:
            continue
        others = [joint_of[body].joint for body in loop.bodies]
        odd = next((j for j in others if not _moves_across(j, cut.axes[0], values)), None)
        names = {cut.name, *(j.name for j in others)}
        sensor = next((r for r in model.reactions if getattr(r, "joint", "") in names), None)
        if odd is None and sensor is None:
            outcome = _freed(outcome, cut)
        else:
            why = f"'{odd.name}' leaves the plane" if odd is not None else f"'{sensor.name}' is a reaction in its loop"  # type: ignore[union-attr]
            note = Note(element=cut.name, words=f"keeps its five equations: {why}", span=cut.span)
            outcome = replace(outcome, left=(*outcome.left, note))
    return outcome


def _moves_across(joint: Joint, normal: Vector, values: dict[object, float]) -> bool:
    """Return whether a joint leaves directions along the normal alone: it turns about it or slides across it."""
    if joint.kind is JointKind.FIXED:
        return True
    if joint.kind in _TURNS:
        return all(abs(x) <= _PARALLEL for x in _numbers(sympy.Matrix(joint.axes[0]).cross(sympy.Matrix(normal)), values))
    return joint.kind is JointKind.PRISMATIC and abs(_numbers([_dot(joint.axes[0], normal)], values)[0]) <= _PARALLEL


def _dot(a: Vector, b: Vector) -> object:
    return sum((x * y for x, y in zip(a, b, strict=True)), sympy.Integer(0))


def _numbers(expressions: object, values: dict[object, float]) -> list[float]:
    return [evaluate(sympy.sympify(e), values) for e in expressions]  # type: ignore[attr-defined]


def _freed(outcome: Outcome, cut: Joint) -> Outcome:
    free = replace(cut, kind=JointKind.POINT_ON_LINE)
    model = replace(outcome.model, joints=tuple(free if j.name == cut.name else j for j in outcome.model.joints))
    note = Note(element=cut.name, words="needs two of its equations: its loop moves in a plane", span=cut.span)
    return replace(outcome, model=model, done=(*outcome.done, note))
