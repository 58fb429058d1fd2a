"""The peers: other simulators that a model can be exported to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.run.additions import Exporter
from cutjoint_bench.export import exudyn, mujoco, pinocchio
from cutjoint_bench.export.columns import known_outputs


@dataclass(frozen=True, kw_only=True)
class Peer(Exporter):
    """A simulator: its ``integrators`` by preference; ``adaptive`` ones choose their steps by a tolerance."""

    integrators: tuple[str, ...]
    adaptive: frozenset[str] = frozenset()


MUJOCO = Peer(name="mujoco", integrators=mujoco.INTEGRATORS, export=mujoco.export_mujoco, known_outputs=known_outputs)
EXUDYN = Peer(name="exudyn", integrators=exudyn.INTEGRATORS, export=exudyn.export_exudyn, known_outputs=known_outputs)
PINOCCHIO = Peer(
    name="pinocchio", integrators=pinocchio.INTEGRATORS, adaptive=pinocchio.ADAPTIVE, export=pinocchio.export_pinocchio,
    known_outputs=known_outputs,
)  # fmt: skip

PEERS: Mapping[str, Peer] = {peer.name: peer for peer in (MUJOCO, EXUDYN, PINOCCHIO)}
