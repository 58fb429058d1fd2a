"""Friction by the loads of joints: a crank against equations by hand, its energy, orders of errors, rest that lasts, Painleve's limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.tasks.states import NoEquilibriumError, find_scene_equilibrium, find_scene_modes
from tests.conftest import with_heavy
from tests.physics.simulation import compile_text, completed
from tests.physics.test_friction import BLOCK, PENDULUM, ROD, run

#: A crank of 0.1 m, a rod of 0.3 m and a slider, all in one plane; the joints have the motions that leave no equation redundant.
CRANK = """
cutjoint: 1
name: crank
gravity: [0, 0, -9.81]
points: {{A: [0, 0, 0], B: [0.06, 0, 0.08], C: [{C}, 0, 0]}}
bodies:
  crank: {{mass: 0.5, centre_of_mass: {{midpoint: [A, B]}}, inertia: [0.002, 0.002, 0.002]}}
  rod: {{mass: 0.8, centre_of_mass: {{midpoint: [B, C]}}, inertia: [0.006, 0.006, 0.006]}}
  slider: {{mass: 1.2, centre_of_mass: C, inertia: [0.001, 0.001, 0.001]}}
joints:
  A: {{kind: revolute, bodies: [ground, crank], at: A, axis: [0, -1, 0]}}
  B: {{kind: cylindrical, bodies: [crank, rod], at: B, axis: [0, -1, 0]{cut_B}}}
  C: {{kind: universal, bodies: [rod, slider], at: C, axis: [0, -1, 0], axis_2: [0, 0, 1]}}
  S: {{kind: cylindrical, bodies: [ground, slider], at: C, axis: [1, 0, 0]{cut_S}}}
forces:
  motor: {{kind: joint_force, joint: A, law: 0.4}}
  at_A: {{kind: joint_friction, joint: A, coefficient: 0.2, radius: 0.02, preload: 1}}
  at_B: {{kind: joint_friction, joint: B, coordinate: angle, coefficient: 0.3, radius: 0.015}}
  at_C: {{kind: joint_friction, joint: C, coordinate: angle_1, coefficient: 0.1, static: 0.2, stribeck_speed: 0.1, radius: 0.01}}
  at_S: {{kind: joint_friction, joint: S, coordinate: displacement, coefficient: 0.15}}
outputs: [A.angle, A.angle_rate, B.angle_rate, C.angle_1_rate, S.displacement_rate, at_A.load, at_B.load, at_C.load, at_S.load,
          at_A.force, at_B.force, at_C.force, at_S.force]
scenes:
  turn: {{end: 0.7, output_step: {rows}, rates: {{A.angle_rate: 9}}}}
"""
SLIDER = 0.06 + np.sqrt(0.09 - 0.08**2)


def crank(rows: float = 0.01, cut: str = "B") -> str:
    cuts = {f"cut_{joint}": ", cut: true" if joint == cut else ", cut: false" for joint in "BS"}
    return CRANK.format(C=repr(float(SLIDER)), rows=rows, **cuts)


@dataclass(frozen=True, kw_only=True)
class Rub:
    """Friction by hand: the force by N of load and the rate of the bristle's share."""

    mu: float
    static: float
    stribeck: float
    radius: float

    def law(self, rate: float, s: float) -> tuple[float, float]:
        v = self.radius * rate
        g = (self.mu + (self.static - self.mu) * np.exp(-((v / self.stribeck) ** 2))) / self.static
        u = s / g
        w = max(0.0, 2 * u * u - 1)
        a = w * w / (1 + w * w) * (1 + np.tanh(u * v / 1e-5))
        force = -self.radius * self.static * g * (u + (1 - u * u) / 2 * np.tanh(v / 0.01))
        return force, v / 1e-4 * (1 - a) / (1 + 4 * a * u * v / 1e-4 * 1e-3)


RUBS = (
    Rub(mu=0.2, static=0.2, stribeck=1, radius=0.02), Rub(mu=0.3, static=0.3, stribeck=1, radius=0.015),
    Rub(mu=0.1, static=0.2, stribeck=0.1, radius=0.01), Rub(mu=0.15, static=0.15, stribeck=1, radius=1),
)  # fmt: skip


def rates(angle: float, rate: float) -> tuple[float, float, float, float]:
    """Of the joints A, B, C and of the slide; the rod's angle is below the line from B to C."""
    b = np.arcsin(0.1 * np.sin(angle) / 0.3)
    rod = -0.1 * np.cos(angle) * rate / (0.3 * np.cos(b))
    return rate, rod - rate, -rod, -0.1 * np.sin(angle) * rate + 0.3 * np.sin(b) * rod


