"""Turns of kinds whose inputs take very different times, on a clock that is counted, not read."""

from __future__ import annotations

from collections import Counter
from math import sqrt

import pytest

from .turns import TURN, Turns


def play(turns: Turns, costs: dict[str, float], *, seconds: float, setups: dict[str, float] | None = None) -> dict[str, list[int]]:
    """The seeds that each kind has in so many seconds of one process; each first turn takes a set-up more."""
    seeds: dict[str, list[int]] = {name: [] for name in costs}
    now = 0.0
    while turn := turns.next(seconds - now):
        name, these = turn
        first = 0.0 if seeds[name] else (setups or {}).get(name, 0.0)
        seeds[name] += these
        turns.end(name, len(these), seconds=first + costs[name] * len(these), checked=costs[name] * len(these))
        now += first + costs[name] * len(these)
    return seeds


@pytest.mark.parametrize("shares", [{"short": 1, "long": 1, "other": 1}, {"short": 1, "long": 2, "other": 0.5}])
def test_kinds_share_time_and_inputs(shares: dict[str, float]) -> None:
    """Time and inputs have a product in the ratio of the shares' squares: n = k s/sqrt(c) inputs of c seconds each."""
    costs = {"short": 0.01, "long": 20.0, "other": 1.0}
    seeds = play(Turns.of(0, shares, {}), costs, seconds=2000)
    for name, share in shares.items():
        fair = 2000 * share * sqrt(costs[name]) / sum(share * sqrt(costs[name]) for name, share in shares.items())
        assert len(seeds[name]) * costs[name] == pytest.approx(fair, abs=2 * max(TURN, *costs.values()))


def test_seeds_follow_each_other_from_the_first() -> None:
    seeds = play(Turns.of(7, {"a": 1, "b": 1}, {}), {"a": 0.5, "b": 3.0}, seconds=100)
    for each in seeds.values():
        assert each == list(range(7, 7 + len(each)))
        assert len(each) > 10


def test_a_kind_ends_with_its_count_and_leaves_the_time_to_others() -> None:
    seeds = play(Turns.of(0, {"a": 1, "b": 1}, {"a": 5}), {"a": 1.0, "b": 1.0}, seconds=100)
    assert {name: len(each) for name, each in seeds.items()} == {"a": 5, "b": 95}


def test_each_kind_has_its_turn_where_one_input_takes_most_of_the_time() -> None:
    seeds = play(Turns.of(0, {"slow": 1, "fast": 1, "last": 1}, {}), {"slow": 250.0, "fast": 1.0, "last": 1.0}, seconds=300)
    assert {name: len(each) for name, each in seeds.items()} == {"slow": 1, "fast": 25, "last": 25}


def test_a_long_set_up_is_not_taken_for_long_inputs() -> None:
    seeds = play(Turns.of(0, {"a": 1, "b": 1}, {}), {"a": 1.0, "b": 1.0}, seconds=300, setups={"a": 100.0})
    assert Counter({name: len(each) for name, each in seeds.items()}) == pytest.approx({"a": 80, "b": 120}, abs=2 * TURN)


def test_no_input_begins_that_would_not_end() -> None:
    assert len(play(Turns.of(0, {"a": 1}, {}), {"a": 40.0}, seconds=100)["a"]) == 2


def test_turns_under_way_count() -> None:
    turns = Turns.of(0, {"a": 1, "b": 1, "c": 1}, {})
    begun = [turns.next(10.0) for _ in range(3)]
    assert begun == [("a", range(1)), ("b", range(1)), ("c", range(1))]
