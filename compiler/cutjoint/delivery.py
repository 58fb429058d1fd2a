"""The folder of ``compile --out``: it stands alone where the method can, else it has generated source and its simulator."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cutjoint.emit.source import Source
from cutjoint.formulate.records import Equations
from cutjoint.locations import AnyPath, path_of
from cutjoint.methods import DEFAULT_PRECISION, METHODS, join_or
from cutjoint.program.records import Program
from cutjoint.run.errors import RunError
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_files, write_whole
from cutjoint.standalone import Standalone, linearised_methods, make_standalone


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """The ``files`` of a folder by name, the name of its ``program``, and what that is made from where it stands alone."""

    folder: Path
    files: Mapping[str, str]
    program: str
    alone: Standalone | None

    def write(self, simulator: Path, flags: Sequence[str]) -> None:
        """Write all files; each replaces an earlier one as a whole, so that an earlier program that is running goes on.

        Raises:
            ToolchainError: the C++ compiler failed.
            OutputError: a file cannot be written.
        """
        built = simulator if self.alone is None else self.alone.build_simulator(flags)
        write_files(self.folder, self.files)
        os.chmod(write_whole(self.folder / self.program, built.read_bytes()), built.stat().st_mode & 0o777)


def plan_delivery(
    out: AnyPath | None, generated: tuple[Equations, Program, Source], *, method: str, precision: str, integrator: str | None, lanes: bool,
    linearise: bool,
) -> Delivery | None:  # fmt: skip
    """Plan a folder for the results of `pipeline.generate`; None if there is no ``out``.

    Raises:
        RunError: an ``integrator`` is named that the folder cannot have, or derivatives (``linearise``) of a folder that has none.
        OutputError: one of the files is the model.
    """
    folder, (equations, program, source) = path_of(out), generated
    if folder is None or not METHODS[method].stands_alone or precision != DEFAULT_PRECISION:
        if integrator is not None:
            raise RunError("integrator: only folders that stand alone have one of their own; give it to simulate instead")
        if linearise:
            able = f"use method {join_or(linearised_methods())}, in {DEFAULT_PRECISION}"
            raise RunError(f"linearise: only folders that stand alone have derivatives; give one by out, and {able}")
        delivery = None if folder is None else Delivery(folder=folder, files=source.files, program="simulator", alone=None)
    else:
        alone = make_standalone(equations, program, source, integrator=integrator, equal_steps=True, lanes=lanes, linearise=linearise)
        delivery = Delivery(folder=folder, files=alone.files, program=alone.simulator, alone=alone)
    if delivery is not None:
        model, names = Path(equations.topology.model.span.file), (*delivery.files, delivery.program)
        require_apart({"the model": model}, documents=[(f"--out {folder}: file", delivery.folder / name) for name in names])
    return delivery
