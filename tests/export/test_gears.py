"""Gears in exports: MuJoCo couples joints, the others refuse; trajectories are compared in `test_peers.py`."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint_bench.export.peers import PEERS
from tests.conftest import needs_cpp
from tests.export.cases import GEARED, geared
from tests.export.own import Case, exported

pytestmark = needs_cpp


def couplings(case: Case, folder: Path) -> dict[str, tuple[str, str | None, float]]:
    """MuJoCo's gears by name: both joints and the ratio."""
    root = ElementTree.parse(exported("mujoco", case, folder) / "gears.xml")
    found = {}
    for element in root.iter("equality"):
        for e in element.iter("joint"):
            offset, ratio, *rest = map(float, e.attrib["polycoef"].split())
            assert offset == 0.0
            assert not any(rest)
            found[e.attrib["name"]] = (e.attrib["joint1"], e.get("joint2"), ratio)
    return found


def test_mujoco_couples_joints(tmp_path: Path) -> None:
    found = couplings(geared(), tmp_path)
    assert found["mesh"] == ("rack", "pinion", 0.1)
    assert found["right_mesh"] == ("right_pin.angle", "spider_pin", -1.0)
    assert len(found) == 6


def test_beside_a_joint_that_stands_still_the_other_one_stands(tmp_path: Path) -> None:
    model = read_model_text(GEARED.replace('guide: "0.5*sin(3*t)"', "guide: 0.2"), "gears.yaml")
    found = couplings(Case(model=model, scene=model.scenes["run"], parameters={}), tmp_path)
    assert found["wheels"] == ("driven", None, 0.0)


def test_mujoco_refuses_coordinates_that_its_joints_do_not_have() -> None:
    text = GEARED.replace("pinion: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 1, 0]}",
                          "pinion: {kind: free, bodies: [ground, wheel], at: [0, 0, 0]}")  # fmt: skip
    text = text.replace("{joints: [rack, pinion], ratio: 0.1 m/rad}", "{joints: [rack, pinion.x], ratio: 1}")
    text = text.replace("[pinion.angle, ", "[")
    model = read_model_text(text, "gears.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["mujoco"].export(model, model.scenes["run"], {}, ())
    assert str(refused.value) == (
        "gears.yaml:35:3: gear 'mesh': a coordinate of a joint of kind free is none in MuJoCo; leave it out, or name another joint"
    )


REASONS = {
    "exudyn": "Exudyn, where bodies have no joint coordinates", "pinocchio": "Pinocchio, whose program there couples no joint coordinates"
}  # fmt: skip


@pytest.mark.parametrize("peer", REASONS)
def test_the_others_refuse_gears(peer: str) -> None:
    case = geared()
    with pytest.raises(ModelError) as refused:
        PEERS[peer].export(case.model, case.scene, {}, ())
    wanted = f"gears.yaml:35:3: gear 'mesh': is not exported to {REASONS[peer]}; leave it out, or couple the bodies there by hand"
    assert wanted in str(refused.value).splitlines()