def motion(angle: float, rate: float, shares: Sequence[float]) -> tuple[float, np.ndarray, np.ndarray]:
    """Angular acceleration, changes of the bristles and loads: the equations of three bodies for nine forces and accelerations.

    The unknowns are the crank's and the rod's angular accelerations, the slider's acceleration, the forces on the crank at A, on the rod at
    B, and on the slider at C, each x and z, and the slide's force.  The moment that keeps the slider from turning takes friction at C.
    """
    c, s = np.cos(angle), np.sin(angle)
    b = np.arcsin(0.1 * s / 0.3)
    p, q = np.cos(b), np.sin(b)  # C - B = 0.3 (p, -q): its turn is -b
    turn = -0.1 * c * rate / (0.3 * p)
    found = [rub.law(each, share) for rub, each, share in zip(RUBS, rates(angle, rate), shares, strict=True)]
    M = np.zeros((10, 10))
    al, be, x, ax, az, bx, bz, cx, cz, n = range(10)
    u, w = np.array([c, s]), np.array([p, -q])
    across_u, across_w = np.array([-s, c]), np.array([q, p])
    for i, (fa, fb, fc) in enumerate(((ax, bx, cx), (az, bz, cz))):
        M[i, al], M[i, fa], M[i, fb] = 0.5 * 0.05 * across_u[i], -1, 1  # the crank: its centre at 0.05 u
        M[2 + i, al], M[2 + i, be], M[2 + i, fb], M[2 + i, fc] = 0.8 * 0.1 * across_u[i], 0.8 * 0.15 * across_w[i], -1, 1
        M[4 + i, fc] = -1
        M[8 + i, al], M[8 + i, be] = 0.1 * across_u[i], 0.3 * across_w[i]
    M[4, x], M[5, n], M[8, x] = 1.2, -1, -1
    M[6, al] = 0.002
    M[6, [bx, bz]] = 0.05 * np.array([-u[1], u[0]])  # moments about the centres: those of -B at +0.05 u and of A at -0.05 u
    M[6, [ax, az]] = 0.05 * np.array([-u[1], u[0]])
    M[7, be] = 0.006
    M[7, [bx, bz]] = 0.15 * np.array([-w[1], w[0]])
    M[7, [cx, cz]] = 0.15 * np.array([-w[1], w[0]])
    right = np.zeros(10)
    bend_u, bend_w = -(rate**2) * u, -(turn**2) * w
    right[0:2] = -0.5 * (0.05 * bend_u + np.array([0, 9.81]))
    right[2:4] = -0.8 * (0.1 * bend_u + 0.15 * bend_w + np.array([0, 9.81]))
    right[5] = -1.2 * 9.81
    right[8:10] = -(0.1 * bend_u + 0.3 * bend_w)
    right[6] = 0.4
    pushes = np.zeros((10, 4))
    pushes[[6, 6, 7, 7, 4], [0, 1, 1, 2, 3]] = np.array([1, -1, 1, -1, 1]) * np.array([found[i][0] for i in (0, 1, 1, 2, 3)])
    solved = np.linalg.solve(M, np.column_stack([right, pushes]))
    loads = np.full(4, 20.0)
    for _ in range(200):
        y = solved[:, 0] + solved[:, 1:] @ loads
        before, loads = loads, np.array([1 + np.hypot(y[ax], y[az]), np.hypot(y[bx], y[bz]), np.hypot(y[cx], y[cz]), abs(y[n])])
        if np.abs(loads - before).max() < 1e-12:
            break
    else:
        raise AssertionError("the loads do not settle")
    return y[al], np.array([change for _, change in found]), loads


