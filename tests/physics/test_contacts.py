"""Balls and feet on planes and cylinders with the library's law of contact, against closed forms: rebound, sticking, rolling."""

from __future__ import annotations

from math import log, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Contact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model
from cutjoint_bench.mechanics_alone import require_mechanics_alone
from tests.conftest import needs_cpp
from tests.physics.simulation import CompileOptions, compile_scene

pytestmark = needs_cpp

BALL = """
cutjoint: 1
name: ball
gravity: [0, 0, GRAVITY]
submodels: {law: {include: library/contact_law}}
bodies: {ball: {mass: 0.5, centre_of_mass: [0, 0, 0.1], inertia: [0.002, 0.002, 0.002]}}
joints: {free: {kind: free, bodies: [ground, ball], at: [0, 0, 0.1]}}
forces:
  floor: {kind: contact, bodies: [ground, ball], SURFACE, centre: [0, 0, 0.1], radius: 0.1, force: [law.Fx, law.Fy, law.Fz]}
instances:
  law:
    use: law
    with: {deflection: floor.deflection, deflection_rate: floor.deflection_rate, vx: floor.vx, vy: floor.vy, stiffness: 1e6, LAW}
outputs: [ball.x, ball.y, ball.z, ball.vx, ball.vy, ball.vz, ball.wx, ball.wy, ball.wz, floor.Fx, floor.Fy, floor.Fz]
scenes: {run: {SCENE}}
"""
PLANE, TUBE = "at: [0, 0, 0], normal: z", "at: [0, 0, 0.5], axis: y, cylinder: 0.5, inside: true"


def run_of(folder: Path, text: str, method: str = "recursive", **how: object) -> Trajectory:
    path = folder / "model.yaml"
    path.write_text(text)
    model = read_model(path)
    run = simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method)), **how)  # type: ignore[arg-type]
    assert run.failure is None, run.failure
    return run


def ball(surface: str, law: str, scene: str, gravity: float = -9.81) -> str:
    return BALL.replace("SURFACE", surface).replace("LAW", law).replace("SCENE", scene).replace("GRAVITY", str(gravity))


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
@pytest.mark.parametrize(("exponent", "damping"), [(1.5, 0.4), (1.0, 1.5), (1.5, 0.0)])
def test_a_ball_rebounds_as_its_law_integrates(tmp_path: Path, method: str, exponent: float, damping: float) -> None:
    """m d'' = -k d^n (1 + c d') leaves v - ln(1 + c v)/c where the ball arrives with v, and the same where it leaves, whatever k and n."""
    law = f"exponent: {exponent}, damping: {damping}"
    scene = "end: 0.05, output_step: 0.001, positions: {free.z: 2 mm}, rates: {free.vz: -1}"
    run = run_of(tmp_path, ball(PLANE, law, scene, 0), method, tolerance=1e-9)
    assert run["floor.Fz"].max() > 10
    left = run["ball.vz"][-1]
    if damping == 0:
        assert left == pytest.approx(1.0, rel=1e-6)
        return

    def kept(v: float) -> float:
        return v / damping - log(1 + damping * v) / damping**2

    expected = brentq(lambda v: kept(1.0) - kept(-v), 0.0, min(1.0, 1 / damping * (1 - 1e-12)))
    assert left == pytest.approx(expected, rel=1e-6)
    assert left < 0.9


def test_a_ball_slides_then_rolls(tmp_path: Path) -> None:
    """Friction slows it by mu g and turns it until v = w l; then nothing slides any more."""
    m, r, inertia, g, mu, v0 = 0.5, 0.1, 0.002, 9.81, 0.3, 2.0
    sunk = (m * g / 1e6) ** (2 / 3)
    scene = f"end: 1, output_step: 0.01, positions: {{free.z: {-sunk}}}, rates: {{free.vx: {v0}}}"
    run = run_of(tmp_path, ball(PLANE, f"friction: {mu}, tangential: 1e5", scene))
    arm = r - sunk
    rolls = v0 / (mu * g * (1 + m * arm**2 / inertia))
    t, late = run.t, run.t > rolls + 0.02
    sliding = (t > 0.02) & (t < rolls - 0.02)
    assert sliding.sum() > 5
    assert late.sum() > 20
    np.testing.assert_allclose(run["ball.vx"][sliding], v0 - mu * g * t[sliding], rtol=0, atol=3e-3)
    np.testing.assert_allclose(run["ball.vx"][late], v0 / (1 + inertia / (m * arm**2)), rtol=2e-3)
    np.testing.assert_allclose(run["ball.wy"][late] * arm, run["ball.vx"][late], rtol=0, atol=2e-3)


