"""cutjoint: a model compiler for multibody dynamics.

From Python::

    import cutjoint

    artifact = cutjoint.compile_model(Path("models/iltis.yaml"), scene="simul1")
    run = cutjoint.simulate(artifact, dt=0.0075)
    run.t, run["chassis.z"]
"""

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model, read_model_text
from cutjoint.pipeline import compile_model, simulate
from cutjoint.run.run_file import RunError
from cutjoint.states import NoEquilibriumError, find_equilibrium
from cutjoint.toolchain.build import ToolchainError
from cutjoint.topology.build import build_topology
from cutjoint.topology.spanning_tree import TopologyError

__all__ = [
    "ModelError", "NoEquilibriumError", "RunError", "ToolchainError", "TopologyError", "build_topology", "compile_model",
    "find_equilibrium", "read_model", "read_model_text", "simulate",
]  # fmt: skip
