"""LagrangianEquations -> a description (JSON) for the generic system, which interprets the model at run time.

Nodes are points, directions and angles: of the ground with a value, coordinates, or combinations of nodes before them.  Equations, forces
and reports are over *forms*, linear combinations of nodes; the first ``running`` of them are those that equations and forces use.  What
finds the start of a run is the description of the same model for the generic mechanism, with ``marks``: where each coordinate is
carried.  Expressions are trees (trees.py).
"""

from __future__ import annotations

from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.natural.nodes import Node
from cutjoint.model.records import GROUND
from cutjoint_bench.generic.mechanism import describe_generic, heading
from cutjoint_bench.generic.natural.forces import force_elements
from cutjoint_bench.generic.natural.forms import FormTable, described_form
from cutjoint_bench.generic.natural.masses import masses_of
from cutjoint_bench.generic.natural.outputs import Reports
from cutjoint_bench.generic.natural.places import Marks
from cutjoint_bench.generic.natural.rows import rows_of
from cutjoint_bench.generic.trees import Json, Trees


def describe_generic_natural(equations: LagrangianEquations) -> Json:
    """The system: nodes, masses, equations, forces and reported columns."""
    topology, scene = equations.topology, equations.scene
    trees, table = Trees.of(topology.model, scene), FormTable(layout=equations.layout)
    rows, forces = rows_of(equations, table, trees), list(force_elements(table, trees, equations.outputs))
    described_rows = [{"name": f"{r.element}.{r.name}", **r.details, "forms": table.numbers(r.forms)} for r in rows]
    described_forces = [
        {"name": f.name, "kind": f.kind, "quantities": f.quantities, **f.details, "forms": table.numbers(f.forms)} for f in forces
    ]
    running = len(table.forms)
    masses, weights = _masses(equations, table, trees), _weights(equations, table, trees)
    reports = Reports(table=table, trees=trees, rows=rows, forces=forces)
    outputs, marks = [reports.describe(output) for output in equations.outputs], Marks(equations, trees)
    nodes = _nodes(equations, trees, marks)
    return {
        "format": "cutjoint-generic-natural-1",
        "method": equations.method,
        **heading(trees),
        "coordinates": list(equations.coordinate_names),
        "nodes": nodes,
        "forms": table.described(trees),
        "running": running,
        "masses": masses,
        "weights": weights,
        "equations": described_rows,
        "forces": described_forces,
        "outputs": outputs,
        "start": {**describe_generic(topology, scene, ()), "marks": marks.described},
    }


def _nodes(equations: LagrangianEquations, trees: Trees, marks: Marks) -> list[Json]:
    """The nodes in the order of the layout; a coordinate with its offset and where it is carried."""
    nodes, offset = [], 0
    for node in equations.layout.nodes:
        nodes.append({"name": node.name, **_origin(equations, trees, marks, node, offset)})
        offset += node.size if node.is_coordinate else 0
    return nodes


def _origin(equations: LagrangianEquations, trees: Trees, marks: Marks, node: Node, offset: int) -> Json:
    if node.is_coordinate:
        return {"coordinate": offset, "size": node.size, "place": marks.place(node)}
    if node.body == GROUND:
        return {"value": trees.all(node.place)}
    assert node.parts is not None
    return {"parts": described_form(equations.layout, trees, node.parts)}


def _masses(equations: LagrangianEquations, table: FormTable, trees: Trees) -> list[list[object]]:
    """The elements of all groups' mass matrices, of each the upper triangle: form, form, mass."""
    return [
        [table.number_of({i: 1}), table.number_of({j: 1}), trees.one(mass)]
        for group, i, j, mass in masses_of(equations.layout, trees.model)
        if group.basis.index(i) <= group.basis.index(j)
    ]  # fmt: skip


def _weights(equations: LagrangianEquations, table: FormTable, trees: Trees) -> list[list[object]]:
    """Centres of mass with their masses."""
    return [
        [table.number(table.point(body.name, body.centre_of_mass)), trees.one(body.mass)]
        for body in equations.topology.model.bodies if body.mass != 0
    ]  # fmt: skip
