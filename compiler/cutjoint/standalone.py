"""Mechanisms as folders that stand alone: their files, and what a compiler makes of them.

    Program -> files -> library or simulator
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cutjoint.emit.source import Source
from cutjoint.emit.standalone import STEPS, emit_standalone, simulation_size
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import DEFAULT_INTEGRATOR, Events
from cutjoint.program.records import Program
from cutjoint.run.errors import RunError
from cutjoint.run.options import Options
from cutjoint.run.run_file import make_run_file
from cutjoint.toolchain.build import FLAGS, build_folder, simulator_of


@dataclass(frozen=True, kw_only=True)
class Standalone:
    """A folder's files by name; ``name`` is the model's, ``digest`` that of its source, ``size`` the bytes that a simulation takes at
    most, ``integrator`` the name of the rule of its steps, ``run_file`` the settings, parameters and start that it begins with."""

    name: str
    files: Mapping[str, str]
    digest: str
    size: int
    integrator: str
    run_file: Mapping[str, Any]

    @property
    def simulator(self) -> str:
        """The name of the program that reads a run file and prints a table."""
        return simulator_of(self.name)

    def build_simulator(self, flags: Sequence[str] = FLAGS) -> Path:
        """That program; errors as of `toolchain.build.build_folder`."""
        return build_folder(self.name, self.files, self.digest, shared=False, flags=flags)

    def build_library(self, flags: Sequence[str] = FLAGS) -> Path:
        """The shared library; errors as of `toolchain.build.build_folder`."""
        return build_folder(self.name, self.files, self.digest, shared=True, flags=flags)


def make_standalone(equations: RecursiveEquations, program: Program, source: Source, *, integrator: str | None = None) -> Standalone:
    """The folder of a mechanism in a scene, with the settings, parameters and start of that.

    The integrator is that of the scene unless one is named; where the core has not the scene's, or the scene names none, it is the
    trapezoidal rule.

    Raises:
        RunError: the core has not the integrator, or the scene has a setting or a start without a finite value.
    """
    model, own = equations.topology.model, equations.scene.numerics.integrator
    if integrator is not None and integrator not in STEPS:
        raise RunError(f"integrator: '{integrator}' is not one of folders that stand alone, {', '.join(STEPS)}")
    chosen = integrator or (own if own is not None and own in STEPS else DEFAULT_INTEGRATOR)
    options = Options(integrator=chosen, events=None if STEPS[chosen].finds_events else Events.CROSSED)
    run_file = make_run_file(model, equations.scene, {}, task="simulate", options=options)
    return Standalone(
        name=model.name, files=emit_standalone(program, equations, run_file, source.digest), digest=source.digest,
        size=simulation_size(program, equations, chosen), integrator=chosen, run_file=run_file,
    )  # fmt: skip
