"""Frequency responses beside closed forms and NumPy, sampled loops beside z-transforms, random vibration beside closed forms."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import control
import numpy as np
import pytest
import sympy
from click.testing import CliRunner
from scipy import linalg, signal
from scipy.special import k1

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.inputs import TIME
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.read import read_model, read_model_text
from cutjoint.run.simulation import simulate
from cutjoint.stepping.state_space import SampledStateSpace, StateSpace
from cutjoint.stepping.vibration import weighting
from tests.conftest import MODELS, ROOT, needs_cpp

pytestmark = needs_cpp

#: Sprung and unsprung mass of a corner, suspension, tyre; inertia, places of the axles.
BODY, HUB, SPRING, DAMPER, TYRE = 300.0, 40.0, 2.0e4, 1500.0, 2.0e5
PITCH, FRONT, REAR = 500.0, 1.2, -1.4


def corner(name: str, x: float) -> dict[str, str]:
    """The elements of a wheel on its post, under the body at x."""
    return {
        "parameters": f"  {name}_post: {{value: 0, unit: m, binding: input}}\n",
        "bodies": f"  {name}_pad: {{massless: true}}\n  {name}_hub: {{mass: {HUB}, centre_of_mass: [{x}, 0, 0.3]}}\n",
        "joints": f"  {name}_lift: {{kind: prismatic, bodies: [ground, {name}_pad], at: [{x}, 0, 0], axis: z, guide: {name}_post}}\n"
        f"  {name}_travel: {{kind: prismatic, bodies: [ground, {name}_hub], at: [{x}, 0, 0.3], axis: z}}\n",
        "forces": f"  {name}_tyre: {{kind: axial_force, bodies: [{name}_pad, {name}_hub], origin: [{x}, 0, 0], point: [{x}, 0, 0.3], "
        f'axis: z, law: "{TYRE}*(0.3 - travel)"}}\n'
        f"  {name}_strut: {{kind: axial_force, bodies: [{name}_hub, body], origin: [{x}, 0, 0.3], point: [{x}, 0, 0.8], axis: z, "
        f'law: "{SPRING}*(0.5 - travel) - {DAMPER}*rate"}}\n',
    }  # fmt: skip


def car(*corners: tuple[str, float]) -> str:
    """A quarter car or a half car; its body heaves, that of a half car pitches."""
    parts = [corner(*each) for each in corners]
    sections = {section: "".join(part[section] for part in parts) for section in parts[0]}
    half = len(corners) > 1
    sections["bodies"] += f"  body: {{mass: {BODY * len(corners)}, centre_of_mass: [0, 0, 0.8], inertia: [{PITCH}, {PITCH}, {PITCH}]}}\n"
    sections["bodies"] += "  sledge: {massless: true}\n" if half else ""
    sections["joints"] += f"  heave: {{kind: prismatic, bodies: [ground, {'sledge' if half else 'body'}], at: [0, 0, 0.8], axis: z}}\n"
    sections["joints"] += "  pitch: {kind: revolute, bodies: [sledge, body], at: [0, 0, 0.8], axis: [0, 1, 0]}\n" if half else ""
    outputs = ", ".join(f"{name}_tyre.force, {name}_strut.travel" for name, _ in corners)
    text = "".join(f"{section}:\n{content}" for section, content in sections.items())
    head = f"cutjoint: 1\nname: car\ngravity: [0, 0, {0 if half else -9.81}]\n"
    return f"{head}{text}outputs: [body.az, {outputs}]\nscenes: {{stand: {{end: 1}}}}\n"


@cache
def linear(text: str, **asked: object) -> StateSpace | SampledStateSpace:
    return cutjoint.find_linear_model(read_model_text(text, "model.yaml"), **asked)  # type: ignore[arg-type]


def quarter() -> StateSpace:
    found = linear(car(("front", 0.0)))
    assert isinstance(found, StateSpace)
    return found


def quarter_by_hand(s: np.ndarray) -> np.ndarray:
    """Acceleration, tyre force and travel of the strut by the height of the post, (points, 3)."""
    strut = SPRING + DAMPER * s
    hub = TYRE / (HUB * s**2 + strut + TYRE - strut**2 / (BODY * s**2 + strut))
    body = strut * hub / (BODY * s**2 + strut)
    return np.stack([s**2 * body, TYRE * (1 - hub), body - hub], axis=-1)


def test_a_quarter_car_on_a_post_responds_as_its_closed_form() -> None:
    near = quarter()
    response = near.frequency_response()
    expected = quarter_by_hand(2j * np.pi * response.frequencies)
    assert response.frequencies[0] < 0.5
    assert response.frequencies[-1] > 30
    assert np.abs(response.values[:, :, 0] / expected - 1).max() < 1e-9
    assert near.y[1] == pytest.approx((BODY + HUB) * 9.81, rel=1e-9)
    assert near.places == {"front_post": (0.0, 0.0)}
    # the tyre force by the post: zeros of the free car, s^2 (HUB BODY s^2 + (HUB + BODY)(SPRING + DAMPER s))
    roots = np.roots([HUB * BODY, (HUB + BODY) * DAMPER, (HUB + BODY) * SPRING])
    assert near.zeros("front_tyre.force", "front_post") == pytest.approx(np.sort_complex([0, 0, *roots]), rel=1e-6, abs=1e-4)


def test_systems_of_scipy_and_control_are_the_same_model() -> None:
    near = quarter().choose(outputs=["front_tyre.force", "front_strut.travel"])
    f = np.geomspace(0.1, 50, 40)
    values = near.frequency_response(f).values
    _, by_scipy = signal.freqresp(near.choose(outputs=["front_tyre.force"]).to_scipy(), 2 * np.pi * f)
    assert np.abs(by_scipy / values[:, 0, 0] - 1).max() < 1e-9
    system = near.to_control()
    assert system.output_labels == ["front_tyre_force", "front_strut_travel"]
    assert np.abs(system(2j * np.pi * f)[:, 0] / values[:, :, 0].T - 1).max() < 1e-9
    peak = near.peak("front_tyre.force", "front_post", np.geomspace(0.01, 1e4, 800))
    alone = near.choose(outputs=["front_tyre.force"]).to_control()
    assert peak.gain == pytest.approx(control.norm(alone, "inf", tol=1e-9), rel=1e-6)
    by_rate = near.to_control("rate")
    assert np.abs(by_rate(2j * np.pi * f)[0, 0] * 2j * np.pi * f / values[:, 0, 0] - 1).max() < 1e-9


def test_a_regulator_of_a_sampled_system_is_fed_with_the_states_of_the_model() -> None:
    """By a zero-order hold: the poles as designed are those of the exact motion between samples, by a Taylor series of the exponential."""
    near, every = quarter().choose(outputs=["front_strut.travel"]), 0.02
    A, B, _, _ = near.realise("acceleration")
    sampled = control.sample_system(near.to_control("acceleration"), every, "zoh")
    gain, _, poles = control.dlqr(sampled, np.eye(len(A)), [[1.0]])
    free, term = np.eye(len(A) + 1), np.eye(len(A) + 1)
    for k in range(1, 80):
        term = term @ np.block([[A, B], [np.zeros((1, len(A) + 1))]]) * every / k
        free += term
    held = np.linalg.eigvals(free[:-1, :-1] - free[:-1, -1:] @ gain)
    assert np.poly(held) == pytest.approx(np.poly(poles), abs=1e-8)
    assert np.abs(held).max() < 1


def half_by_hand() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M, C, K of heave, pitch (nose down), front and rear hub, and the forces by the posts."""
    reach = np.array([[1, -FRONT, -1, 0], [1, -REAR, 0, -1]])
    M, hubs = np.diag([2 * BODY, PITCH, HUB, HUB]), np.array([[0, 0], [0, 0], [1, 0], [0, 1]])
    return M, DAMPER * reach.T @ reach, SPRING * reach.T @ reach + TYRE * hubs @ hubs.T, TYRE * hubs


