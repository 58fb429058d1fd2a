"""Requirements of a peer, and its runs."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cutjoint.model.expressions.quantities import QUANTITIES
from cutjoint.model.records import Body
from cutjoint.run.results import FailureReport, Trajectory, read_table
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.export.peers import Peer
from cutjoint_bench.peers.build import build_exudyn, build_mujoco, build_pinocchio


@dataclass(frozen=True, kw_only=True)
class Engine:
    """The run of a peer's exports: the Python ``module`` that it needs; ``build``, from an export's folder to the command to run there."""

    module: str
    build: Callable[[Path], list[str]]


ENGINES: Mapping[str, Engine] = {
    "mujoco": Engine(module="mujoco", build=build_mujoco),
    "exudyn": Engine(module="exudyn", build=build_exudyn),
    "pinocchio": Engine(module="pinocchio", build=build_pinocchio),
}


def available(peer: Peer) -> bool:
    """True if a peer's module is installed."""
    return find_spec(ENGINES[peer.name].module) is not None


def build_peer(peer: Peer, folder: Path) -> list[str]:
    """Make an export in a folder ready; the command that runs it there.

    Raises:
        ToolchainError: the peer is not installed, or its program does not compile.
    """
    return ENGINES[peer.name].build(folder)


def run_peer(
    peer: Peer, folder: Path, *, dt: float, end: float, integrator: str, output_step: float, tolerance: float = 1e-6
) -> Trajectory:  # fmt: skip
    """Run an export that was written into a folder; times in s.  A run that breaks down is returned as far as it came.

    ``tolerance`` is for adaptive integrators, which stop at each multiple of ``dt`` besides.

    Raises:
        ToolchainError: the peer is not installed, or its program does not compile.
        SimulatorError: the program could not begin.
    """
    with temporary_folder() as place:
        table = place / "table.csv"
        choice = ["--tolerance", repr(tolerance)] if integrator in peer.adaptive else []
        times = ["--dt", repr(dt), "--end", repr(end), "--output-step", repr(output_step), *choice]
        summary = _call([*build_peer(peer, folder), *times, "--integrator", integrator, "--out", str(table)], folder)
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