def test_sliding_crank_follows_equations_by_hand(tmp_path: Path) -> None:
    runs = {cut: completed(run(tmp_path, crank(cut=cut), tolerance=1e-9, end=0.3)) for cut in "BS"}
    start = [float(np.arctan2(0.08, 0.06)), 9, 0, 0, 0, 0]

    def derive(t: float, y: np.ndarray) -> np.ndarray:
        turn, changes, _ = motion(y[0], y[1], y[2:])
        return np.array([y[1], turn, *changes])

    t = runs["B"].t
    exact = solve_ivp(derive, (0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-10, method="Radau").y
    loads = np.array([motion(y[0], y[1], y[2:])[2] for y in exact.T])
    assert exact[0][-1] > 1.1 * np.pi  # a dead centre lies behind it, where the slide and its friction turn round
    for done in runs.values():
        assert np.abs(done.columns["A.angle"] - (exact[0] - exact[0][0])).max() < 1e-5
        assert np.abs(done.columns["A.angle_rate"] - exact[1]).max() < 1e-4
        for i, name in enumerate(("at_A", "at_B", "at_C", "at_S")):
            assert np.abs(done.columns[f"{name}.load"] - loads[:, i]).max() < 1e-3 * loads[:, i].max(), name


def energy(columns: Trajectory | dict[str, np.ndarray]) -> np.ndarray:
    """Of the crank, by hand: kinetic, and by weight."""
    angle, rate = columns["A.angle"] + np.arctan2(0.08, 0.06), columns["A.angle_rate"]
    b = np.arcsin(np.sin(angle) / 3)
    turn, slide = -np.cos(angle) * rate / (3 * np.cos(b)), -0.1 * np.sin(angle) * rate - 0.1 * np.cos(angle) * rate * np.tan(b)
    x = -0.1 * np.sin(angle) * rate + 0.15 * np.sin(b) * turn
    z = 0.1 * np.cos(angle) * rate + 0.15 * np.cos(b) * turn
    kinetic = (0.002 + 0.5 * 0.05**2) * rate**2 + 0.006 * turn**2 + 0.8 * (x**2 + z**2) + 1.2 * slide**2
    return kinetic / 2 + 9.81 * (0.5 * 0.05 * np.sin(angle) + 0.8 * 0.05 * np.sin(angle))


def test_friction_takes_the_energy_that_is_missing(tmp_path: Path) -> None:
    done = completed(run(tmp_path, crank(rows=0.0001), tolerance=1e-9))
    c = done.columns
    power = sum(
        c[f"at_{joint}.force"] * c[rate]
        for joint, rate in (("A", "A.angle_rate"), ("B", "B.angle_rate"), ("C", "C.angle_1_rate"), ("S", "S.displacement_rate"))
    )
    work, change = simpson(power, x=done.t), energy(c)[-1] - energy(c)[0] - 0.4 * (c["A.angle"][-1] - c["A.angle"][0])
    assert work < -0.5
    assert change == pytest.approx(work, abs=1e-4)


@pytest.mark.parametrize(("integrator", "order"), [("trapezoidal", 2), ("rk4", 4)])
def test_errors_have_the_order_of_the_integrator(integrator: str, order: int, tmp_path: Path) -> None:
    """Of bristles that stay springs: where one begins to slide its rate has a bend."""
    artifact = compile_text(tmp_path, PENDULUM.replace("preload: 3", "preload: 3, presliding: 1, damping_speed: 2"))
    exact = completed(simulate(artifact, integrator="dormand-prince", tolerance=1e-12, error=False)).columns
    runs = [completed(simulate(artifact, integrator=integrator, dt=dt, error=False)).columns for dt in (1e-2, 5e-3)]
    for name in ("pin.angle", "pin.angle_rate"):
        errors = [np.abs(columns[name] - exact[name]).max() for columns in runs]
        assert errors[0] / errors[1] == pytest.approx(2**order, rel=0.05), (name, errors)


@pytest.mark.parametrize("end", with_heavy([20, 1000], 1000))
def test_shaken_block_rests_as_long_as_it_is_held(end: float, tmp_path: Path) -> None:
    """Its load is 44 % of the limit, and up to 5 % more or less as it shakes: it does not move by 1e-9 m/s."""
    columns = completed(run(tmp_path, BLOCK.format(coefficient=1, shake='"0.9*sin(20*pi*t)"', end=end), tolerance=1e-10)).columns
    x = columns["block.x"]  # once in each period of the load
    assert abs(x[-1] - x[20]) < 1e-9 * (end - 2)


@pytest.mark.parametrize("task", [find_scene_equilibrium, find_scene_modes])
def test_equilibrium_that_friction_cannot_hold_is_refused(task: Callable[[Model, Scene], object]) -> None:
    """The block needs 8 N, and 18 N press it on its slide."""
    held, sliding = (read_model_text(BLOCK.format(coefficient=c, shake=0, end=1), "block.yaml") for c in (0.45, 0.4))
    task(held, held.scenes["go"])
    start = simulate(compile_interpreted(sliding, replace(sliding.scenes["go"], pose="equilibrium")), check=False)
    assert start.failure is not None
    with pytest.raises(NoEquilibriumError, match=r"no static equilibrium was found .*, and that friction can hold what it must: 'rub'"):
        task(sliding, sliding.scenes["go"])


def test_equilibrium_and_mode_are_those_of_the_bristle() -> None:
    """The limit of 18 N over the 0.1 mm to it is the stiffness at rest."""
    model = read_model_text(BLOCK.format(coefficient=1, shake=0, end=1), "block.yaml")
    found = find_scene_equilibrium(model, model.scenes["go"]).values
    assert (found["rub.force"], found["rub.load"], found["rub_bristle.value"]) == pytest.approx((-8, 18, 8 / 18), rel=1e-6)
    modes = find_scene_modes(model, model.scenes["go"])
    swing = next(m.eigenvalue for m in modes.modes if m.eigenvalue.imag != 0)
    assert abs(swing) ** 2 == pytest.approx(18 / 1e-4 / 2, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_advice_to_the_rod_of_painleve_is_its_limit(sign: int, tmp_path: Path) -> None:
    """With m the mass, J the inertia and r from the centre to the shoe, mu m |r_x r_z| = J + m r_x^2 at the limit: mu = 4/3."""
    artifact = compile_text(tmp_path, ROD.format(coefficient=2, x=sign))
    failure = simulate(artifact, integrator="dormand-prince", error=False, check=False).failure
    assert failure is not None
    factor = float(failure.advice.split("friction ")[1].split(" times")[0])
    assert 4 / 3 - 2 * 1e-3 <= 2 * factor <= 4 / 3 + 1e-3
    completed(run(tmp_path, ROD.format(coefficient=2 * factor - 0.002, x=sign), tolerance=1e-6))
