"""The numbers of a model's elements, as the file has them: a table for each kind of element."""

from collections.abc import Iterator, Mapping, Sequence

from cutjoint.elements.interaction import Carrier, Frame
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.natural.nodes import NodeKind
from cutjoint.formulate.records import Equations
from cutjoint.model.records import Force, Joint, Model
from cutjoint.report.explain.views import Entry, code, line_of, make_table, number, place, text


def explain_elements(equations: Equations) -> Iterator[Entry]:
    """The tables; those without rows are not printed."""
    model, scene = equations.topology.model, equations.scene
    bodies = [
        (code(b.name), line_of(b), text(b.mass, model), place(b.centre_of_mass, model), place(b.inertia, model)) for b in model.bodies
    ]
    yield _entry("Bodies", ("body", "line", "mass", "centre of mass", "inertia xx, yy, zz, xy, xz, yz"), bodies)
    joints = [
        (code(j.name), line_of(j), j.kind, code(j.base), code(j.follower), _ends(j, model), _axes(j, model),
         code(j.element.coordinates) + (", guided" if j.guide is not None else ""))
        for j in model.joints
    ]  # fmt: skip
    yield _entry("Joints", ("joint", "line", "kind", "base", "follower", "point", "axes", "coordinates"), joints)
    gears = [(code(g.name), line_of(g), code(f"{end.joint}.{end.name}" for end in (g.first, *g.coordinates[1:]))) for g in model.gears]
    yield _entry("Gears", ("gear", "line", "coordinates"), gears)
    forces = [
        (code(f.name), line_of(f), f.element.kind + ("" if is_active(f, scene) else ", switched off"), *_where(f, model))
        for f in model.forces
    ]  # fmt: skip
    yield _entry("Forces", ("force", "line", "kind", "on", "places"), forces)
    controllers = [(code(c.name), line_of(c), number(c.offset), number(c.every)) for c in model.controllers]
    yield _entry("Controllers", ("controller", "line", "first sample, s", "period, s"), controllers)
    if isinstance(equations, LagrangianEquations):
        nodes = [
            (code(n.name), n.kind.value, "" if n.kind is NodeKind.ANGLE else place(n.place, model)) for n in equations.layout.coordinates
        ]
        yield _entry("Natural coordinates", ("coordinate", "kind", "design position"), nodes)


def _entry(title: str, headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Entry:
    return Entry(title=title, table=make_table(headings, rows))


def _ends(joint: Joint, model: Model) -> str:
    return place(joint.at, model) + (f" to {place(joint.to, model)}" if joint.to is not None else "")


def _axes(joint: Joint, model: Model) -> str:
    pitch = f", pitch {text(joint.pitch, model)}" if joint.pitch is not None else ""
    return "; ".join(place(axis, model) for axis in joint.axes) + pitch


def _where(force: Force, model: Model) -> tuple[str, str]:
    """The bodies or the joint of a force, and its points and directions."""
    if force.joint_of:
        return code(f"{force.joint_of}.{force.coordinate_of}"), ""
    places: Mapping[str, str] = {
        p.field: "; ".join(place(axis, model) for axis in p.of(force)) if isinstance(p, Frame) else place(p.of(force), model)
        for p in force.places
    }  # fmt: skip
    bodies = code(getattr(force, carrier) for carrier in Carrier if hasattr(force, carrier))
    return bodies, ", ".join(f"{field} {where}" for field, where in places.items())
