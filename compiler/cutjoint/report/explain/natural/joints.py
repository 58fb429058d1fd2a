"""What joints share, and the constraints of what sharing does not settle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cutjoint.formulate.directions import tangents
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.needs import ANGLES, angle_axes
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.model.geometry import GLOBAL_AXES
from cutjoint.model.records import COORDINATES, Joint, JointKind, Vector
from cutjoint.report.explain.groups import Counterparts, group
from cutjoint.report.explain.joints import coordinate_symbol, explain_guide
from cutjoint.report.explain.latex import matrix, text, variants
from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.natural.forms import clean_place
from cutjoint.report.explain.natural.shapes import left_out_note
from cutjoint.report.explain.views import Chapter, Entry, code, make_table, with_others

_NOTES = (
    "Bodies that share nodes need no equation for these. What a joint asks for beyond that are products of nodes or combinations, over "
    "the way $d$ from the joint's point of the base to that of the follower, its axis $a$ in the base, and directions $t_1$ and $t_2$ of "
    "the base across $a$. The tables have the directions in the design position.",
)

_DISTANCE_NOTE = "$l$ is the length of $d$ in the design position."

_ANGLE_NOTE = (
    "An angle is measured from $b_1$ towards $b_2$, two directions of one body, to the direction $f$ of the other; the residual is the "
    "sine of what it is off."
)


@dataclass(frozen=True, kw_only=True)
class Equation:
    """An equation of a joint: its residual over directions, which are given in the design position."""

    name: str
    residual: str
    directions: tuple[tuple[str, Vector], ...]


def joint_equations(layout: Layout, joint: Joint) -> tuple[Equation, ...]:
    """The equations of a joint in their order: open ones, measured angles, guides."""
    measured = [name for element, name in layout.angles if element == joint.name]
    guided = COORDINATES[joint.kind] if joint.guide is not None else ()
    return (
        *(_open(joint) if joint.name not in layout.idle else ()),
        *(_angle(joint, name, name) for name in measured),
        *(_guided(joint, name) for name in guided),
    )


def _open(joint: Joint) -> Iterator[Equation]:
    match joint.kind:
        case JointKind.UNIVERSAL:
            axes = (("a_b", joint.axes[0]), ("a_f", joint.axes[1]))
            yield Equation(name="angle", residual=r"a_b \cdot a_f", directions=axes)
        case JointKind.PRISMATIC | JointKind.CYLINDRICAL | JointKind.POINT_ON_LINE:
            yield from _across(joint)
        case JointKind.SCREW:
            yield from _across(joint)
            yield Equation(name="advance", residual=r"d \cdot a - h \varphi", directions=(("a", joint.axes[0]),))
        case JointKind.PLANAR:
            yield Equation(name="height", residual=r"d \cdot a", directions=(("a", joint.axes[0]),))
        case JointKind.DISTANCE:
            yield Equation(name="length", residual=r"\frac{d \cdot d - l^2}{2 l}", directions=())


def _tangents(joint: Joint) -> tuple[tuple[str, Vector], tuple[str, Vector]]:
    first, second = (tuple(t) for t in tangents(joint, joint.axes[0]))
    return ("t_1", first), ("t_2", second)


def _across(joint: Joint) -> Iterator[Equation]:
    for i, (symbol, direction) in enumerate(_tangents(joint), 1):
        yield Equation(name=f"across_{i}", residual=rf"d \cdot {symbol}", directions=((symbol, direction),))


def _angle(joint: Joint, name: str, coordinate: str) -> Equation:
    """The equation of an angle, a coordinate or a guide; the directions of angle_1 are marked with 1."""
    mark = coordinate.partition("_")[2]
    b_1, b_2, f = (f"b_{{{mark}1}}", f"b_{{{mark}2}}", f"f_{{{mark}}}") if mark else ("b_1", "b_2", "f")
    angle = coordinate_symbol(coordinate)
    _, first, second, _, other = angle_axes(joint, coordinate)
    residual = rf"{f} \cdot ({b_2} \cos {angle} - {b_1} \sin {angle})"
    return Equation(name=name, residual=residual, directions=((b_1, first), (b_2, second), (f, other)))


def _guided(joint: Joint, coordinate: str) -> Equation:
    name, symbol = f"{coordinate}_guide", coordinate_symbol(coordinate)
    if joint.kind is JointKind.SCREW:
        return Equation(name=name, residual=rf"{symbol} - {symbol}(t)", directions=())
    if coordinate in ANGLES.get(joint.kind, ()):
        return _angle(joint, name, coordinate)
    if joint.kind is JointKind.PLANAR:
        along = _tangents(joint)[coordinate.endswith("2")]
    else:
        along = ("a", GLOBAL_AXES["xyz".index(coordinate)] if joint.kind is JointKind.FREE else joint.axes[0])
    return Equation(name=name, residual=rf"d \cdot {along[0]} - {symbol}", directions=(along,))


def explain_joint_constraints(d: Derivation, counterparts: Sequence[Counterparts]) -> Chapter:
    """All joints with what they share, then those with equations, by kind."""
    joints = {j.name: j for j in d.model.joints}
    equations = {j.name: found for j in d.model.joints if (found := joint_equations(d.full.layout, j))}
    residuals = {name: tuple(e.residual for e in found) for name, found in equations.items()}
    kinds = {name: (joints[name].kind, residuals[name]) for name in equations}
    groups = group(list(equations), counterparts, kinds.__getitem__, residuals.__getitem__)
    entries = tuple(_entry(d, [joints[name] for name in names], [equations[name] for name in names]) for names in groups)
    return Chapter(title="Constraints of joints", notes=_NOTES, formulas=(), entries=(_shared(d), *entries))


def _shared(d: Derivation) -> Entry:
    layout = d.full.layout
    rows = [
        (code(j.name), j.span.place, j.kind.value, code(j.base), code(j.follower), _what(layout, j),
         code(e.name for e in joint_equations(layout, j)) or "none")
        for j in d.model.joints
    ]  # fmt: skip
    headings = ("joint", "line", "kind", "base", "follower", "shared", "equations")
    return Entry(title="What joints share", notes=tuple(_peculiarities(d)), formulas=(), table=make_table(headings, rows))


def _peculiarities(d: Derivation) -> Iterator[str]:
    joints, layout = d.model.joints, d.full.layout
    idle = [j.name for j in joints if j.name in layout.idle]
    if idle:
        yield f"These universal joints only keep a rod without attitude from turning about itself, and have no equation: {code(idle)}."
    guided = [j.name for j in joints if j.guide is not None]
    if guided:
        yield f"Guided, so that equations hold them to functions of time: {code(guided)}."
    distances = [j.name for j in joints if j.kind is JointKind.DISTANCE]
    if distances:
        yield f"The rods of these distance joints are an equation each, and have no coordinates: {code(distances)}."


def _what(layout: Layout, joint: Joint) -> str:
    if layout.group_of[joint.base] == layout.group_of[joint.follower]:
        return "everything: rigidly joined"
    return code(n.name for n in shared_nodes(layout, joint)) or "nothing"


def shared_nodes(layout: Layout, joint: Joint) -> tuple[Node, ...]:
    """The nodes at the joint's point and along its directions that both bodies carry."""
    places: list[tuple[NodeKind, Vector]] = []
    if joint.kind in (JointKind.SPHERICAL, JointKind.UNIVERSAL, JointKind.REVOLUTE):
        places.append((NodeKind.POINT, joint.at))
    if joint.kind in (JointKind.REVOLUTE, JointKind.CYLINDRICAL, JointKind.SCREW, JointKind.PLANAR):
        places.append((NodeKind.VECTOR, joint.axes[0]))
    if joint.kind is JointKind.PRISMATIC:
        places += [(NodeKind.VECTOR, axis) for axis in GLOBAL_AXES]
    pairs = [[layout.find(body, kind, place) for body in (joint.base, joint.follower)] for kind, place in places]
    return tuple(base for base, follower in pairs if base is not None and base is follower)