def test_a_half_car_on_two_posts_responds_as_its_matrices_say() -> None:
    near = linear(car(("front", FRONT), ("rear", REAR)))
    f = np.geomspace(0.2, 50, 60)
    values = near.frequency_response(f).values
    M, C, K, B = half_by_hand()
    for at, found in zip(2j * np.pi * f, values, strict=True):
        q = np.linalg.solve(M * at**2 + C * at + K, B)
        tyres = TYRE * (np.eye(2) - q[2:])
        assert found[[0, 1, 3]] == pytest.approx(np.vstack([at**2 * q[0], tyres]), rel=1e-9, abs=1e-9 * np.abs(tyres).max())


# Roads


def test_a_quarter_car_on_a_road_without_limits_has_the_closed_forms_of_white_noise() -> None:
    """Mean squares by Lyapunov's equation, by hand: of acceleration and travel of a car without a damper in the tyre."""
    found = cutjoint.random_vibration(quarter(), road="C", speed=20.0)
    q = 2 * np.pi**2 * 256e-6 * 0.1**2 * 20.0
    total = BODY + HUB
    acceleration = q * (total * SPRING**2 / (2 * DAMPER * BODY**2) + TYRE * DAMPER / (2 * BODY**2))
    assert found.white[0] ** 2 == pytest.approx(acceleration, rel=1e-9)
    assert found.white[2] ** 2 == pytest.approx(q * total / (2 * DAMPER), rel=1e-9)
    f = np.geomspace(0.011 * 20, 2.83 * 20, 200_001)
    gain = np.abs(quarter_by_hand(2j * np.pi * f)) ** 2
    density = gain * (256e-6 * (f / 20 / 0.1) ** -2 / 20)[:, None]
    assert found.rms == pytest.approx(np.sqrt(np.trapezoid(density, f, axis=0)), rel=1e-8)
    assert found.weighted[0] == pytest.approx(np.sqrt(np.trapezoid(density[:, 0] * weighting("Wk", f) ** 2, f)), rel=1e-8)
    assert np.isnan(found.weighted[1:]).all()
    assert found.variation[1] == pytest.approx(found.rms[1] / (total * 9.81), rel=1e-9)


