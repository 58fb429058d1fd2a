"""Modes that are known in closed form, or of the one coordinate that a mechanism has."""

from __future__ import annotations

import json
import re
from math import cos, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq, minimize_scalar

from cutjoint.analysis.closing import close_loops, design_coordinates
from cutjoint.analysis.modes import Modes, eigenpairs, find_mode_shapes
from cutjoint.cli import main
from cutjoint.formulate.implicit.equations import ImplicitEquations
from cutjoint.model.read import read_model, read_model_text
from cutjoint.report.tasks import mode_tables, participants
from cutjoint.run.scenes import find_scene
from cutjoint.tasks.states import find_scene_modes
from tests.analysis.linearised import Array, implicit, linearised
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.mechanisms.driven import pushed_text

G = 9.81


def at_rest(text: str, q: Array | None = None) -> Modes:
    """The modes of a model at rest in a pose, else in its design position."""
    equations = implicit(text)
    q = design_coordinates(equations.start) if q is None else q
    return find_mode_shapes(linearised(equations, q, np.zeros(equations.start.speeds), at_rest=True), 0.0)


def frequencies(modes: Modes) -> list[float]:
    return [2 * pi * m.frequency for m in modes.modes]


def pendulums(damping: float = 0.0) -> str:
    """Two point masses of 1 kg on links of 1 m that hang down."""
    return f"""
cutjoint: 1
name: double_pendulum
gravity: [0, -{G}, 0]
bodies:
  upper: {{mass: 1, centre_of_mass: [0, -1, 0]}}
  lower: {{mass: 1, centre_of_mass: [0, -2, 0]}}
joints:
  top: {{kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 0, 1], spring: {{stiffness: 0, damping: {damping}}}}}
  middle: {{kind: revolute, bodies: [upper, lower], at: [0, -1, 0], axis: [0, 0, 1]}}
"""


def test_double_pendulum() -> None:
    """omega^2 = (2 -+ sqrt 2) g/l; the lower angle from the vertical is +-sqrt 2 times the upper one, the joint's less by one."""
    modes = at_rest(pendulums())
    assert frequencies(modes) == pytest.approx([sqrt((2 - sqrt(2)) * G), sqrt((2 + sqrt(2)) * G)], rel=1e-12)
    assert [m.time_constant for m in modes.modes] == [None, None]
    for mode, ratio in zip(modes.modes, (sqrt(2) - 1, -sqrt(2) - 1), strict=True):
        assert mode.shape["middle.angle"].amplitude / mode.shape["top.angle"].amplitude == pytest.approx(ratio, rel=1e-9)
        assert sum(p.share for p in mode.shape.values()) == pytest.approx(1.0, abs=1e-12)
    assert modes.zeros == 0
    assert [m.eigenvalue for m in modes.undamped] == pytest.approx([m.eigenvalue for m in modes.modes], rel=1e-9)


@pytest.mark.parametrize(
    ("q", "damping", "growth"), [([pi, 0.0], 0.0, sqrt((2 + sqrt(2)) * G)), ([0.0, 0.0], 0.0, 0.0), ([0.0, 0.0], 3.0, 0.0)]
)
def test_an_unstable_equilibrium_is_reported(q: list[float], damping: float, growth: float) -> None:
    modes = at_rest(pendulums(damping), np.array(q))
    assert modes.growth_rate == pytest.approx(growth, rel=1e-9)
    said = [text for text in mode_tables(modes) if isinstance(text, str) and text.startswith("unstable")]
    assert said == ["unstable: small disturbances of the static equilibrium grow as exp(5.787 t), t in s"] * bool(growth)


def test_damped_double_pendulum() -> None:
    """Against numpy's roots of the characteristic polynomial in absolute angles, one damper at the top:
    (2 s^2 + c s + 2 g)(s^2 + g) - s^4 = 0."""
    c = 0.7
    roots = np.roots(np.polysub(np.polymul([2, c, 2 * G], [1, 0, G]), [1, 0, 0, 0, 0]))
    expected = sorted((r for r in roots if r.imag >= 0), key=abs)
    modes = at_rest(pendulums(c)).modes
    assert [m.eigenvalue for m in modes] == pytest.approx(expected, rel=1e-11)
    assert [m.damping_ratio for m in modes] == pytest.approx([-r.real / abs(r) for r in expected], rel=1e-10)


