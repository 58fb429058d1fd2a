"""Topology -> a description (JSON) for the generic mechanism, which interprets the model at run time; expressions are trees (trees.py)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from cutjoint.elements.gear import NAMES as GEAR_NAMES
from cutjoint.elements.interaction import Carrier, Interaction
from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.interactions.on_coordinate import OnCoordinate
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.elements.joint import (
    AXIAL_FRAME,
    Advance,
    BodyDirection,
    Condition,
    Direction,
    JointDisplacement,
    Offset,
    Product,
    Products,
    Rotation,
    SameAttitude,
    SameDirection,
    SameDistance,
    SamePoint,
    Translation,
    rate_name,
)
from cutjoint.elements.joint import Motion as ChainMotion
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import make_charts, tunable_parameters
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.quantities import needs_place
from cutjoint.kernels.closures import derive_closure
from cutjoint.model.expressions.quantities import reaction_component, reported_element, unit_of
from cutjoint.model.records import COORDINATES, SPEEDS, Body, Force, Gear, Joint, Marker, Model, Output, Reaction, Scalar, Scene
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint_bench.generic.cut_coordinates import describe_cut_coordinate
from cutjoint_bench.generic.trees import Json, Trees, quantity_names


def describe_generic(topology: Topology, scene: Scene, outputs: tuple[Output, ...]) -> Json:
    """The model in one scene: bodies in the order of the tree, cut joints, gears, the forces that act, the reported columns."""
    model, trees = topology.model, Trees.of(topology.model, scene)
    charts = {chart.joint: chart for chart in make_charts(topology)}
    bodies = {body.name: body for body in model.bodies}
    tyres = [force.name for force in model.forces if force.has_road]
    return {
        "format": "cutjoint-generic-1",
        **heading(trees),
        "bodies": [_body(trees, bodies[t.child], t, charts.get(t.joint.name)) for t in topology.tree],
        "cuts": [_cut(trees, joint) for joint in topology.cuts],
        "gears": [_gear(trees, gear, topology) for gear in model.gears],
        "forces": [_force(trees, f, topology, tyres) for f in placed_forces(model, scene, outputs)],
        "outputs": [_output(trees, output, topology, scene) for output in outputs],
    }


def placed_forces(model: Model, scene: Scene, outputs: tuple[Output, ...]) -> Iterator[Force]:
    """The forces that act, and without their laws those that are switched off and of which outputs ask where their parts are."""
    for force in model.forces:
        if needs_place(force, model, scene, outputs):
            yield force if is_active(force, scene) else _without_laws(force)


def _without_laws(force: Force) -> Force:
    """A force with laws of zero."""
    laws = {name: getattr(force, name) for name in force.element.laws}
    changed: dict[str, Any] = {name: tuple(law * 0 for law in x) if isinstance(x, tuple) else x * 0 for name, x in laws.items()}
    return replace(force, **changed)


def force_source(output: Output, force: Force, scene: Scene) -> Json:
    """The source of a force's column; zero of what a force that is switched off does not measure."""
    known = is_active(force, scene) or output.quantity in force.measured_when_off
    return {"kind": "force", "quantity": output.column} if known else {"kind": "zero"}


def heading(trees: Trees) -> Json:
    """The beginning of the descriptions for all generic solvers."""
    model = trees.model
    return {
        "name": model.name,
        "scene": trees.scene.name,
        "gravity": trees.all(model.gravity),
        "parameters": [{"name": p.name, "unit": p.unit, "default": p.value} for p in tunable_parameters(model)],
        "inputs": trees.inputs(),
        "roads": [force.name for force in model.forces if force.has_road],
    }