def test_rear_wheels_follow_front_wheels_and_tracks_have_the_coherence_of_an_isotropic_surface() -> None:
    near = linear(car(("front", FRONT), ("rear", REAR)))
    assert isinstance(near, StateSpace)
    found = cutjoint.random_vibration(near, road=1e-5, speed=15.0, points=7)
    apart = cutjoint.random_vibration(near, road=1e-5, speed=15.0, points=7, places={"front_post": (0, 0.7), "rear_post": (0, -0.7)})
    M, C, K, B = half_by_hand()
    for f, behind, beside in zip(found.frequencies, found.densities, apart.densities, strict=True):
        s, n = 2j * np.pi * f, f / 15
        q = np.linalg.solve(M * s**2 + C * s + K, B)
        tyres, struts = TYRE * (np.eye(2) - q[2:]), np.array([[1, -FRONT, -1, 0], [1, -REAR, 0, -1]]) @ q
        G = np.vstack([s**2 * q[0], tyres[0], struts[0], tyres[1], struts[1]])
        height, x = 1e-5 * (n / 0.1) ** -2 / 15, 2 * np.pi * n * 1.4
        by_delay = G @ [1.0, np.exp(-2j * np.pi * f * (FRONT - REAR) / 15)]
        assert behind == pytest.approx(height * np.abs(by_delay) ** 2, rel=1e-9)
        coherence = np.array([[1, x * k1(x)], [x * k1(x), 1]])
        assert beside == pytest.approx(height * np.einsum("oi,ij,oj->o", G, coherence, G.conj()).real, rel=1e-9)
    # the acceleration's variance with the delay, by quadrature of the white noise's transfer over all frequencies
    f = np.linspace(1e-3, 4000, 2_000_001)
    s = 2j * np.pi * f
    A = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    values, vectors = np.linalg.eig(A)
    forces = np.linalg.solve(vectors, np.vstack([np.zeros((4, 2)), np.linalg.solve(M, B)]))
    heave = sum((vectors[0, i] * (forces[i, 0] + forces[i, 1] * np.exp(-s * (FRONT - REAR) / 15))) / (s - values[i]) for i in range(8))
    white = 2 * np.pi**2 * 1e-5 * 0.1**2 * 15 * 2 * np.trapezoid(np.abs(s * heave) ** 2, f)
    assert found.white[0] ** 2 == pytest.approx(white, rel=2e-4)  # what is beyond the last frequency: 1e-4