def chain(n: int, stiffness: float, damping: float, fixed: bool) -> str:
    """n sliders of 2 kg in a row with springs between them, ``fixed`` to the ground at both ends or free."""
    lines = ["cutjoint: 1", "name: chain", "gravity: [0, 0, 0]", "bodies:"]
    lines += [f"  b{i}: {{mass: 2, centre_of_mass: [{i}, 0, 0]}}" for i in range(1, n + 1)]
    lines += ["joints:"]
    lines += [f"  j{i}: {{kind: prismatic, bodies: [ground, b{i}], at: [{i}, 0, 0], axis: [1, 0, 0]}}" for i in range(1, n + 1)]
    lines += ["forces:"]
    ends = ["ground", *(f"b{i}" for i in range(1, n + 1)), "ground"]
    for i in range(n + 1) if fixed else range(1, n):
        law = f"{{stiffness: {stiffness}, damping: {damping}, free_length: 1}}"
        lines += [f"  s{i}: {{kind: point_spring, bodies: [{ends[i]}, {ends[i + 1]}], from: [{i}, 0, 0], to: [{i + 1}, 0, 0], law: {law}}}"]
    return "\n".join(lines) + "\n"


def test_chain_between_walls() -> None:
    """omega_j = 2 sqrt(k/m) sin(j pi / (2 n + 2)), damping ratio omega c / (2 k), amplitudes sin(i j pi / (n + 1))."""
    n, k, c = 4, 50.0, 1.0
    modes = at_rest(chain(n, k, c, fixed=True))
    natural = [2 * sqrt(k / 2) * sin(j * pi / (2 * n + 2)) for j in range(1, n + 1)]
    assert [abs(m.eigenvalue) for m in modes.modes] == pytest.approx(natural, rel=1e-11)
    assert [m.damping_ratio for m in modes.modes] == pytest.approx([w * c / (2 * k) for w in natural], rel=1e-10)
    assert [m.eigenvalue.imag for m in modes.undamped] == pytest.approx(natural, rel=1e-11)
    for j, mode in enumerate(modes.modes, 1):
        shape = np.array([mode.shape[f"j{i}.displacement"].amplitude for i in range(1, n + 1)])
        expected = np.array([sin(i * j * pi / (n + 1)) for i in range(1, n + 1)])
        assert shape / shape[0] == pytest.approx(expected / expected[0], abs=1e-9)


def test_free_chain_moves_as_a_whole() -> None:
    """omega_j = 2 sqrt(k/m) sin(j pi / (2 n)); the whole moves off with a double zero, which rounding would make a pair of 1e-7 1/s."""
    n, k = 3, 50.0
    modes = at_rest(chain(n, k, 0.0, fixed=False))
    assert frequencies(modes) == pytest.approx([2 * sqrt(k / 2) * sin(j * pi / (2 * n)) for j in range(1, n)], rel=1e-11)
    assert (modes.degrees_of_freedom, modes.zeros, list(modes.rigid_body_modes)) == (3, 2, ["j1.displacement"])
    assert [p.amplitude for p in modes.rigid_body_modes["j1.displacement"].values()] == pytest.approx([1.0] * n, abs=1e-12)


def test_zeros_of_a_chain_of_integrators_are_counted() -> None:
    """Three zeros with one eigenvector, beside -2 and its eigenvector."""
    A = np.array([[0.0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 0], [0, 0, 0, -2]])
    values, vectors, null, zeros = eigenpairs(A)
    assert values == pytest.approx([-2.0])
    assert pytest.approx(np.zeros((4, 1)), abs=1e-12) == A @ vectors + 2 * vectors
    assert (zeros, null.shape) == (3, (4, 1))


# Loops


def four_bar_in_motion(angle: float, rate: float) -> tuple[ImplicitEquations, Modes]:
    """The parallelogram with its cranks at an angle from the vertical, turning."""
    model = read_model(MODELS / "four_bar.yaml")
    equations = implicit(model)
    way = np.array([-1.0 if "coupler" in name else 1.0 for name in equations.start.speed_names])
    found = close_loops(equations.start, angle * way)
    assert found is not None
    return equations, find_mode_shapes(linearised(equations, found[0], rate * way, at_rest=False), 0.0)


