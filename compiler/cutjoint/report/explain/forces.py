"""Every force's law, its partial derivatives, and how it acts; every gear's equation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy

from cutjoint.elements.gear import NAMES, TEXT
from cutjoint.elements.interaction import Carrier, Frame, Page, Place, Point, T, gets, on_both, pair
from cutjoint.formulate.forces import is_active, variable
from cutjoint.formulate.records import Equations
from cutjoint.model.records import Force, Gear, JointCoordinate, Model, Scalar
from cutjoint.report.explain.latex import equations as print_equations
from cutjoint.report.explain.latex import place, text, variants
from cutjoint.report.explain.laws import RATE, differentiate, expand_polynomials, explain_calspan, explain_law, law_symbols
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others

Cells = tuple[tuple[str, str], ...]

#: Forces in natural coordinates.
POINT_NOTES = (
    "A force on a point of a body works on the displacement of that point: $Q_p$ takes it, and a point that is no coordinate hands it on "
    "to the nodes that it combines, times their coefficients. A law $F$ over a scalar $s$ works on $s$: $Q$ takes $F$ times the gradient "
    "of $s$. A torque $T$ on a body works on the three directions $e_x$, $e_y$, $e_z$ of the body that are the global axes in the design "
    r"position: $Q_{e_i}$ takes $T \times e_i / 2$.",
)


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


@dataclass(frozen=True, kw_only=True)
class LawPage:
    """The laws of forces in LaTeX: the part of `elements.interaction.Page` that all methods share."""

    model: Model

    def law(self, name: str, law: Scalar, position: str, symbol: str) -> tuple[str, ...]:
        """A law, and its partial derivatives."""
        return explain_law(name, law, position, symbol, self.model)

    def laws(self, name: str, laws: Sequence[Scalar], symbol: str) -> tuple[str, ...]:
        """Three laws, each over one displacement or rotation, and the diagonals of their Jacobians."""
        names = [f"{symbol}_{{{axis}}}" for axis in "xyz"]
        mine = [(variable(f"position_{i}"), variable(f"rate_{i}")) for i in range(3)]
        symbols = law_symbols(self.model)
        for (x, rate), text_of in zip(mine, names, strict=True):
            symbols |= {x: text_of, rate: rf"\dot {text_of}"}
        position = variable("position")
        own = [expand_polynomials(law).subs({position: x, RATE: r}) for law, (x, r) in zip(laws, mine, strict=True)]
        slopes = [[differentiate(law, pair[which]) for law, pair in zip(own, mine, strict=True)] for which in (0, 1)]
        return print_equations([
            (name, sympy.Matrix(own)),
            (rf"\partial {name} / \partial {symbol}", sympy.diag(*slopes[0])),
            (rf"\partial {name} / \partial \dot {symbol}", sympy.diag(*slopes[1])),
        ], symbols)  # fmt: skip

    def vector(self, name: str, components: Sequence[Scalar], by: Mapping[str, str]) -> tuple[str, ...]:
        """Components, and those of their Jacobians that are not zero; rates are set as components of their symbol."""
        F, symbols, jacobians = sympy.Matrix(components), law_symbols(self.model), []
        for symbol, names in by.items():
            variables = [variable(each) for each in names.split()]
            symbols |= {x: f"{symbol}_{{{x.name[-1]}}}" for x in variables if len(x.name) > 1}
            jacobians.append((rf"\partial {name} / \partial {symbol}", F.jacobian(variables)))
        return print_equations([(name, F), *((each, J) for each, J in jacobians if not J.is_zero_matrix)], symbols)

    def calspan(self) -> tuple[str, ...]:
        """The steps of the Calspan model."""
        return explain_calspan()

    def number(self, value: Scalar) -> str:
        """A number of the model."""
        return text(value, self.model)


@dataclass(frozen=True, kw_only=True)
class BodyPage(LawPage):
    """Forces as wrenches on bodies."""

    def either(self, bodies: T, points: T) -> T:
        """The text for bodies."""
        return bodies

    def apply_force_pair(self, start: str, end: str, force: str) -> str:
        """Opposite wrenches."""
        return on_both("-", force, rf"{end} \times {force}")

    def apply_force_along(self, start: str, end: str, axis: str, way: str, force: str) -> str:
        """Opposite wrenches."""
        return on_both("+", f"{force} {axis}", rf"{end} \times {force} {axis}")

    def apply_force(self, at: str, force: str, body: str = "") -> str:
        """The wrench of a force."""
        return _joins(body, force, rf"{at} \times {force}")

    def apply_torque(self, torque: str, body: str = "") -> str:
        """The wrench of a torque."""
        return _joins(body, "0", torque)

    def kind_of_coordinate(self, force: Force) -> str:
        """Any coordinate: wrenches and unknowns of joints are explained together."""
        return ""


@dataclass(frozen=True, kw_only=True)
class PointPage(LawPage):
    """Forces on displacements of points, directions and angles."""

    def either(self, bodies: T, points: T) -> T:
        """The text for points."""
        return points

    def apply_force_pair(self, start: str, end: str, force: str) -> str:
        """Opposite forces on both points."""
        return pair(end, start, "-", force)

    def apply_force_along(self, start: str, end: str, axis: str, way: str, force: str) -> str:
        """Opposite forces on both points, and one on the axis."""
        return rf"{pair(end, start, '+', f'{force} {axis}')}, \quad {gets(axis, '+', f'{force} {way}')}"

    def apply_force(self, at: str, force: str, body: str = "") -> str:
        """A force on a point."""
        return gets(at, "+", force)

    def apply_torque(self, torque: str, body: str = "") -> str:
        """A torque on the directions of its body."""
        on_directions = gets(f"e_{{{body} i}}" if body else "e_i", "+", r"T \times e_i / 2")
        return rf"T = {torque}, \quad {on_directions}"

    def kind_of_coordinate(self, force: Force) -> str:
        """The kind by the joint's guide and its measures."""
        joint = next(j for j in self.model.joints if j.name == force.joint_of)
        if joint.guide is not None:
            return "guided"
        return "angle" if force.coordinate_of in joint.element.measures else "slide"


