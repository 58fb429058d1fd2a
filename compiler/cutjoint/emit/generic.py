"""Topology -> a description (JSON) for the generic mechanism, which interprets the model at run time.

Numbers that depend on open parameters, and laws, are trees: a number, ``["p", i]`` for parameter i, ``["t"]``, ``["motion"]``
(0 where the mechanism is held at rest, else 1), a variable of the law by name, or ``[operation, tree, ...]`` with the
operations of the block IR.  Parameters of binding const are numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy

from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import guide_rates, make_charts, make_translator, open_parameters
from cutjoint.formulate.records import Chart
from cutjoint.formulate.recursive.closures import derive_closure
from cutjoint.formulate.translate import Translator
from cutjoint.model.quantities import unit_of
from cutjoint.model.records import (
    COORDINATES,
    SPEEDS,
    AxialForce,
    Body,
    BodyLoad,
    Bushing,
    Force,
    Joint,
    JointForce,
    Marker,
    Model,
    Output,
    PointSpring,
    Reaction,
    Scalar,
    Scene,
    Tyre,
)
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.topology.records import Topology, TreeJoint

Json: TypeAlias = dict[str, Any]

#: Variables of the laws.
VARIABLES = ("length", "travel", "position", "rate", "x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz")


def describe_generic(topology: Topology, scene: Scene, outputs: tuple[Output, ...]) -> Json:
    """The model in one scene: bodies in the order of the tree, cut joints, the forces that act, the reported columns."""
    model, trees = topology.model, _Trees.of(topology.model, scene)
    charts = {chart.joint: chart for chart in make_charts(topology)}
    bodies = {body.name: body for body in model.bodies}
    tyres = [force.name for force in model.forces if isinstance(force, Tyre)]
    return {
        "format": "cutjoint-generic-1",
        "name": model.name,
        "scene": scene.name,
        "gravity": trees.all(model.gravity),
        "parameters": [{"name": p.name, "unit": p.unit, "default": p.value} for p in open_parameters(model)],
        "roads": tyres,
        "bodies": [_body(trees, bodies[t.child], t, charts.get(t.joint.name), model, scene) for t in topology.tree],
        "cuts": [_cut(trees, joint) for joint in topology.cuts],
        "forces": [_force(trees, f, topology, tyres) for f in model.forces if is_active(f, scene)],
        "outputs": [_output(trees, output, topology, scene) for output in outputs],
    }


@dataclass(frozen=True)
class _Trees:
    """Writes SymPy expressions as trees, by way of the block IR's scalars."""

    translator: Translator

    @classmethod
    def of(cls, model: Model, scene: Scene) -> _Trees:
        builder = Builder()
        variables = {sympy.Symbol(n, real=True): builder.symbol(n, 1, BindingTime.ITERATION) for n in VARIABLES}
        return cls(make_translator(builder, model, scene).with_values(variables))

    def one(self, expression: Scalar) -> Any:
        return _tree(self.translator.scalar(expression))

    def all(self, expressions: Iterable[Scalar]) -> list[Any]:
        return [self.one(e) for e in expressions]


def _tree(block: Block) -> Any:
    data: Any = block.data
    match block.op:
        case "const":
            return data[0][0]
        case "symbol":
            return ["p", 0] if data == "parameters" else [data]
        case "take":  # of the column of parameters
            return ["p", data[0][0]]
        case "call":
            return [data[0], *map(_tree, block.args)]
        case "add" | "sub" | "mul" | "neg":
            return [block.op, *map(_tree, block.args)]
    raise ValueError(f"{block!r} is not a scalar expression")


def _body(trees: _Trees, body: Body, t: TreeJoint, chart: Chart | None, model: Model, scene: Scene) -> Json:
    return {
        "name": body.name,
        "parent": t.parent,
        "reversed": t.reversed,
        "mass": trees.one(body.mass),
        "centre_of_mass": trees.all(body.centre_of_mass),
        "inertia": trees.all(body.inertia),
        "joint": {
            **_geometry(trees, t.joint),
            "guide": None if t.joint.guide is None else [_guide(trees, guide, model, scene) for guide in t.joint.guide],
            "q": None if chart is None else chart.q,
            "v": None if chart is None else chart.v,
            "coordinates": [] if chart is None else list(chart.coordinate_names),
            "speeds": [] if chart is None else list(chart.speed_names),
        },
    }


def _guide(trees: _Trees, guide: Scalar, model: Model, scene: Scene) -> list[Any]:
    position, *rates = trees.all(guide_rates(guide, model, scene))
    return [position, *map(_in_motion, rates)]


def _in_motion(tree: Any) -> Any:
    """Zero where the mechanism is held at rest."""
    return ["mul", ["motion"], tree]


def _cut(trees: _Trees, joint: Joint) -> Json:
    names = derive_closure(joint).names
    return {**_geometry(trees, joint), "base": joint.base, "follower": joint.follower, "equations": list(names)}


def _geometry(trees: _Trees, joint: Joint) -> Json:
    return {
        "name": joint.name,
        "kind": str(joint.kind),
        "at": trees.all(joint.at),
        "to": None if joint.to is None else trees.all(joint.to),
        "axes": [trees.all(axis) for axis in joint.axes],
        "pitch": None if joint.pitch is None else trees.one(joint.pitch),
    }