@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_parallelogram_in_motion(angle: float) -> None:
    """th'' = c sin th from the vertical, all inertia that of th: eigenvalues +-sqrt(c cos th), whatever the speed; 12 equations, 4 of them
    needed."""
    c = G * (3 / 2 + 2) / (3 / 3 + 2)
    equations, modes = four_bar_in_motion(angle, 1.7)
    assert (modes.degrees_of_freedom, len(equations.equation_names)) == (1, 12)
    root = sqrt(abs(c * cos(angle)))
    expected = [root, -root] if cos(angle) > 0 else [1j * root]
    assert sorted((m.eigenvalue for m in modes.modes), key=lambda v: -v.real) == pytest.approx(expected, rel=1e-9)


CRANK, COUPLER, ROCKER, GROUND = 1.0, 2.5, 2.0, 3.0
K, C = 40.0, 3.0

UNEQUAL = f"""
cutjoint: 1
name: unequal
gravity: [0, -{G}, 0]
points:
  A: [0, 0, 0]
  D: [{GROUND}, 0, 0]
  B: [{CRANK * cos(0.5)}, {CRANK * sin(0.5)}, 0]
  P: [PX, PY, 0]
bodies:
  crank: {{mass: 1, centre_of_mass: {{midpoint: [A, B]}}, inertia: [0, 0.1, 0.1]}}
  coupler: {{mass: 2, centre_of_mass: {{midpoint: [B, P]}}, inertia: [0, 0.9, 0.9]}}
  rocker: {{mass: 1.5, centre_of_mass: {{midpoint: [D, P]}}, inertia: [0, 0.5, 0.5]}}
joints:
  a: {{kind: revolute, bodies: [ground, crank], at: A, axis: [0, 0, 1], spring: {{stiffness: {K}, damping: {C}}}}}
  b: {{kind: revolute, bodies: [crank, coupler], at: B, axis: [0, 0, 1]}}
  d: {{kind: revolute, bodies: [ground, rocker], at: D, axis: [0, 0, 1]}}
  p: {{kind: revolute, bodies: [coupler, rocker], at: P, axis: [0, 0, 1], cut: true}}
"""


def pins(angle: float) -> tuple[Array, Array]:
    """B and P at a crank angle, P above the ground, by the circles about B and D."""
    B, D = CRANK * np.array([cos(angle), sin(angle)]), np.array([GROUND, 0.0])
    way = D - B
    length = float(np.hypot(*way))
    along = (COUPLER**2 - ROCKER**2 + length**2) / (2 * length)
    return B, B + along * way / length + sqrt(COUPLER**2 - along**2) * np.array([-way[1], way[0]]) / length


def turns(angle: float) -> Array:
    """The directions of crank, coupler and rocker at a crank angle."""
    B, P = pins(angle)
    return np.array([angle, np.arctan2(*(P - B)[::-1]), np.arctan2(P[1], P[0] - GROUND)])


def one_coordinate(angle: float) -> tuple[float, float]:
    """The potential, and the inertia that the crank's angle has, by differences of the bodies' places."""

    def places(th: float) -> Array:
        B, P = pins(th)
        D = np.array([GROUND, 0.0])
        return np.array([*(B / 2), *((B + P) / 2), *((D + P) / 2), *turns(th)])

    h = 1e-3
    rate = (8 * (places(angle + h) - places(angle - h)) - places(angle + 2 * h) + places(angle - 2 * h)) / (12 * h)
    x = places(angle)
    potential = G * (x[1] + 2 * x[3] + 1.5 * x[5]) + K * (angle - 0.5) ** 2 / 2
    return potential, float(rate**2 @ [1, 1, 2, 2, 1.5, 1.5, 0.1, 0.9, 0.5])


@needs_cpp
@pytest.mark.parametrize(("law", "leads"), [("-32*position", False), ("-32*position - 1e-9*way", True)])
def test_a_state_that_nothing_follows_leads_no_mode(law: str, leads: bool) -> None:
    """A block of 2 kg on a spring of 32 N/m, and a state that counts its way in tenths of a millimetre: 1e4 in units of the block's way.
    At 4 rad/s and an amplitude of 1 m the block has 2*4**2, the state the square of its value over its size of 1."""
    text = f"""
cutjoint: 1
name: block
gravity: [0, 0, 0]
bodies: {{block: {{mass: 2, centre_of_mass: [0, 0, 0]}}}}
joints: {{slide: {{kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}}}}
states: {{way: {{start: 0, rate: 1e4*slide.displacement_rate}}}}
forces: {{spring: {{kind: joint_force, joint: slide, law: {law}}}}}
scenes: {{go: {{end: 1}}}}
"""
    model = read_model_text(text, "block.yaml")
    modes = find_scene_modes(model, model.scenes["go"])
    swing = next(mode for mode in modes.modes if mode.eigenvalue.imag)
    assert abs(swing.eigenvalue) == pytest.approx(4, rel=1e-5)
    assert swing.shape["slide.displacement"].share == pytest.approx(2 * 4**2 / (2 * 4**2 + 1e8) if leads else 1)
    assert abs(swing.shape["way.value"].amplitude) == pytest.approx(1 if leads else 1e4, rel=1e-5)