def _joins(body: str, force: str, moment: str) -> str:
    Q = f"Q_{{{body}}}" if body else "Q"
    return rf"{Q} \leftarrow {Q} + \begin{{bmatrix}} {force} \cr {moment} \end{{bmatrix}}"


def describe(force: Force, model: Model, page: Callable[..., Page] = BodyPage) -> ForceDescription:
    """The description of a force on a method's page."""
    explanation = force.interaction.explain(force, page(model=model))
    return ForceDescription(
        title=force.interaction.title(force), notes=explanation.notes, actions=explanation.actions, laws=explanation.laws,
        places=_where(force, model), constants=explanation.constants,
    )  # fmt: skip


def _where(force: Force, model: Model) -> Cells:
    """The bodies of a force, its points, and its directions; or its joint and coordinate."""
    if force.joint_of:
        return ("joint", code(force.joint_of)), ("coordinate $z$", code(force.coordinate_of))
    bodies = [(carrier.value, code(getattr(force, carrier))) for carrier in Carrier if hasattr(force, carrier)]
    places = sorted({p.field: p for p in force.places}.values(), key=lambda place: not isinstance(place, Point))
    return *bodies, *((place.field, _cell(place, force, model)) for place in places)


def _cell(where: Place, force: Force, model: Model) -> str:
    return "; ".join(place(axis, model) for axis in where.of(force)) if isinstance(where, Frame) else place(where.of(force), model)


# Forces


def explain_forces(
    equations: Equations, counterparts: Sequence[Counterparts], page: Callable[..., Page] = BodyPage,
    notes: tuple[str, ...] = (),
) -> Chapter:  # fmt: skip
    """The forces that act in the scene, on the page of a formulation; those that are switched off are named."""
    model, scene = equations.topology.model, equations.scene
    forces = {f.name: f for f in model.forces if is_active(f, scene)}
    descriptions = {name: describe(f, model, page) for name, f in forces.items()}
    groups = group(list(forces), counterparts, lambda name: descriptions[name].kind, lambda name: descriptions[name].laws)
    entries = [_entry([forces[n] for n in names], [descriptions[n] for n in names]) for names in groups]
    off = [f for f in model.forces if f.name not in forces]
    if off:
        rows = make_table(("force", "line"), ((code(f.name), line_of(f)) for f in off))
        entries.append(Entry(title="Switched off", notes=("Not in this scene's equations.",), formulas=(), table=rows))
    return Chapter(title="Forces", notes=notes if model.forces else ("None but gravity.",), formulas=(), entries=tuple(entries))


def _entry(forces: Sequence[Force], descriptions: Sequence[ForceDescription]) -> Entry:
    first = descriptions[0]
    shared = [item for item in first.constants if all(item in m.constants for m in descriptions)]
    constants = [[item for item in m.constants if item not in shared] for m in descriptions]
    notes = [f"Constants: {', '.join(f'{name} = {value}' for name, value in shared)}."] if shared else []
    headings = ("force", "line", *(name for name, _ in (*first.places, *constants[0])))
    rows = [
        (code(f.name), line_of(f), *(cell for _, cell in (*m.places, *numbers)))
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
    rows = [
        (code(g.name), line_of(g), _coordinate(g.first), ", ".join(map(_coordinate, g.coordinates[1:])), _relation(g, model))
        for g in gears
    ]  # fmt: skip
    linear = r"\Phi = q_a - r q_b, \quad \dot \Phi = \dot q_a - r \dot q_b, \quad \ddot \Phi = \ddot q_a - r \ddot q_b"
    bent = r"\Phi = q_a - f(q_b), \quad \dot \Phi = \dot q_a - f' \dot q_b, \quad \ddot \Phi = \ddot q_a - f' \ddot q_b - f'' \dot q_b^2"
    forms = {"ratio $r$": linear} if any(g.law is None for g in gears) else {}
    forms |= {"law $f$": bent} if any(g.law is not None for g in gears) else {}
    return Entry(
        title=f"Gears: {with_others([g.name for g in gears])}",
        notes=(f"{TEXT.capitalize()}, with all turns. Equations: {code(NAMES)}.",),
        formulas=tuple(forms.values()),
        table=make_table(("gear", "line", "$q_a$", "$q_b$", " or ".join(forms)), rows),
    )


def _relation(gear: Gear, model: Model) -> str:
    """The law of a gear, or its ratios."""
    if gear.law is not None:
        return text(gear.law, model)
    return ", ".join(text(ratio, model) for ratio in (gear.ratio, *(ratio for _, ratio in gear.others)))


def _coordinate(end: JointCoordinate) -> str:
    return code(f"{end.joint}.{end.name}")
