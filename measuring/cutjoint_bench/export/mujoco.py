"""A model for MuJoCo: an MJCF file and a program in C++ that steps it with the model's forces."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence

from cutjoint.model.records import Model, Output, Scene
from cutjoint.run.additions import Export
from cutjoint_bench.export.columns import make_columns
from cutjoint_bench.export.forces_cpp import Forces, write_forces
from cutjoint_bench.export.laws import Numbers
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.export.mujoco_model import Mjcf, body_name, write_mjcf
from cutjoint_bench.export.printing import environment
from cutjoint_bench.export.program_cpp import column_text, offset, part_texts, support_files
from cutjoint_bench.export.records import Column, Mechanism

#: Equality constraints and forces alone are a quadratic problem: two iterations of Newton's method solve it.
INTEGRATORS = (
    "rk4", "euler", "implicit", "implicitfast", "rk4_two_iterations", "euler_two_iterations", "implicitfast_two_iterations",
)  # fmt: skip


def export_mujoco(model: Model, scene: Scene, parameters: Mapping[str, float], outputs: Sequence[Output]) -> Export:
    """The files NAME.xml and NAME.cpp, with the headers that the latter includes.

    Raises:
        ModelError: a body without mass, a cut joint that MuJoCo does not have, an output that peers do not report.
        RunError, TopologyError, SimulatorError, ToolchainError: as for a run, which finds where the scene starts.
    """
    mechanism, numbers = build_mechanism(model, scene, parameters), Numbers.of(model, scene, parameters)
    columns = make_columns(model, mechanism, numbers, outputs)
    mjcf, forces = write_mjcf(mechanism), write_forces(mechanism, numbers, scene)
    differences = tuple(_differences(mechanism, mjcf))
    program = _program(mechanism, mjcf, forces, columns, differences)
    files = {f"{model.name}.cpp": program, f"{model.name}.xml": mjcf.text, "forces.hpp": forces.text, **support_files("mujoco_peer.hpp")}
    return Export(files=files, differences=differences)


def _differences(mechanism: Mechanism, mjcf: Mjcf) -> Iterator[str]:
    if mechanism.cuts:
        yield (
            "Loops are closed by soft constraints: across one, 1e-4 of the acceleration that the bodies would have without it remains, and "
            "gaps close with a time constant of one step (rk4) or two."
        )
    if mechanism.gears:
        yield "Gears are soft in the same way: 1e-4 of the acceleration that they prevent remains."
    if any(joint.guide for joint in mechanism.tree):
        yield (
            f"Guided joints have an armature of {mjcf.guide_inertia!r} kg or kg m2, are driven by a force that moves it as prescribed, and "
            "are set to the prescribed place at every step."
        )
    if mjcf.raised:
        yield (
            "Bodies need inertia about all axes: a millionth of the largest, or 1e-9 m2 times the mass, is put in where there is none, "
            f"in {', '.join(mjcf.raised)}."
        )
    if mechanism.forces:
        yield "The implicit integrators do not see the derivatives of the model's forces, which a callback applies."


def _program(mechanism: Mechanism, mjcf: Mjcf, forces: Forces, columns: Sequence[Column], differences: Sequence[str]) -> str:
    return environment().get_template("mujoco.cpp.jinja").render(
        name=mechanism.name, bodies=[json.dumps(body_name(name)) for name in forces.bodies], differences=differences,
        columns=[column_text(mechanism, forces, c) for c in columns], parts=part_texts(mechanism, forces),
        guide_inertia=repr(mjcf.guide_inertia),
        laws=[
            {"joint": json.dumps(mjcf.joints[f.joint, f.index]), "offset": repr(offset(mechanism, f)), "function": f.function}
            for f in forces.joint_forces
        ],
        guides=[{"joint": json.dumps(mjcf.joints[g.joint, g.index]), "function": g.function} for g in forces.guides],
    )  # fmt: skip
