"""Model -> Markdown: what the compiler derived, for an engineer to read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cutjoint.methods import DEFAULT_METHOD, METHODS, Formulation
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.records import Note
from cutjoint.report.explain.bodies import explain_bodies
from cutjoint.report.explain.closures import explain_closures
from cutjoint.report.explain.forces import explain_forces
from cutjoint.report.explain.graph import class_entries, cut_table, elimination, loop_table, summarise, tree_lines
from cutjoint.report.explain.joints import explain_joints
from cutjoint.report.explain.natural.document import explain_natural
from cutjoint.report.explain.newton import explain_newton
from cutjoint.report.explain.operations import cost_table, count_operations, derive, operations_table, parameter_costs
from cutjoint.report.explain.reduced import explain_reduction
from cutjoint.report.explain.views import Chapter, Entry, Explanation, Table, find_counterparts, render
from cutjoint.topology.build import build_topology


@dataclass(frozen=True, kw_only=True)
class RecursiveExplanation(Explanation):
    """Everything that the template prints, in its order."""

    tree: tuple[str, ...]
    cuts: Table
    loops: Table
    classes: tuple[Entry, ...]
    elimination: Entry
    chapters: tuple[Chapter, ...]
    operations: Table
    costs: Table


def explain(model: Model, scene: Scene, method: str = DEFAULT_METHOD, *, done: Sequence[Note] = ()) -> str:
    """The Markdown of a model in a scene, by a method of ``cutjoint.methods.METHODS``; ``done`` is what passes did to a reduced one.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that the method does not determine.
    """
    reduction = explain_reduction(model, scene, done)
    if METHODS[method].formulation is Formulation.NATURAL:
        return explain_natural(model, scene, method, reduction)
    return _explain_recursive(model, scene, method, reduction)


def _explain_recursive(model: Model, scene: Scene, method: str, reduction: tuple[Chapter, ...]) -> str:
    # Model -> Program
    equations, program = derive(build_topology(model), scene)
    # Program -> Explanation
    topology, counts = equations.topology, count_operations(program)
    by_class = [find_counterparts(c) for c in topology.classes]
    counterparts = [row for rows in by_class for row in rows]
    explanation = RecursiveExplanation(
        model=model.name, scene=scene.name, method=method,
        summary=summarise(equations, program), tree=tree_lines(topology),
        cuts=cut_table(equations), loops=loop_table(topology), classes=class_entries(topology.classes, by_class),
        elimination=elimination(topology, counts),
        chapters=(
            explain_bodies(topology, counterparts),
            explain_joints(equations, counterparts),
            explain_closures(topology, scene.numerics, counterparts),
            explain_forces(equations, counterparts),
            *((explain_newton(equations, method),) if METHODS[method].formulation is Formulation.IMPLICIT else ()),
            *reduction,
        ),
        operations=operations_table(topology, counts), costs=cost_table(parameter_costs(equations, program)),
    )  # fmt: skip
    # Explanation -> Markdown
    return render("explain.md.jinja", explanation)
