"""Alternatives to the cut joints in use."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cutjoint.kernels.closures import derive_closure
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import SPEEDS, JointKind
from cutjoint.topology.build import build_topology
from cutjoint.topology.search import rank_cuts, reasons_not_to_cut
from cutjoint.topology.spanning_tree import cost_of
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.random_models import CUT_KINDS, chosen_loops, random_loops, workshop


@pytest.mark.parametrize("seed", range(8))
def test_no_single_exchange_is_better_than_the_chosen_cuts(seed: int) -> None:
    topology = build_topology(chosen_loops(seed))
    choices = rank_cuts(topology)
    assert len(choices) == len(topology.cuts) > 0
    for choice in choices:
        costs = [choice.used.cost, *(o.cost for o in choice.alternatives)]
        assert costs == sorted(costs)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_an_alternative_is_what_the_model_would_get_by_asking_for_it(seed: int) -> None:
    model = chosen_loops(seed)
    for choice in rank_cuts(build_topology(model)):
        for option in choice.alternatives:
            assert option.joint in option.cuts
            assert choice.used.joint not in option.cuts
            cuts = {c.name for c in option.cuts}
            asked = build_topology(replace(model, joints=tuple(replace(j, cut=j.name in cuts) for j in model.joints)))
            assert {c.name for c in asked.cuts} == cuts
            assert [t.child for t in asked.tree] == [t.child for t in option.tree]
            assert cost_of(model, asked.tree, asked.cuts) == option.cost


@pytest.mark.parametrize("seed", range(4))
def test_joints_that_must_not_be_cut_are_no_alternatives(seed: int) -> None:
    model = random_loops(seed)
    assert all(o.joint.name not in reasons_not_to_cut(model) for choice in rank_cuts(build_topology(model)) for o in choice.alternatives)


def test_joints_of_the_suspension_that_could_be_cut() -> None:
    found = rank_cuts(build_topology(read_model(MODELS / "iltis.yaml")))
    names = {c.used.joint.name: sorted(o.joint.name for o in c.alternatives) for c in found}
    assert names["rear_left.leaf_hinge"] == ["rear_left.arm_hinge", "rear_left.carrier_ball", "rear_left.leaf_ball"]
    assert names["rear_left.tie_rod_ball"] == ["rear_left.arm_hinge", "rear_left.carrier_ball", "rear_left.tie_rod_joint"]


def test_a_free_choice_cuts_each_window_of_the_n_four_bar_once() -> None:
    text = four_bar_text(4).replace(", cut: true", "")
    topology = build_topology(read_model_text(text, "m.yaml"))
    assert {loop.width for loop in topology.loops} == {1}
    for choice in rank_cuts(topology):
        window = choice.used.joint.name.removeprefix("closure_").removeprefix("coupler_").removesuffix(".pin")
        assert {o.joint.name for o in (choice.used, *choice.alternatives)} == {f"closure_{window}", f"coupler_{window}.pin"}


@pytest.mark.parametrize("kind", CUT_KINDS)
def test_equations_that_a_cut_brings_beyond_those_it_needs(kind: JointKind) -> None:
    """A cut joint's cost counts what its kernel has beyond six less the speeds of its kind."""
    w = workshop(0, f"one loop {kind}")
    w.joint(kind, w.grow("ground", JointKind.FREE), "ground", cut=True)
    topology = build_topology(w.model())
    (cut,) = topology.cuts
    expected = len(derive_closure(cut).names) - (6 - len(SPEEDS[kind]))
    assert cost_of(w.model(), topology.tree, topology.cuts).redundant == expected
