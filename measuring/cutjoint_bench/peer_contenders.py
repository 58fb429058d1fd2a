"""Other simulators as contenders: what can be exported to, with each of its integrators."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory

from cutjoint.methods import DEFAULT_METHOD
from cutjoint.run.result_files import write_files
from cutjoint.run.results import Trajectory
from cutjoint_bench.cases import outputs_of_bodies
from cutjoint_bench.cutjoint_contenders import tolerance_of
from cutjoint_bench.export.peers import PEERS, Peer
from cutjoint_bench.peers.run import available, run_peer
from cutjoint_bench.records import Case, Contender
from cutjoint_bench.steps import common_step

#: The packages that bring a module, where their name is another.
_PACKAGES = {"mujoco": "mujoco-core", "pinocchio": "pin"}


@dataclass(frozen=True, kw_only=True)
class PeerRunner:
    """A case exported to a peer, into a folder that lasts as long as this; ``own_step`` (s) is that of the scene."""

    peer: Peer
    integrator: str
    row: float
    own_step: float
    end: float
    folder: TemporaryDirectory[str]
    differences: tuple[str, ...]
    digest: str

    @property
    def configuration(self) -> Mapping[str, str]:
        """Version, integrator, unavoidable differences, and the digest of the exported program."""
        made = {"version": _version(self.peer), "integrator": self.integrator, "digest": self.digest}
        return {**made, "differences": " ".join(self.differences)}

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are some of the case's; adaptive integrators take ``dt`` as ours do, for how accurate they are asked to be."""
        if self.integrator in self.peer.adaptive:
            return self.run(self.row, tolerance_of(dt, self.own_step))
        return self.run(dt, 0.0)

    def run(self, dt: float, tolerance: float) -> Trajectory:
        """A run by steps, or where the integrator chooses them by a tolerance and the distance of rows."""
        return run_peer(
            self.peer, Path(self.folder.name), dt=dt, end=self.end, integrator=self.integrator, output_step=common_step(dt, self.row),
            tolerance=tolerance,
        )  # fmt: skip


def peer_contenders() -> Iterator[Contender]:
    """Each peer with each of its integrators."""
    for peer in PEERS.values():
        for integrator in peer.integrators:
            yield Contender(
                name=f"{peer.name}/{integrator}", label=f"{peer.name}, {integrator}", group="peer",
                prepare=partial(_prepare, peer=peer, integrator=integrator), available=partial(available, peer),
                identify=partial(_identify, peer=peer),
            )  # fmt: skip


def _prepare(case: Case, *, peer: Peer, integrator: str) -> PeerRunner:
    export = peer.export(case.of_peers or case.model, case.scene, case.parameters, outputs_of_bodies(case.model))
    folder = TemporaryDirectory(prefix="cutjoint-peer-")
    write_files(Path(folder.name), export.files)
    return PeerRunner(
        peer=peer, integrator=integrator, row=case.scene.output_step, end=case.scene.end, folder=folder, differences=export.differences,
        own_step=case.scene.numerics.of_method(DEFAULT_METHOD).step,
        digest=sha256(json.dumps(dict(export.files), sort_keys=True).encode()).hexdigest(),
    )


def _identify(_: Case, *, peer: Peer) -> Mapping[str, str]:
    return {"version": _version(peer)}


def _version(peer: Peer) -> str:
    package = _PACKAGES.get(peer.name, peer.name)
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return package