def _force(trees: _Trees, force: Force, topology: Topology, tyres: Sequence[str]) -> Json:
    match force:
        case PointSpring():
            details = {"start": trees.all(force.start), "end": trees.all(force.end), **_pair(trees, force, "length")}
        case AxialForce():
            geometry = {name: trees.all(getattr(force, name)) for name in ("origin", "point", "axis")}
            details = {**geometry, **_pair(trees, force, "travel")}
        case Bushing():
            details = _bushing(trees, force)
        case BodyLoad():
            details = _load(trees, force)
        case JointForce():
            body, joint = next((t.child, t.joint) for t in topology.tree if t.joint.name == force.joint)
            index = COORDINATES[joint.kind].index(force.coordinate)
            details = {"body": body, "coordinate": index, "law": _law(trees, force.law, "position")}
        case Tyre():
            geometry = {"centre": trees.all(force.centre), "axis": trees.all(force.axis)}
            constants = {name: trees.one(value) for name, value in force.constants.items()}
            details = {"body": force.body, **geometry, "road": tyres.index(force.name), "constants": constants}
    return {"name": force.name, "kind": _KINDS[type(force)], "quantities": _quantity_names(force), **details}


_KINDS: Mapping[type, str] = {
    PointSpring: "point_spring", AxialForce: "axial_force", Bushing: "bushing", BodyLoad: "load", JointForce: "joint_force",
    Tyre: "tyre",
}  # fmt: skip


def _pair(trees: _Trees, force: PointSpring | AxialForce, position: str) -> Json:
    return {"base": force.base, "follower": force.follower, "law": _law(trees, force.law, position)}


def _bushing(trees: _Trees, force: Bushing) -> Json:
    return {
        "base": force.base,
        "follower": force.follower,
        "point": trees.all(force.point),
        "axes": [trees.all(axis) for axis in force.axes],
        "laws": trees.all(force.laws),
    }


def _load(trees: _Trees, load: BodyLoad) -> Json:
    components = trees.all(load.components)
    return {
        "body": load.body,
        "point": None if load.point is None else trees.all(load.point),
        "axes": load.axes,
        "components": [_in_motion(c) for c in components] if load.moving_only else components,
    }


def _law(trees: _Trees, law: Scalar, position: str) -> Json:
    by_position, by_rate = (sympy.diff(law, sympy.Symbol(name, real=True)) for name in (position, "rate"))
    return {"force": trees.one(law), "stiffness": trees.one(by_position), "damping": trees.one(by_rate)}


#: What each kind of force reports, in the order in which the generic mechanism writes it.
_QUANTITIES: Mapping[type, tuple[str, ...]] = {
    PointSpring: ("force", "stiffness", "damping", "length", "rate"),
    AxialForce: ("force", "stiffness", "damping", "travel", "rate"),
    Bushing: ("Fx", "Fy", "Fz", "Mx", "My", "Mz", "dx", "dy", "dz", "rx", "ry", "rz"),
    BodyLoad: ("Fx", "Fy", "Fz"),
    JointForce: ("force", "stiffness", "damping"),
    Tyre: ("Fz", "Fy", "Mz", "slip", "camber", "deflection"),
}


def _quantity_names(force: Force) -> list[str]:
    if isinstance(force, BodyLoad) and force.point is None:
        return ["Mx", "My", "Mz"]
    return list(_QUANTITIES[type(force)])


def _output(trees: _Trees, output: Output, topology: Topology, scene: Scene) -> Json:
    model = topology.model
    element = next(
        e for group in (model.bodies, model.markers, model.reactions, model.forces, model.joints) for e in group
        if e.name == output.element
    )  # fmt: skip
    return {"name": output.column, "unit": unit_of(model, output), **_source(trees, output, element, topology, scene)}


def _source(trees: _Trees, output: Output, element: Any, topology: Topology, scene: Scene) -> Json:
    """Where a column's value comes from."""
    match element:
        case Body():
            return _motion(trees, element.name, element.centre_of_mass, output.quantity)
        case Marker():
            return _motion(trees, element.body, element.point, output.quantity)
        case Reaction():
            direction = trees.all(element.direction)
            return {"kind": "reaction", "cut": element.joint, "body": element.body, "direction": direction}
        case Joint():
            return _joint_value(output, element, topology)
    return {"kind": "force", "quantity": output.column} if is_active(element, scene) else {"kind": "zero"}


def _motion(trees: _Trees, body: str, point: Iterable[Scalar], quantity: str) -> Json:
    return {"kind": "motion", "body": body, "point": trees.all(point), "quantity": quantity}


def _joint_value(output: Output, joint: Joint, topology: Topology) -> Json:
    body = next(t.child for t in topology.tree if t.joint.name == joint.name)
    coordinates = COORDINATES[joint.kind]
    if output.quantity in coordinates:
        return {"kind": "joint_position", "body": body, "index": coordinates.index(output.quantity)}
    return {"kind": "joint_rate", "body": body, "index": SPEEDS[joint.kind].index(output.quantity)}
