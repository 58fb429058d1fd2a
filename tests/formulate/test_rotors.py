"""Wheels whose mass moves with their carriers: the equations are those of wheels that are eliminated as any body is."""

from __future__ import annotations

from zlib import crc32

import numpy as np
import pytest
import sympy

from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive import equations
from cutjoint.model.read import read_model_text
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import reachable_blocks
from cutjoint.topology.build import build_topology
from tests.formulate.test_natural import Hills
from tests.physics.test_wheels import DATA, PAIR

AXLE = """
cutjoint: 1
name: axle
gravity: [0, 0, -9.81]
bodies: {chassis: {mass: 900, centre_of_mass: [0, 0, 0.5], inertia: [100, 400, 400]}}
joints: {moves: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.5]}}
submodels:
  suspension: {include: library/double_wishbone}
  wheel: {include: library/wheel_mf62}
  corner:
    connectors: [chassis]
    instances:
      links: {use: suspension, connect: {chassis: chassis, steering: chassis}, with: {x0: 0, tyre: 0}}
      wheel:
        use: wheel
        connect: {carrier: links.carrier}
        with: {x: 0, y: 0.74, z: 0.35, toe: 0.02, camber: -0.01, brake: 300, drive: 40}
        properties: mf62.tir
instances:
  left: &left {use: corner, connect: {chassis: chassis}}
  right: {<<: *left, mirror: y}
outputs: [left.wheel.rolling.contact.vy, left.wheel.rolling.wheel.ax, left.links.carrier.az]
scenes: {run: {end: 1, numerics: {dt: 0.001}}}
"""

#: A wheel far from the centre of mass of what carries it, which turns about all axes.
TRAILER = """
cutjoint: 1
name: trailer
gravity: [0, 0, -9.81]
bodies: {chassis: {mass: 90, centre_of_mass: [0.3, 0, 0.5], inertia: [10, 40, 40]}}
joints: {moves: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.5]}}
submodels: {wheel: {include: library/wheel_mf62}}
instances:
  w: {use: wheel, connect: {carrier: chassis}, with: {x: 0, y: 0.74, z: 0.35, toe: 0.02, camber: -0.01, brake: 300}, properties: mf62.tir}
outputs: [w.rolling.contact.vy, w.rolling.wheel.ax]
scenes: {run: {end: 1, numerics: {dt: 0.001}}}
"""


def found(e: RecursiveEquations, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Results of functions at a state that follows from the names of the inputs."""
    results = {f"{f.name} {name}": block for f in e.functions if f.name in names for name, block in f.results.items()}
    known = {"motion": [1.0], "numerics": [1e4, 1.0, 10.0], "parameters": [float(sympy.sympify(p.value)) for p in e.parameters]}
    for name, size in {(str(block.data), block.shape[0]) for block in reachable_blocks(results.values()) if block.op == "symbol"}:
        values = np.random.default_rng(crc32(name.encode())).uniform(-0.05, 0.05, size)
        if name.startswith("q:") and size in (4, 7):
            values[-4] = 1
            values[-4:] /= np.linalg.norm(values[-4:])
        known.setdefault(name, list(values * (400 if "bearing" in name else 20 if name.startswith("v:") else 1)))
    inputs = {name: np.array([values]) for name, values in known.items()}
    blocks = interpret_blocks(list(results.values()), inputs, {road: Hills() for road in e.roads})
    return {name: np.ravel(blocks[block]) for name, block in results.items()}


@pytest.mark.parametrize("text", [PAIR % ("", ""), PAIR % ("", ", mirror: y"), AXLE, TRAILER], ids=["tree", "mirrored", "loops", "free"])
def test_rotors_move_as_other_bodies_do(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model = read_model_text(text, "m.yaml", folder=DATA)
    topology, scene = build_topology(model), model.scenes["run"]
    ours, plain = [], equations.find_rotors
    for rotors in (plain, lambda k, model: {}):
        monkeypatch.setattr(equations, "find_rotors", rotors)
        e = equations.formulate_recursive(topology, scene, scene.outputs)
        ours.append((e, found(e, ("evaluate", "report", "energy", "project"))))
    (fewer, one), (more, other) = ours
    for name, values in other.items():
        assert one[name] == pytest.approx(values, rel=1e-9, abs=1e-9 * max(1.0, np.abs(values).max())), name
    sizes = [len(reachable_blocks(e.functions[0].results.values())) for e in (fewer, more)]
    assert sizes[0] < 0.97 * sizes[1]
