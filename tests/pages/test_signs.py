"""The picture of signs: its script draws the same, and models do as it shows."""

from __future__ import annotations

from pathlib import Path

import pytest
from docs.pictures import signs

from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

TEXT = """
cutjoint: 1
name: signs
gravity: [0, 0, 0]
bodies:
  base: {mass: 1, centre_of_mass: [0, 0, 0]}
  follower: {mass: 2, centre_of_mass: [1, 0, 0]}
joints:
  rail: {kind: prismatic, bodies: [ground, base], at: [0, 0, 0], axis: x, GUIDE}
  slide: {kind: prismatic, bodies: [base, follower], at: [1, 0, 0], axis: x}
forces: {push: FORCE}
reactions: {bears: {joint: rail, axes_of: ground, direction: x}}
outputs: [base.ax, follower.ax, bears.force]
scenes: {run: {end: 1 ms, output_step: 1 ms}}
"""


def test_the_picture_is_what_its_script_draws() -> None:
    assert signs.FILE.read_text(encoding="utf-8") == signs.picture()


@pytest.mark.parametrize(
    ("force", "sign"),
    [
        ("{kind: point_spring, bodies: [base, follower], from: [0, 0, 0], to: [1, 0, 0], law: 6}", -1),
        ("{kind: joint_force, joint: slide, law: 6}", 1),
        ("{kind: axial_force, bodies: [base, follower], origin: [0, 0, 0], point: [1, 0, 0], axis: x, law: 6}", 1),
    ],
)
@pytest.mark.parametrize("guide", ["", "guide: 0"])
def test_positive_numbers_act_as_the_arrows(tmp_path: Path, force: str, sign: int, guide: str) -> None:
    """Newton's law: 6 N on 2 kg and back on 1 kg; the joint of a base at rest gives it what the force takes."""
    path = tmp_path / "signs.yaml"
    path.write_text(TEXT.replace("FORCE", force).replace(", GUIDE", f", {guide}" if guide else ""), encoding="utf-8")
    model = read_model(path)
    run = simulate(compile_scene(model, model.scenes["run"]))
    found = [run[name][0] for name in ("base.ax", "follower.ax", "bears.force")]
    assert found == pytest.approx([0, sign * 3, sign * 6] if guide else [-sign * 6, sign * 3, 0], abs=1e-9)
