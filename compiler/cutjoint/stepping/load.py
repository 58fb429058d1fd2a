"""From a model file to a simulation."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.locations import AnyPath
from cutjoint.model.read import read_model
from cutjoint.pipeline import generate
from cutjoint.run.scenes import find_scene
from cutjoint.standalone import make_standalone
from cutjoint.stepping.library import Library
from cutjoint.stepping.simulation import Simulation
from cutjoint.toolchain.build import FLAGS


def load(path: AnyPath, *, scene: str | None = None, flags: Sequence[str] = FLAGS) -> Simulation:
    """Compile a model file for a scene, the only one if none is named, or find it in the cache; `Simulation.reset` comes next.

    Steps are those of the recursive method with the trapezoidal rule, as long as the scene says.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError, RunError: the model or the scene is wrong.
        ToolchainError: a tool is not installed, or the compiler failed.
    """
    model = read_model(path)
    chosen = find_scene(model, scene)
    equations, program, source = generate(model, chosen, chosen.outputs)
    standalone = make_standalone(equations.mechanism, program, source)
    mechanism = equations.mechanism
    return Simulation(Library(
        standalone.build_library(flags), standalone.name, standalone.size, has_inputs=bool(mechanism.inputs),
        balls=[c.v + c.scalars for c in mechanism.charts if c.ball], equations=len(mechanism.equation_names),
    ))  # fmt: skip
