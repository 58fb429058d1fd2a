"""The peers: other simulators that a model can be exported to, and how to run what was exported."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cutjoint.export import exudyn, mujoco, pinocchio
from cutjoint.export.records import Export
from cutjoint.model.quantities import QUANTITIES
from cutjoint.model.records import Body, Model, Output, Scene
from cutjoint.run.result_files import write_whole
from cutjoint.run.results import FailureReport, Trajectory, read_table
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.temporary import temporary_folder


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A simulator: ``integrators`` by preference, and the Python modules that it ``needs``.

    ``export`` makes its files of a model in a scene with changed parameters and the outputs to report; ``build`` makes a folder with
    these files ready and returns the command that runs there.
    """

    name: str
    integrators: tuple[str, ...]
    needs: tuple[str, ...]
    export: Callable[[Model, Scene, Mapping[str, float], Sequence[Output]], Export]
    build: Callable[[Path], list[str]]


PEERS: Mapping[str, Peer] = {
    peer.name: peer
    for peer in (
        Peer(
            name="mujoco", integrators=mujoco.INTEGRATORS, needs=("mujoco",), export=mujoco.export_mujoco,
            build=mujoco.build_mujoco,
        ),
        Peer(
            name="exudyn", integrators=exudyn.INTEGRATORS, needs=("exudyn",), export=exudyn.export_exudyn,
            build=exudyn.build_exudyn,
        ),
        Peer(
            name="pinocchio", integrators=pinocchio.INTEGRATORS, needs=("pinocchio",), export=pinocchio.export_pinocchio,
            build=pinocchio.build_pinocchio,
        ),
    )
}  # fmt: skip


def available(peer: Peer) -> bool:
    """Whether what a peer needs is installed."""
    return all(find_spec(module) is not None for module in peer.needs)


def write_export(export: Export, folder: Path) -> None:
    """Put an export's files into a folder."""
    for name, text in export.files.items():
        write_whole(folder / name, text)


def run_peer(peer: Peer, folder: Path, *, dt: float, end: float, integrator: str, output_step: float) -> Trajectory:
    """Run an export that was written into a folder; times in s.  A run that breaks down is returned as far as it came.

    Raises:
        ToolchainError: the peer is not installed, or its program does not compile.
        SimulatorError: the program could not begin.
    """
    with temporary_folder() as place:
        table = place / "table.csv"
        times = ["--dt", repr(dt), "--end", repr(end), "--output-step", repr(output_step)]
        summary = _call([*peer.build(folder), *times, "--integrator", integrator, "--out", str(table)], folder)
        if not table.exists():
            raise SimulatorError(f"{peer.name}: {summary['message']}")
        t, columns = read_table(table)
    failed = summary["status"] != "done"
    failure = FailureReport(
        message=summary["message"], time=float(t[-1]) if t.size else 0.0, step=summary["steps"], element=peer.name, residual=math.nan,
        advice="try a smaller step",
    )  # fmt: skip
    units = {name: QUANTITIES[Body][name.rpartition(".")[2]] for name in columns}
    return Trajectory(
        t=t, columns=columns, units=units, steps=summary["steps"], evaluations=0, seconds=summary["seconds"], undetermined=(),
        failure=failure if failed else None,
    )  # fmt: skip


def _call(command: Sequence[str], folder: Path) -> dict[str, Any]:
    """The line of JSON that a program prints last."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    try:
        summary = json.loads(lines[-1] if lines else "")
    except json.JSONDecodeError:
        raise SimulatorError(done.stderr.strip()[-800:] or f"the program ended with status {done.returncode}") from None
    assert isinstance(summary, dict)
    return summary
