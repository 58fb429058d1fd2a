"""Mechanisms as folders that stand alone: their files, and what a compiler makes of them.

    Program -> files -> library or simulator
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cutjoint.emit.source import Source
from cutjoint.emit.standalone import emit_standalone, simulation_size
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import Events
from cutjoint.program.records import Program
from cutjoint.run.options import Options
from cutjoint.run.run_file import make_run_file
from cutjoint.toolchain.build import FLAGS, build_folder, simulator_of

#: How simulations take their steps, whatever the scene says of its runs.
STEPS = Options(integrator="trapezoidal", events=Events.CROSSED)


@dataclass(frozen=True, kw_only=True)
class Standalone:
    """A folder's files by name; ``name`` is the model's, ``digest`` that of its source, ``size`` the bytes that a simulation takes at
    most."""

    name: str
    files: Mapping[str, str]
    digest: str
    size: int

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


def make_standalone(equations: RecursiveEquations, program: Program, source: Source) -> Standalone:
    """The folder of a mechanism in a scene, with the settings, parameters and start of that.

    Raises:
        RunError: the scene has a setting or a start without a finite value.
    """
    model = equations.topology.model
    run_file = make_run_file(model, equations.scene, {}, task="simulate", options=STEPS)
    files = emit_standalone(program, equations, run_file, source.digest)
    return Standalone(name=model.name, files=files, digest=source.digest, size=simulation_size(program, equations))
