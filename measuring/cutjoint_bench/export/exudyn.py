"""A model for Exudyn: a script in Python, and the modules that it imports."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from textwrap import fill

import sympy

from cutjoint.formulate.inputs import TIME
from cutjoint.model.errors import ModelError
from cutjoint.model.records import GROUND, JointKind, Model, Output, Scene
from cutjoint.run.additions import Export
from cutjoint_bench.export.chains import gear_problems, joint_force_problems
from cutjoint_bench.export.columns import make_columns
from cutjoint_bench.export.exudyn_forces import ForceWriter, road_statements
from cutjoint_bench.export.exudyn_joints import Constraint, constrain, independent_cuts, joint_problems, locked
from cutjoint_bench.export.exudyn_laws import function
from cutjoint_bench.export.forces_cpp import arm
from cutjoint_bench.export.laws import Numbers
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.export.printing import TEMPLATES, environment
from cutjoint_bench.export.records import Column, Mechanism, PeerJoint, RigidBody

INTEGRATORS = ("generalized_alpha", "trapezoidal_index2")

#: Modules beside the script.
MODULES = ("exudyn_elements", "exudyn_peer")
#: The modules that those import; a script of such a name would hide it.
_IMPORTED = frozenset({"exudyn", "numpy", *MODULES})

_NO_GEARS = "Exudyn, where bodies have no joint coordinates"


def export_exudyn(model: Model, scene: Scene, parameters: Mapping[str, float], outputs: Sequence[Output]) -> Export:
    """The script NAME.py, and the modules that are the same for all models.

    Raises:
        ModelError: a body without mass, a joint that Exudyn does not have, an output that peers do not report.
        RunError, TopologyError, SimulatorError, ToolchainError: as for a run, which finds where the scene starts.
    """
    mechanism, numbers = build_mechanism(model, scene, parameters), Numbers.of(model, scene, parameters)
    if problems := [*joint_problems(mechanism), *joint_force_problems(mechanism), *gear_problems(mechanism, _NO_GEARS)]:
        raise ModelError(problems)
    columns = make_columns(model, mechanism, numbers, outputs)
    cuts, left_out = independent_cuts(model, scene, mechanism)
    differences = tuple(_differences(mechanism, left_out))
    name = script_name(model.name)
    constraints = [constraint for constraint in (*map(constrain, mechanism.tree), *cuts) if any(constraint.locked)]
    text = environment().get_template("exudyn.py.jinja").render(
        name=model.name, scene=scene.name, script=name, differences=[fill(d, 138) for d in differences], integrator=INTEGRATORS[0],
        gravity=repr(mechanism.gravity), bodies=[_body(body) for body in mechanism.bodies], parts=list(_parts(mechanism)),
        joints=[{"name": c.joint.name, "statements": list(_joint(mechanism, c))} for c in constraints],
        columns=[_column(mechanism, column) for column in columns], **_forces(mechanism, numbers, scene),
    )  # fmt: skip
    modules = {f"{module}.py": (TEMPLATES / f"{module}.py").read_text(encoding="utf-8") for module in MODULES}
    return Export(files={name: text, **modules}, differences=differences)


def script_name(model: str) -> str:
    """The script's name, which hides no module that it needs."""
    return f"{model}_model.py" if model in _IMPORTED or model in sys.stdlib_module_names else f"{model}.py"


def _forces(mechanism: Mechanism, numbers: Numbers, scene: Scene) -> dict[str, object]:
    """Values of the template for forces and roads."""
    roads = road_statements(mechanism, numbers, scene)
    writer = ForceWriter(mechanism, numbers, {radius: name for radius, (name, _) in roads.items()})
    statements = ((force.name, writer.statement(force)) for force in mechanism.forces)
    return {
        "roads": [f"{name} = {road}" for name, road in roads.values()],
        "forces": [{"name": name, "statement": statement} for name, statement in statements if statement is not None],
    }


def _differences(mechanism: Mechanism, left_out: Sequence[Constraint]) -> Iterator[str]:
    if left_out:
        listed = "; ".join(f"{cut.joint.name}: {cut.words}" for cut in left_out)
        yield f"Equations of cut joints that follow from the others are left out, since Exudyn wants independent ones ({listed})."
    if any(joint.guide for joint in mechanism.tree):
        yield "Guided joints are prescribed in position; Exudyn begins as if they did not accelerate at the start."


def _body(body: RigidBody) -> str:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    arguments = (
        f"mass={body.mass!r}, centre={body.centre!r}, inertia={(xx, yy, zz, yz, xz, xy)!r}, velocity={body.velocity!r}, spin={body.spin!r}"
    )
    return f"mechanism.body({body.name!r}, {arguments})"


def _parts(mechanism: Mechanism) -> Iterator[str]:
    """The bodies of the model that have mass and can move."""
    for name, place in mechanism.places.items():
        if place.of != GROUND and place.mass > 0:
            yield f"mechanism.part({name!r}, {place.of!r}, {arm(mechanism, place.of, place.centre)!r})"


def _column(mechanism: Mechanism, column: Column) -> str:
    return f"mechanism.column({column.name!r}, {column.body!r}, {arm(mechanism, column.body, column.point)!r}, {column.quantity!r})"


def _joint(mechanism: Mechanism, constraint: Constraint) -> Iterator[str]:
    joint = constraint.joint
    arms = ((body, arm(mechanism, body, point)) for body, point in ((joint.base, joint.base_point), (joint.follower, joint.follower_point)))
    ends = ", ".join(map(repr, arms))
    if constraint.locked != locked(joint.element):
        yield f"mechanism.joint({ends}, {constraint.axes!r}, {constraint.locked!r})"
    elif joint.kind is JointKind.REVOLUTE:
        yield f"mechanism.revolute({ends}, {constraint.axes!r})"
    elif joint.kind is JointKind.SPHERICAL:
        yield f"mechanism.spherical({ends})"
    elif joint.kind is JointKind.DISTANCE:
        yield f"mechanism.distance({ends})"
    else:
        yield f"mechanism.joint({ends}, {constraint.axes!r}, {constraint.locked!r})"
    if joint.guide:
        yield f"mechanism.joint({ends}, {constraint.axes!r}, {(0, 0, 1, 0, 0, 0)!r}, {_slide(joint)})"


def _slide(joint: PeerJoint) -> str:
    """The slide of a guided joint: the way between its points along the axis, and its rate."""
    way = sum(a * (f - b) for a, f, b in zip(joint.base_axes[0], joint.follower_point, joint.base_point, strict=True))
    slid = joint.guide[0] - joint.coordinates[0] + way
    return function((), slid, sympy.diff(slid, TIME))
