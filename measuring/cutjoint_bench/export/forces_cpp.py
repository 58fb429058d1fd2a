"""The forces of a mechanism as C++, for peers that are programs in C++: what forces.hpp says, and the headers beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import sympy

from cutjoint.elements.interaction import Point
from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.emit.names import unique
from cutjoint.formulate.inputs import TIME
from cutjoint.model.records import COORDINATES, GROUND, Force, Scalar, Scene, Vector
from cutjoint.run.roads import Piece, road_pieces
from cutjoint_bench.export.laws import Numbers, Triple, expression
from cutjoint_bench.export.printing import environment, vector
from cutjoint_bench.export.records import Mechanism

#: The template's view of a part of the header.
View: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Term:
    """A function of forces.hpp that belongs to a coordinate of a tree joint: a joint force's law, or a guide."""

    function: str
    joint: str
    index: int


@dataclass(frozen=True, kw_only=True)
class Forces:
    """The header's text and what a peer takes from it.

    ``bodies`` are the C++ names of the indices of the rigid bodies, in their order.  ``joint_forces`` are functions of the model's
    coordinate, its rate and time, ``guides`` functions of time that give a coordinate, its rate and its acceleration.
    """

    text: str
    bodies: Mapping[str, str]
    joint_forces: tuple[Term, ...]
    guides: tuple[Term, ...]


def write_forces(mechanism: Mechanism, numbers: Numbers, scene: Scene) -> Forces:
    """The header with the forces on the bodies, the laws of joint forces, and the guides that move."""
    bodies, roads = body_names(mechanism), _roads(mechanism, numbers, scene)
    joint_forces, guides = _joint_forces(mechanism, numbers), list(_guides(mechanism))
    writer = _Writer(mechanism, numbers, bodies, {radius: road["name"] for radius, road in roads.items()})
    text = environment().get_template("forces.hpp.jinja").render(
        name=mechanism.name, bodies=list(bodies.values()), roads=list(roads.values()), joint_forces=joint_forces, guides=guides,
        forces=[{"name": f.name, "call": writer.call(f)} for f in mechanism.forces if not f.joint_of],
    )  # fmt: skip
    return Forces(text=text, bodies=bodies, joint_forces=_terms(joint_forces), guides=_terms(guides))


def body_names(mechanism: Mechanism) -> dict[str, str]:
    """A C++ name for the index of each rigid body."""
    taken: set[str] = set()
    return {body.name: unique(f"body_{body.name.replace('.', '_')}", taken) for body in mechanism.bodies}


@dataclass(frozen=True)
class _Writer:
    """Writes the statement of one force; ``roads`` are names by the radius of the wheels."""

    mechanism: Mechanism
    numbers: Numbers
    bodies: Mapping[str, str]
    roads: Mapping[float, str]

    def call(self, force: Force) -> str:
        match force.interaction:
            case LineForce() as how:
                law = self.law(force.expressions[0], how.position)
                return _call("point_spring", *self.point(how.start, force), *self.point(how.end, force), law)
            case AxisForce() as how:
                base = (*self.point(how.origin, force), self.direction(how.axis.body(force), how.axis.of(force)))
                return _call("axial_force", *base, *self.point(how.point, force), self.law(force.expressions[0], how.position))
            case Compliance() as how:
                ends = ((*self.point(end, force), self.axes(end.body(force), how.frame.of(force))) for end in (how.base, how.follower))
                return _call("bushing", *(text for end in ends for text in end), self.six_laws(force.expressions))
            case Wrench():
                return self.load(force)
            case RoadContact() as how:
                return self.wheel(force, how)
        raise AssertionError(force)

    def wheel(self, tyre: Any, how: RoadContact) -> str:
        constants = {name: self.numbers.number(value) for name, value in tyre.constants.items()}
        data = ", ".join(f".{name} = {constants[name]!r}" for name in _TYRE)
        wheel = (*self.point(how.centre, tyre), self.direction(how.axis.body(tyre), how.axis.of(tyre)))
        return _call("tyre", *wheel, f"TyreData{{{data}}}", self.roads[constants["radius"]])

    def point(self, point: Point, force: Force) -> tuple[str, str]:
        """The body of a point and its arm there."""
        return self.at(point.body(force), point.of(force))

    def at(self, body: str, point: Vector) -> tuple[str, str]:
        """A body and the arm of one of its points."""
        place = self.mechanism.places[body].point(self.numbers.triple(point))
        return self.side(body), vector(arm(self.mechanism, self.mechanism.places[body].of, place))

    def side(self, body: str) -> str:
        of = self.mechanism.places[body].of
        return "ground" if of == GROUND else f"side({self.bodies[of]})"

    def direction(self, body: str, direction: Vector) -> str:
        return vector(self.mechanism.places[body].direction(self.numbers.triple(direction)))

    def axes(self, body: str, axes: Sequence[Vector]) -> str:
        return f"{{{', '.join(self.direction(body, axis) for axis in axes)}}}"

    def law(self, law: Scalar, position: str) -> str:
        return _function(["double " + position, "double rate"], "double", expression(self.numbers.law(law)))

    def six_laws(self, laws: Sequence[Scalar]) -> str:
        """The laws of a bushing, each over its own place in the arrays ``position`` and ``rate``."""
        texts = [
            expression(_renamed(self.numbers.law(law), {name: f"{name}[{i}]" for name in ("position", "rate")}))
            for i, law in enumerate(laws)
        ]
        six = "std::array<double, 6>"
        return _function([f"const {six}& position", f"const {six}& rate"], six, f"{six}{{{', '.join(texts)}}}")

    def load(self, load: Any) -> str:
        laws = [expression(_renamed(self.numbers.law(law), _MEMBERS)) for law in load.components]
        variables = ["Vector w"] if load.point is None else ["Vector place", "Vector velocity"]
        name, body = ("torque", [self.side(load.body)]) if load.point is None else ("load", [*self.at(load.body, load.point)])
        law = _function(variables, "Vector", f"{{{', '.join(laws)}}}")
        if load.has_frame:
            return _call(f"body_{name}", *body, self.axes(load.body, _GLOBAL), law)
        return _call(name, *body, law)