def test_unequal_four_bar() -> None:
    """m s^2 + C s + V'' = 0 at the least potential V of the one coordinate."""
    angle = minimize_scalar(lambda th: one_coordinate(th)[0], bounds=(-0.5, 0.5), method="bounded", options={"xatol": 1e-10}).x
    h = 1e-3
    slope = lambda th: sum(w * one_coordinate(th + k * h)[0] for k, w in ((1, 8), (-1, -8), (2, -1), (-2, 1))) / (12 * h)  # noqa: E731
    angle = brentq(slope, angle - 1e-3, angle + 1e-3, xtol=1e-14)
    V = sum(w * slope(angle + k * h) for k, w in ((1, 8), (-1, -8), (2, -1), (-2, 1))) / (12 * h)
    expected = max(np.roots([one_coordinate(angle)[1], C, V]), key=lambda r: r.imag)
    assert expected.imag > 1
    _, P = pins(0.5)
    equations = implicit(UNEQUAL.replace("PX", repr(float(P[0]))).replace("PY", repr(float(P[1]))))
    start, turned = equations.start, turns(angle) - turns(0.5)
    angles = {"a.angle": turned[0], "b.angle": turned[1] - turned[0], "d.angle": turned[2]}
    found = close_loops(start, np.array([angles[name] for name in start.coordinate_names]))
    assert found is not None
    assert found[0][start.coordinate_names.index("a.angle")] == pytest.approx(angle - 0.5, abs=1e-12)
    modes = find_mode_shapes(linearised(equations, found[0], np.zeros(start.speeds), at_rest=True), 0.0)
    assert [m.eigenvalue for m in modes.modes] == pytest.approx([expected], rel=1e-8)


# Compiled


@needs_cpp
def test_flyball_governor_after_a_second() -> None:
    """A published stiff problem: -8075, -1444, -20.5 1/s (benchmark A05); the whole turns about its shaft without resistance."""
    model = read_model(MODELS / "flyball.yaml")
    modes = find_scene_modes(model, find_scene(model, None), at=1.0)
    real = sorted(m.eigenvalue.real for m in modes.modes)
    assert real[:3] == pytest.approx([-8075, -1444, -20.5], abs=0.5)
    assert list(modes.rigid_body_modes) == ["bearing.angle"]
    assert modes.time == pytest.approx(1.0, abs=1e-12)


@needs_cpp
@pytest.mark.parametrize("at", [None, 0.0])
def test_an_input_that_is_held_counts(at: float | None) -> None:
    """omega^2 = (100 + push) / 2 of 2 kg on a spring that an input stiffens."""
    model = read_model_text(pushed_text("-(100 + push)*position"), "pushed.yaml")
    modes = find_scene_modes(model, find_scene(model, None), at=at, parameters={"push": 28.0})
    assert frequencies(modes) == pytest.approx([8.0], rel=1e-12)


def command(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["modes", *map(str, arguments)])
    return result.exit_code, result.output


@needs_cpp
def test_vehicle(tmp_path: Path) -> None:
    """Bounce, pitch, roll, four wheel hops; at rest its tyres hold neither x nor y nor yaw."""
    out = tmp_path / "modes.json"
    status, output = command(MODELS / "iltis.yaml", "--out", out)
    assert status == 0, output
    assert "rigid-body modes, with 6 eigenvalues of zero: chassis_free.x, chassis_free.y, chassis_free.wz" in " ".join(output.split())
    found = json.loads(out.read_text())
    assert (found["about"], found["degrees_of_freedom"], found["zero_eigenvalues"]) == ("static equilibrium", 10, 6)
    leaders = [max(m["shape"], key=lambda n: m["shape"][n]["share"]) for m in found["modes"]]
    assert leaders[:4] == ["chassis_free.wy", "chassis_free.z", "chassis_free.wx", "chassis_free.wx"]
    assert all(name.endswith("arm_hinge.angle") for name in leaders[4:])
    assert len(leaders) == 7
    rows = [line.split(" | ") for line in (ROOT / "docs" / "evidence" / "verification.md").read_text().splitlines() if " ± " in line]
    assert [row[2:4] for row in rows] == [[f"{m['frequency']:.3f}", f"{m['damping_ratio']:.3f}"] for m in found["modes"]]