def _body(trees: Trees, body: Body, t: TreeJoint, chart: Chart | None) -> Json:
    return {
        "name": body.name,
        "parent": t.parent,
        "reversed": t.reversed,
        "mass": trees.one(body.mass),
        "centre_of_mass": trees.all(body.centre_of_mass),
        "inertia": trees.all(body.inertia),
        "joint": {
            **_geometry(trees, t.joint),
            "guide": None if t.joint.guide is None else [trees.guide(guide) for guide in t.joint.guide],
            "q": None if chart is None else chart.q,
            "v": None if chart is None else chart.v,
            "coordinates": [] if chart is None else list(chart.coordinate_names),
            "speeds": [] if chart is None else list(chart.speed_names),
        },
    }


def _cut(trees: Trees, joint: Joint) -> Json:
    names = derive_closure(joint).names
    return {**_geometry(trees, joint), "base": joint.base, "follower": joint.follower, "equations": list(names)}


def _gear(trees: Trees, gear: Gear, topology: Topology) -> Json:
    """A gear as the sum of its coordinates with their factors."""
    tree = {t.joint.name: t for t in topology.tree}
    terms = [
        {
            "body": tree[c.joint].child, "coordinate": tree[c.joint].joint.element.coordinates.index(c.name), "factor": trees.one(factor)
        }
        for c, factor in gear.terms
    ]  # fmt: skip
    return {"name": gear.name, "terms": terms, "equations": list(GEAR_NAMES)}


def _geometry(trees: Trees, joint: Joint) -> Json:
    return {
        "name": joint.name,
        "chain": [_motion_of_chain(joint, motion) for motion in joint.element.chain],
        "from_inner": joint.element.from_inner,
        "conditions": [_condition(condition) for condition in joint.element.conditions],
        "at": trees.all(joint.at),
        "to": None if joint.to is None else trees.all(joint.to),
        "axes": [trees.all(axis) for axis in joint.axes],
        "pitch": None if joint.pitch is None else trees.one(joint.pitch),
    }


def _motion_of_chain(joint: Joint, motion: ChainMotion) -> Json:
    match motion:
        case Translation():
            return {"kind": "slide", "direction": motion.direction, "coordinate": joint.element.coordinates.index(motion.coordinate)}
        case Rotation():
            coordinate = joint.element.coordinates.index(motion.coordinate)
            more = {"share": float(motion.share), "advances": motion.is_screw}
            return {"kind": "turn", "direction": motion.direction, "coordinate": coordinate, **more}
        case Offset():
            return {"kind": "offset", "direction": motion.direction}
    return {"kind": "ball"}


def _condition(condition: Condition) -> Json:
    """A condition by its name with what it names; the generic solver has its equations by hand."""
    name = {
        SamePoint: "same_point", SameDirection: "same_direction", SameAttitude: "same_attitude", Products: "products",
        SameDistance: "same_distance", Advance: "advance",
    }[type(condition)]  # fmt: skip
    directions: Sequence[Direction] = ()
    match condition:
        case SameDirection():
            directions = (condition.direction,)
        case SameAttitude():
            directions = condition.frame
        case Advance():
            directions = AXIAL_FRAME
    sums = condition.sums if isinstance(condition, Products) else ()
    return {"kind": name, "directions": list(directions), "sums": [[_product(p) for p in products] for products in sums]}


def _product(product: Product) -> Json:
    return {"left": _factor(product.left), "right": _factor(product.right), "weight": float(product.weight)}


def _factor(factor: BodyDirection | JointDisplacement) -> list[str]:
    return ["displacement"] if isinstance(factor, JointDisplacement) else [factor.end, factor.direction]


def _force(trees: Trees, force: Any, topology: Topology, tyres: Sequence[str]) -> Json:
    """A force by the name of its interaction with where it acts and its laws; the generic solver has its equations by hand."""
    how = force.interaction
    match how:
        case LineForce() | AxisForce():
            details = {**_places(trees, force), "law": trees.law(force.expressions[0], how.position)}
        case Compliance():
            axes = [trees.all(axis) for axis in how.frame.of(force)]
            details = {"point": trees.all(how.base.of(force)), "axes": axes, "laws": trees.all(force.expressions)}
        case Wrench():
            details = _load(trees, force)
        case OnCoordinate():
            details = {**_acted_on(trees, force, topology), "law": trees.law(force.expressions[0], how.position)}
        case RoadContact():
            details = {**_places(trees, force), "road": tyres.index(force.name), "constants": trees.constants(force)}
    ends = {carrier.value: getattr(force, carrier) for carrier in Carrier if hasattr(force, carrier)}
    return {"name": force.name, "kind": _KINDS[type(how)], "quantities": quantity_names(force), **ends, **details}