def _entry(d: Derivation, joints: Sequence[Joint], equations: Sequence[Sequence[Equation]]) -> Entry:
    first, names = joints[0], [e.name for e in equations[0]]
    notes = [f"Equations: {code(names)}.", *left_out_note(d, [f"{j.name}.{name}" for j in joints for name in names])]
    notes += [_DISTANCE_NOTE] if first.kind is JointKind.DISTANCE else []
    notes += [_ANGLE_NOTE] if any("cos" in e.residual for e in equations[0]) else []
    residual = rf"\Phi = {matrix([e.residual] for e in equations[0])}"
    guides = variants([j.name for j in joints], [explain_guide(j, d.full) for j in joints])
    directions = [dict(pair for e in own for pair in e.directions) for own in equations]
    pitch = ["pitch $h$"] if first.kind is JointKind.SCREW else []
    headings = ("joint", "line", "base", "follower", "point", *pitch, *(f"${symbol}$" for symbol in directions[0]))
    rows = [
        (code(j.name), j.span.place, code(j.base), code(j.follower), _ends(j, d), *([text(j.pitch, d.model)] if pitch else []),
         *(clean_place(direction, d.model) for direction in own.values()))
        for j, own in zip(joints, directions, strict=True)
    ]  # fmt: skip
    return Entry(
        title=f"{first.kind.value.capitalize().replace('_', ' ')}: {with_others([j.name for j in joints])}", notes=tuple(notes),
        formulas=(residual, *guides), table=make_table(headings, rows),
    )  # fmt: skip


def _ends(joint: Joint, d: Derivation) -> str:
    return clean_place(joint.at, d.model) + (f" to {clean_place(joint.to, d.model)}" if joint.to is not None else "")