def test_a_ball_rolls_to_and_fro_in_a_tube(tmp_path: Path) -> None:
    """Its period is that of a pendulum of length (R - r)(1 + I/(m r^2)), but for the sinking and the spring along the surface."""
    m, r, R, inertia, g = 0.5, 0.1, 0.5, 0.002, 9.81
    sunk = (m * g / 1e6) ** (2 / 3)
    scene = f"end: 5, output_step: 0.005, positions: {{free.z: {-sunk}}}, rates: {{free.vx: 0.1, free.wy: 1}}"
    run = run_of(tmp_path, ball(TUBE, "friction: 0.8, tangential: 1e6", scene))
    crossings = run.t[1:][(run["ball.x"][:-1] < 0) & (run["ball.x"][1:] >= 0)]
    exact = 2 * pi * sqrt((R - r) * (1 + inertia / (m * r**2)) / g)
    assert crossings.size >= 2
    assert np.diff(crossings).mean() == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("spin", ["free.wx: 40", "free.wy: -60", "free.wz: 30"])
def test_no_bounce_gains_energy(tmp_path: Path, spin: str) -> None:
    """A ball that spins, slides and bounces: in flight its energy is that of the flight before or less."""
    scene = f"end: 2, output_step: 0.002, positions: {{free.z: 0.3}}, rates: {{free.vx: 1, free.vy: -0.5, {spin}}}"
    run = run_of(tmp_path, ball(PLANE, "friction: 0.6, tangential: 7e5, damping: 0.05", scene))
    speeds = sum(run[f"ball.v{axis}"] ** 2 for axis in "xyz")
    energy = 0.25 * speeds + 0.001 * sum(run[f"ball.w{axis}"] ** 2 for axis in "xyz") + 0.5 * 9.81 * run["ball.z"]
    flying = energy[run["floor.Fz"] == 0]
    assert 20 < flying.size < energy.size
    assert np.all(np.diff(flying) < 1e-5)
    assert flying[-1] < 0.95 * flying[0]


#: A block on four feet, on a table at 20 % that shakes along its slope and across it.
BLOCK = """
cutjoint: 1
name: block
gravity: [-1.9237, 0, -9.6196]
submodels:
  foot:
    connectors: [table, block]
    parameters: [x, y]
    submodels: {law: {include: library/contact_law}}
    forces:
      touch: {kind: contact, bodies: [table, block], at: [0, 0, 0], normal: z, along: x, centre: [x, y, 0], force: [law.Fx, law.Fy, law.Fz]}
    instances:
      law:
        use: law
        with:
          {deflection: touch.deflection, deflection_rate: touch.deflection_rate, vx: touch.vx, vy: touch.vy, stiffness: 1e5, exponent: 1,
           damping: 1, friction: 0.44, tangential: 1e5, settling: 0.005}
bodies:
  table: {mass: 10, centre_of_mass: [0, 0, -0.1], inertia: [1, 1, 1]}
  block: {mass: 2, centre_of_mass: [0, 0, 0.05], inertia: [0.02, 0.02, 0.03]}
joints:
  shaker: {kind: planar, bodies: [ground, table], at: [0, 0, 0], axis: y, guide: [5e-5*sin(120*t), 5e-5*sin(150*t), 0]}
  free: {kind: free, bodies: [ground, block], at: [0, 0, 0.05]}
instances:
  a: {use: foot, connect: {table: table, block: block}, with: {x: 0.1, y: 0.1}}
  b: {use: foot, connect: {table: table, block: block}, with: {x: 0.1, y: -0.1}}
  c: {use: foot, connect: {table: table, block: block}, with: {x: -0.1, y: 0.1}}
  d: {use: foot, connect: {table: table, block: block}, with: {x: -0.1, y: -0.1}}
outputs: [{way: block.x - table.x}, a.touch.Fz, a.touch.Fx]
scenes: {run: {end: 20.95, output_step: 0.20943951023931953, positions: {free.z: -0.05 mm}}}
"""


def test_a_block_on_a_slope_that_shakes_does_not_creep(tmp_path: Path) -> None:
    """Over 21 s of shaking with 0.7 and 1.1 m/s^2, read at whole periods: its feet carry up to 0.85 of their limit, and stay."""
    run = run_of(tmp_path, BLOCK)
    way = run["way"][run.t > 2]
    assert np.abs(run["a.touch.Fx"]).max() > 1.0
    assert np.ptp(way) < 2e-9
    assert abs(np.polyfit(run.t[run.t > 2], way, 1)[0]) < 1e-10


