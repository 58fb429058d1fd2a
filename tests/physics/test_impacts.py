"""Guides whose rates jump: momentum carries over, by every method and integrator, and the balance of work and energy has the impulses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Output
from cutjoint.run.artifact import Artifact
from cutjoint.topology.build import build_topology
from tests.conftest import needs_cpp
from tests.mechanisms.random_models import NOWHERE, TIME, random_loops, random_tree, scene
from tests.oracles.dense import DenseMechanism, Instant, Motion
from tests.physics.simulation import compile_model, completed, simulate

pytestmark = needs_cpp

#: The times at which guides begin to move (s), not at a row, and at the end of a row's step.
BETWEEN, AT_A_ROW = 0.2037, 0.2

#: Integrators of each method, with what makes them exact.
RUNS: dict[str, tuple[dict[str, Any], ...]] = {
    "recursive": (
        {"integrator": "dormand-prince", "tolerance": 1e-10}, {"integrator": "rk4"}, {"integrator": "trapezoidal", "events": "crossed"},
        {"integrator": "trapezoidal", "events": "located"}, {"integrator": "trapezoidal", "events": "crossed", "iterations": 8},
        {"integrator": "dormand-prince", "tolerance": 1e-10, "events": "crossed"}, {"integrator": "rk4", "events": "crossed"},
    ),
    "recursive-newton": (
        {"integrator": "radau5", "tolerance": 1e-10}, {"integrator": "radau5-fixed"}, {"integrator": "trapezoidal", "events": "crossed"},
        {"integrator": "trapezoidal", "events": "located"}, {"integrator": "generalised-alpha", "events": "crossed"},
        {"integrator": "generalised-alpha", "events": "located"}, {"integrator": "radau5", "tolerance": 1e-10, "events": "crossed"},
    ),
    "augmented": ({},), "classical": ({},),
}  # fmt: skip
CASES = [pytest.param(method, how, id="-".join([method, *map(str, how.values())])) for method, ways in RUNS.items() for how in ways]

#: A cart on a rail that a guide moves, and a rod on it that turns freely.
CART = """\
cutjoint: 1
name: cart
gravity: [0, 0, 0]
bodies:
  cart: {mass: 3, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  rod: {mass: 2, centre_of_mass: [0, 0, -0.5], inertia: [0.2, 0.3, 0.1]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0], guide: "where(t < BEGIN, 0, 2*(t - BEGIN))"}
  pin: {kind: revolute, bodies: [cart, rod], at: [0, 0, 0], axis: [0, 1, 0]}
outputs: [cart.x, cart.vx, pin.angle, pin.angle_rate]
scenes:
  run: {end: 0.4, output_step: 0.02, numerics: {dt: 0.002}}
