"""Predicted operations rank models as counted ones do."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import spearmanr

from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import DEFAULT_CLOSURE
from cutjoint.model.read import read_model
from cutjoint.model.records import GROUND, Gear, JointCoordinate, JointKind, Model
from cutjoint.program.records import Program
from cutjoint.program.scalars import FREE
from cutjoint.program.schedule import schedule
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology
from cutjoint.topology.spanning_tree import cost_of
from tests.conftest import MODELS
from tests.mechanisms.random_models import NOWHERE, SIZE, K, chosen_loops, floating_loops, random_loops, scene, tree_with, workshop

#: Ways to cut a suspension's two loops at other joints, the leaf link's loop first.
SUSPENSIONS = [
    (leaf, tie)
    for leaf in ("leaf_hinge", "leaf_ball", "arm_hinge", "carrier_ball")
    for tie in ("tie_rod_ball", "tie_rod_joint", "arm_hinge", "carrier_ball")
    if "tie_rod" in tie or "leaf" in leaf
]


def program_of(topology: Topology) -> Program:
    equations = formulate_recursive(topology, next(iter(topology.model.scenes.values()), scene()), ())
    evaluate = equations.functions[0]
    return schedule(equations.builder, [(evaluate.name, evaluate.results)])


def counted_and_predicted(model: Model) -> tuple[int, int]:
    topology = build_topology(model)
    return program_of(topology).operations("evaluate"), cost_of(model, topology.tree, topology.cuts).operations


@pytest.mark.parametrize("file", [MODELS / "iltis.yaml", MODELS / "car.yaml"])
def test_a_vehicle_takes_what_is_predicted(file: Path) -> None:
    """Within a sixth; of the closure that runs have by default, forces included, which are not predicted."""
    topology = build_topology(read_model(file))
    equations = formulate_recursive(topology, next(iter(topology.model.scenes.values())), (), closure=DEFAULT_CLOSURE)
    program = schedule_recursive(equations, lanes=True)
    cost = cost_of(topology.model, topology.tree, topology.cuts)
    assert cost.operations == pytest.approx(program.operations("evaluate"), rel=1 / 6)
    assert cost.counted_once == pytest.approx(program.instructions("evaluate"), rel=1 / 6)


def rank_correlation(models: list[Model]) -> float:
    counted, predicted = zip(*(counted_and_predicted(m) for m in models), strict=True)
    return float(spearmanr(counted, predicted).statistic)


def test_random_models() -> None:
    models = [make(seed) for make, n in ((random_loops, 6), (chosen_loops, 6), (floating_loops, 3)) for seed in range(n)]
    assert rank_correlation(models) > 0.8


@pytest.mark.parametrize("kind", [K.CONSTANT_VELOCITY, K.DISTANCE])
def test_placing_of_the_costliest_kinds(kind: JointKind) -> None:
    """The predictions of the kinds that cost most are means over these trees; those of the others are over further mechanisms."""
    counts = []
    for seed in range(4):
        topology = build_topology(tree_with(kind, seed % 2 == 1, seed))
        counted = kinematics(program_of(topology))
        counts += [counted[t.joint.name] for t in topology.tree if t.joint.kind is kind and t.parent != GROUND]
    assert JOINTS[kind].operations.placing[1] == pytest.approx(sum(counts) / len(counts), rel=0.1)


def kinematics(program: Program) -> Counter[str]:
    """Operations of the joints' kinematics by joint."""
    counted: Counter[str] = Counter()
    nodes = [program.graph.nodes[n] for n in program.function("evaluate").statements]
    for node in nodes:
        section = program.sections[node.section]
        if section.stage == "kinematics" and node.op not in FREE:
            counted[section.element] += max(node.lanes, 1)
    return counted


def test_a_gear_more_in_a_branch() -> None:
    w = workshop(0, "geared chain")
    body = GROUND
    for kind in (K.REVOLUTE, K.PRISMATIC, K.CYLINDRICAL, K.REVOLUTE):
        body = w.grow(body, kind)
    ends = [JointCoordinate(joint=j.name, name=j.element.coordinates[0], unit="") for j in w.joints]
    whole, inner = (
        Gear(name=name, first=ends[i], second=ends[k], ratio=SIZE.symbol, span=NOWHERE) for name, i, k in (("whole", 0, 3), ("inner", 1, 2))
    )
    counts, predicted = zip(*(counted_and_predicted(replace(w.model(), gears=gears)) for gears in ((whole,), (whole, inner))), strict=True)
    assert counts[1] - counts[0] == predicted[1] - predicted[0]


def suspension(joints: tuple[str, str]) -> Model:
    """The vehicle with its left suspensions alone, cut at two joints each; without sensors, for which a joint must be cut."""
    model = read_model(MODELS / "iltis.yaml")

    def left(elements: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(e for e in elements if "_right." not in e.name)

    cuts = tuple(replace(j, cut=j.name.partition(".")[2] in joints) if "." in j.name else j for j in left(model.joints))
    return replace(model, bodies=left(model.bodies), joints=cuts, forces=left(model.forces), reactions=(), markers=())


def test_iltis_cut_elsewhere() -> None:
    assert len(SUSPENSIONS) == 12
    assert rank_correlation([suspension(joints) for joints in SUSPENSIONS]) > 0.8