def test_a_mirrored_contact_moves_as_the_image() -> None:
    """The second direction counts the other way in the image: forces along it and the turn too."""
    text = """
cutjoint: 1
name: pair
gravity: [0, 0, 0]
submodels:
  side:
    bodies: {foot: {mass: 1, centre_of_mass: [0, 0.3, 0.1], inertia: [1, 1, 1]}}
    joints: {free: {kind: free, bodies: [ground, foot], at: [0, 0.3, 0.1]}}
    forces:
      touch:
        {kind: contact, bodies: [ground, foot], at: [0, 0, 0], normal: [0, 0.6, 0.8], along: x, centre: [0, 0.3, 0.1], radius: 0.5,
         force: [vx, vy + turn, deflection]}
instances: {l: {use: side}, r: {use: side, mirror: y}}
"""
    left, right = read_model_text(text, "pair.yaml").forces
    assert isinstance(left, Contact)
    assert isinstance(right, Contact)
    assert [float(x) for x in right.normal or ()] == [0, -0.6, 0.8]
    assert [str(x) for x in right.force] == ["vx", "turn + vy", "deflection"]


def test_programs_that_have_no_contacts_are_not_given_any(tmp_path: Path) -> None:
    text = ball(PLANE, "exponent: 1", "end: 1")
    text = text[: text.index("instances:")].replace("submodels: {law: {include: library/contact_law}}\n", "")
    text = text.replace("[law.Fx, law.Fy, law.Fz]", "[0, 0, deflection]")
    with pytest.raises(ModelError, match="'floor': only cutjoint has contacts; leave it out"):
        require_mechanics_alone(read_model_text(text, "ball.yaml"))


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        ("at: [0, 0, 0]", "needs either 'normal' of a plane or 'axis' of a cylinder"),
        ("at: [0, 0, 0], axis: y", "'axis' and 'cylinder' go together"),
        ("at: [0, 0, 0], normal: z, inside: true", "a plane has no inside"),
        ("at: [0, 0, 0], normal: z, along: z", "along is along the normal; write a direction across it, or leave it out"),
    ],
)
def test_surfaces_that_are_none_are_reported(tmp_path: Path, surface: str, said: str) -> None:
    path = tmp_path / "ball.yaml"
    path.write_text(ball(surface, "exponent: 1", "end: 1"))
    with pytest.raises(ModelError) as error:
        read_model(path)
    assert said in str(error.value)


#: A ball that falls, with a spin or without, touches and flies on.
SPUN = """
cutjoint: 1
name: spun
gravity: [0, 0, -9.81]
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0.21], inertia: [0.016, 0.016, 0.016]}}
joints: {p: {kind: planar, bodies: [ground, ball], at: [0, 0, 0.21], axis: [0, -1, 0]}}
forces:
  sole: {kind: contact, bodies: [ground, ball], at: [0, 0, 0], normal: z, along: x, centre: [0, 0, 0.21], radius: 0.2,
         force: [grip.Fx, grip.Fy, grip.Fz]}
submodels: {contact_law: {include: library/contact_law}}
instances:
  grip: {use: contact_law, with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy,
         stiffness: 1e5, damping: 0.3, friction: 0.4}}
outputs: [ball.x, ball.z, ball.wy]
scenes: {run: {end: 0.15, output_step: 0.01, rates: {p.angle_rate: SPIN}}}
"""


@pytest.mark.parametrize("spin", [12, 0])
@pytest.mark.parametrize(("method", "integrator", "events"), [
    ("recursive", "dormand-prince", "located"), ("recursive", "dormand-prince", "crossed"), ("recursive", "dop853", "located"),
    ("recursive-newton", "radau5", "located"), ("recursive-newton", "radau5", "crossed"),
])  # fmt: skip
def test_touching_and_flight_go_on_by_all_methods(tmp_path: Path, method: str, integrator: str, events: str, spin: int) -> None:
    """About the point on the plane that the ball touches its angular momentum stays while it slides and grips: I w + m r vx."""
    run = run_of(tmp_path, SPUN.replace("SPIN", str(spin)), method, integrator=integrator, events=events, tolerance=1e-6, error=False)
    vx = np.gradient(run["ball.x"], run.t)
    flying = run.t > 0.1
    assert np.ptp(run["ball.x"][~flying & (run.t < 0.04)]) < 1e-9
    np.testing.assert_allclose(0.016 * (run["ball.wy"][flying] + spin), -0.2 * vx[flying], rtol=0.03, atol=1e-9)  # it sinks by 3 % of 0.2 m
