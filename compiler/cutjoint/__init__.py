"""cutjoint: a model compiler for multibody dynamics.

From Python::

    import cutjoint

    artifact = cutjoint.compile_model("models/iltis.yaml", scene="simul1")
    run = cutjoint.simulate(artifact, dt=0.0075)
    run.t, run["chassis.z"]

docs/how-to/python.md goes through all of it.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, which takes long to import: `entry` stands behind this

if TYPE_CHECKING:
    from typing import Any

    from cutjoint.analysis.inertia import NoInertiaError
    from cutjoint.analysis.mobility import GuideError
    from cutjoint.compile.pipeline import compile_model
    from cutjoint.fits.fit import Fit, fit
    from cutjoint.importing.network import NetworkError, network_law
    from cutjoint.model.errors import ModelError
    from cutjoint.package.errors import CutjointError, EquationsError, MissingToolsError, RunError, ToolchainError
    from cutjoint.package.extensions import MissingPackageError
    from cutjoint.program.blocks import ConstantError
    from cutjoint.run.failures import FailedBatchError, FailedRunError, IncompleteError
    from cutjoint.run.outputs import OutputError
    from cutjoint.run.reading import read_model
    from cutjoint.run.simulator import SimulatorError
    from cutjoint.sparse.plan import MissingLibraryError
    from cutjoint.stepping.handle import SimulationError
    from cutjoint.stepping.load import load
    from cutjoint.stepping.response import find_linear_model
    from cutjoint.stepping.rollout import rollout
    from cutjoint.stepping.simulation import Simulation
    from cutjoint.stepping.state_space import FrequencyResponse, SampledStateSpace, StateSpace
    from cutjoint.stepping.values import (
        AdjointSensitivities,
        EigenvalueSensitivities,
        EventSensitivities,
        ForwardSensitivities,
        StateSensitivities,
        StepDerivatives,
    )
    from cutjoint.stepping.vibration import RandomVibration, random_vibration
    from cutjoint.sweeps.run import Sweep, sweep
    from cutjoint.tasks.batch import compile_batch, simulate, simulate_batch
    from cutjoint.tasks.inverse import inverse_dynamics
    from cutjoint.tasks.kinematics.sweep import find_compliance, find_kinematics
    from cutjoint.tasks.realtime import FailedRealTimeError, run_in_real_time
    from cutjoint.tasks.states import NoEquilibriumError, find_equilibrium, find_initial_state, find_modes, find_trim
    from cutjoint.topology.build import build_topology
    from cutjoint.topology.reading import read_model_text
    from cutjoint.topology.spanning_tree import TopologyError
    from cutjoint.view.views import write_view

__all__ = [
    "AdjointSensitivities", "ConstantError", "CutjointError", "EigenvalueSensitivities", "EquationsError", "EventSensitivities",
    "FailedBatchError", "FailedRealTimeError", "FailedRunError", "Fit", "ForwardSensitivities", "FrequencyResponse", "GuideError",
    "IncompleteError", "MissingLibraryError", "MissingPackageError", "MissingToolsError", "ModelError", "NetworkError",
    "NoEquilibriumError", "NoInertiaError", "OutputError", "RandomVibration", "RunError", "SampledStateSpace", "Simulation",
    "SimulationError", "SimulatorError", "StateSensitivities", "StateSpace", "StepDerivatives", "Sweep", "ToolchainError", "TopologyError",
    "build_topology", "compile_batch", "compile_model", "find_compliance", "find_equilibrium", "find_initial_state", "find_kinematics",
    "find_linear_model", "find_modes", "find_trim", "fit", "inverse_dynamics", "load", "network_law", "random_vibration", "read_model",
    "read_model_text", "rollout", "run_in_real_time", "simulate", "simulate_batch", "sweep", "write_view",
]  # fmt: skip

#: The modules of these names, which `__getattr__` imports.
_HOMES = {
    "analysis.inertia": "NoInertiaError", "analysis.mobility": "GuideError", "compile.pipeline": "compile_model", "fits.fit": "Fit fit",
    "importing.network": "NetworkError network_law", "model.errors": "ModelError",
    "package.errors": "CutjointError EquationsError MissingToolsError RunError ToolchainError",
    "package.extensions": "MissingPackageError", "program.blocks": "ConstantError",
    "run.failures": "FailedBatchError FailedRunError IncompleteError", "run.outputs": "OutputError", "run.reading": "read_model",
    "run.simulator": "SimulatorError", "sparse.plan": "MissingLibraryError", "stepping.handle": "SimulationError", "stepping.load": "load",
    "stepping.response": "find_linear_model", "stepping.rollout": "rollout", "stepping.simulation": "Simulation",
    "stepping.state_space": "FrequencyResponse SampledStateSpace StateSpace",
    "stepping.values": "EventSensitivities EigenvalueSensitivities StateSensitivities AdjointSensitivities ForwardSensitivities "
    "StepDerivatives",
    "stepping.vibration": "RandomVibration random_vibration", "sweeps.run": "Sweep sweep",
    "tasks.batch": "compile_batch simulate simulate_batch", "tasks.inverse": "inverse_dynamics",
    "tasks.kinematics.sweep": "find_compliance find_kinematics", "tasks.realtime": "FailedRealTimeError run_in_real_time",
    "tasks.states": "NoEquilibriumError find_equilibrium find_initial_state find_modes find_trim", "topology.build": "build_topology",
    "topology.reading": "read_model_text", "topology.spanning_tree": "TopologyError", "view.views": "write_view",
}  # fmt: skip


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a name of the list above at its first use: SymPy takes longer to import than a cached run takes to run."""
        if name.startswith("__"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from types import FunctionType

        from cutjoint.package.renamed import NAMES, accept_old_names, renamed

        if name in NAMES:
            return __getattr__(renamed(name, NAMES))
        for home, names in _HOMES.items():
            if name in names.split():
                found = getattr(import_module(f"cutjoint.{home}"), name)
                if isinstance(found, FunctionType):
                    found = accept_old_names(found)
                    found.__module__ = __name__
                globals()[name] = found
                return found
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return __all__