FALLING = """cutjoint: 1
name: falling
gravity: [0, 0, -9.81]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [0, 0, 1]}}
scenes: {fall: {end: 1, output_step: 0.1}}
"""


@needs_cpp
def test_errors_say_what_to_do(tmp_path: Path) -> None:
    falling = tmp_path / "falling.yaml"
    falling.write_text(FALLING, encoding="utf-8")
    status, output = command(falling)
    assert status == 1
    assert "falling.yaml:5:10: scene 'fall': no static equilibrium was found near the given pose" in output
    assert "with 9.81 m/s^2 or rad/s^2;" in output
    assert output.rstrip().endswith("or linearise about a motion with --at")
    summed = tmp_path / "summed.yaml"
    summed.write_text(pendulums() + "states: {cost: {start: 0, rate: 1 + top.angle**2}}\nscenes: {hang: {end: 1}}\n", encoding="utf-8")
    status, output = command(summed)
    assert status == 1
    assert "worst at 'cost.value' with 1; the rate of this state does not vanish at rest" in output
    assert output.rstrip().endswith("leave the state out of the model, or linearise about a motion with --at")
    status, output = command(MODELS / "iltis.yaml", "--at", 1)
    assert (status, output.split(": ")[1][:12]) == (1, "name a scene")
    held = tmp_path / "held.yaml"
    held.write_text(pendulums() + "scenes:\n  tilted: {end: 1, positions: {top.angle: 0.3}}\n")
    status, output = command(held)
    assert status == 1
    assert re.search(r"scene 'tilted': [\d.]+ N\*m hold 'top\.angle'", output)
    assert "leave its coordinate out of positions, guide its joint, or linearise about a motion with --at" in output


# A caster at speed

CASTER = """
cutjoint: 1
name: caster
gravity: [0, 0, 0]
parameters: {{trail: {trail}, damping: {damping}, relaxation: 0.3, cornering: 9000}}
bodies:
  cart: {{mass: 500, centre_of_mass: [0, 0, 0.5], inertia: [1, 1, 1]}}
  fork: {{mass: 4, centre_of_mass: [-0.03, 0, 0.5], inertia: [0.1, 0.1, 0.2]}}
  tyre: {{mass: 10, centre_of_mass: [-trail, 0, 0.3], inertia: [0.3, 0.5, 0.3]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, cart], at: [0, 0, 0.5], axis: [1, 0, 0]}}
  kingpin: {{kind: revolute, bodies: [cart, fork], at: [0, 0, 0.5], axis: [0, 0, 1], spring: {{stiffness: 0, damping: damping}}}}
  bearing: {{kind: revolute, bodies: [fork, tyre], at: [-trail, 0, 0.3], axis: [0, 1, 0]}}
forces:
  contact: {{kind: wheel, body: tyre, centre: [-trail, 0, 0.3], axis: [0, 1, 0], radius: 0.31, force: [0, cornering*shear/relaxation, 0]}}
states:
  shear: {{start: 0 m, rate: -contact.vy - contact.vx*shear/relaxation}}
scenes: {{roll: {{end: 1, rates: {{slide.displacement_rate: {speed}, bearing.angle_rate: {spin}}}}}}}
"""


def caster(trail: float, damping: float, speed: float) -> tuple[list[complex], list[complex]]:
    """The eigenvalues of a caster on a tyre with relaxation, found and by its characteristic polynomial, complex ones once, by their sizes.

    I a'' + k a' = -e F and s F' + v F = C (v a + e a'), with the trail e and the relaxation length s.
    """
    model = read_model_text(CASTER.format(trail=trail, damping=damping, speed=speed, spin=speed / 0.3), "caster.yaml")
    found = [m.eigenvalue for m in find_scene_modes(model, find_scene(model, None), at=0.0).modes]
    inertia, length, stiffness = 0.2 + 4 * 0.03**2 + 0.3 + 10 * trail**2, 0.3, 9000
    polynomial = [
        inertia * length, inertia * speed + damping * length, damping * speed + stiffness * trail**2, stiffness * trail * speed
    ]  # fmt: skip
    return sorted(found, key=abs), sorted((r for r in np.roots(polynomial) if r.imag >= 0), key=abs)


