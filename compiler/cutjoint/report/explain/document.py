"""Model -> Markdown: what the compiler derived, for an engineer to read: every formula is printed from the blocks that are compiled."""

import re
from collections.abc import Iterator, Sequence

from cutjoint.compile.systems import schedule_system
from cutjoint.emit.source import environment
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.methods import DEFAULT_METHOD, METHODS, Formulation
from cutjoint.model.outcome import Note
from cutjoint.model.records import Model, RodForce, Scene
from cutjoint.package.locations import __version__
from cutjoint.program.records import Program
from cutjoint.report.explain.elements import explain_elements
from cutjoint.report.explain.equations import explain_equations
from cutjoint.report.explain.graph import class_entries, cut_table, elimination, loop_table, summarise, tree_lines
from cutjoint.report.explain.operations import cost_table, count_operations, derive, operations_table, parameter_costs
from cutjoint.report.explain.views import DIGITS, Entry, code, find_counterparts, line_of, make_table, text
from cutjoint.topology.build import build_topology


def explain(model: Model, scene: Scene, method: str = DEFAULT_METHOD, *, done: Sequence[Note] = ()) -> str:
    """The Markdown of a model in a scene, by a method of ``cutjoint.methods.METHODS``; ``done`` is what passes did to a reduced one.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that the method does not determine.
    """
    # Model -> Program
    start, program = derive(build_topology(model), scene)
    equations, compiled = _compiled(start, program, method, scene)
    # Program -> Markdown
    topology = start.topology
    counterparts = [find_counterparts(c) for c in topology.classes]
    is_natural = METHODS[method].formulation is Formulation.NATURAL
    text = environment().get_template("explain.md.jinja").render(
        model=model.name, scene=scene.name, method=method, version=__version__, digits=DIGITS, is_natural=is_natural,
        summary=summarise(start, equations, compiled), tree=tree_lines(topology), cuts=cut_table(start), loops=loop_table(topology),
        classes=class_entries(topology.classes, counterparts), elimination=elimination(topology, count_operations(program)),
        elements=(*explain_elements(equations), *explain_reduction(model, scene, done)),
        chapters=explain_equations(equations, counterparts),
        operations=operations_table(topology, count_operations(compiled, "linearise" if METHODS[method].has_system else "evaluate")),
        costs=None if isinstance(equations, SystemEquations) else cost_table(parameter_costs(start, program)),
    )  # fmt: skip
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"


def _compiled(start: RecursiveEquations, program: Program, method: str, scene: Scene) -> tuple[Equations, Program]:
    if not METHODS[method].has_system:
        return start, program
    return schedule_system(start, method, scene.outputs, lanes=False)


def is_reduced(model: Model, scene: Scene) -> bool:
    """Return whether a model has elements of passes: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))


def explain_reduction(model: Model, scene: Scene, done: Sequence[Note]) -> Iterator[Entry]:
    """What passes made of the model in its file: nothing of one that they did not change."""
    if done:
        rows = make_table(("element", "line", "what was done"), ((code(n.element), line_of(n), n.text) for n in done))
        yield Entry(title="Reduced model", notes=("Each element that a pass changed.",), table=rows)
    guards = [g for g in model.guards if is_active(g.force, scene)]
    if guards:
        cells = ((code(g.force.name), line_of(g.force), ", ".join(text(m, model) for m in g.margins)) for g in guards)
        words = "Forces that are taken out, since they do not act while these margins are not negative. A run stops where one is negative."
        yield Entry(title="Guards", notes=(words,), table=make_table(("force", "line", "margins"), cells))
    rods = [r for r in model.reactions if isinstance(r, RodForce)]
    if rods:
        sums = ((code(r.name), line_of(r), " + ".join(f"{text(w, model)} {code(rod)}" for rod, w in r.weights)) for r in rods)
        words = "Reactions of links that distances stand for: the forces that push the distances' points apart, each times its share."
        yield Entry(title="Sensors of rods", notes=(words,), table=make_table(("sensor", "line", "sum"), sums))
    others = [o for o in scene.outputs if o.stands_for]
    if others:
        read = ((code(o.column), f"{o.factor:g} {code(f'{o.element}.{o.quantity}')}") for o in others)
        yield Entry(title="Columns", notes=("Columns that are read from others.",), table=make_table(("column", "read from"), read))
