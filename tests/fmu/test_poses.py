"""Poses of bodies and markers as variables of FMUs."""

from __future__ import annotations

from pathlib import Path

import pytest

import cutjoint
from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.hung import HUNG

from .exchange import Exchange
from .slaves import ERROR, OK, started, write

pytestmark = needs_cpp


def fmu(version: int) -> Fmu:
    model = read_model_text(HUNG, "hung.yaml")
    return make_fmu(model, find_scene(model, None), version=version, kind="both", poses=True)


@pytest.mark.parametrize("version", with_heavy([2, 3], 2))
def test_fmus_have_the_poses_of_the_interface(version: int, tmp_path: Path) -> None:
    made, path = fmu(version), tmp_path / "hung.yaml"
    path.write_text(HUNG)
    names = [v.name for v in made.interface.poses]
    assert (len(names), names[16], names[19], names[-1]) == (64, "pose.top.x", "pose.top.qw", "pose.tip.dz")
    slave, sim = started(made), cutjoint.load(path, poses=True)
    sim.inputs["place"] = 0.0  # as FMUs hold inputs at what the scene has at time 0
    sim.reset()
    for i in range(3):
        assert slave.step(0.1 * i, 0.1) == OK, slave.log
        sim.advance(0.1 * i + 0.1)
        assert slave.get(*names) == sim.poses.array.ravel().tolist()
    assert slave.set_reference(slave.references["pose.top.x"], 0.0) == ERROR
    exchange = Exchange(made).begin()
    sim.reset()
    assert exchange.get(*names) == pytest.approx(sim.poses.array.ravel(), abs=1e-12)
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(write(made, tmp_path, sources=True, binary=False))) == []