"""

#: A load on a winch's rope, which a gear moves twice as fast as the guided drum's slide, and starts at once.
HOIST = """\
cutjoint: 1
name: hoist
gravity: [0, 0, -9.81]
bodies:
  slide: {mass: 4, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  load: {mass: 10, centre_of_mass: [1, 0, 0], inertia: [1, 1, 1]}
joints:
  drum: {kind: prismatic, bodies: [ground, slide], at: [0, 0, 0], axis: [0, 0, 1], guide: "where(t < BEGIN, 0, 1.5*(t - BEGIN))"}
  rope: {kind: prismatic, bodies: [ground, load], at: [1, 0, 0], axis: [0, 0, 1]}
gears:
  block: {joints: [rope, drum], ratio: 2}
outputs: [slide.vz, load.z, load.vz]
scenes:
  run: {end: 0.4, output_step: 0.02, numerics: {dt: 0.002}}
"""


@cache
def _compiled(text: str, begin: float, method: str) -> Artifact:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.yaml"
        path.write_text(text.replace("BEGIN", repr(begin)), encoding="utf-8")
        return compile_model(path, method=method)


@pytest.mark.parametrize("begin", [BETWEEN, AT_A_ROW])
@pytest.mark.parametrize(("method", "how"), CASES)
def test_a_cart_takes_its_rod_along(method: str, how: dict[str, Any], begin: float) -> None:
    """The rod's momentum about its pin stays that of rest, I w = m l u; its kinetic energy and the cart's are the guide's work."""
    m, length, u, own, cart = 2.0, 0.5, 2.0, 0.3, 3.0
    w = m * length * u / (own + m * length**2)
    energy = (cart + m) * u**2 / 2 - m * length * u * w + (own + m * length**2) * w**2 / 2
    run = completed(simulate(_compiled(CART, begin, method), **how))
    assert [impact.element for impact in run.statistics.impacts] == ["rail"]
    assert run.statistics.impacts[0].time == pytest.approx(begin, abs=1e-9)
    assert run.statistics.impacts[0].work == pytest.approx(energy, rel=1e-9)
    later = run.t > begin - 1e-9
    np.testing.assert_allclose(run["pin.angle_rate"][~later], 0, atol=1e-12)
    assert run["pin.angle_rate"][later][0] == pytest.approx(w, rel=2e-3)
    np.testing.assert_allclose(run["cart.vx"][later], u, rtol=1e-9)
    first = float(run.t[later][1])
    assert run["pin.angle"][later][1] == pytest.approx(w * (first - begin), abs=3e-4)


@pytest.mark.parametrize(("method", "how"), CASES)
def test_the_balance_has_the_work_of_the_impulse(method: str, how: dict[str, Any]) -> None:
    run = completed(simulate(_compiled(CART, BETWEEN, method), **how))
    assert run.energy is not None
    assert run.energy.share < 1e-4


@pytest.mark.parametrize(("method", "how"), CASES)
def test_a_rate_jumps_through_a_gear(method: str, how: dict[str, Any]) -> None:
    """Both masses get their speeds at once, and the guide's impulse does the work of both."""
    run = completed(simulate(_compiled(HOIST, AT_A_ROW, method), **how))
    later = run.t > AT_A_ROW - 1e-9
    np.testing.assert_allclose(run["load.vz"][later], 3.0, rtol=1e-6)
    np.testing.assert_allclose(run["load.z"][later], 3.0 * (run.t[later] - AT_A_ROW), atol=1e-6)
    assert [impact.work for impact in run.statistics.impacts] == [pytest.approx((4 * 1.5**2 + 10 * 3.0**2) / 2, rel=1e-6)]
    assert run.energy is not None
    assert run.energy.share < 1e-6


@pytest.mark.parametrize(("method", "how"), CASES)
def test_steps_leave_no_jump_out_between_them(method: str, how: dict[str, Any]) -> None:
    """Rates that jump where steps end, but for rounding: the cart goes to and fro, and the rod, which turns by little, with it."""
    length, count = 0.0075, 40
    whens = [round(length * 3 * k, 4) for k in range(1, count + 1)]
    laws = [f"where(t < {when!r}, 0, {2 - 4 * (k % 2) if k else 1}*(t - {when!r}))" for k, when in enumerate(whens)]
    text = CART.replace("where(t < BEGIN, 0, 2*(t - BEGIN))", " + ".join(laws)).replace("dt: 0.002", f"dt: {length}")
    text = text.replace("end: 0.4, output_step: 0.02", "end: 0.945, output_step: 0.045")
    run = completed(simulate(_compiled(text, BETWEEN, method), error=False, **how))
    np.testing.assert_allclose([impact.time for impact in run.statistics.impacts], whens, atol=1e-9)
    assert abs(run["cart.vx"][-1]) == pytest.approx(1.0)
    m, arm, own = 2.0, 0.5, 0.3
    assert abs(run["pin.angle_rate"][-1]) == pytest.approx(m * arm / (own + m * arm**2), rel=0.05)


@pytest.mark.parametrize(("method", "how"), CASES)
def test_a_place_that_jumps_is_no_impact(method: str, how: dict[str, Any]) -> None:
    text = HOIST.replace("where(t < BEGIN, 0, 1.5*(t - BEGIN))", "where(t < BEGIN, 0, 0.1)")
    run = simulate(_compiled(text, BETWEEN, method), check=False, error=False, **how)
    assert run.statistics.impacts == ()


def test_an_acceleration_that_jumps_is_no_impact() -> None:
    """A rate that goes over within a ten-thousandth of a second is continuous, however steep."""
    text = CART.replace("2*(t - BEGIN))", "where(t < BEGIN + 1e-4, 1e4*(t - BEGIN)**2, 2*(t - BEGIN) - 1e-4))")
    for how in RUNS["recursive"]:
        run = completed(simulate(_compiled(text, BETWEEN, "recursive"), error=False, **how))
        assert run.statistics.impacts == ()


# Beside the dense reference

BEGIN, STEP = 0.1, 0.02


def jumping(model: Model) -> Model:
    """The model without forces, with guides that begin to move at once at BEGIN."""
    rng = np.random.default_rng(len(model.bodies))

    def law() -> Any:
        rate = sympy.Float(rng.uniform(0.5, 1.5))
        return sympy.Piecewise((sympy.Integer(0), TIME < BEGIN), (rate * (TIME - BEGIN), True))

    joints = tuple(j if j.guide is None else replace(j, guide=tuple(law() for _ in j.guide)) for j in model.joints)
    return replace(model, joints=joints, forces=(), reactions=(), markers=())


def struck_at_rest(mechanism: DenseMechanism, t: float = BEGIN) -> tuple[dict[str, np.ndarray], float]:
    """The bodies' velocities and angular velocities after guides have struck it at rest in the design position, and the work (J).

    By dense algebra alone: M v + p + J^T mu = 0, J v + Phi_t = 0 with the momentum p that guides give to the free coordinates.
    """
    q = np.zeros(mechanism.nq)
    for x in mechanism.layout.values():
        if x.ball:
            q[x.q + x.scalars] = 1.0
    still = Instant(q=q, v=np.zeros(mechanism.nv), t=t)
    motion, closures = mechanism.motion(still), mechanism.closures(still)
    M, J, n = mechanism.inertia(motion)[0], closures.jacobian, mechanism.nv
    matrix = np.block([[M, J.T], [J, np.zeros((mechanism.m, mechanism.m))]])
    right = -np.concatenate([_momentum(mechanism, motion), closures.rate])
    solution = np.linalg.lstsq(matrix, right, rcond=1e-10)[0]
    assert np.abs(matrix @ solution - right).max() < 1e-9, "guides ask for what loops do not allow"
    after = mechanism.motion(replace(still, v=solution[:n]))
    found, energy = {}, 0.0
    for body in mechanism.model.bodies:
        mass, centre, own = mechanism.inertia_of(body)
        velocity, (_, w, _) = after.point(body.name, centre)[2], after.spin(body.name)
        found[body.name] = np.concatenate([velocity, w])
        energy += mass * velocity @ velocity / 2 + w @ after.R[body.name] @ own @ after.R[body.name].T @ w / 2
    return found, energy


def _momentum(mechanism: DenseMechanism, motion: Motion) -> np.ndarray:
    p = np.zeros(mechanism.nv)
    for body in mechanism.model.bodies:
        mass, centre, own = mechanism.inertia_of(body)
        _, columns, velocity, _ = motion.point(body.name, centre)
        turning, w, _ = motion.spin(body.name)
        p += mass * columns.T @ velocity + turning.T @ motion.R[body.name] @ own @ motion.R[body.name].T @ w
    return p


@cache
def _interpreted(make: Callable[..., Model], seed: int, method: str) -> Artifact:
    model = jumping(make(seed, gravity=False))
    outputs = tuple(Output(element=body.name, quantity=q, span=NOWHERE) for body in model.bodies for q in SPEEDS)
    still = replace(scene(), end=BEGIN + STEP, output_step=STEP, numerics=replace(scene().numerics, dt=STEP / 4))
    return compile_interpreted(model, still, method=method, outputs=outputs)


_CONVERGING = [(method, how) for method in ("recursive", "recursive-newton") for how in RUNS[method] if "iterations" not in how]
SPEEDS = ("vx", "vy", "vz", "wx", "wy", "wz")
TREES = [pytest.param(random_tree, seed, id=f"tree{seed}") for seed in (0, 3, 6, 9)]
LOOPS = [pytest.param(random_loops, seed, id=f"loops{seed}") for seed in (4, 6, 8, 10, 12, 18)]


@pytest.mark.parametrize(("make", "seed"), [*TREES, *LOOPS])
def test_random_mechanisms_are_struck_as_by_dense_algebra(make: Callable[..., Model], seed: int) -> None:
    """All speeds of all bodies, and the work, where trees and loops with massless links stand at rest."""
    model = jumping(make(seed, gravity=False))
    exact, work = struck_at_rest(DenseMechanism(build_topology(model), scene()))
    for method, how in _CONVERGING:
        run = completed(simulate(_interpreted(make, seed, method), error=False, **how))
        row = int(np.argmin(np.abs(run.t - BEGIN)))
        for body, speeds in exact.items():
            found = np.array([run[f"{body}.{q}"][row] for q in SPEEDS])
            np.testing.assert_allclose(found, speeds, rtol=1e-6, atol=1e-7, err_msg=f"{method} {how} {body}")
        assert sum(impact.work for impact in run.statistics.impacts) == pytest.approx(work, rel=1e-6)


#: Turns about several axes, and one mirrored.
TURNED = {
    "in the plane": ((0.8, -0.6, 0), (0.6, 0.8, 0), (0, 0, 1)),
    "in space": ((0.36, 0.48, -0.8), (-0.8, 0.6, 0), (0.48, 0.64, 0.6)),
    "mirrored": ((0.6, 0, 0.8), (0, -1, 0), (-0.8, 0, 0.6)),
}


def _slider_crank(turn: np.ndarray[Any, Any]) -> Model:
    """A guided crank whose rate falls from 5 to -3 rad/s at 0.2 s, a rod, a slider, and a mass that a spring holds on it."""

    def at(x: float, z: float, *, sign: float = 1.0) -> list[float]:
        return (sign * turn @ (x, 0, z)).tolist()

    axis = (np.linalg.det(turn) * turn @ (0, 1, 0)).tolist()
    body = "{{mass: {}, centre_of_mass: {}, inertia: [{i}, {i}, {i}]}}"
    text = f"""\
cutjoint: 1
name: slider_crank
gravity: [0, 0, 0]
bodies:
  crank: {body.format(2, at(0, 0.05), i=0.002)}
  rod: {body.format(1, at(0.15, 0.05), i=0.009)}
  slider: {body.format(3, at(0.3, 0), i=0.01)}
  m: {body.format(1, at(0.5, 0), i=0.01)}
joints:
  pin: {{kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: {axis}, guide: "where(t < 0.2, 5*t, 1 - 3*(t - 0.2))"}}
  elbow: {{kind: revolute, bodies: [crank, rod], at: {at(0, 0.1)}, axis: {axis}}}
  wrist: {{kind: revolute, bodies: [rod, slider], at: {at(0.3, 0)}, axis: {axis}}}
  rail: {{kind: prismatic, bodies: [ground, slider], at: {at(0.3, 0)}, axis: {at(1, 0)}}}
  spring: {{kind: prismatic, bodies: [slider, m], at: {at(0.5, 0)}, axis: {at(1, 0)}}}
forces: {{held: {{kind: joint_force, joint: spring, law: -150*position}}}}
outputs: [m.x, m.y, m.z]
scenes: {{run: {{end: 0.4, output_step: 0.02, rates: {{spring.displacement_rate: 0}}, numerics: {{dt: 0.002}}}}}}
"""
    return read_model_text(text, "slider_crank.yaml")


@cache
def _placed(method: str, turn: tuple[tuple[float, ...], ...]) -> np.ndarray[Any, Any]:
    """The mass in the axes of the mechanism that lies along x, a row each."""
    matrix, model = np.array(turn), _slider_crank(np.array(turn))
    run = completed(simulate(compile_interpreted(model, model.scenes["run"], method=method), error=False, **RUNS[method][0]))
    assert len(run.statistics.impacts) == 1
    return np.stack([run[f"m.{axis}"] for axis in "xyz"], axis=1) @ matrix


@pytest.mark.parametrize("turn", TURNED)
@pytest.mark.parametrize("method", RUNS)
def test_a_loop_that_is_turned_or_mirrored_is_struck_alike(method: str, turn: str) -> None:
    """Equations across the plane of a loop are zero but for rounding, where it does not lie along the axes."""
    np.testing.assert_allclose(_placed(method, TURNED[turn]), _placed(method, tuple(map(tuple, np.eye(3).tolist()))), atol=1e-9)


def _carried(guide: str) -> Model:
    """A carriage that follows a guide, with a mass on it that slides along without a force."""
    text = f"""\
cutjoint: 1
name: carried
gravity: [0, 0, 0]
parameters: {{x: {{value: 0, unit: m, binding: input}}}}
bodies: {{carriage: {{mass: 1, centre_of_mass: [0, 0, 0]}}, load: {{mass: 2, centre_of_mass: [1, 0, 0]}}}}
joints:
  way: {{kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: x, guide: "{guide}"}}
  slide: {{kind: prismatic, bodies: [carriage, load], at: [1, 0, 0], axis: x}}
outputs: [load.x]
scenes: {{run: {{end: 1, output_step: 0.1, inputs: {{x: "where(t < 0.3, 0, t - 0.2)"}}}}}}
"""
    return read_model_text(text, "carried.yaml")


@pytest.mark.parametrize(
    ("guide", "size", "time"),
    [("where(t < 0.5, t, t + 0.25)", "0.25 m", "0.5"), ("sign(0.25 - t)", "-2 m", "0.25"), ("3*x", "0.3 m", "0.3"),
     ("where(2*t >= 0.5, 1e-3, 0)", "0.001 m", "0.25")],
)  # fmt: skip
def test_a_guide_that_jumps_is_named_for_methods_differ_in_what_it_carries(guide: str, size: str, time: str) -> None:
    """No force moves the load, which stays where it is by the methods in natural coordinates and not by the recursive ones."""
    model = _carried(guide)
    for method in ("recursive", "augmented"):
        with pytest.warns(UserWarning, match=f"carried.yaml:7:3: the guide of 'way' jumps by {size} at {time} s: "):
            compile_interpreted(model, model.scenes["run"], method=method)


def test_check_names_a_guide_that_jumps(tmp_path: Path) -> None:
    (tmp_path / "carried.yaml").write_text(_carried("where(t < 0.5, t, t + 0.25)").text, encoding="utf-8")
    done = CliRunner(env={"COLUMNS": "300"}).invoke(main, ["check", str(tmp_path / "carried.yaml")])
    assert "carried.yaml:7:3: the guide of 'way' jumps by 0.25 m at 0.5 s: " in done.output


@pytest.mark.parametrize("guide", ["where(t < 0.5, t, 1 - t)", "abs(t - 0.5)", "max(0, t - 0.5)", "where(t < 0.3, 1.1*t, 0.33001)",
                                   "where(t < 2, 0, 1)", "sin(1000*t)*where(t < 0.5, t - 0.5, 0)"])  # fmt: skip
@pytest.mark.filterwarnings("error")
def test_a_guide_whose_rate_alone_jumps_is_not(guide: str) -> None:
    model = _carried(guide)
    compile_interpreted(model, model.scenes["run"])