def test_frequency_weightings_are_those_of_the_standard() -> None:
    """ISO 2631-1, table 3: Wk and Wd at thirds of octaves, whose values have four digits."""
    bands = np.array([0.5, 1, 2, 4, 5, 8, 10, 16, 31.5, 80])
    assert 1000 * weighting("Wk", bands) == pytest.approx([418, 482, 531, 967, 1039, 1036, 988, 768, 405, 132], abs=1.0)
    assert 1000 * weighting("Wd", bands[[0, 1, 2, 3, 4, 5, 7, 8]]) == pytest.approx([853, 1011, 890, 512, 409, 253, 125, 63.2], abs=1.0)


# Drives and loops

DRIVE = """
cutjoint: 1
name: drive
gravity: [0, 0, 0]
parameters: {torque: {value: 0, unit: N*m, binding: input}}
bodies:
  motor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 0.02]}
  load: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 0.3]}
joints:
  rotor: {kind: revolute, bodies: [ground, motor], at: [0, 0, 0], axis: z}
  shaft: {kind: revolute, bodies: [motor, load], at: [0, 0, 0], axis: z}
forces:
  twist: {kind: joint_force, joint: shaft, law: "-60*position - 0.1*rate"}
  drag: {kind: joint_force, joint: rotor, law: torque}
outputs: [motor.wz, load.wz]
scenes: {still: {end: 1}}
"""


def test_a_two_mass_drive_has_its_antiresonance_and_margins() -> None:
    near = linear(DRIVE)
    s = 2j * np.pi * np.geomspace(0.01, 100, 50)
    spring, J, L = 60 + 0.1 * s, 0.02, 0.3
    D = s * (J * L * s**2 + (J + L) * spring)
    found = near.evaluate(s)[:, :, 0]
    assert np.abs(found / np.stack([(L * s**2 + spring) / D, spring / D], axis=-1) - 1).max() < 1e-9
    zeros = sorted(near.zeros("motor.wz", "torque"), key=lambda z: z.imag)
    assert zeros == pytest.approx(sorted(np.roots([L, 0.1, 60]), key=lambda z: z.imag), rel=1e-9)
    assert np.sort(np.abs(near.poles))[:2] == pytest.approx([0, 0], abs=1e-9)
    margins = near.margins("load.wz", "torque", np.geomspace(0.01, 100, 400))
    by_control = control.stability_margins(control.tf([0.1, 60], [J * L, (J + L) * 0.1, (J + L) * 60, 0]))
    assert [margins.gain, margins.phase] == pytest.approx(by_control[:2], rel=1e-8)
    assert [2 * np.pi * margins.gain_at, 2 * np.pi * margins.phase_at] == pytest.approx(by_control[3:5], rel=1e-8)


# An isolator, a drive with backlash, a rotor

ISOLATOR = """
cutjoint: 1
name: isolator
gravity: [0, 0, -9.81]
parameters: {floor: {value: 0, unit: m, binding: input}}
bodies: {table: {massless: true}, device: {mass: 12, centre_of_mass: [0, 0, 0.1]}}
joints:
  shake: {kind: prismatic, bodies: [ground, table], at: [0, 0, 0], axis: z, guide: floor}
  rise: {kind: prismatic, bodies: [ground, device], at: [0, 0, 0.1], axis: z}
states:
  damper: {start: 0 m, rate: "9000*(mount.travel - 0.1 - damper)/250"}
forces:
  mount:
    {kind: axial_force, bodies: [table, device], origin: [0, 0, 0], point: [0, 0, 0.1], axis: z,
     law: "3000*(0.1 - travel) - 9000*(travel - 0.1 - damper)"}
outputs: [device.az, mount.force, damper.value]
scenes: {stand: {end: 1}}
"""


def test_an_isolator_with_an_elastically_hung_damper_has_its_transmissibility() -> None:
    """A spring of 3 kN/m beside a damper of 250 N s/m that hangs on 9 kN/m: a state of first order."""
    near = linear(ISOLATOR)
    assert isinstance(near, StateSpace)
    f = np.geomspace(0.05, 200, 80)
    s = 2j * np.pi * f
    branch = 9000 * 250 * s / (9000 + 250 * s)
    device = (3000 + branch) / (12 * s**2 + 3000 + branch)
    damper = 9000 * (device - 1) / (9000 + 250 * s)
    expected = np.stack([s**2 * device, -(3000 + branch) * (device - 1), damper], axis=-1)
    assert np.abs(near.frequency_response(f).values[:, :, 0] / expected - 1).max() < 1e-9
    poles = np.roots([12 * 250, 12 * 9000, 250 * 12000, 3000 * 9000])  # of the closed form's denominator
    assert np.sort_complex(near.poles) == pytest.approx(np.sort_complex(poles), rel=1e-9)


