"""Predicted operations rank models as counted ones do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scipy.stats import spearmanr

from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model
from cutjoint.model.records import Model
from cutjoint.program.schedule import schedule
from cutjoint.topology.build import build_topology
from cutjoint.topology.spanning_tree import cost_of
from tests.conftest import MODELS
from tests.mechanisms.random_models import chosen_loops, floating_loops, random_loops, scene

#: Ways to cut a suspension's two loops at other joints, the leaf link's loop first.
SUSPENSIONS = [
    (leaf, tie)
    for leaf in ("leaf_hinge", "leaf_ball", "arm_hinge", "carrier_ball")
    for tie in ("tie_rod_ball", "tie_rod_joint", "arm_hinge", "carrier_ball")
    if "tie_rod" in tie or "leaf" in leaf
]


def counted_and_predicted(model: Model) -> tuple[int, int]:
    topology = build_topology(model)
    equations = formulate_recursive(topology, next(iter(model.scenes.values()), scene()), ())
    evaluate = equations.functions[0]
    program = schedule(equations.builder, [(evaluate.name, evaluate.results)])
    return program.operations("evaluate"), cost_of(model, topology.tree, topology.cuts).operations


def rank_correlation(models: list[Model]) -> float:
    counted, predicted = zip(*(counted_and_predicted(m) for m in models), strict=True)
    return float(spearmanr(counted, predicted).statistic)


def test_random_models() -> None:
    models = [make(seed) for make, n in ((random_loops, 6), (chosen_loops, 6), (floating_loops, 3)) for seed in range(n)]
    assert rank_correlation(models) > 0.8


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
