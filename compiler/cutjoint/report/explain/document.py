"""Model -> Markdown: what the compiler derived, for an engineer to read: every formula is printed from the blocks that are compiled.

Equations stand element by element in the order of the program's sweeps; elements of one form are explained once.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from cutjoint.compile.systems import schedule_system
from cutjoint.elements.interaction import Carrier, Frame
from cutjoint.emit.source import environment
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import discrete_state_name
from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.natural.nodes import NodeKind
from cutjoint.formulate.records import SAMPLE, Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import DEFAULT_METHOD, METHODS, START, Formulation
from cutjoint.model.outcome import Note
from cutjoint.model.records import Binding, Force, Joint, Model, Parameter, RodForce, Scene
from cutjoint.package.locations import __version__
from cutjoint.program.records import Program
from cutjoint.program.scalars import FREE
from cutjoint.program.schedule import schedule
from cutjoint.report.explain.formulas import Formulas, words
from cutjoint.report.explain.graph import class_entries, cut_table, elimination, loop_table, summarise, tree_lines
from cutjoint.report.explain.views import (
    DIGITS,
    Counterparts,
    Entry,
    Table,
    code,
    find_counterparts,
    line_of,
    make_table,
    number,
    place,
    text,
)
from cutjoint.run.settings import find_closure
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology

#: The sweeps of an evaluation, in their order.
STAGES = (
    "inputs", "kinematics", "body", "joint", "inertia", "signal", "force", "closure", "constraint", "condensation", "accelerations",
    "multipliers", "force_residual", "tangent",
)  # fmt: skip
#: The functions whose equations are printed; the others solve, check and report with the same blocks.
_FUNCTIONS = ("evaluate", "dynamic_residual", "constraint_residual", "guard", "scene_inputs", "sample")
#: What differs between elements of one form: names, numbers of unnamed blocks, numbers.
_OWN = re.compile(r"\\text\{ [^}]* \}|x_\{\d+|\d+(?:\.\d+)?")
_ROW = r" \cr "
#: The lines of one element in a sweep.
Lines = tuple[str, list[str]]


@dataclass(frozen=True, kw_only=True)
class Cost:
    """The cost of a tunable parameter: additional operations of an evaluation, and scalars that the loaded stage stores."""

    parameter: Parameter
    operations: int
    stored: int


def derive(topology: Topology, scene: Scene) -> tuple[RecursiveEquations, Program]:
    """The equations of a scene, and their program."""
    closure = find_closure(scene.numerics, METHODS[START]).name
    equations = formulate_recursive(topology, scene, scene.outputs, closure=closure)
    return equations, schedule(equations.builder, [(f.name, f.results) for f in equations.functions])


def count_operations(program: Program, function: str = "evaluate") -> dict[tuple[str, str], int]:
    """The operations of a function without lanes by stage and element."""
    counts: dict[tuple[str, str], int] = {}
    for n in program.function(function).statements:
        node = program.graph.nodes[n]
        if node.op not in FREE:
            section = program.sections[node.section]
            counts[section.stage, section.element] = counts.get((section.stage, section.element), 0) + 1
    return counts


def operations_table(topology: Topology, counts: Mapping[tuple[str, str], int]) -> Table:
    """One row an element, one column a stage, known ones in their order."""
    model, joints = topology.model, (*(t.joint for t in topology.tree), *topology.closing)
    known = {stage for stage, _ in counts}
    stages = [*(s for s in STAGES if s in known), *sorted(known - set(STAGES))]
    lines = {e.name: line_of(e) for e in (*model.bodies, *joints, *model.forces, *model.signals, *model.states)}
    elements = [name for name in ("", *lines) if any((stage, name) in counts for stage in stages)]
    rows = [
        (code(name) if name else "all together", lines.get(name, ""), *_cells([counts.get((stage, name), 0) for stage in stages]))
        for name in elements
    ]  # fmt: skip
    sums = _cells([sum(n for (stage, _), n in counts.items() if stage == s) for s in stages])
    return make_table(("element", "line", *stages, "sum"), [*rows, ("**sum**", "", *(f"**{cell}**" for cell in sums))])


def _cells(counts: list[int]) -> tuple[str, ...]:
    return tuple(str(n) if n else "" for n in (*counts, sum(counts)))


def parameter_costs(equations: RecursiveEquations, program: Program) -> tuple[Cost, ...]:
    """The price of each parameter with binding ``param``, the others staying open."""
    costs = []
    for i, parameter in enumerate(equations.parameters):
        dependent = _dependent(program, i)
        operations = _saved(equations, program, parameter) if dependent else 0
        costs.append(Cost(parameter=parameter, operations=operations, stored=len(dependent & program.stored)))
    return tuple(costs)


def _saved(equations: RecursiveEquations, program: Program, parameter: Parameter) -> int:
    """The operations of ``evaluate`` that folding in the parameter's value saves."""
    model, closed = equations.topology.model, replace(parameter, binding=Binding.CONST)
    model = replace(model, parameters=tuple(closed if p is parameter else p for p in model.parameters))
    program_of_closed = derive(replace(equations.topology, model=model), equations.scene)[1]
    return program.operations("evaluate") - program_of_closed.operations("evaluate")