BACKLASH = """
cutjoint: 1
name: drive
gravity: [0, 0, 0]
parameters: {torque: {value: 0, unit: N*m, binding: input}}
bodies:
  load: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 0.3]}
  motor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 0.02]}
joints:
  axle: {kind: revolute, bodies: [ground, load], at: [0, 0, 0], axis: z}
  shaft: {kind: revolute, bodies: [load, motor], at: [0, 0, 0], axis: z}
forces:
  teeth: {kind: joint_force, joint: shaft, law: "-60*(max(position - 0.01, 0) + min(position + 0.01, 0)) - 0.1*rate"}
  spring: {kind: joint_force, joint: axle, law: -5*position}
  drive: {kind: load, body: motor, torque: [0, 0, torque]}
outputs: [motor.wz, load.wz]
scenes: {still: {end: 1}}
"""


@pytest.mark.parametrize(("moment", "stiffness", "torque"), [(None, 60.0, 2.0), (None, 60.0, -2.0), (0.0, 0.0, 0.0)])
def test_a_drive_with_backlash_is_linearised_on_its_flank_or_between_them(moment: float | None, stiffness: float, torque: float) -> None:
    """Wound up by 2 N m the teeth touch on one flank; at the start of a run without torque they do not."""
    near = linear(BACKLASH.replace("value: 0, unit: N*m", f"value: {torque}, unit: N*m"), at=moment)
    s = 2j * np.pi * np.geomspace(0.05, 100, 50)
    shaft, J, L, spring = stiffness + 0.1 * s, 0.02, 0.3, 5.0
    D = (J * s**2 + shaft) * (L * s**2 + shaft + spring) - shaft**2
    expected = np.stack([s * (L * s**2 + shaft + spring) / D, s * shaft / D], axis=-1)
    assert np.abs(near.evaluate(s)[:, :, 0] / expected - 1).max() < 1e-9


def test_a_rotor_in_anisotropic_bearings_responds_as_its_gyroscopic_matrices_say() -> None:
    """A torque about x tilts the disc of the page about x and, by its spin, about y."""
    page = (ROOT / "docs/how-to/rotating-machines.md").read_text(encoding="utf-8")
    model, _, _ = page.partition('title="rotor.yaml"\n')[2].partition("```")
    near = cutjoint.find_linear_model(
        read_model_text(model.replace("value: 100, unit: rad/s", "value: 400, unit: rad/s"), "rotor.yaml"), scene="steady",
        inputs=["disc.wrench.tx", "disc.wrench.fy"], outputs=["rx.angle", "ry.angle", "disc.y"], external_wrenches=["disc"],
    )  # fmt: skip
    s = 2j * np.pi * np.geomspace(0.5, 500, 60)
    for at, found in zip(s, near.evaluate(s), strict=True):
        whirl = np.array([[0.4 * at**2 + 2 * at + 4e4, 0.7 * 400 * at], [-0.7 * 400 * at, 0.4 * at**2 + 2 * at + 6e4]])
        tilt = np.linalg.solve(whirl, [1.0, 0.0])
        assert found[:2, 0] == pytest.approx(tilt, rel=1e-9)
        assert found[2, 1] == pytest.approx(1 / (20 * at**2 + 200 * at + 2e6), rel=1e-9)


CART, POLE, LENGTH, PERIOD = 1.0, 0.2, 0.5, 0.02
GAINS = np.array([-1.0, 32.0, -2.2, 6.5])
CART_POLE = f"""
cutjoint: 1
name: balance
gravity: [0, 0, -9.81]
parameters: {{gust: {{value: 0, unit: N, binding: input}}}}
bodies:
  cart: {{mass: {CART}, centre_of_mass: [0, 0, 0]}}
  pole: {{mass: {POLE}, centre_of_mass: [0, 0, {LENGTH}]}}
joints:
  rail: {{kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: x}}
  pin: {{kind: revolute, bodies: [cart, pole], at: [0, 0, 0], axis: y}}
controllers:
  balance:
    every: 20 ms
    signals: {{push: "max(-50, min(50, 1.0*rail.displacement + 32.0*pin.angle + 2.2*rail.displacement_rate + 6.5*pin.angle_rate))"}}
forces:
  motor: {{kind: joint_force, joint: rail, law: balance.push + gust}}
outputs: [cart.x, pin.angle, balance.push]
scenes: {{upright: {{end: 10}}}}
"""


