"""Ratings of cuts, and the Jacobian that they are found from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutjoint.analysis.closing import design_coordinates, evaluate_closures, explore
from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.skew import RatedChoice, rate_choices
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import JointGeometry, design_jacobian
from cutjoint.topology.search import rank_cuts
from cutjoint.topology.spanning_tree import joints_around
from tests.analysis.formulated import formulated
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.overconstrained import parallel_cranks_text
from tests.mechanisms.random_models import chosen_loops, random_loops


def rated(model: Model, limit: int = 3) -> tuple[RatedChoice, ...]:
    topology = build_topology(model)
    return rate_choices(topology, rank_cuts(topology), limit)


def loops_jacobian(equations: RecursiveEquations) -> tuple[np.ndarray, np.ndarray]:
    """The loops' Jacobian from the joints' twists, with the columns of the speeds, and from the formulation."""
    topology = equations.topology
    loops = [(cut, joints_around(topology.tree, cut)) for cut in topology.cuts]
    met = list(dict.fromkeys(t.joint.name for _, around in loops for t in around))
    by_joint = {c.joint: range(c.v, c.v + len(c.speed_names)) for c in equations.charts}
    from_twists = np.zeros((len(equations.equation_names), equations.speeds))
    from_twists[:, [v for name in met for v in by_joint.get(name, ())]] = design_jacobian(JointGeometry(model=topology.model), loops)
    return from_twists, evaluate_closures(equations, design_coordinates(equations))[1]


@pytest.mark.parametrize("seed", [1, 3])
def test_the_design_jacobian_is_that_of_the_formulation(seed: int) -> None:
    for make in (random_loops, chosen_loops):
        from_twists, expected = loops_jacobian(formulated(make(seed)))
        np.testing.assert_allclose(from_twists, expected, rtol=0, atol=1e-12)


def test_the_condition_of_a_single_loop_is_that_of_its_jacobian() -> None:
    text = parallel_cranks_text(2)
    (choice,) = rated(read_model_text(text, "m.yaml"))
    (pose, *_) = explore(formulated(text))
    assert choice.used.condition == pytest.approx(pose.condition, rel=1e-12)


def test_given_cuts_say_so_and_what_another_would_change() -> None:
    choices = rated(read_model_text((MODELS / "iltis.yaml").read_text(), "iltis.yaml"))
    assert len(choices) == 8
    hinge = choices[0]
    assert hinge.used.option.joint.name == "front_left.leaf_hinge"
    assert hinge.reason.startswith("given by the model: ")
    assert [a.option.joint.name.removeprefix("front_left.") for a in hinge.alternatives] == ["leaf_ball", "carrier_ball", "arm_hinge"]


def test_a_chosen_cut_says_when_another_is_as_good() -> None:
    text = four_bar_text(3).partition("outputs:")[0].replace(", cut: true", "")
    for choice in rated(read_model_text(text, "m.yaml")):
        assert choice.reason == f"chosen: the same cost as at {choice.alternatives[0].option.joint.name}"
        assert choice.used.option.cost == choice.alternatives[0].option.cost < choice.alternatives[1].option.cost


def test_a_loop_without_a_choice_says_so() -> None:
    text = parallel_cranks_text(2, cut="").replace("axis: [0, 0, 1]}", "axis: [0, 0, 1], cut: false}")
    text = text[::-1].replace("}eslaf :tuc ,", "}", 1)[::-1]
    (choice,) = rated(read_model_text(text, "m.yaml"))
    assert (choice.alternatives, choice.reason) == ((), "no other joint of the loop may be cut")


def test_of_equal_cost_the_better_conditioned_comes_first() -> None:
    (choice,) = rated(read_model_text(parallel_cranks_text(2, (0.0, 3.0)), "m.yaml"))
    keys = [(a.option.cost, float(f"{a.condition:.2e}")) for a in choice.alternatives]
    assert keys == sorted(keys)
    everything = rated(read_model_text(parallel_cranks_text(2, (0.0, 3.0)), "m.yaml"), limit=9)[0].alternatives
    assert choice.alternatives == everything[: len(choice.alternatives)]


def _slider_crank() -> Model:
    lines = (MODELS / "slider_crank.yaml").read_text().replace(", cut: true", "").splitlines(keepends=True)
    return read_model_text("".join(line for line in lines if not line.startswith("outputs:")), "slider_crank.yaml")


@pytest.mark.parametrize(
    "make",
    [
        *(lambda seed=seed: chosen_loops(seed) for seed in range(6)),
        _slider_crank,
        lambda: read_model(MODELS / "car.yaml"),
        lambda: read_model(MODELS / "axle.yaml"),
        lambda: read_model_text(four_bar_text(4).replace(", cut: true", ""), "four_bar.yaml"),
        lambda: read_model_text((MODELS / "andrews.yaml").read_text().replace(", cut: true", ""), "andrews.yaml"),
    ],
)
def test_no_other_cut_of_a_loop_is_as_cheap_and_better_conditioned(make: object) -> None:
    for choice in rated(make(), limit=99):  # type: ignore[operator]
        used = choice.used
        for other in choice.alternatives:
            assert other.option.cost > used.option.cost or other.condition > 0.99 * used.condition, other.option.joint.name


@pytest.mark.parametrize("make", [lambda: read_model_text(parallel_cranks_text(3, cut=""), "m.yaml"), lambda: chosen_loops(1)])
def test_another_cut_changes_the_redundant_equations_as_its_kind_says(make: object) -> None:
    """The degrees of freedom stay; counted from the closures of the model cut there."""
    model: Model = make()  # type: ignore[operator]
    before = find_mobility(formulated(model))
    for choice in rated(model, limit=2):
        for option in (a.option for a in choice.alternatives):
            cuts = {c.name for c in option.cuts}
            moved = replace(model, joints=tuple(replace(j, cut=j.name in cuts) for j in model.joints))
            after = find_mobility(formulated(moved))
            assert after.degrees_of_freedom == before.degrees_of_freedom
            assert after.redundant - before.redundant == option.cost.redundant - choice.used.option.cost.redundant
