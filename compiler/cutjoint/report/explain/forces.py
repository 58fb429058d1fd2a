"""Every force's law, its partial derivatives, and how it acts, with a description for each kind; every gear's equation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy

from cutjoint.elements.force import (
    AxisForce,
    Carrier,
    Compliance,
    Frame,
    Interaction,
    LineForce,
    OnCoordinate,
    Place,
    Point,
    RoadContact,
    Wrench,
)
from cutjoint.elements.gear import NAMES, TEXT
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.records import Equations
from cutjoint.model.records import BodyLoad, Force, Gear, JointCoordinate, JointForce, LawForce, Model, Tyre
from cutjoint.report.explain import laws as tyre
from cutjoint.report.explain.latex import equations as print_equations
from cutjoint.report.explain.latex import place, text, variants
from cutjoint.report.explain.laws import RATE, differentiate, expand_polynomials, explain_law, law_symbols
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, make_table, with_others

Cells = tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class ForceDescription:
    """A force as the explanation shows it.

    ``actions`` are formulas of its action, ``laws`` formulas with its numbers; ``places`` and ``constants`` are pairs of a heading and a
    cell, the constants those that forces of a kind may share.
    """

    title: str
    notes: tuple[str, ...]
    actions: tuple[str, ...]
    laws: tuple[str, ...]
    places: Cells
    constants: Cells

    @property
    def kind(self) -> tuple[str, ...]:
        """The key of forces that are explained together."""
        return self.title, *self.notes, *self.actions


def describe(force: Force, model: Model) -> ForceDescription:
    """The description of a force."""
    how = force.interaction
    return DESCRIPTIONS[type(how)](force, how, model)


def _title(force: Force) -> str:
    return force.element.kind.replace("_", " ").capitalize()


def _where(force: Force, model: Model) -> Cells:
    """The bodies of a force, its points, and its directions."""
    bodies = [(carrier.value, code(getattr(force, carrier))) for carrier in Carrier if hasattr(force, carrier)]
    places = sorted({p.field: p for p in force.places}.values(), key=lambda place: not isinstance(place, Point))
    return *bodies, *((place.field, _cell(place, force, model)) for place in places)


def _cell(where: Place, force: Force, model: Model) -> str:
    return "; ".join(place(axis, model) for axis in where.of(force)) if isinstance(where, Frame) else place(where.of(force), model)


def _on_both(sign: str, force: str, moment: str) -> str:
    """A wrench on the follower, the opposite one on the base."""
    other = "+" if sign == "-" else "-"
    wrench = rf"\begin{{bmatrix}} {force} \cr {moment} \end{{bmatrix}}"
    return rf"Q_f \leftarrow Q_f {sign} {wrench}, \quad Q_b \leftarrow Q_b {other} {wrench}"


def _stretch(force: LawForce, how: LineForce, model: Model) -> ForceDescription:
    return ForceDescription(
        title=_title(force),
        notes=("$F$ is the tension between the start $p_s$, fixed in the base, and the end $p_e$, fixed in the follower.",),
        actions=(
            r"\ell = \lVert p_e - p_s \rVert, \quad n = (p_e - p_s) / \ell, \quad \dot \ell = n \cdot (v_e - v_s)",
            _on_both("-", "F n", r"p_e \times F n"),
        ),
        laws=explain_law("F", force.law, how.position, r"\ell", model), places=_where(force, model), constants=(),
    )  # fmt: skip


def _travel(force: LawForce, how: AxisForce, model: Model) -> ForceDescription:
    return ForceDescription(
        title=_title(force),
        notes=("$F$ pushes the follower's point $p$ along the axis $a$, which is fixed in the base like the origin $p_o$; both "
               "velocities are of the bodies at $p$.",),
        actions=(r"s = a \cdot (p - p_o), \quad \dot s = a \cdot (v_f - v_b)", _on_both("+", "F a", r"p \times F a")),
        laws=explain_law("F", force.law, how.position, "s", model), places=_where(force, model), constants=(),
    )  # fmt: skip


def _on_coordinate(force: JointForce, how: OnCoordinate, model: Model) -> ForceDescription:
    return ForceDescription(
        title=_title(force),
        notes=("$F$ joins the generalised force of the coordinate $z$ where the joint is eliminated; a guided joint follows its "
               "guide. Where the joint is cut, $z$ is measured, and $F$ acts along its direction, or about its axis, on both bodies.",),
        actions=(r"D e = b^T (Q_i - M_i d) + F",), laws=explain_law("F", force.law, how.position, "z", model),
        places=(("joint", code(force.joint)), ("coordinate $z$", code(force.coordinate))), constants=(),
    )  # fmt: skip


def _compliance(force: Force, how: Compliance, model: Model) -> ForceDescription:
    return ForceDescription(
        title=_title(force),
        notes=("$E$ holds the axes $e_k$ carried by the base, $G$ the axes $g_k$ carried by the follower; $d$ are the displacements along "
               r"and $\theta$ the small rotations about the former, both velocities are of the bodies at the follower's point $p$.",),
        actions=(
            r"S = E^T G, \quad d = E^T (p - p_b), \quad \theta = E^T \sum\nolimits_{k} e_k \times g_k / 2, \quad"
            r" T = (\text{tr} S \cdot \mathbf{1} - S) / 2",
            r"\dot d = E^T (v_f - v_b), \quad \dot \theta = T E^T (\omega_f - \omega_b)",
            _on_both("+", "E F", r"p \times E F + E T^T M"),
        ),
        laws=_six_laws(force, model), places=_where(force, model), constants=(),
    )  # fmt: skip


def _six_laws(force: Force, model: Model) -> tuple[str, ...]:
    """Six laws along axes and about them, each over one displacement or rotation, and the diagonals of their Jacobians."""
    position = sympy.Symbol("position", real=True)
    names = [f"{letter}_{{{axis}}}" for letter in ("d", r"\theta") for axis in "xyz"]
    mine = [(sympy.Symbol(f"position_{i}", real=True), sympy.Symbol(f"rate_{i}", real=True)) for i in range(6)]
    symbols = law_symbols(model)
    for (x, rate), name in zip(mine, names, strict=True):
        symbols |= {x: name, rate: rf"\dot {name}"}
    laws = [expand_polynomials(law).subs({position: x, RATE: r}) for law, (x, r) in zip(force.expressions, mine, strict=True)]
    formulas: list[str] = []
    for letter, place_of, part in (("F", "d", slice(0, 3)), ("M", r"\theta", slice(3, 6))):
        pairs = list(zip(laws[part], mine[part], strict=True))
        formulas += print_equations([
            (letter, sympy.Matrix([law for law, _ in pairs])),
            (rf"\partial {letter} / \partial {place_of}", sympy.diag(*(differentiate(law, x) for law, (x, _) in pairs))),
            (rf"\partial {letter} / \partial \dot {place_of}", sympy.diag(*(differentiate(law, r) for law, (_, r) in pairs))),
        ], symbols)  # fmt: skip
    return tuple(formulas)


_PLACE, _SPEED = (sympy.symbols(names, real=True) for names in ("x y z", "vx vy vz"))


def _load(force: BodyLoad, how: Wrench, model: Model) -> ForceDescription:
    axes = "the body's axes" if force.in_body else "global axes"
    at_point = f"A force at the body's point $p$, in {axes}; $r$ is that point's place, $v$ its velocity."
    notes = [f"A torque in {axes}." if force.point is None else at_point]
    if force.moving_only:
        notes.append("Absent while the equilibrium is sought.")
    turned = "R F" if force.in_body else "F"
    wrench = rf"0 \cr {turned}" if force.point is None else rf"{turned} \cr p \times {turned}"
    return ForceDescription(
        title="Torque" if force.point is None else _title(force), notes=tuple(notes),
        actions=(rf"Q \leftarrow Q + \begin{{bmatrix}} {wrench} \end{{bmatrix}}",), laws=_components(force, model),
        places=_where(force, model), constants=(),
    )  # fmt: skip


def _components(load: BodyLoad, model: Model) -> tuple[str, ...]:
    """The components and those of their Jacobians by place and velocity that are not zero."""
    symbols = law_symbols(model) | dict(zip(_SPEED, (f"v_{{{axis}}}" for axis in "xyz"), strict=True))
    F = sympy.Matrix(load.components)
    jacobians = ((r"\partial F / \partial r", F.jacobian(_PLACE)), (r"\partial F / \partial v", F.jacobian(_SPEED)))
    return print_equations([("F", F), *((name, J) for name, J in jacobians if not J.is_zero_matrix)], symbols)


def _contact(force: Tyre, how: RoadContact, model: Model) -> ForceDescription:
    letters = {"stiffness": "stiffness k", "radius": "radius R", "spin_inertia": "spin inertia I"}
    return ForceDescription(
        title=_title(force), notes=tyre.NOTES, actions=(*tyre.CONTACT, *tyre.explain_calspan(), tyre.ACTION), laws=(),
        places=_where(force, model),
        constants=tuple((letters.get(name, name), text(value, model)) for name, value in force.constants.items()),
    )  # fmt: skip


DESCRIPTIONS: Mapping[type[Interaction], Callable[..., ForceDescription]] = {
    LineForce: _stretch, AxisForce: _travel, Compliance: _compliance, Wrench: _load, OnCoordinate: _on_coordinate, RoadContact: _contact,
}  # fmt: skip


# Forces


def explain_forces(
    equations: Equations, counterparts: Sequence[Counterparts], description: Callable[[Force, Model], ForceDescription] = describe,
    notes: tuple[str, ...] = (),
) -> Chapter:  # fmt: skip
    """The forces that act in the scene, in the description of a formulation; those that are switched off are named."""
    model, scene = equations.topology.model, equations.scene
    forces = {f.name: f for f in model.forces if is_active(f, scene)}
    descriptions = {name: description(f, model) for name, f in forces.items()}
    groups = group(list(forces), counterparts, lambda name: descriptions[name].kind, lambda name: descriptions[name].laws)
    entries = [_entry([forces[n] for n in names], [descriptions[n] for n in names]) for names in groups]
    off = [f for f in model.forces if f.name not in forces]
    if off:
        rows = make_table(("force", "line"), ((code(f.name), f.span.place) for f in off))
        entries.append(Entry(title="Switched off", notes=("Not in this scene's equations.",), formulas=(), table=rows))
    return Chapter(title="Forces", notes=notes if model.forces else ("None but gravity.",), formulas=(), entries=tuple(entries))


def _entry(forces: Sequence[Force], descriptions: Sequence[ForceDescription]) -> Entry:
    first = descriptions[0]
    shared = [item for item in first.constants if all(item in m.constants for m in descriptions)]
    constants = [[item for item in m.constants if item not in shared] for m in descriptions]
    notes = [f"Constants: {', '.join(f'{name} = {value}' for name, value in shared)}."] if shared else []
    headings = ("force", "line", *(name for name, _ in (*first.places, *constants[0])))
    rows = [
        (code(f.name), f.span.place, *(cell for _, cell in (*m.places, *numbers)))
        for f, m, numbers in zip(forces, descriptions, constants, strict=True)
    ]  # fmt: skip
    names = [f.name for f in forces]
    return Entry(
        title=f"{first.title}: {with_others(names)}", notes=(*first.notes, *notes),
        formulas=(*first.actions, *variants(names, [m.laws for m in descriptions])), table=make_table(headings, rows),
    )  # fmt: skip


# Gears


def explain_gears(model: Model) -> tuple[Entry, ...]:
    """One entry for all gears, none where there is no gear."""
    return (_gear_entry(model.gears, model),) if model.gears else ()


def _gear_entry(gears: Sequence[Gear], model: Model) -> Entry:
    rows = [(code(g.name), g.span.place, _coordinate(g.first), _coordinate(g.second), text(g.ratio, model)) for g in gears]
    return Entry(
        title=f"Gears: {with_others([g.name for g in gears])}",
        notes=(f"{TEXT.capitalize()}, with all turns. Equations: {code(NAMES)}.",),
        formulas=(r"\Phi = q_a - r q_b, \quad \dot \Phi = \dot q_a - r \dot q_b, \quad \ddot \Phi = \ddot q_a - r \ddot q_b",),
        table=make_table(("gear", "line", "$q_a$", "$q_b$", "ratio $r$"), rows),
    )


def _coordinate(end: JointCoordinate) -> str:
    return code(f"{end.joint}.{end.name}")
