"""Forces of drives that a prescribed motion needs, beside the accelerations that a run under them has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.records import Model, Output
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from cutjoint.tasks.inverse import inverse_dynamics
from cutjoint.topology.reading import read_model_text
from tests.conftest import needs_cpp

pytestmark = needs_cpp

#: A five-bar with springs, dampers, a rotor and a gear, whose two degrees of freedom a scene prescribes.
FIVE_BAR = """
cutjoint: 1
name: five_bar
gravity: [0, 0, -9.81]
parameters: {ta: {value: 0, unit: N*m, binding: input}, tc: {value: 0, unit: N*m, binding: input}}
points: {A: [0, 0, 0], B: [0.5, 0, 0.5], C: [1, 0, 0], D: [1.5, 0, 0.5], E: [1, 0, 1.2]}
bodies:
  a: {mass: 1, centre_of_mass: {midpoint: [A, B]}, inertia: [0.02, 0.02, 0.02]}
  b: {mass: 2, centre_of_mass: {midpoint: [B, E]}, inertia: [0.02, 0.02, 0.02]}
  c: {mass: 1, centre_of_mass: {midpoint: [C, D]}, inertia: [0.02, 0.02, 0.02]}
  d: {mass: 1, centre_of_mass: {midpoint: [D, E]}, inertia: [0.02, 0.02, 0.02]}
  rotor: {mass: 0.5, centre_of_mass: A, inertia: [0.002, 0.004, 0.002]}
joints:
  ja: {kind: revolute, bodies: [ground, a], at: A, axis: y, armature: 0.3, spring: {stiffness: 5, damping: 1}}
  jb: {kind: revolute, bodies: [a, b], at: B, axis: y}
  jc: {kind: revolute, bodies: [ground, c], at: C, axis: y}
  jd: {kind: revolute, bodies: [c, d], at: D, axis: y, spring: {stiffness: 2, damping: 0.4}}
  je: {kind: revolute, bodies: [b, d], at: E, axis: y}
  spin: {kind: revolute, bodies: [ground, rotor], at: A, axis: y}
gears: {mesh: {joints: [spin, ja], ratio: -7}}
forces:
  ma: {kind: joint_force, joint: ja, law: ta}
  mc: {kind: joint_force, joint: jc, law: tc}
outputs: [a.ax, a.az, b.ax, b.az, d.ax, d.az]
scenes:
  move: {end: 1, output_step: 0.25, drive: {ja: "0.3*sin(3*t)", jb: "0.2*sin(2*t)**2"}}
  part: {end: 1, output_step: 0.25, drive: {ja: "0.3*sin(3*t)"}}
  free: {end: 1.0e-3, POSITIONS}
