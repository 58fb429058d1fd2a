"""The joints that the compiler cuts, beside what a search by hand finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import pytest

from cutjoint.elements.joint import rate_name
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import GROUND, Model, Output
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology
from cutjoint.topology.search import Spanning, find_rules, span
from cutjoint.topology.spanning_tree import TopologyError, cost_of
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.random_models import NOWHERE, chosen_loops


def car() -> Model:
    return read_model(MODELS / "car.yaml")


def front() -> Model:
    """The car without its rear corners."""
    lines = (MODELS / "car.yaml").read_text().splitlines(keepends=True)
    return read_model_text("".join(line for line in lines if not line.startswith("  rear_")), "front.yaml")


def axle() -> Model:
    return read_model(MODELS / "axle.yaml")


def slider_crank() -> Model:
    """The one of the models, with nothing said of its cuts."""
    text = (MODELS / "slider_crank.yaml").read_text().replace(", cut: true", "")
    return read_model_text("".join(line for line in text.splitlines(keepends=True) if not line.startswith("outputs:")), "slider_crank.yaml")


def four_bars() -> Model:
    """Three windows with nothing said of their cuts."""
    return read_model_text(four_bar_text(3).partition("outputs:")[0].replace(", cut: true", ""), "four_bar.yaml")


def cut_by_hand(model: Model, count: int) -> Iterator[Topology]:
    """Every way to cut so many joints, the same ones in all instances."""
    names = {j.name: j.name.rpartition(".")[2] for j in model.joints if j.element.closes and j.guide is None}
    for chosen in combinations(sorted(set(names.values())), count):
        joints = tuple(replace(j, cut=names[j.name] in chosen) if j.name in names else j for j in model.joints)
        try:
            yield build_topology(replace(model, joints=joints))
        except TopologyError:
            continue


def counted_once(topology: Topology) -> int:
    """The operations that are emitted, those of all lanes counted once."""
    equations = formulate_recursive(topology, next(iter(topology.model.scenes.values())), ())
    return schedule_recursive(equations, lanes=True).instructions("evaluate")


@pytest.mark.parametrize(("make", "count"), [(front, 2), (slider_crank, 1)])
def test_no_cuts_by_hand_take_fewer_operations(make: object, count: int) -> None:
    model: Model = make()  # type: ignore[operator]
    by_hand = [counted_once(topology) for topology in cut_by_hand(model, count)]
    assert len(by_hand) >= 3
    assert counted_once(build_topology(model)) == min(by_hand)


@pytest.mark.parametrize(("make", "count"), [(car, 2), (axle, 4)])
def test_no_cuts_by_hand_are_predicted_to_take_fewer_operations(make: object, count: int) -> None:
    model: Model = make()  # type: ignore[operator]
    chosen = build_topology(model)
    by_hand = [cost_of(model, topology.tree, topology.cuts) for topology in cut_by_hand(model, count)]
    assert len(by_hand) > 10
    assert cost_of(model, chosen.tree, chosen.cuts) == min(by_hand)


def spanning_trees(model: Model, count: int) -> Iterator[Spanning]:
    """Every choice of so many cut joints that leaves a tree, as the rules allow it."""
    rules = find_rules(model)
    free = [j.name for j in model.joints if j.name not in rules.uncuttable]
    for names in combinations(free, count):
        reached = {GROUND}
        for _ in model.bodies:
            reached |= {b for j in model.joints if j.name not in names and {j.base, j.follower} & reached for b in (j.base, j.follower)}
        if len(reached) == len(model.bodies) + 1:  # all bodies by as many joints as there are
            spanning = Spanning(model=model, cut=frozenset(names))
            if not rules.faults(spanning.tree, spanning.cuts):
                yield spanning


@pytest.mark.parametrize("make", [slider_crank, four_bars, *(lambda seed=seed: chosen_loops(seed) for seed in range(6))])
def test_no_other_tree_is_predicted_to_take_fewer_operations(make: object) -> None:
    model: Model = make()  # type: ignore[operator]
    """But for trees with forces on more cut joints."""
    chosen, rules = span(model), find_rules(model)
    costs = [(rules.forces_on(spanning.cuts), spanning.cost) for spanning in spanning_trees(model, len(chosen.cut))]
    assert len(costs) > 1
    assert (rules.forces_on(chosen.cuts), chosen.cost) == min(costs)


@pytest.mark.parametrize("make", [car, axle, slider_crank])
def test_outputs_change_no_cuts(make: object) -> None:
    """But for angles of joints in spatial loops, which are not known where these are cut."""
    model: Model = make()  # type: ignore[operator]
    outputs = tuple(
        Output(element=e.name, quantity=next(iter(quantities(e))), span=NOWHERE) for e in (*model.bodies, *model.force_elements)
    ) + tuple(Output(element=j.name, quantity=rate_name(c), span=NOWHERE) for j in model.joints for c in j.element.measurable)
    cuts = [
        span(replace(model, scenes={name: replace(scene, outputs=wanted) for name, scene in model.scenes.items()})).cut
        for wanted in ((), outputs)
    ]
    assert cuts[0] == cuts[1]


@pytest.mark.parametrize("make", [car, axle])
def test_the_same_joints_of_all_instances_are_cut(make: object) -> None:
    model: Model = make()  # type: ignore[operator]
    cuts: dict[str, set[str]] = {}
    for cut in build_topology(model).cuts:
        instance, _, name = cut.name.rpartition(".")
        cuts.setdefault(instance, set()).add(name)
    assert len(cuts) > 1
    assert len({frozenset(names) for names in cuts.values()}) == 1