def test_a_cart_pole_under_sampled_state_feedback_has_its_exact_discrete_transfer() -> None:
    """x, theta (to +x), and their rates: (m + p) x'' + p l theta'' = F, x'' + l theta'' = g theta."""
    near = linear(CART_POLE, at=0.0)
    assert isinstance(near, SampledStateSpace)
    assert near.unsteady == {}
    M = np.array([[CART + POLE, POLE * LENGTH], [1.0, LENGTH]])
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[:2, 2:], A[2:, 1], B[2:, 0] = np.eye(2), np.linalg.solve(M, [0.0, 9.81]), np.linalg.solve(M, [1.0, 0.0])
    K = np.array([[1.0, 32.0, 2.2, 6.5]])
    F = linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * PERIOD)
    Ad, Bd = F[:4, :4], F[:4, 4:]
    closed = np.linalg.eigvals(Ad + Bd @ K)
    own = near.poles[np.abs(near.poles) > 1e-6]
    assert np.sort_complex(own) == pytest.approx(np.sort_complex(closed), rel=1e-10)
    system = near.to_scipy()
    for z in np.exp(2j * np.pi * np.array([0.1, 1.0, 5.0, 20.0]) * PERIOD):
        by_gust = np.linalg.solve(z * np.eye(4) - Ad - Bd @ K, Bd)
        expected = np.vstack([by_gust[:2], K @ by_gust])
        found = system.C @ np.linalg.solve(z * np.eye(len(system.A)) - system.A, system.B) + system.D
        assert np.abs(found / expected - 1).max() < 1e-12
    # the component at the frequency of a gust that is no step: what the plant does, and what the held push adds
    for f, found in zip([0.1, 1.0, 5.0, 20.0, 37.0], near.frequency_response([0.1, 1.0, 5.0, 20.0, 37.0]).values, strict=True):
        s, z = 2j * np.pi * f, np.exp(2j * np.pi * f * PERIOD)
        by_force = np.linalg.solve(s * np.eye(4) - A, B)
        at_samples = np.linalg.solve(np.eye(4) - np.linalg.solve(z * np.eye(4) - Ad, Bd @ K), by_force)
        push = K @ at_samples * (1 - 1 / z) / (s * PERIOD)
        assert found == pytest.approx(np.vstack([(by_force + by_force @ push)[:2], push]), rel=1e-10)


LOOP = """
cutjoint: 1
name: loop
gravity: [0, 0, 0]
parameters:
  wanted: {value: 0, unit: m, binding: input}
bodies:
  slide: {mass: 2, centre_of_mass: [0, 0, 0]}
joints:
  rail: {kind: prismatic, bodies: [ground, slide], at: [0, 0, 0], axis: x}
states:
  current: {start: 0, rate: "40*(inner.force - current)"}
controllers:
  outer: {every: 20 ms, delay: 20 ms, signals: {speed: 1.5*(wanted - rail.displacement)}, offset: 5 ms}
  inner:
    every: 4 ms
    signals: {error: outer.speed - rail.displacement_rate, force: 20*error + 3*sum}
    memory: {sum: {start: 0, next: sum + 0.004*error}}
forces:
  motor: {kind: joint_force, joint: rail, law: "current - 3*rate - 12*position"}
outputs: [rail.displacement, inner.force, slide.ax]
scenes:
  run: {end: 100, output_step: 1 ms, inputs: {wanted: "0.1*sin(2*pi*1.75*t)"}}
"""


@pytest.mark.heavy
def test_the_response_of_a_loop_of_two_rates_is_the_fourier_coefficient_of_a_long_run() -> None:
    model = read_model_text(LOOP, "loop.yaml")
    near = cutjoint.find_linear_model(model)
    run = simulate(compile_interpreted(model, model.scenes["run"]), integrator="dop853", tolerance=1e-12, error=False)
    last = slice(-8_001, -1)  # 14 whole periods
    t = run.t[last]
    wave = np.exp(-2j * np.pi * 1.75 * t) * 2 / len(t)
    found = near.frequency_response([1.75]).values[0, :, 0]
    for i, name in enumerate(near.outputs[:1]):
        assert abs(1j * (run.columns[name][last] @ wave) / 0.1 / found[i] - 1) < 1e-6


