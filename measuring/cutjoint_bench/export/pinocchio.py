"""A model for Pinocchio: a program in C++."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence

from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model, Output, Scene
from cutjoint.run.additions import Export
from cutjoint_bench.export.chains import chain_problems, gear_problems
from cutjoint_bench.export.columns import make_columns
from cutjoint_bench.export.forces_cpp import write_forces
from cutjoint_bench.export.laws import Numbers
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.export.pinocchio_tree import Contact, Mass, Tree, TreeJoint, build_tree
from cutjoint_bench.export.printing import environment, vector
from cutjoint_bench.export.program_cpp import column_text, offset, part_texts, support_files
from cutjoint_bench.export.records import Mechanism

#: `lcaba`: the articulated-body algorithm for loops, in place of a sparse factorisation of the constrained system.
INTEGRATORS = ("rk4", "semi_implicit_euler", "dormand_prince", "lcaba_rk4", "lcaba_semi_implicit_euler", "lcaba_dormand_prince")
ADAPTIVE = frozenset({"dormand_prince", "lcaba_dormand_prince"})

#: The parts that are the same for all models, each with what it includes.
ENGINE = {
    "pinocchio_dynamics.cc": ("pinocchio_dynamics.hpp",),
    "pinocchio_peer.cc": ("pinocchio_peer.hpp", "pinocchio_dynamics.hpp", "mechanics.hpp", "program.hpp"),
}

#: No checks at every call; and what Pinocchio's headers want of Boost, whose lists are shorter by default.
DEFINITIONS = (
    "-DNDEBUG", "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)  # fmt: skip

_NO_GEARS = "Pinocchio, whose program there couples no joint coordinates"


def export_pinocchio(model: Model, scene: Scene, parameters: Mapping[str, float], outputs: Sequence[Output]) -> Export:
    """The file NAME.cpp, and those that are the same for all models.

    Raises:
        ModelError: a body without mass, a joint or a force that is not exported, an output that peers do not report.
        RunError, TopologyError, SimulatorError, ToolchainError: as for a run, which finds where the scene starts.
    """
    mechanism, numbers = build_mechanism(model, scene, parameters), Numbers.of(model, scene, parameters)
    problems = chain_problems(mechanism, (*mechanism.tree, *mechanism.cuts))
    if problems := [*problems, *gear_problems(mechanism, _NO_GEARS)]:
        raise ModelError(problems)
    columns = make_columns(model, mechanism, numbers, outputs)
    tree, forces = build_tree(model, scene, mechanism), write_forces(mechanism, numbers, scene)
    differences, numerics = tuple(_differences(mechanism, tree)), scene.numerics.of_method("recursive")
    program = environment().get_template("pinocchio.cpp.jinja").render(
        name=mechanism.name, scene=scene.name, differences=differences, definitions=" ".join(DEFINITIONS), integrator=INTEGRATORS[0],
        joints=[_joint(joint) for joint in tree.joints], masses=[_mass(mass) for mass in tree.masses],
        bodies=[f"{{{tree.outermost[body.name]}, {vector(body.centre)}}}" for body in mechanism.bodies],
        contacts=[_contact(contact) for contact in tree.contacts],
        laws=[f"{{{tree.places[f.joint, f.index]}, {offset(mechanism, f)!r}, {f.function}}}" for f in forces.joint_forces],
        guides=[f"{{{tree.places[g.joint, g.index]}, {g.function}}}" for g in forces.guides],
        columns=[column_text(mechanism, forces, column) for column in columns], parts=part_texts(mechanism, forces),
        gravity=vector(mechanism.gravity), frequency=repr(float(numerics.frequency)), ratio=repr(float(numerics.damping_ratio)),
        add_forces="nullptr" if all(f.joint_of for f in mechanism.forces) else "add_forces",
    )  # fmt: skip
    engine = support_files(*ENGINE, *(header for headers in ENGINE.values() for header in headers))
    files = {f"{model.name}.cpp": program, "forces.hpp": forces.text, **engine}
    return Export(files=files, differences=differences)


def _differences(mechanism: Mechanism, tree: Tree) -> Iterator[str]:
    if tree.contacts:
        yield "Loops are closed on accelerations; gaps close again as the scene's frequency and damping ratio say, as in cutjoint."
    for cut, body in tree.split.items():
        yield f"Body '{body}' is in equal parts for cut joint '{cut}': one moves on the joint and is welded to the other."
    if any(joint.guide for joint in mechanism.tree):
        yield (
            "Guided joints have an armature of 1e9 times the mass of all bodies, are driven by a force that moves it as prescribed, and "
            "are set to the prescribed place and rate at every stage."
        )


def _joint(joint: TreeJoint) -> str:
    part = joint.part
    speeds = [*joint.speeds, *[0.0] * (6 - len(joint.speeds))]
    kind, axis = f"Joint::{part.type}", vector(part.axis or (0.0, 0.0, 0.0))
    return f"{{{kind}, {json.dumps(joint.name)}, {joint.parent}, {vector(part.point)}, {axis}, {part.pitch!r}, {vector(speeds)}}}"


def _mass(mass: Mass) -> str:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = mass.body.inertia
    inertia = [mass.share * x for x in (xx, xy, yy, xz, yz, zz)]
    return f"{{{mass.joint}, {mass.share * mass.body.mass!r}, {vector(mass.body.centre)}, {vector(inertia)}}}"


def _contact(contact: Contact) -> str:
    ends = f"{contact.first}, {contact.second}, {vector(contact.on_first)}, {vector(contact.on_second)}"
    return f"{{{str(contact.weld).lower()}, {ends}}}"
