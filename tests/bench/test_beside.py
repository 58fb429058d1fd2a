"""Ours beside peers at equal errors: which setting counts, and its row in the table."""

from __future__ import annotations

from cutjoint_bench.findings import Spot
from cutjoint_bench.studies.beside import at_error, rows


def test_the_fastest_of_the_settings_that_are_accurate_enough() -> None:
    spots = [Spot(0.1, "mujoco/rk4", 1e-2, 2e-3), Spot(0.3, "mujoco/rk4", 5e-3, 5e-5), Spot(0.2, "mujoco/rk4", 4e-3, 8e-5)]
    assert at_error(spots, 1e-3) == at_error(spots, 1e-4) == spots[2]
    assert at_error(spots, 1e-6) is None


def test_what_is_asked_for_is_not_another_accuracy() -> None:
    spots = [Spot(0.2, "asked", 1e-3, 1e-8), Spot(0.1, "asked", 1e-4, 1e-8)]
    assert at_error(spots, 1e-3) == spots[0]


def test_ratios_are_of_least_times_and_of_turns() -> None:
    """Twice in each turn, and 0.04 over 0.01 by the least times."""
    def of(contender: str, *seconds: float) -> dict[str, object]:
        return {"error": 1e-3, "contender": contender, "dt": 0.01, "reached": 5e-4, "seconds": seconds}

    head, row, *_ = rows([
        of("recursive", 0.02, 0.03, 0.01), of("asked", 0.04, 0.04, 0.04), of("mujoco/rk4", 0.5, 0.5, 0.5),
        of("pinocchio/rk4", 9.0, 9.0, 9.0),
        of("pinocchio/lcaba_rk4", 0.04, 0.06, 0.04),
    ])  # fmt: skip
    assert head[1:6] == ["ours", "asked", "MuJoCo", "Pinocchio", "Pinocchio, `lcaba`"]
    assert row[1] == "10 (`recursive`, 10; 5.0e-04)"
    assert row[-2:] == ["4 (2 .. 4)", "1 (1 .. 1.5)"]
