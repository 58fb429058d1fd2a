"""Model -> Markdown: what the compiler derived in natural coordinates, and the two methods' equations for a step
(Cuadrado et al. 2000, sections 2.1 and 2.2).
"""

from dataclasses import dataclass

from cutjoint.methods import METHODS
from cutjoint.model.records import Model, Numerics, Scene
from cutjoint.report.explain.forces import POINT_NOTES, PointMechanics, explain_forces
from cutjoint.report.explain.graph import count_bodies, given_rows, operation_rows
from cutjoint.report.explain.latex import number
from cutjoint.report.explain.natural.derivation import Derivation, derive_natural
from cutjoint.report.explain.natural.joints import explain_constraints
from cutjoint.report.explain.natural.layout import explain_layout, kinds
from cutjoint.report.explain.natural.nodes import explain_masses, saving, sharing_table
from cutjoint.report.explain.operations import count_operations, operations_table
from cutjoint.report.explain.views import Chapter, Entry, Explanation, Table, code, find_counterparts, make_table, plural, render
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.plan import Plan

_FATE = {
    "augmented": "They are held like all others: the penalty makes the tangent regular whatever their rank.",
    "classical": "They are left out: with them the tangent would be singular.",
}


def explain_dependence(d: Derivation) -> Chapter:
    """The equations that others imply in every pose; the last of those that depend on each other."""
    spans = d.model.constraint_spans
    owners = {f"{c.element}.{name}": c.element for c in d.full.constraints for name in c.names}
    rows = [(code(name), spans[owners[name]].place) for name in d.dependent]
    if not rows:
        return Chapter(title="Dependent equations", notes=("None.",), formulas=(), entries=())
    notes = ("In every pose that the compiler tries these follow from the equations before them.", _FATE[d.full.method])
    entry = Entry(title=plural(len(rows), "equation"), notes=(), formulas=(), table=make_table(("equation", "line"), rows))
    return Chapter(title="Dependent equations", notes=notes, formulas=(), entries=(entry,))


def summarise_natural(d: Derivation) -> Table:
    """The counts."""
    model, layout = d.model, d.full.layout
    coordinates = len(d.full.coordinate_names)
    return make_table(("what", "count"), [
        ("bodies", count_bodies(model)),
        ("joints", f"{len(model.joints)}, {sum(1 for j in model.joints if j.guide is not None)} of them guided"),
        *given_rows(d.full),
        ("coordinates", f"{coordinates}, of {kinds(layout.coordinates)}"),
        ("constraint equations", f"{len(d.full.equation_names)}, {d.rank} of them independent{_left_out(d)}"),
        ("degrees of freedom", str(coordinates - d.rank)),
        ("entries of the tangent", tangent_entries(d.plan.pattern)),
        *factorisation_rows(d.plan),
        *operation_rows(d.program),
    ])  # fmt: skip


def _left_out(d: Derivation) -> str:
    n = len(d.full.equation_names) - len(d.equations.equation_names)
    return f", {n} left out" if n else ""


def tangent_entries(pattern: Pattern) -> str:
    """The number of entries of the tangent beside its size, in words."""
    n, size = len(pattern.row), pattern.size
    return f"{n} of {size * (size + 1) // 2} of the lower triangle" if pattern.symmetric else f"{n} of {size**2}"


def factorisation_rows(plan: Plan) -> list[tuple[str, str]]:
    """The cost of solving with the tangent: the order in use and the other tried ones, by their predicted operations in four lanes."""
    used, *others = (f"{code(trial.name)} with {trial.operations}" for trial in plan.trials)
    rejected = f"; {', '.join(others)}" if others else ""
    return [
        ("order of elimination", f"{used} operations in four lanes{rejected}"),
        ("multiply-adds of a factorisation and a solution", str(plan.multiply_adds)),
    ]


#: The parts of a linearisation, in their order.
_STAGES = ("inputs", "body", "joint", "inertia", "constraint", "signal", "force", "tangent")


@dataclass(frozen=True, kw_only=True)
class NaturalExplanation(Explanation):
    """Everything that the template prints, in its order."""

    saving: str
    sharing: Table
    layout: Chapter
    steps: Chapter
    chapters: tuple[Chapter, ...]
    operations: Table


def explain_natural(model: Model, scene: Scene, method: str, further: tuple[Chapter, ...] = ()) -> str:
    """The Markdown of a model in a scene, by "augmented" or "classical"; ``further`` are chapters that all methods share.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that natural coordinates do not determine.
    """
    # Model -> Derivation
    d = derive_natural(model, scene, method)
    # Derivation -> Explanation
    topology = d.full.topology
    counterparts = [row for c in topology.classes for row in find_counterparts(c)]
    explanation = NaturalExplanation(
        model=model.name, scene=scene.name, method=method, summary=summarise_natural(d), saving=saving(d),
        sharing=sharing_table(d.full.layout, len(model.bodies)), layout=explain_layout(d),
        steps=explain_method(method, scene.numerics),
        chapters=(
            explain_constraints(d),
            explain_masses(d, counterparts),
            explain_forces(d.full, counterparts, POINT_NOTES, PointMechanics),
            explain_dependence(d),
            *further,
        ),
        operations=operations_table(topology, count_operations(d.program, "linearise"), _STAGES, "all together"),
    )  # fmt: skip
    # Explanation -> Markdown
    return render("explain_natural.md.jinja", explanation)


_ABOUT = {
    "augmented": "Newton's method solves for the coordinates at the end of a step; multipliers take over what the penalty carries. "
    "The tangent has the symmetric parts of damping and stiffness alone.",
    "classical": "Newton's method solves for the coordinates at the end of a step and for the multipliers together. "
    "The tangent has damping and stiffness whole.",
}


def explain_method(method: str, numerics: Numerics) -> Chapter:
    """The method in words, with the scene's settings."""
    rates = "Velocities and accelerations follow by the trapezoidal rule (eqs. 4, 5), and are projected onto the constraints."
    return Chapter(title=f"The {method} method", notes=(_ABOUT[method], rates, _settings(method, numerics)), formulas=(), entries=())


def _settings(method: str, numerics: Numerics) -> str:
    settings, given = numerics.of_method(method), numerics.methods.get(method, {})
    dt = rf"In this scene $\Delta t$ = {number(settings.step, times='e{}')} s"
    if METHODS[method].saddle_point:
        return f"{dt}."
    penalty = f"= {number(given['penalty'], times='e{}')}" if "penalty" in given else "follows from masses and step"
    return rf"{dt}, and $\alpha$ {penalty}."
