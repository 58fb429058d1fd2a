"""Isomorphic parts of a mechanism, whatever is cut."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import SubtreeClass
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.program.test_fold import with_a_rack

CAR = MODELS / "car.yaml"


def cut_at(model: Model, names: set[str]) -> Model:
    """The model with the joints of these names cut in every instance."""
    return replace(model, joints=tuple(replace(j, cut=j.name.rpartition(".")[2] in names) for j in model.joints))


def side_by_side(found: SubtreeClass) -> None:
    """Corresponding elements have the same name in all instances, unless they belong to several."""
    assert found.independent
    for row in zip(*found.members, strict=True):
        assert len({name.rpartition(".")[2] for name in row}) == 1


@pytest.mark.parametrize("first", ["upper_hinge", "upper_ball", "lower_hinge", "lower_ball"])
@pytest.mark.parametrize("second", ["rod_inner_ball", "rod_outer_joint"])
def test_the_corners_of_a_car_are_one_class_wherever_they_are_cut(first: str, second: str) -> None:
    (found,) = build_topology(cut_at(read_model(CAR), {first, second})).classes
    assert (len(found.roots), found.size) == (4, 4)
    side_by_side(found)


def test_the_order_of_the_file_makes_no_other_class() -> None:
    """One corner's arms stand in the file in another order than those of the others."""
    model = cut_at(read_model(CAR), {"upper_ball", "rod_inner_ball"})
    upper = next(j for j in model.joints if j.name == "rear_left.upper_hinge")
    (found,) = build_topology(replace(model, joints=(upper, *(j for j in model.joints if j is not upper)))).classes
    assert (len(found.roots), found.size) == (4, 4)
    side_by_side(found)


def test_the_sides_of_an_axle_are_one_class() -> None:
    """A guided rack between the tie rods and a bushing between the stabilisers' halves leave the sides independent."""
    sides, pads = build_topology(read_model(MODELS / "axle.yaml")).classes
    assert (len(sides.roots), sides.size) == (2, 5)
    side_by_side(sides)
    assert pads.roots == ("pad_l", "pad_r")


def test_a_rack_between_the_sides_leaves_them_independent() -> None:
    """One that slides by itself is their hub: its sides are alike with those of the axle behind, which has none."""
    topology = build_topology(read_model_text(with_a_rack(), "car.yaml"))
    (found,) = topology.classes
    assert (len(found.roots), found.size) == (4, 4)
    side_by_side(found)
    assert sorted(branch.hub for branch in topology.branches) == ["", "", "", "rack", "rack"]


def test_parts_of_different_carriers_are_classes_of_their_own() -> None:
    """The rear corners on a body of their own, which only slides."""
    rear = "  rear: {mass: 900, centre_of_mass: [0, 0, 0.58], inertia: [380, 1450, 1600]}\n"
    heave = "  heave: {kind: prismatic, bodies: [ground, rear], at: [0, 0, 0.58], axis: [0, 0, 1]}\n"
    text = CAR.read_text().replace("bodies:\n", f"bodies:\n{rear}", 1).replace("joints:\n", f"joints:\n{heave}", 1)
    front, back = text.split("  rear_left: {")
    assert "chassis: chassis, steering: chassis" in back
    behind = back.replace("chassis: chassis, steering: chassis", "chassis: rear, steering: rear")
    model = read_model_text(f"{front}  rear_left: {{{behind}", "cars.yaml")
    found = build_topology(model).classes
    assert sorted(sorted(name.partition(".")[0] for name in c.roots) for c in found) == [
        ["front_left", "front_right"], ["rear_left", "rear_right"],
    ]  # fmt: skip
    for c in found:
        side_by_side(c)


def test_the_members_of_a_chain_have_no_lanes() -> None:
    """Each coupler of the N-four-bar hangs on the crank before it."""
    classes = build_topology(read_model_text(four_bar_text(7), "four_bar.yaml")).classes
    assert classes
    assert not any(c.independent or c.lanes for c in classes)


@pytest.mark.parametrize(("law", "sizes"), [("drive", [4]), ("drive*rate", [2, 2])])
def test_a_part_may_lack_what_drives_others(law: str, sizes: list[int]) -> None:
    """A law over inputs alone is a number, as the 0 of a corner that nothing drives; one over the motion is not."""
    forces = "".join(
        f"  push_{side}: {{kind: joint_force, joint: {side}.lower_hinge, law: {law if 'rear' in side else 0}}}\n"
        for side in ("front_left", "front_right", "rear_left", "rear_right")
    )
    drive = f"parameters:\n  drive: {{value: 0, unit: {'N*m*s' if 'rate' in law else 'N*m'}, binding: input}}\n"
    text = CAR.read_text().replace("bodies:\n", f"{drive}forces:\n{forces}bodies:\n", 1)
    model = cut_at(read_model_text(text, "car.yaml"), {"upper_ball", "rod_inner_ball"})
    assert sorted(len(c.roots) for c in build_topology(model).classes) == sizes
