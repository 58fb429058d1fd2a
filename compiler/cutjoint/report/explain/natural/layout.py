"""The points, directions and angles that are coordinates, and the nodes that follow from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cutjoint.elements.interaction import Frame, Point
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.model.records import GROUND, Force, Model, Vector
from cutjoint.report.explain.natural.derivation import Derivation, design_value, form_text
from cutjoint.report.explain.views import Chapter, Entry, code, make_table, plural

#: The span of a basis's nodes among a body's directions, by their number.
_DIRECTIONS = ("", "none", "of a line", "of a plane", "all")

_NOTES = (
    "A node is a point in m, a unit vector or an angle in rad. A body is spanned by up to four of them, its basis: $e_0$, a point, and "
    "further points and directions. Whatever else of the body there is to say is a linear combination of these with constant "
    "coefficients, which sum up to one over the points of a point, to zero over those of a direction.",
    "Bodies are laid out from the ground outwards. What a joint shares with a body laid out before comes first: a spherical joint and a "
    "universal one share a point, a revolute one a point and a direction, a cylindrical, a screw or a planar one a direction, a prismatic "
    "one all directions. Then come points and directions that joints, forces and outputs use, then unit vectors across these.",
    "A node is called after the joint, force or body that first asked for it, `axis` its direction, `across` a unit vector across the "
    "rest of a basis.",
)


def explain_layout(d: Derivation) -> Chapter:
    """The nodes: coordinates, constants, combinations; and every body's basis."""
    entries = (_coordinates(d), _bases(d), _combinations(d), _others(d), _constants(d))
    return Chapter(title="Layout", notes=_NOTES, formulas=(), entries=tuple(e for e in entries if e.table.rows))


def _coordinates(d: Derivation) -> Entry:
    layout, joints = d.full.layout, {node: joint for (joint, _), node in d.full.layout.angles.items()}
    rows = [
        (code(n.name), n.kind.value, f"joint {code(joints[n])}" if n in joints else _carriers(layout, n, d.model), design_value(n, d.model))
        for n in layout.coordinates
    ]  # fmt: skip
    title = f"{plural(len(d.full.coordinate_names), 'coordinate')}: {kinds(layout.coordinates)}"
    notes = ["Points and unit vectors have the components `x`, `y`, `z`."]
    if joints:
        notes.append("An angle is a coordinate because an output, a force or a screw uses it; an equation holds it.")
    return Entry(title=title, notes=tuple(notes), formulas=(), table=make_table(("coordinate", "kind", "carried by", "design value"), rows))


def kinds(nodes: Sequence[Node]) -> str:
    """The number of nodes of each kind, in words."""
    counts = [(sum(n.kind is kind for n in nodes), kind.value) for kind in NodeKind]
    return ", ".join(plural(count, noun) for count, noun in counts if count) or "none"


def _carriers(layout: Layout, node: Node, model: Model) -> str:
    groups = layout.carriers.get(node, set())
    return code(b for b in (GROUND, *(body.name for body in model.bodies)) if layout.group_of[b] in groups)


def _constants(d: Derivation) -> Entry:
    layout = d.full.layout
    nodes = [n for n in layout.nodes if n.body == GROUND]
    rows = [(code(n.name), n.kind.value, _carriers(layout, n, d.model), design_value(n, d.model)) for n in nodes]
    return Entry(
        title=f"Constants of the ground: {kinds(nodes)}", notes=(), formulas=(),
        table=make_table(("constant", "kind", "carried by", "value"), rows),
    )  # fmt: skip


def _combinations(d: Derivation) -> Entry:
    layout, model = d.full.layout, d.model
    nodes = [n for n in layout.nodes if n.parts is not None]
    rows = [
        (code(n.name), n.kind.value, code(n.body), form_text(n.parts or {}, model), _carriers(layout, n, model), design_value(n, model))
        for n in nodes
    ]  # fmt: skip
    return Entry(
        title=f"Combinations of a body's basis: {kinds(nodes)}", formulas=(),
        notes=("A body has more points and directions that joints share than its basis takes up; these are no coordinates.",),
        table=make_table(("node", "kind", "of", "combination", "carried by", "design value"), rows),
    )  # fmt: skip


def _bases(d: Derivation) -> Entry:
    groups = list(d.full.layout.groups.values())
    widest = max((len(g.basis) for g in groups), default=0)
    rows = [
        (code(b.name for b in d.bodies(g)), d.bodies(g)[0].span.place, *_cells([code(n.name) for n in g.basis], widest),
         _DIRECTIONS[len(g.basis)])
        for g in groups
    ]  # fmt: skip
    headings = ("body", "line", *(f"$e_{i}$" for i in range(widest)), "directions known")
    return Entry(title="Bases", notes=tuple(_peculiarities(d)), formulas=(), table=make_table(headings, rows))


def _cells(cells: Sequence[str], count: int) -> tuple[str, ...]:
    return (*cells, *[""] * (count - len(cells)))


def _peculiarities(d: Derivation) -> Iterator[str]:
    layout = d.full.layout
    if any(len(g.bodies) > 1 for g in layout.groups.values()):
        yield "Bodies that a fixed joint connects are one rigid body, and stand in one row."
    fast = [b.name for b in d.model.bodies if layout.group_of[b.name] == GROUND]
    if fast:
        yield f"Fixed to the ground, without coordinates: {code(fast)}."
    rods = [b.name for g in layout.groups.values() if len(g.basis) < 3 for b in d.bodies(g)]
    if rods:
        yield f"These have no attitude, since nothing asks for one, neither a mass off their line nor a joint or force: {code(rods)}."


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A point or direction of a body that a mass or a force has."""

    owner: str
    what: str
    body: str
    kind: NodeKind
    place: Vector


def _others(d: Derivation) -> Entry:
    """Points and directions of masses and forces that have no node of their own."""
    layout, model = d.full.layout, d.model
    forces = [f for f in model.forces if is_active(f, d.full.scene)]
    parts = [*_masses(model), *(part for f in forces for part in _parts(f))]
    rows = [
        (code(p.owner), p.what, code(p.body), form_text(form, model)) for p in parts
        if layout.group_of[p.body] != GROUND and layout.find(p.body, p.kind, p.place) is None
        and (form := layout.point(p.body, p.place) if p.kind is NodeKind.POINT else layout.direction(p.body, p.place))
    ]  # fmt: skip
    return Entry(
        title="Points and directions of masses and forces", formulas=(),
        notes=("Those that are no nodes, as combinations of their body's basis.",),
        table=make_table(("element", "what", "of", "combination"), rows),
    )  # fmt: skip


def _masses(model: Model) -> Iterator[_Part]:
    for body in model.bodies:
        if body.mass != 0:
            yield _Part(owner=body.name, what="centre of mass", body=body.name, kind=NodeKind.POINT, place=body.centre_of_mass)


def _parts(force: Force) -> Iterator[_Part]:
    places = [place for place in force.places if not isinstance(place, Frame)]
    fields = [place.field for place in places]
    for place in places:
        what = f"{place.field} of {place.carrier}" if fields.count(place.field) > 1 else place.field
        kind = NodeKind.POINT if isinstance(place, Point) else NodeKind.VECTOR
        yield _Part(owner=force.name, what=what, body=place.body(force), kind=kind, place=place.of(force))
