"""Model -> Markdown: what the compiler derived, for an engineer to read."""

from __future__ import annotations

import re
from dataclasses import dataclass

import jinja2

from cutjoint.locations import templates_folder
from cutjoint.model.records import Model, Scene
from cutjoint.report.explain.bodies import explain_bodies
from cutjoint.report.explain.closures import explain_closures
from cutjoint.report.explain.forces import explain_forces
from cutjoint.report.explain.graph import class_entries, cut_table, elimination, loop_table, summarise, tree_lines
from cutjoint.report.explain.groups import find_counterparts
from cutjoint.report.explain.joints import explain_joints
from cutjoint.report.explain.latex import DIGITS
from cutjoint.report.explain.operations import cost_table, count_operations, derive, operations_table, parameter_costs
from cutjoint.report.explain.views import Chapter, Entry, Table
from cutjoint.topology.build import build_topology
from cutjoint.version import __version__


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Everything that the template prints, in its order."""

    model: str
    scene: str
    version: str
    digits: int
    summary: Table
    tree: tuple[str, ...]
    cuts: Table
    loops: Table
    classes: tuple[Entry, ...]
    elimination: Entry
    chapters: tuple[Chapter, ...]
    operations: Table
    costs: Table


def explain(model: Model, scene: Scene) -> str:
    """The Markdown of a model in a scene.

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
    """
    # Model -> Program
    equations, program = derive(build_topology(model), scene)
    # Program -> Explanation
    topology, counts = equations.topology, count_operations(program)
    by_class = [find_counterparts(topology, c) for c in topology.classes]
    counterparts = [row for rows in by_class for row in rows]
    explanation = Explanation(
        model=model.name, scene=scene.name, version=__version__, digits=DIGITS,
        summary=summarise(equations, program), tree=tree_lines(topology),
        cuts=cut_table(equations), loops=loop_table(topology), classes=class_entries(topology.classes, by_class),
        elimination=elimination(topology, counts),
        chapters=(
            explain_bodies(topology, counterparts),
            explain_joints(equations, counterparts),
            explain_closures(topology, scene.numerics, counterparts),
            explain_forces(equations, counterparts),
        ),
        operations=operations_table(topology, counts), costs=cost_table(parameter_costs(equations, program)),
    )  # fmt: skip
    # Explanation -> Markdown
    text = _environment().get_template("explain.md.jinja").render(e=explanation)
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"


def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates_folder()), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