@needs_cpp
@pytest.mark.parametrize("damping", [0.0, 20.0])
@pytest.mark.parametrize("speed", [2.0, 30.0])
def test_shimmy_of_a_caster(speed: float, damping: float) -> None:
    for trail in (0.05, 0.25, 0.35):
        found, expected = caster(trail, damping, speed)
        assert found == pytest.approx(expected, rel=1e-9)


@needs_cpp
def test_a_caster_shimmies_below_the_relaxation_length() -> None:
    """Routh's criterion without a damper: stable where the trail is longer than the relaxation length, at every speed."""
    for speed in (2.0, 30.0):
        grows = [max(value.real for value in caster(trail, 0.0, speed)[0]) for trail in (0.299, 0.301)]
        assert grows[0] > 1e-6
        assert grows[1] < -1e-6


@needs_cpp
def test_controllers_that_are_held_are_named(tmp_path: Path) -> None:
    """A sampled spring swings the hinge in a run; held, it leaves the hinge free."""
    model, out = tmp_path / "servo.yaml", tmp_path / "modes.json"
    text = (
        "cutjoint: 1\nname: servo\ngravity: [0, 0, 0]\nbodies: {arm: {mass: 1, centre_of_mass: [0.5, 0, 0]}}\n"
        "joints: {hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: z}}\n"
        "forces: {motor: {kind: joint_force, joint: hinge, law: loop.u}}\n"
        "controllers: {loop: {every: 1 ms, signals: {u: -400*hinge.angle}}}\nscenes: {run: {end: 1, output_step: 0.1}}\n"
    )
    for law, held in (("loop.u", ["loop"]), ("-400*position", [])):
        model.write_text(text if held else text.replace("loop.u", law).replace("controllers:", "#"))
        done = CliRunner().invoke(main, ["modes", str(model), "--out", str(out)])
        assert done.exit_code == 0, done.output
        assert ("'loop': sampled values are held constant" in " ".join(done.output.split())) == bool(held)
        found = json.loads(out.read_text())
        assert (found["frozen_controllers"], bool(found["modes"])) == (held, not held)


STANDING = """
cutjoint: 1
name: stands
gravity: [0, 0, -9.81]
bodies: {carrier: {mass: 350, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}}
joints: {heave: {kind: prismatic, bodies: [ground, carrier], at: [0, 0, 0.3], axis: [0, 0.2, 1]}}
forces: {damper: {kind: joint_force, joint: heave, law: -2000*rate}}
submodels: {wheel: {include: library/wheel_brush}}
instances:
  w:
    use: wheel
    connect: {carrier: carrier}
    with: {x: 0, y: 0, z: 0.3, radius: 0.3, mass: 15, spin_inertia: 1, cross_inertia: 0.6, stiffness: 2e5, slip_stiffness: 60000,
      cornering_stiffness: 40000}
scenes: {rest: {end: 1}}
"""


@needs_cpp
def test_zeros_of_a_standing_wheel() -> None:
    """It stands as well turned, and with any side shear of its tread, rolling and brake; heave, which shear moves, has a mode."""
    model = read_model_text(STANDING, "m.yaml")
    modes = find_scene_modes(model, find_scene(model, None))
    assert sorted(modes.rigid_body_modes) == ["w.rolling.bearing.angle", *(f"w.rolling.{s}.value" for s in ("held", "rolled", "shear_y"))]
    assert (modes.degrees_of_freedom, modes.zeros) == (2, 4)
    assert abs(modes.rigid_body_modes["w.rolling.shear_y.value"]["heave.displacement"].amplitude) > 1e-3
    text = [made for made in mode_tables(modes) if isinstance(made, str)]
    assert text == ["rigid-body modes and states that nothing restores, with 4 eigenvalues of zero: w.rolling.bearing.angle; "
                    "w.rolling.shear_y.value, w.rolling.rolled.value, w.rolling.held.value"]  # fmt: skip
    shown = [dict(participants(mode.shape)) for mode in modes.modes]
    assert ["heave.displacement"] in [[*each] for each in shown]
    assert all(("%" in amplitude) is not name.endswith(".value") for each in shown for name, amplitude in each.items())
