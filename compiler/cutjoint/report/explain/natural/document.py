"""Model -> Markdown: what the compiler derived in natural coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.model.records import Model, Scene
from cutjoint.report.explain.forces import explain_forces
from cutjoint.report.explain.groups import find_counterparts
from cutjoint.report.explain.natural import force_descriptions
from cutjoint.report.explain.natural.dependence import explain_dependence
from cutjoint.report.explain.natural.derivation import derive_natural
from cutjoint.report.explain.natural.joints import explain_joint_constraints
from cutjoint.report.explain.natural.layout import explain_layout
from cutjoint.report.explain.natural.masses import explain_masses
from cutjoint.report.explain.natural.method import explain_method
from cutjoint.report.explain.natural.shapes import explain_shapes
from cutjoint.report.explain.natural.sharing import saving, sharing_table
from cutjoint.report.explain.natural.summary import summarise_natural
from cutjoint.report.explain.operations import count_operations, operations_table
from cutjoint.report.explain.render import Explanation, render
from cutjoint.report.explain.views import Chapter, Table

#: The parts of a linearisation, in their order.
_STAGES = ("inputs", "body", "joint", "inertia", "constraint", "force", "tangent")


@dataclass(frozen=True, kw_only=True)
class NaturalExplanation(Explanation):
    """Everything that the template prints, in its order."""

    saving: str
    sharing: Table
    layout: Chapter
    steps: Chapter
    chapters: tuple[Chapter, ...]
    operations: Table


def explain_natural(model: Model, scene: Scene, method: str, reduction: tuple[Chapter, ...] = ()) -> str:
    """The Markdown of a model in a scene, by "augmented" or "classical"; ``reduction`` is the chapter of a reduced one.

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
            explain_shapes(d, counterparts),
            explain_joint_constraints(d, counterparts),
            explain_masses(d, counterparts),
            explain_forces(d.full, counterparts, force_descriptions.describe_natural, force_descriptions.NOTES),
            explain_dependence(d),
            *reduction,
        ),
        operations=operations_table(topology, count_operations(d.program, "linearise"), _STAGES, "all together"),
    )  # fmt: skip
    # Explanation -> Markdown
    return render("explain_natural.md.jinja", explanation)
