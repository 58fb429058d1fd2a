"""Model -> Markdown: what the compiler derived, for an engineer to read.

Methods in relative coordinates have chapters of their own, on the step of ``recursive-newton`` and on the elements of a reduced model that
no file has: guards, sensors of rods, columns that stand for others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.compile.systems import formulate_system
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import TIME
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import DEFAULT_METHOD, METHODS, Formulation
from cutjoint.model.outcome import Note
from cutjoint.model.records import Controller, Model, RodForce, Scalar, Scene
from cutjoint.program.schedule import schedule
from cutjoint.report.explain.bodies import explain_bodies
from cutjoint.report.explain.closures import explain_closures
from cutjoint.report.explain.forces import explain_forces
from cutjoint.report.explain.graph import class_entries, cut_table, elimination, loop_table, summarise, tree_lines
from cutjoint.report.explain.joints import explain_joints
from cutjoint.report.explain.latex import latex, parameter_symbols, text
from cutjoint.report.explain.natural.document import explain_natural
from cutjoint.report.explain.operations import cost_table, count_operations, derive, operations_table, parameter_costs
from cutjoint.report.explain.views import Chapter, Entry, Explanation, Table, code, find_counterparts, line_of, make_table, render
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
    further = (*explain_signals(model), *explain_reduction(model, scene, done))
    if METHODS[method].formulation is Formulation.NATURAL:
        return explain_natural(model, scene, method, further)
    return _explain_recursive(model, scene, method, further)


def _explain_recursive(model: Model, scene: Scene, method: str, further: tuple[Chapter, ...]) -> str:
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
            *further,
        ),
        operations=operations_table(topology, counts), costs=cost_table(parameter_costs(equations, program)),
    )  # fmt: skip
    # Explanation -> Markdown
    return render("explain.md.jinja", explanation)


def explain_signals(model: Model) -> tuple[Chapter, ...]:
    """The chapters of states and signals, and of controllers, none for a model without them."""
    symbols = {**parameter_symbols(model), TIME: "t"}
    rates = [rf"\dot {{{symbols[s.symbol]}}} = {latex(s.rate, symbols)}" for s in model.states]
    values = [f"{symbols[s.symbol]} = {latex(s.value, symbols)}" for s in model.signals]
    sampled = tuple(_explain_controller(controller, symbols) for controller in model.controllers)
    if not rates + values:
        return sampled
    return (Chapter(title="States and signals", notes=(_SIGNALS,), formulas=(*rates, *values), entries=()), *sampled)


def _explain_controller(controller: Controller, symbols: Mapping[Scalar, str]) -> Chapter:
    times = f"Samples at {controller.offset:.9g} s + k {controller.every:.9g} s. {_SAMPLES}"
    computed = [f"{symbols[s.symbol]} = {latex(s.value, symbols)}" for s in controller.signals]
    # a memory is one line
    held = dict.fromkeys(rf"{symbols[h.symbol]} \leftarrow {latex(h.next, symbols)}" for h in controller.discrete_states)
    return Chapter(title=f"Controller {controller.name}", notes=(times,), formulas=(*computed, *held), entries=())


_SAMPLES = "A plus marks what is computed at a sample, of what was held before; then all that is held changes at once."

_SIGNALS = "Rates of states, which are integrated with the mechanism, and names for expressions. Quantities are those that outputs have."


def is_reduced(model: Model, scene: Scene) -> bool:
    """Return whether a model has elements of passes: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))


_STEP = (
    "The elimination above finds where a run begins. A step solves the balance of the same bodies, joints and forces for the accelerations "
    "of the joints, from which positions and speeds follow by the trapezoidal rule (eqs. 43, 44). Operations of one call, all lanes:"
)


def explain_newton(start: RecursiveEquations, method: str) -> Chapter:
    """The equations of a step in the recursion's coordinates; ``start`` are those that begin a run."""
    equations, _ = formulate_system(start, method, ())
    program = schedule(equations.builder, [(f.name, f.results) for f in equations.functions])
    costs = make_table(("function", "operations"), [(f"`{f.name}`", str(program.operations(f.name))) for f in program.functions])
    entry = Entry(title="Operations", notes=(), formulas=(), table=costs)
    return Chapter(title=f"The {method} method", notes=(_STEP,), formulas=(), entries=(entry,))


def explain_reduction(model: Model, scene: Scene, done: Sequence[Note]) -> tuple[Chapter, ...]:
    """The chapter of a reduced model, none for one as its file has it."""
    if not (is_reduced(model, scene) or done):
        return ()
    return (Chapter(title="Reduced model", notes=(_NOTE,), formulas=(), entries=tuple(_entries(model, scene, done))),)


_NOTE = "Passes made it from the model of the file; its elements are explained above as they are now."


def _entries(model: Model, scene: Scene, done: Sequence[Note]) -> Iterator[Entry]:
    if done:
        rows = make_table(("element", "line", "what was done"), ((code(n.element), line_of(n), n.words) for n in done))
        yield _entry("Passes", "Each element that a pass changed.", rows)
    guards = [g for g in model.guards if is_active(g.force, scene)]
    if guards:
        cells = ((code(g.force.name), line_of(g.force), ", ".join(text(m, model) for m in g.margins)) for g in guards)
        words = "Forces that are taken out, since they do not act while these margins are not negative. A run stops where one is negative."
        yield _entry("Guards", words, make_table(("force", "line", "margins"), cells))
    rods = [r for r in model.reactions if isinstance(r, RodForce)]
    if rods:
        sums = ((code(r.name), line_of(r), " + ".join(f"{text(w, model)} {code(rod)}" for rod, w in r.weights)) for r in rods)
        words = "Reactions of links that distances stand for: the forces that push the distances' points apart, each times its share."
        yield _entry("Sensors of rods", words, make_table(("sensor", "line", "sum"), sums))
    others = [o for o in scene.outputs if o.stands_for]
    if others:
        read = ((code(o.column), f"{o.factor:g} {code(f'{o.element}.{o.quantity}')}") for o in others)
        yield _entry("Columns", "Columns that are read from others.", make_table(("column", "read from"), read))


def _entry(title: str, note: str, table: Table) -> Entry:
    return Entry(title=title, notes=(note,), formulas=(), table=table)
