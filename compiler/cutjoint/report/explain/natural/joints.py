"""The points and directions that joints share, and the constraints that sharing does not replace."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy

from cutjoint.elements.joint import Direction, End, JointDisplacement
from cutjoint.formulate.natural.joint_rows import AngleRow, Arm, JointRow, SumRow, Term, joint_rows
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.kernels.joints import direction_of
from cutjoint.model.geometry import GLOBAL_AXES
from cutjoint.model.records import Joint, Vector
from cutjoint.report.explain.forces import explain_gears
from cutjoint.report.explain.joints import coordinate_symbol, explain_guide
from cutjoint.report.explain.latex import matrix, text, variants
from cutjoint.report.explain.natural.derivation import Derivation, clean_place
from cutjoint.report.explain.natural.shapes import left_out_note
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others

_NOTES = (
    "Bodies that share nodes need no equation for these. What a joint asks for beyond that are products of nodes or combinations, over "
    "the way $d$ from the joint's point of the base to that of the follower, its axis $a$ in the base, and directions $t_1$ and $t_2$ of "
    "the base across $a$. The tables have the directions in the design position.",
)

_DISTANCE_NOTE = "$l$ is the length of $d$ in the design position."

_MARK_NOTE = "Directions with a mark are those of the follower."

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
    return tuple(_equation(joint, row) for row in joint_rows(layout, joint))


def _equation(joint: Joint, row: JointRow) -> Equation:
    match row:
        case SumRow():
            return _sum(joint, row)
        case AngleRow():
            return _angle(joint, row)
    symbol = coordinate_symbol(joint.element, row.coordinate)
    return Equation(name=row.name, residual=rf"{symbol} - {symbol}(t)", directions=())


def _sum(joint: Joint, row: SumRow) -> Equation:
    if row.constant is not None:
        return Equation(name=row.name, residual=r"\frac{d \cdot d - l^2}{2 l}", directions=())
    arms = dict.fromkeys(f for term in row.terms for f in (term.left, term.right) if isinstance(f, Arm))
    residual = " + ".join(_term(joint, term) for term in row.terms).replace("+ - ", "- ").replace("+ -", "- ")
    if row.pitch is not None:
        residual += rf" - h {coordinate_symbol(joint.element, *joint.element.coordinates)}"
    if row.guide is not None:
        residual += f" - {coordinate_symbol(joint.element, row.name.removesuffix('_guide'))}"
    return Equation(name=row.name, residual=residual, directions=tuple((_symbol(joint, arm), arm.place) for arm in arms))


def _term(joint: Joint, term: Term) -> str:
    weight = "" if term.weight == 1 else f"{sympy.latex(term.weight)} "
    return rf"{weight}{_symbol(joint, term.left)} \cdot {_symbol(joint, term.right)}"


def _symbol(joint: Joint, factor: Arm | JointDisplacement) -> str:
    """The LaTeX of a factor: the way, the axis, a direction across it."""
    if isinstance(factor, JointDisplacement):
        return "d"
    direction = factor.carried.direction
    if direction in (Direction.ACROSS_1, Direction.ACROSS_2):
        mark = "'" if factor.carried.end is End.FOLLOWER else ""
        return f"t_{1 + (direction is Direction.ACROSS_2)}{mark}"
    return "a" if len(joint.axes) == 1 else f"a_{factor.carried.end[0]}"


def _angle(joint: Joint, row: AngleRow) -> Equation:
    """The equation of an angle, a coordinate or a guide; the directions of angle_1 are marked with 1."""
    mark = row.coordinate.partition("_")[2]
    b_1, b_2, f = (f"b_{{{mark}1}}", f"b_{{{mark}2}}", f"f_{{{mark}}}") if mark else ("b_1", "b_2", "f")
    angle = coordinate_symbol(joint.element, row.coordinate)
    residual = rf"{f} \cdot ({b_2} \cos {angle} - {b_1} \sin {angle})"
    arms = ((b_1, row.first), (b_2, row.second), (f, row.pointer))
    return Equation(name=row.name, residual=residual, directions=tuple((symbol, arm.place) for symbol, arm in arms))


def explain_joint_constraints(d: Derivation, counterparts: Sequence[Counterparts]) -> Chapter:
    """All joints with their shared nodes, then the joints with equations, by kind, then the gears."""
    joints = {j.name: j for j in d.model.joints}
    equations = {j.name: found for j in d.model.joints if (found := joint_equations(d.full.layout, j))}
    residuals = {name: tuple(e.residual for e in found) for name, found in equations.items()}
    kinds = {name: (joints[name].kind, residuals[name]) for name in equations}
    groups = group(list(equations), counterparts, kinds.__getitem__, residuals.__getitem__)
    entries = tuple(_entry(d, [joints[name] for name in names], [equations[name] for name in names]) for names in groups)
    return Chapter(title="Constraints of joints", notes=_NOTES, formulas=(), entries=(_shared(d), *entries, *explain_gears(d.model)))


def _shared(d: Derivation) -> Entry:
    layout = d.full.layout
    rows = [
        (code(j.name), line_of(j), j.kind, code(j.base), code(j.follower), _what(layout, j),
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
    distances = [j.name for j in joints if j.to is not None]
    if distances:
        yield f"The rods of these distance joints are an equation each, and have no coordinates: {code(distances)}."


def _what(layout: Layout, joint: Joint) -> str:
    if layout.group_of[joint.base] == layout.group_of[joint.follower]:
        return "everything: rigidly joined"
    return code(n.name for n in shared_nodes(layout, joint)) or "nothing"


def shared_nodes(layout: Layout, joint: Joint) -> tuple[Node, ...]:
    """The nodes at the joint's point and along its directions that both bodies carry."""
    places: list[tuple[NodeKind, Vector]] = []
    element = joint.element
    if element.shares_point:
        places.append((NodeKind.POINT, joint.at))
    if element.shared_direction is not None:
        places.append((NodeKind.VECTOR, direction_of(joint, element.shared_direction)))
    if element.keeps_directions:
        places += [(NodeKind.VECTOR, axis) for axis in GLOBAL_AXES]
    pairs = [[layout.find(body, kind, place) for body in (joint.base, joint.follower)] for kind, place in places]
    return tuple(base for base, follower in pairs if base is not None and base is follower)