def _dependent(program: Program, index: int) -> set[int]:
    """The scalars of the loaded stage that depend on a parameter; none if no function needs it."""
    dependent: set[int] = set()
    for n in program.loaded:
        node = program.graph.nodes[n]
        if node.data == ("parameters", index) or dependent.intersection(node.args):
            dependent.add(n)
    return dependent


def cost_table(costs: tuple[Cost, ...]) -> Table:
    """One row a parameter."""
    rows = [
        (code(c.parameter.name), line_of(c.parameter), number(c.parameter.value), c.parameter.unit,
         f"{c.operations:+d}" if c.operations else "0", str(c.stored))
        for c in costs
    ]  # fmt: skip
    return make_table(("parameter", "line", "value", "unit", "operations of `evaluate`", "scalars stored when loaded"), rows)


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


def printed(equations: Equations) -> Formulas:
    """The formulas of what a step computes."""
    return Formulas(equations, (block for f in equations.functions if f.name in _FUNCTIONS for block in f.results.values()))


def explain_equations(equations: Equations, counterparts: Sequence[Sequence[Counterparts]]) -> dict[str, list[Entry]]:
    """The entries of each sweep; of elements that play the same part in isomorphic subtrees, or have one form, the first is printed."""
    formulas, sections = printed(equations), equations.builder.sections
    by_section: dict[int, list[str]] = {}
    for block in formulas.defined:
        by_section.setdefault(block.section, []).append(f"{formulas.names[block]} &= {formulas.define(block)}")
    part = {name: row[0] for rows in counterparts for row in rows for name in row}
    stages: dict[str, dict[tuple[str, ...], list[Lines]]] = {}
    for i, lines in sorted(by_section.items(), key=lambda item: (not item[0], item[0])):  # section 0 has sums of all others
        section = sections[i]
        key = part.get(section.element, _form(lines))
        stages.setdefault(section.stage, {}).setdefault((section.equation, section.turn, key), []).append((section.element, lines))
    entries = {stage: list(_entries(forms)) for stage, forms in stages.items()}
    held = equations.topology.model.discrete_states
    if held:
        (sample,) = (f.results.values() for f in equations.functions if f.name == SAMPLE)
        names = (words(discrete_state_name(value).partition(":")[0]) for value in held)
        updates = dict.fromkeys(rf"{name} &\leftarrow {formulas.show(block)}" for name, block in zip(names, sample, strict=True))
        entries.setdefault("controller", []).append(Entry(title="Held from a sample on", formula=_aligned(updates)))
    return entries


def _form(lines: list[str]) -> str:
    """Formulas without the names and the numbers of their elements."""
    order: dict[str, int] = {}
    return _OWN.sub(lambda own: "#" if own[0][0].isdigit() else f"<{order.setdefault(own[0], len(order))}>", "\n".join(lines))


def _entries(forms: dict[tuple[str, ...], list[Lines]]) -> Iterator[Entry]:
    for (equation, turn, _), members in forms.items():
        first, *others = dict.fromkeys(name for name, _ in members)
        notes = [f"`{equation}`"] if equation else []
        if others:
            notes.append(f"Of the same form, with other names, numbers or signs: {code(others)}.")
        title = (code(first) if first else "All together") + (f", {turn}" if turn else "")
        yield Entry(title=title, notes=tuple(notes), formula=_aligned(members[0][1]))


def _aligned(lines: Iterable[str]) -> str:
    return rf"\begin{{aligned}} {_ROW.join(lines)} \end{{aligned}}"


def explain(model: Model, scene: Scene, method: str = DEFAULT_METHOD, *, done: Sequence[Note] = ()) -> str:
    """The Markdown of a model in a scene, by a method of ``cutjoint.methods.METHODS``; ``done`` is what passes did to a reduced one.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that the method does not determine.
    """
    # Model -> Program
    start, program = derive(build_topology(model), scene)
    equations: Equations = start
    if METHODS[method].has_system:
        equations, compiled = schedule_system(start, method, scene.outputs, lanes=False)
    else:
        compiled = program
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
