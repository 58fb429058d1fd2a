"""The peers: other simulators that a model can be exported to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cutjoint.export import exudyn, mujoco, pinocchio
from cutjoint.export.records import Export
from cutjoint.model.records import Model, Output, Scene
from cutjoint.run.result_files import write_whole


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A simulator: its ``integrators`` by preference.

    ``export`` makes its files of a model in a scene with changed parameters and the outputs to report.
    """

    name: str
    integrators: tuple[str, ...]
    export: Callable[[Model, Scene, Mapping[str, float], Sequence[Output]], Export]


PEERS: Mapping[str, Peer] = {
    peer.name: peer
    for peer in (
        Peer(name="mujoco", integrators=mujoco.INTEGRATORS, export=mujoco.export_mujoco),
        Peer(name="exudyn", integrators=exudyn.INTEGRATORS, export=exudyn.export_exudyn),
        Peer(name="pinocchio", integrators=pinocchio.INTEGRATORS, export=pinocchio.export_pinocchio),
    )
}


def write_export(export: Export, folder: Path) -> None:
    """Put an export's files into a folder."""
    for name, text in export.files.items():
        write_whole(folder / name, text)
