"""The cost of the equations: operations by element and stage, and the price of every parameter that stays open."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS, START
from cutjoint.model.records import Binding, Model, Parameter, Scene
from cutjoint.program.records import Program
from cutjoint.program.scalars import FREE
from cutjoint.program.schedule import schedule
from cutjoint.report.explain.views import Table, code, line_of, make_table, number
from cutjoint.run.settings import find_closure
from cutjoint.topology.records import Topology

#: The sweeps of an evaluation, in their order.
STAGES = (
    "inputs", "kinematics", "body", "joint", "inertia", "signal", "force", "closure", "constraint", "condensation", "accelerations",
    "multipliers", "force_residual", "tangent",
)  # fmt: skip


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
    model = _close(equations.topology.model, parameter)
    _, closed = derive(replace(equations.topology, model=model), equations.scene)
    return program.operations("evaluate") - closed.operations("evaluate")


def _close(model: Model, parameter: Parameter) -> Model:
    """The model with the parameter's value folded in."""
    closed = replace(parameter, binding=Binding.CONST)
    return replace(model, parameters=tuple(closed if p is parameter else p for p in model.parameters))


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
