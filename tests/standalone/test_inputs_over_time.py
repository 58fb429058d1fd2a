"""Derivatives of runs by inputs over time: beside closed forms, differences of runs, and forward beside backward."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import cutjoint
from cutjoint.package.errors import RunError
from tests.conftest import needs_cpp, with_heavy
from tests.standalone.c_exports import HERE, compile_object, folder_of, link, run, write
from tests.standalone.test_derivatives import SANITIZE
from tests.standalone.test_radau_derivatives import by_radau
from tests.standalone.test_run_adjoints import backwards
from tests.standalone.test_run_derivatives import CART, fourth_order
from tests.standalone.test_step_derivatives import OSCILLATOR, SHARP, loaded

pytestmark = needs_cpp

#: A mass that a force pushes.
MASS = """
cutjoint: 1
name: mass
gravity: [0, 0, 0]
parameters: {push: {value: 0, unit: N, binding: input}, load: {value: 2, unit: kg, binding: param}}
bodies: {mass: {mass: load, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {motor: {kind: joint_force, joint: rail, law: push}}
outputs: [rail.displacement, rail.displacement_rate]
scenes: {run: {end: 1, output_step: 0.01}}
"""

#: A four-bar whose crank a motor turns and whose foot a guide moves.
BAR = f"""
cutjoint: 1
name: bar
gravity: [0, 0, -9.81]
parameters:
  torque: {{value: 0.3, unit: N*m, binding: input}}
  place: {{value: 0, unit: m, binding: input}}
  k: {{value: 20, binding: param}}
bodies:
  arm: {{mass: 1, centre_of_mass: [0.15, 0, 0], inertia: [0.001, 0.01, 0.01]}}
  rod: {{mass: 0.5, centre_of_mass: [0.4, 0, 0.15], inertia: [0.001, 0.01, 0.01]}}
  rocker: {{mass: 0.5, centre_of_mass: [0.5, 0, 0.15], inertia: [0.001, 0.005, 0.005]}}
  base: {{mass: 1, centre_of_mass: [0.5, 0, 0]}}
joints:
  crank: {{kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
  knee: {{kind: revolute, bodies: [arm, rod], at: [0.3, 0, 0], axis: y}}
  top: {{kind: revolute, bodies: [rod, rocker], at: [0.5, 0, 0.3], axis: y}}
  foot: {{kind: revolute, bodies: [base, rocker], at: [0.5, 0, 0], axis: y}}
  slide: {{kind: prismatic, bodies: [ground, base], at: [0.5, 0, 0], axis: x, guide: place}}
forces: {{motor: {{kind: joint_force, joint: crank, law: torque - k*position - 0.3*rate}}}}
outputs: [crank.angle, crank.angle_rate, foot.angle]
scenes: {{fall: {{end: 1, numerics: {{{SHARP}}}}}}}
"""

Given = Mapping[str, Any]


def values_of(given: Any, key: str = "value") -> NDArray[np.float64]:
    return np.asarray(given[key] if isinstance(given, Mapping) else given, dtype=float)


def compare(sim: cutjoint.Simulation, inputs: Given, by: list[str], share: float, h: float, dot: float | None, steps: int = 100) -> None:
    """Slopes along some knots beside differences of runs, and two objectives with weights at random by the adjoint method."""
    outputs, start = list(sim.outputs), sim.snapshot()

    def run(by: list[str], inputs: Given = inputs) -> cutjoint.ForwardSensitivities:
        sim.restore(start)
        return sim.forward_sensitivities(steps, outputs, by, every=5, inputs=inputs)

    along, column = run(by), 0
    for name in by:
        of, key = name.removesuffix(".rate"), "rate" if name.endswith(".rate") else "value"
        if of not in inputs:
            column += 1
            continue
        values = values_of(inputs[of], key)
        for k in (0, 1, len(values) // 2, len(values) - 1):
            unit = np.eye(len(values))[k]

            def course(change: float, of: str = of, key: str = key, unit: NDArray[np.float64] = unit) -> NDArray[np.float64]:
                moved = values_of(inputs[of], key) + change * unit
                return run([], {**inputs, of: {**inputs[of], key: moved} if isinstance(inputs[of], Mapping) else moved}).values

            found = fourth_order(course, 10 * h if key == "rate" else h)  # which moves less
            error = np.abs(along.derivatives[..., column + k] - found).max(axis=0) / np.abs(found).max(axis=0).clip(1e-6)
            assert error.max() < share, (name, k, error)
        column += len(values)
    assert len(along.by) == column
    if dot is None:
        return
    sizes = np.maximum(np.abs(along.values).max(axis=0), 1e-3)
    weights = np.random.default_rng(1).normal(size=(2, *along.values.shape)) / sizes
    sim.restore(start)
    back = sim.adjoint_sensitivities(steps, outputs, by, weights, every=5, inputs=inputs)
    assert back.by == along.by
    assert (back.values == along.values).all()
    wanted = np.tensordot(weights, along.derivatives, 2)
    assert np.abs(back.derivatives - wanted).max() / np.abs(wanted).max() < dot


def test_a_mass_that_a_piecewise_linear_force_pushes() -> None:
    """x'' = u/m: by a knot with its hat N x(1) changes by the integral of (1 - t) N/m, its rate by that of N/m, which rk4 has exactly."""
    sim = backwards(MASS, "mass", integrator="rk4").reset(dt=0.01)
    t = np.array([0.0, 0.1, 0.25, 0.6, 1.0])
    values = np.array([1.0, -3.0, 2.0, 0.5, -1.0])
    table = {"t": t, "value": values, "interpolation": "linear"}
    outputs = ["rail.displacement", "rail.displacement_rate"]
    run = sim.adjoint_sensitivities(100, outputs, ["push", "load"], "end", every=100, inputs={"push": table})
    nodes, weights = np.polynomial.legendre.leggauss(4)
    hats = np.eye(len(t))

    def integrate(weigh: Any) -> NDArray[np.float64]:
        parts = [((1 + nodes) * (b - a) / 2 + a, weights * (b - a) / 2) for a, b in pairwise(t)]
        return np.array([sum(w @ (weigh(at) * np.interp(at, t, hat)) for at, w in parts) for hat in hats])

    known = np.array([integrate(lambda at: 1 - at), integrate(np.ones_like)]) / 2
    assert run.by == (*(f"push[{k}]" for k in range(5)), "load")
    assert run.derivatives[:, :5] == pytest.approx(known, abs=1e-14)
    assert run.objectives == pytest.approx(known @ values, abs=1e-13)
    assert run.derivatives[:, 5] == pytest.approx(-known @ values / 2, abs=1e-13)


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_held_values_are_those_of_a_host(integrator: str) -> None:
    """A run has the end of one whose host gives each value before its steps, and the slope by a shift is the sum of those by values."""
    settings: dict[str, float] = {"iterations": 40} if integrator == "trapezoidal" else {}
    sim = loaded(OSCILLATOR, "oscillator", "recursive", integrator).reset(dt=0.01, **settings)
    values, start = np.random.default_rng(0).normal(size=20), sim.snapshot()
    run = sim.forward_sensitivities(60, ["mass.x"], ["push"], every=60, inputs={"push": values})
    assert np.isnan(sim.inputs["push"])
    sim.restore(start)
    for value in values:
        sim.inputs["push"] = value
        sim.run(3)
    assert run.values[-1, 0] == pytest.approx(sim.outputs["mass.x"], rel=1e-13)
    sim.restore(start)
    shifted = sim.forward_sensitivities(60, ["mass.x"], ["push"], every=60)  # a linear motion
    assert run.derivatives[-1, 0].sum() == pytest.approx(shifted.derivatives[-1, 0, 0], rel=1e-12)


@pytest.mark.parametrize("integrator", with_heavy(["trapezoidal", "rk4", "dormand-prince"], "dormand-prince"))
@pytest.mark.parametrize("kind", ["held", "at rest", "linear", "cubic", "with rates"])
def test_states_and_controllers(integrator: str, kind: str) -> None:
    """Values that are the same one behind the other may change apart all the same."""
    settings: dict[str, dict[str, float]] = {"trapezoidal": {"iterations": 40}, "dormand-prince": {"tolerance": 1e-10}}
    sim = backwards(CART, "cart", integrator=integrator).reset(dt=5e-3, **settings.get(integrator, {}))
    sim.choose_independent()
    rng = np.random.default_rng(2)
    if kind in ("held", "at rest"):
        given: Any = rng.normal(size=20) * (kind == "held")
    else:
        given = {"t": np.linspace(0, 0.5, 11), "value": rng.normal(size=11)}
        given |= {"linear": {"interpolation": "linear"}, "with rates": {"rate": rng.normal(size=11)}}.get(kind, {})
    by = ["k", "push", *(["push.rate"] if kind == "with rates" else [])]
    compare(sim, {"push": given}, [*by, "pin.angle"], 1e-6 if integrator == "dormand-prince" else 1e-9, 1e-2, 1e-12)


@pytest.mark.parametrize("integrator", with_heavy(["rk4", "trapezoidal", "radau5-fixed"], "trapezoidal", "radau5-fixed"))
def test_a_motor_and_a_guide_of_a_loop(integrator: str) -> None:
    """A guide's values move the start, too: independent states stay, and the loop closes where it has the guide."""
    method = "recursive-newton" if integrator == "radau5-fixed" else "recursive"
    sim = backwards(BAR, "bar", method, integrator).reset(dt=5e-3)
    sim.choose_independent(["crank.angle_rate"])
    t = np.linspace(0, 0.5, 11)
    guide = {"t": t, "value": 0.02 * np.sin(6 * t), "rate": 0.12 * np.cos(6 * t)}
    torque = np.random.default_rng(1).normal(size=20)
    compare(sim, {"torque": torque, "place": guide}, ["torque", "place", "place.rate", "k"], 1e-7, 1e-3, 1e-9)


def test_a_guide_by_a_law_of_a_loop() -> None:
    """By the trapezoidal rule, along directions and by the adjoint method."""
    sim = backwards(BAR.replace("{end: 1,", "{end: 1, inputs: {place: 0.02*sin(6*t)},"), "bar").reset(dt=5e-3)
    sim.choose_independent(["crank.angle_rate"])
    compare(sim, {}, ["torque", "place", "k", "crank.angle"], 1e-9, 1e-3, 1e-10)


@pytest.mark.heavy
def test_loops_of_newtons_iteration() -> None:
    sim = loaded(BAR, "bar", "recursive-newton", "trapezoidal").reset(dt=1e-3)
    sim.choose_independent(["crank.angle_rate"])
    compare(sim, {"torque": np.random.default_rng(1).normal(size=20)}, ["torque"], 1e-5, 1e-2, None)


@pytest.mark.parametrize("integrator", with_heavy(["radau5-fixed", "radau5"], "radau5"))
@pytest.mark.parametrize("kind", ["held", "with rates"])
def test_coupled_stages(integrator: str, kind: str) -> None:
    """Each stage has the input at its own time."""
    sim = by_radau(CART, "cart", integrator).reset(dt=5e-3)
    sim.choose_independent()
    values, rates = np.random.default_rng(2).normal(size=(2, 20))
    given: Any = values if kind == "held" else {"t": np.linspace(0, 0.5, 20), "value": values, "rate": rates}
    by = ["k", "push", *(["push.rate"] if kind == "with rates" else [])]
    compare(sim, {"push": given}, [*by, "pin.angle"], 1e-6, 1e-2, 1e-11)


#: That mass with a stop on its way.
STOP = MASS.replace("name: mass", "name: stop").replace(
    "law: push}", "law: 'push - where(rail.displacement > 0.2, 400*(rail.displacement - 0.2) + 5, 0)'}"
)


@pytest.mark.parametrize("integrator", with_heavy(["rk4", "dormand-prince", "radau5-fixed"], "dormand-prince"))
def test_events_that_move(integrator: str) -> None:
    stop = by_radau if integrator == "radau5-fixed" else backwards
    sim = stop(STOP, "stop", integrator=integrator).reset(dt=2e-3)
    t = np.linspace(0, 1, 21)
    given = {"t": t, "value": 4 + np.random.default_rng(4).normal(size=21)}
    compare(sim, {"push": given}, ["load", "push"], 1e-6, 1e-3, 1e-11, steps=500)
    sim.reset()
    run = sim.forward_sensitivities(500, ["rail.displacement"], ["push"], events=1, inputs={"push": given})
    assert run.events is not None
    before = t < run.events.times[0] - 0.1
    assert (run.events.derivatives_of_times[0, :21][before] < 0).all()  # a push brings it there sooner


@pytest.mark.parametrize("flags", [(), pytest.param(SANITIZE, marks=pytest.mark.heavy)], ids=["plain", "sanitized"])
def test_calls_right_and_wrong(flags: tuple[str, ...], tmp_path: Path) -> None:
    place = write(folder_of(MASS, "mass.yaml", integrator="rk4", adjoint=True), tmp_path)
    compile_object(place, "mass", flags=flags)
    linked = flags if flags == SANITIZE else ()
    assert run(link(place, "calls", ["-I.", HERE / "trajectory_calls.c", "mass.o"], flags=linked)) == ""


def test_what_cannot_be() -> None:
    sim = backwards(MASS, "mass", integrator="rk4").reset(dt=0.01)
    call = {"steps": 10, "outputs": ["rail.displacement"], "by": ["push"]}
    with pytest.raises(KeyError, match="no 'pus'; did you mean 'push'"):
        sim.forward_sensitivities(**call, inputs={"pus": [1.0]})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=re.escape("input 'push': (3,) values: their number does not divide 10 steps")):
        sim.forward_sensitivities(**call, inputs={"push": [1.0, 2.0, 3.0]})  # type: ignore[arg-type]
    with pytest.raises(RunError, match=re.escape("the table covers from 0 s to 0.05 s, the run from 0 to 0.1 s")):
        sim.forward_sensitivities(**call, inputs={"push": {"t": [0, 0.05], "value": [0, 1]}})  # type: ignore[arg-type]
    with pytest.raises(KeyError, match=re.escape("no 'push.rate'")):
        sim.forward_sensitivities(10, ["rail.displacement"], ["push.rate"], inputs={"push": {"t": [0, 1], "value": [0, 1]}})
    start = sim.snapshot()
    sim.forward_sensitivities(10, ["rail.displacement"], [], inputs={"push": [1.0]})
    sim.restore(start)
    assert sim.run(10)[-1, 0] == 0.0  # a course is of its run alone
