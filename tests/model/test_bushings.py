"""Bushings: their laws and frames, and what is wrong with them."""

from __future__ import annotations

import pytest

from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.records import Bushing

from .pendulum import check, read

DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'
PLACE = "mount: {kind: bushing, bodies: [ground, arm], at: tip"
SIX = "[1, 2, 3, 4, 5, 6]"


def bushing(fields: str) -> Bushing:
    (force,) = read(DRAG, f"{PLACE}, {fields}}}").forces
    assert isinstance(force, Bushing)
    return force


def values(force: Bushing, position: float, rate: float) -> list[float]:
    return [evaluate(law, {variable("position"): position, variable("rate"): rate}) for law in force.laws]


def test_stiffness_and_damping_draw_back() -> None:
    assert values(bushing(f"stiffness: {SIX}"), 2.0, 9.0) == [-2, -4, -6, -8, -10, -12]
    assert values(bushing(f"stiffness: [1 kN/m, 0, 0, 2 N*m, 0, 0], damping: {SIX}"), 1.0, 1.0) == [-1001, -2, -3, -6, -5, -6]


def test_laws_of_any_form() -> None:
    force = bushing("laws: [1, '-rate', {stop: {at: 0, side: below, stiffness: 5}}, 0, {stiffness: 2, free_position: 1}, 3]")
    assert values(force, -1.0, 2.0) == [1, -2, 5, 0, 4, 3]


def test_the_frame_is_right_handed_by_any_two_directions() -> None:
    for given in ("x: [0, 1, 0], y: [0, 0, 1]", "x: [0, 1, 0], z: [1, 0, 0]", "y: [0, 0, 1], z: [1, 0, 0]"):
        assert bushing(f"stiffness: {SIX}, {given}").axes == ((0, 1, 0), (0, 0, 1), (1, 0, 0))


def test_quantities() -> None:
    units = quantities(bushing(f"stiffness: {SIX}"))
    assert list(units) == ["Fx", "Fy", "Fz", "Mx", "My", "Mz", "dx", "dy", "dz", "rx", "ry", "rz"]
    assert [units[name] for name in ("Fx", "Mx", "dx", "rx")] == ["N", "N*m", "m", "rad"]


PROBLEMS = [
    (f"§{PLACE}}}", "@: force 'mount': needs either laws, or stiffness and damping"),
    (f"§{PLACE}, laws: {SIX}, damping: {SIX}}}", "@: force 'mount': needs either laws, or stiffness and damping"),
    (f"{PLACE}, stiffness: §[1, 2, 3]}}", "@: force 'mount': stiffness needs six values; write [along x, y, z, about x, y, z]"),
    (f"{PLACE}, stiffness: [1, 2, 3, §4 N/m, 5, 6]}}", "@: force 'mount': stiffness needs N*m, got N/m"),
    (f"§{PLACE}, stiffness: {SIX}, x: [1, 0, 0]}}", "@: force 'mount': its frame needs two of the directions x, y, z"),
    (f"{PLACE}, stiffness: {SIX}, x: [1, 0, 0], y: §[1, 1, 0]}}", "@: force 'mount': the directions x and y are not perpendicular"),
    (f"{PLACE}, laws: [1, 2, §length, 4, 5, 6]}}",
     "@: force 'mount': laws: unknown symbol 'length'; did you mean 'arm_length'?"),
    ("mount: {kind: bushing, bodies: §[arm, arm], at: tip, stiffness: [1, 2, 3, 4, 5, 6]}",
     "@: force 'mount': joins the body 'arm' to itself; name two bodies"),
]  # fmt: skip


@pytest.mark.parametrize(("new", "expected"), PROBLEMS)
def test_problems(new: str, expected: str) -> None:
    check(DRAG, new, expected)