def _places(trees: Trees, force: Force) -> Json:
    """The points and directions of a force by their parts in the interaction."""
    roles = ((f.name, getattr(force.interaction, f.name)) for f in fields(force.interaction))
    return {name: trees.all(place.of(force)) for name, place in roles}


def _acted_on(trees: Trees, force: Force, topology: Topology) -> Json:
    """The coordinate that a force acts on."""
    cut = next((cut for cut in topology.cuts if cut.name == force.joint_of), None)
    if cut is not None:
        return {"cut": describe_cut_coordinate(trees, topology, cut, force.coordinate_of)}
    body, joint = next((t.child, t.joint) for t in topology.tree if t.joint.name == force.joint_of)
    return {"body": body, "coordinate": COORDINATES[joint.kind].index(force.coordinate_of)}


#: The generic solver's name of each interaction.
_KINDS: Mapping[type[Interaction], str] = {
    LineForce: "point_spring", AxisForce: "axial_force", Compliance: "bushing", Wrench: "load", OnCoordinate: "joint_force",
    RoadContact: "tyre",
}  # fmt: skip


def _load(trees: Trees, load: Any) -> Json:
    return {
        "point": None if load.point is None else trees.all(load.point),
        "axes": load.axes,
        "components": trees.loads(load),
    }


def _output(trees: Trees, output: Output, topology: Topology, scene: Scene) -> Json:
    source = _source(trees, output, reported_element(topology.model, output), topology, scene)
    return {"name": output.column, "unit": unit_of(topology.model, output), **source}


def _source(trees: Trees, output: Output, element: Any, topology: Topology, scene: Scene) -> Json:
    """The source of a column's value."""
    match element:
        case Body():
            return _motion(trees, element.name, element.centre_of_mass, output.quantity)
        case Marker():
            return _motion(trees, element.body, element.point, output.quantity)
        case Reaction():
            return _reaction(trees, element, output.quantity)
        case Joint():
            return _joint_value(trees, output, element, topology)
        case Gear():
            return {"kind": "gear", "gear": element.name}
    return force_source(output, element, scene)


def _motion(trees: Trees, body: str, point: Iterable[Scalar], quantity: str) -> Json:
    return {"kind": "motion", "body": body, "point": trees.all(point), "quantity": quantity}


def _reaction(trees: Trees, reaction: Reaction, quantity: str) -> Json:
    is_moment, direction = reaction_component(reaction, quantity)
    joint = next(j for j in trees.model.joints if j.name == reaction.joint)
    return {
        "kind": "reaction", "joint": joint.name, "follower": joint.follower,
        "point": trees.all(joint.at if joint.to is None else joint.to), "body": reaction.body, "direction": trees.all(direction),
        "moment": is_moment,
    }  # fmt: skip


def _joint_value(trees: Trees, output: Output, joint: Joint, topology: Topology) -> Json:
    if joint in topology.cuts:
        rates = {rate_name(coordinate): coordinate for coordinate in COORDINATES[joint.kind]}
        cut = describe_cut_coordinate(trees, topology, joint, rates.get(output.quantity, output.quantity))
        return {"kind": "cut_rate" if output.quantity in rates else "cut_position", "cut": cut}
    body = next(t.child for t in topology.tree if t.joint.name == joint.name)
    coordinates = COORDINATES[joint.kind]
    if output.quantity in coordinates:
        return {"kind": "joint_position", "body": body, "index": coordinates.index(output.quantity)}
    return {"kind": "joint_rate", "body": body, "index": SPEEDS[joint.kind].index(output.quantity)}