@pytest.mark.heavy
def test_the_iltis_on_four_posts_responds_as_the_fourier_coefficients_of_a_long_run() -> None:
    """Each wheel's ground at an odd frequency, 3 um: products of second order are at even ones.  What rolls off sideways is no number."""
    model = with_inputs(read_model(MODELS / "iltis.yaml"), terrain=["*"])
    posts = {f"{wheel}.tyre.terrain_height": f for wheel, f in (("front_left", 1), ("front_right", 3), ("rear_left", 5), ("rear_right", 7))}
    scene = model.scenes["iavsd_equilibrium"]
    waves = {name: 3e-6 * sympy.sin(2 * sympy.pi * f * TIME) for name, f in posts.items()}
    moved = replace(scene, end=8.0, output_step=1 / 400, inputs={**scene.inputs, **waves})
    run = simulate(compile_interpreted(model, moved), integrator="dop853", tolerance=1e-13, error=False)
    near, last = cutjoint.find_linear_model(model, scene="iavsd_equilibrium", inputs=list(posts)), slice(-801, -1)
    compared = [name for name in near.outputs if not name.endswith(("yaw", "Fy", "slip"))]
    for j, f in enumerate(posts.values()):
        expected = near.frequency_response([f]).values[0, :, j]
        wave = 1j * np.exp(-2j * np.pi * f * run.t[last]) * 2 / 800 / 3e-6
        for name in compared:
            assert abs(run.columns[name][last] @ wave / expected[near.outputs.index(name)] - 1) < 1e-6, (name, f)


def test_the_command_writes_tables_plots_and_errors(tmp_path: Path) -> None:
    model, table = tmp_path / "car.yaml", tmp_path / "response.csv"
    model.write_text(car(("front", 0.0)))

    def run(*words: str) -> tuple[int, str]:
        done = CliRunner().invoke(main, ["response", str(model), *words])
        return done.exit_code, done.output

    where = ("--out", str(table), "--plots", str(tmp_path))
    code, text = run("--output", "front_tyre.force", "--from", "0.1", "--to", "30", "--points", "50", *where)
    assert code == 0
    assert "stable" in text
    columns = np.genfromtxt(table, delimiter=",", names=True)
    gain = np.abs(quarter_by_hand(2j * np.pi * columns["f"])[:, 1])
    assert columns.dtype.names[1:] == ("front_tyreforcefront_postgain", "front_tyreforcefront_postphase")
    assert columns[columns.dtype.names[1]] == pytest.approx(gain, rel=1e-9)
    assert json.loads(Path(f"{table.with_suffix('')}.units.json").read_text())["f"] == "Hz"
    assert {"bode_front_tyre.force.png", "nyquist_front_tyre.force.png"} <= {path.name for path in tmp_path.iterdir()}
    code, text = run("--road", "C", "--speed", "20", "--out", str(table), "--plots", str(tmp_path))
    assert (code, (tmp_path / "densities.png").is_file()) == (0, True)
    assert f"{cutjoint.random_vibration(quarter(), road='C', speed=20.0).rms[1]:.4g}" in text
    assert run("--input", "frnt_post") == (1, f"{model}: the model has no input 'frnt_post'; did you mean 'front_post'?\n")
    assert run("--output", "front_tyre.farce")[1].endswith("'front_tyre' has no quantity 'farce'; did you mean 'force'?\n")
    assert "go together" in run("--road", "C")[1]
    assert "is empty" in run("--from", "5", "--to", "2")[1]
    assert "belong to a frequency response" in run("--road", "C", "--speed", "20", "--from", "1")[1]


def test_a_position_that_a_force_holds_is_no_equilibrium_to_linearise_about() -> None:
    """A scene that sets a height starts there, but nothing holds it: 300 kg 10 mm above the height of rest on 20 kN/m."""
    text = car(("front", 0.0)).replace("end: 1", "end: 1, positions: {heave.displacement: 10 mm}")
    assert "positions" in text
    with pytest.raises(cutjoint.RunError, match=r"scene 'stand': .* hold 'heave.displacement', so that small motions have no equilibrium"):
        linear(text)