"""


def five_bar(start: str = "rates: {}") -> Model:
    return read_model_text(FIVE_BAR.replace("POSITIONS", start), "five_bar.yaml")


def test_drives_bring_the_motion_about() -> None:
    model = five_bar()
    case, scene = find_case(model, "move")
    prescribed = simulate(compile_interpreted(case, scene), error=False)
    found = inverse_dynamics(model, scene="move", drives=["ja", "jc"])
    assert not found.redundant
    assert found.units == {"ja": "N*m", "jc": "N*m"}
    for row, t in enumerate(found.t):
        angles = {"ja.angle": 0.3 * np.sin(3 * t), "jb.angle": 0.2 * np.sin(2 * t) ** 2}
        rates = {"ja.angle_rate": 0.9 * np.cos(3 * t), "jb.angle_rate": 0.4 * np.sin(4 * t)}
        start = ", ".join(f"{what}: {{{', '.join(f'{k}: {float(x)!r}' for k, x in of.items())}}}" for what, of in
                          (("positions", angles), ("rates", rates)))  # fmt: skip
        free, begun = find_case(five_bar(start), "free")
        run = simulate(compile_interpreted(free, begun), inputs={"ta": float(found["ja"][row]), "tc": float(found["jc"][row])}, error=False)
        for column in scene.outputs:
            assert run[column.column][0] == pytest.approx(prescribed[column.column][row], abs=1e-9)


def test_several_solutions_and_none() -> None:
    model = five_bar()
    least = inverse_dynamics(model, scene="move", drives=["ja", "jb", "jc"])
    assert least.redundant
    two = inverse_dynamics(model, scene="move", drives=["ja", "jc"])
    assert np.all(least["ja"] ** 2 + least["jb"] ** 2 + least["jc"] ** 2 <= two["ja"] ** 2 + two["jc"] ** 2 + 1e-12)
    with pytest.raises(RunError, match="the drives ja cannot move 'jb' as scene 'move' does"):
        inverse_dynamics(model, scene="move", drives=["ja"])
    with pytest.raises(RunError, match="leaves 1 degree of freedom open"):
        inverse_dynamics(model, scene="part")
    with pytest.raises(RunError, match="prescribes no motion"):
        inverse_dynamics(model, scene="free")
    with pytest.raises(RunError, match="there is no joint 'jx'"):
        inverse_dynamics(model, scene="move", drives=["jx"])


def test_drives_may_be_joints_that_stand_still_or_would_be_cut() -> None:
    """All sets of drives have one power; a constant law is a motion as any other if its joint is named."""
    bent = '  bent: {end: 1, output_step: 0.25, drive: {ja: "0.3*sin(3*t)", jb: "0"}}\n  held: {end: 0.1, output_step: 0.1, lock: [ja, jb]}'
    text = FIVE_BAR.replace("POSITIONS", "rates: {}") + bent + "\n"
    model = read_model_text(text, "five_bar.yaml")
    columns = [f"{name}.angle_rate" for name in ("ja", "jb", "jc", "jd", "je")]
    powers = []
    for drives in (("ja", "jc"), ("ja", "je"), ("jd", "je"), ("ja", "jb")):
        found = inverse_dynamics(model, scene="move", drives=drives)
        case, scene = find_case(model, "move")
        outputs = [Output(element=c.partition(".")[0], quantity="angle_rate", span=model.span) for c in columns]
        run = simulate(compile_interpreted(case, scene, outputs=outputs), error=False)
        powers.append(sum(found[name] * run[f"{name}.angle_rate"] for name in drives))
    for power in powers[1:]:
        assert power == pytest.approx(powers[0], rel=1e-8, abs=1e-8)
    held = inverse_dynamics(model, scene="held")
    assert inverse_dynamics(model, scene="held", drives=["ja"])["ja"] == pytest.approx(held["ja"], rel=1e-9)  # the other stays locked
    named = inverse_dynamics(model, scene="bent", drives=["ja", "jb"])
    moving = inverse_dynamics(read_model_text(text.replace('jb: "0"', 'jb: "1e-30*t"'), "five_bar.yaml"), scene="bent")
    assert named["jb"] == pytest.approx(moving["jb"], rel=1e-9)
    assert named["ja"] == pytest.approx(moving["ja"], rel=1e-9)


def test_a_pendulum_in_closed_form(tmp_path: Path) -> None:
    text = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
bodies: {arm: {mass: 2, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y, armature: 0.4}}
scenes:
  turn: {end: 1, output_step: 0.1, drive: {pin: "sin(t)"}}
  hold: {end: 0.1, output_step: 0.1, positions: {pin.angle: 30 deg}, lock: [pin]}
  stand: {end: 0.1, output_step: 0.1, drive: {pin: 30 deg}}
"""
    model = read_model_text(text, "pendulum.yaml")
    for scene in ("hold", "stand"):  # where nothing moves, the torque that holds
        assert inverse_dynamics(model, scene=scene)["pin"] == pytest.approx(-2 * 9.81 * 0.5 * np.cos(np.pi / 6), abs=1e-10)
    found = inverse_dynamics(model, scene="turn")
    angle = np.sin(found.t)
    expected = (0.1 + 2 * 0.25 + 0.4) * -np.sin(found.t) - 2 * 9.81 * 0.5 * np.cos(angle)
    assert found["pin"] == pytest.approx(expected, abs=1e-10)
