"""The nodes that joints share, and the equations of bodies and joints that sharing does not replace, as they are computed."""

from collections.abc import Iterator

from cutjoint.formulate.natural.joint_rows import joint_rows
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.kernels.joints import direction_of
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.records import Joint, Vector
from cutjoint.report.explain.blocks import print_residuals
from cutjoint.report.explain.forces import explain_gears
from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.views import Chapter, Entry, code, line_of, make_table

_NOTES = (
    "Bodies keep the lengths and angles of their bases, and joints what nodes that bodies share do not settle; words are nodes, numbers "
    "the design position. The equations of bodies are named after the ends of the ways in their bases.",
)


def explain_constraints(d: Derivation) -> Chapter:
    """All joints with their shared nodes, then all equations, then the gears."""
    spans = d.model.constraint_spans
    rows = [
        (code(f"{c.element}.{name}" for name in names), spans[c.element].place, rf"$\Phi = {residual}$")
        for c in d.full.constraints
        for names, residual in print_residuals(c.residual, c.names, d.model)
    ]
    left_out = [name for name in d.full.equation_names if not d.is_held(name)]
    notes = (f"Left out, since others imply them: {code(left_out)}.",) if left_out else ()
    equations = Entry(title="Equations", notes=notes, formulas=(), table=make_table(("equation", "line", "residual"), rows))
    return Chapter(title="Constraints", notes=_NOTES, formulas=(), entries=(_shared(d), equations, *explain_gears(d.model)))


def _shared(d: Derivation) -> Entry:
    layout = d.full.layout
    rows = [
        (code(j.name), line_of(j), j.kind, code(j.base), code(j.follower), _what(layout, j),
         code(row.name for row in joint_rows(layout, j)) or "none")
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
    if element.constrains_attitude:
        places += [(NodeKind.VECTOR, axis) for axis in GLOBAL_AXES]
    pairs = [[layout.find(body, kind, place) for body in (joint.base, joint.follower)] for kind, place in places]
    return tuple(base for base, follower in pairs if base is not None and base is follower)