def _entry(d: Derivation, joints: Sequence[Joint], equations: Sequence[Sequence[Equation]]) -> Entry:
    first, names = joints[0], [e.name for e in equations[0]]
    notes = [f"Equations: {code(names)}.", *left_out_note(d, [f"{j.name}.{name}" for j in joints for name in names])]
    notes += [_DISTANCE_NOTE] if first.to is not None else []
    notes += [_MARK_NOTE] if any("'" in e.residual for e in equations[0]) else []
    notes += [_ANGLE_NOTE] if any("cos" in e.residual for e in equations[0]) else []
    residual = rf"\Phi = {matrix([e.residual] for e in equations[0])}"
    guides = variants([j.name for j in joints], [explain_guide(j, d.full) for j in joints])
    directions = [dict(pair for e in group for pair in e.directions) for group in equations]
    pitch = ["pitch $h$"] if first.pitch is not None else []
    headings = ("joint", "line", "base", "follower", "point", *pitch, *(f"${symbol}$" for symbol in directions[0]))
    rows = [
        (code(j.name), line_of(j), code(j.base), code(j.follower), _ends(j, d), *([text(j.pitch, d.model)] if pitch else []),
         *(clean_place(direction, d.model) for direction in by_symbol.values()))
        for j, by_symbol in zip(joints, directions, strict=True)
    ]  # fmt: skip
    return Entry(
        title=f"{first.kind.capitalize().replace('_', ' ')}: {with_others([j.name for j in joints])}", notes=tuple(notes),
        formulas=(residual, *guides), table=make_table(headings, rows),
    )  # fmt: skip


def _ends(joint: Joint, d: Derivation) -> str:
    return clean_place(joint.at, d.model) + (f" to {clean_place(joint.to, d.model)}" if joint.to is not None else "")