def arm(mechanism: Mechanism, of: str, point: Triple) -> Triple:
    """The way to a point at the start from the centre of mass of a rigid body; on the ground the point itself."""
    centre = next((b.centre for b in mechanism.bodies if b.name == of), (0.0, 0.0, 0.0))
    x, y, z = (p - c for p, c in zip(point, centre, strict=True))
    return x, y, z


def _roads(mechanism: Mechanism, numbers: Numbers, scene: Scene) -> dict[float, View]:
    """The roads by the radius of the wheels on them."""
    radii = radii_on_road(mechanism, numbers)
    return {radius: _road(f"road_{i}", scene, radius) for i, radius in enumerate(radii)}


def radii_on_road(mechanism: Mechanism, numbers: Numbers) -> Iterable[float]:
    """The radii of the wheels, each once."""
    tyres: Iterable[Any] = (force for force in mechanism.forces if force.has_road)
    return dict.fromkeys(numbers.number(tyre.constants["radius"]) for tyre in tyres)


def _road(name: str, scene: Scene, radius: float) -> View:
    tracks = {side: [_piece(p) for p in pieces] for side, pieces in road_pieces(scene.road, radius).items()}
    return {"name": name, "disc": "true" if scene.road.contact == "disc" else "false", **tracks}


def _piece(piece: Piece) -> str:
    return f"{{Piece::{piece.kind}, {', '.join(repr(float(x)) for x in (piece.start, piece.a, piece.b, piece.c))}}}"


def _joint_forces(mechanism: Mechanism, numbers: Numbers) -> list[View]:
    """Forces on coordinates that move freely; one on a guided or welded joint moves nothing."""
    kinds = {joint.name: joint.kind for joint in mechanism.tree if not joint.guide}
    forces = [f for f in mechanism.forces if f.joint_of in kinds]
    return [
        {
            "function": f"joint_force_{i}", "name": f.name, "joint": f.joint_of, "coordinate": f.coordinate_of,
            "index": COORDINATES[kinds[f.joint_of]].index(f.coordinate_of), "law": expression(numbers.law(f.expressions[0])),
        }
        for i, f in enumerate(forces)
    ]  # fmt: skip


def _guides(mechanism: Mechanism) -> Iterator[View]:
    """The guides that move, with their first two rates."""
    guides = [(joint, i, guide) for joint in mechanism.tree for i, guide in enumerate(joint.guide)]
    for number, (joint, i, guide) in enumerate(guides):
        laws = [expression(sympy.diff(guide, TIME, order)) for order in range(3)]
        coordinate = COORDINATES[joint.kind][i]
        yield {"function": f"guide_{number}", "joint": joint.name, "index": i, "coordinate": coordinate, "laws": laws}


def _terms(views: Sequence[View]) -> tuple[Term, ...]:
    return tuple(Term(**{field.name: view[field.name] for field in fields(Term)}) for view in views)


_GLOBAL: Sequence[Vector] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
_TYRE = ("radius", "stiffness", "spin_inertia", "A0", "A1", "A2", "A3", "A4", "B1", "B3", "B4", "SN", "AF1", "AF2")

#: The variables of loads as members of vectors.
_MEMBERS: Mapping[str, str] = {
    f"{prefix}{axis}": f"{vector}.{axis}" for prefix, vector in (("", "place"), ("v", "velocity"), ("w", "w")) for axis in "xyz"
}


def _call(name: str, *arguments: str) -> str:
    return f"{name}({', '.join(arguments)});"


def _function(parameters: Sequence[str], result: str, value: str) -> str:
    listed = ", ".join(f"[[maybe_unused]] {parameter}" for parameter in parameters)
    return f"[&]({listed}) -> {result} {{ return {value}; }}"


def _renamed(law: Scalar, names: Mapping[str, str]) -> Scalar:
    """A law with other text for its variables."""
    return law.xreplace({sympy.Symbol(name, real=True): sympy.Symbol(text) for name, text in names.items()})
