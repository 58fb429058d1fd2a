"""Accelerations and motions of a scene by cutjoint's recursive method, and by a peer."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import sympy

from cutjoint.methods import PLAIN_CLOSURE, Implementation
from cutjoint.model.elements.link_masses import with_link_masses
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import COORDINATES, SPEEDS, Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.failures import describe_failure, places_of
from cutjoint.run.result_files import write_files
from cutjoint.run.results import read_table
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import find_scene, with_closure, with_settings
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator import call_simulator, failure_of
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology
from cutjoint_bench.export.columns import known_outputs
from cutjoint_bench.export.peers import PEERS, Peer
from cutjoint_bench.generic.build import build_generic
from cutjoint_bench.generic.mechanism import describe_generic
from cutjoint_bench.peers.run import available, build_peer, run_peer
from tests.conftest import MODELS
from tests.mechanisms.random_models import TIME, scene

Array = np.ndarray


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene of a model with changed parameters; its outputs are the motions of bodies and markers that it reports."""

    model: Model
    scene: Scene
    parameters: Mapping[str, float]

    @property
    def outputs(self) -> tuple[Output, ...]:
        return known_outputs(self.model, self.scene.outputs)


def needs(peer: str) -> pytest.MarkDecorator:
    """The mark of tests that run a peer."""
    return pytest.mark.skipif(not available(PEERS[peer]), reason=f"{peer} is not installed")


def case_of(name: str, scene_name: str | None = None) -> Case:
    """A scene of a model in models/."""
    model = read_model(MODELS / f"{name}.yaml")
    return Case(model=model, scene=find_scene(model, scene_name), parameters={})


def vehicle(scene_name: str, **links: float) -> Case:
    """The vehicle with masses in its links."""
    model = with_link_masses(case_of("iltis", scene_name).model, {"*.leaf_link": 2, "*.tie_rod": 1, **links})
    return Case(model=model, scene=model.scenes[scene_name], parameters={"chassis_mass": 1248})


def moving(model: Model, seed: int) -> Scene:
    """A scene that starts off the design position, every joint in motion."""
    rng, joints = np.random.default_rng(seed), [t.joint for t in build_topology(model).tree if t.joint.guide is None]

    def numbers(names: dict[str, tuple[str, ...]], size: float) -> dict[str, sympy.Float]:
        return {f"{joint}.{q}": sympy.Float(rng.uniform(-size, size)) for joint, quantities in names.items() for q in quantities}

    positions = numbers({j.name: COORDINATES[j.kind] for j in joints}, 0.4)
    rates = numbers({j.name: SPEEDS[j.kind] for j in joints}, 1.0)
    return replace(scene({"drive": sympy.Float(0.2) + sympy.sin(TIME)}), positions=positions, rates=rates)


WHEEL = """
cutjoint: 1
name: wheel
gravity: [0, 0, -9.81]
bodies: {wheel: {mass: 50, centre_of_mass: [0, 0.6, 0.35], inertia: [1, 2, 1]}}
joints: {free: {kind: free, bodies: [ground, wheel], at: [0, 0.6, 0.35]}}
forces:
  tyre: {kind: tyre, body: wheel, centre: [0, 0.6, 0.35], axis: [0, 1, 0], radius: 0.36, stiffness: 4.0e+5, spin_inertia: 1.5,
         calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11, SN: 1.0274,
                   AF1: -1.71e-5, AF2: 1.71e-5}}
outputs: [wheel.y]
scenes:
  point: &point
    end: 1
    rates: {free.vx: SPEED, free.vy: 0.4, free.wx: 0.2, free.wz: 0.3}
    road: {contact: point, start: -1.2, profile: [{cosine: 5, amplitude: 0.02}]}
  disc:
    <<: *point
    road: {contact: disc, start: -0.2, profile: [{step: 0.01}, {ramp: 1, rise: 0.02}]}
"""


def wheel(road: str, speed: str) -> Case:
    """A free wheel on a road as a point or a disc, rolling at a speed in m/s or standing."""
    model = read_model_text(WHEEL.replace("SPEED", speed), "wheel.yaml")
    return Case(model=model, scene=find_scene(model, road), parameters={})


def exported(peer: str, case: Case, folder: Path) -> Path:
    """The case in a folder, ready to run."""
    write_files(folder, PEERS[peer].export(case.model, case.scene, case.parameters, case.outputs).files)
    return folder


def start_accelerations(peer: Peer, folder: Path) -> dict[str, tuple[float, float, float]]:
    """The accelerations of the bodies' centres of mass at the start of an export in a folder, m/s2."""
    command = [*build_peer(peer, folder), "--task", "accelerations", "--integrator", peer.integrators[0]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert "message" not in found, found["message"]
    return {body: (x, y, z) for body, (x, y, z) in found.items()}


def both_accelerations(peer: str, case: Case, folder: Path) -> tuple[Array, Array]:
    """The accelerations (bodies, 3) of all bodies with mass at the start: the peer's and cutjoint's."""
    found = start_accelerations(PEERS[peer], exported(peer, case, folder))
    outputs = [Output(element=body, quantity=q, span=case.model.span) for body in found for q in ("ax", "ay", "az")]
    _, own = own_run(case, outputs, end=0.0)
    return np.array(list(found.values())), np.array([own[o.column][0] for o in outputs]).reshape(-1, 3)


def own_run(case: Case, outputs: Sequence[Output], **changes: float) -> tuple[Array, Mapping[str, Array]]:
    """Time and columns of the recursive method; ``changes`` are of dt, end and output_step."""
    timed = with_settings(case.scene, "recursive", {name: value for name, value in changes.items() if name == "dt"})
    timed = replace(timed, **{name: value for name, value in changes.items() if name != "dt"})
    return run_generic(build_topology(case.model), timed, case.parameters, tuple(outputs))


def largest_differences(
    peer: str, case: Case, folder: Path, *, dt: float, own_dt: float, end: float, integrator: str
) -> dict[str, float]:  # fmt: skip
    """The largest difference between peer and cutjoint over ten rows of a run, by column."""
    run = run_peer(PEERS[peer], exported(peer, case, folder), dt=dt, end=end, integrator=integrator, output_step=end / 10)
    assert run.failure is None, str(run.failure)
    t, own = own_run(case, case.outputs, dt=own_dt, end=end, output_step=end / 10)
    np.testing.assert_allclose(run.t, t, atol=1e-9)
    return {name: float(np.abs(run[name] - own[name]).max()) for name in own}


def run_generic(
    topology: Topology, scene: Scene, parameters: Mapping[str, float], outputs: tuple[Output, ...]
) -> tuple[Array, Mapping[str, Array]]:
    """Time and columns of a scene in the generic simulator, which compiles nothing for a model.

    Raises:
        RunError: the scene has no start, or a step fails.
        SimulatorError, ToolchainError: as for a run.
    """
    with temporary_folder() as folder:
        (folder / "model.json").write_text(json.dumps(describe_generic(topology, scene, outputs)), encoding="utf-8")
        run_file = make_run_file(
            topology.model, with_closure(scene, PLAIN_CLOSURE), parameters, task="simulate", out=str(folder / "table.csv"),
            implementation=Implementation.GENERIC, options=PLAIN_STEPS,
        )  # fmt: skip
        summary = call_simulator(build_generic().path, {**run_file.entries(), "model": str(folder / "model.json")})
        if (failure := failure_of(summary)) is not None:
            where = places_of(topology, scene)
            raise RunError(describe_failure(failure, scene.name, where, Path(topology.model.span.file), parameters))
        return read_table(folder / "table.csv")
