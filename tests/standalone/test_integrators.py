"""Simulations whose steps end at events: those of Runge-Kutta methods, explicit and diagonally implicit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.pipeline import compile_model
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.bouncing import bouncing_text, exact_bounces
from tests.mechanisms.driven import pushed_text

from .c_exports import DEFINITIONS, HERE, RANDOM_CALLS, compile_object, foreign_symbols, link, run, standalone_of, write

pytestmark = needs_cpp

PRESS = MODELS / "press.yaml"
#: Methods and integrators with steps of a given length, and with ones of their own.
EQUAL = (("recursive", "rk4"), ("recursive-newton", "radau5-fixed"))
ADAPTIVE = (("recursive", "dormand-prince"), ("recursive", "dop853"), ("recursive-newton", "radau5"))
RULES = EQUAL + ADAPTIVE


@pytest.mark.parametrize(
    ("name", "dt", "method", "integrator"),
    [("press", 1e-3, *EQUAL[0]), ("four_bar", 2e-3, *EQUAL[0]), ("press", 2e-3, *EQUAL[1]), ("andrews", 5e-5, *EQUAL[1])],
)
def test_equal_steps_are_those_of_the_command_line_bit_by_bit(name: str, dt: float, method: str, integrator: str) -> None:
    """The four-bar closes its loops in singular poses, where they are closed another way."""
    path = MODELS / f"{name}.yaml"
    known = simulate(compile_model(path, method=method), integrator=integrator, error=False, dt=dt)
    sim = cutjoint.load(path, method=method, integrator=integrator).reset(dt=dt)
    for row, t in enumerate(known.t):
        sim.advance(t)
        assert list(sim.outputs.values()) == [known[column][row] for column in known.columns], t


@pytest.mark.parametrize(("method", "integrator"), ADAPTIVE)
def test_a_tolerance_is_kept(method: str, integrator: str) -> None:
    known = simulate(compile_model(PRESS), integrator="rk4", error=False, dt=1e-4)
    off = []
    for tolerance in (1e-5, 1e-8):
        sim = cutjoint.load(PRESS, method=method, integrator=integrator).reset(tolerance=tolerance)
        sim.advance(known.t[-1])
        off.append(abs(sim.outputs["pin.angle"] - known["pin.angle"][-1]))
    assert off[0] < 1e-3
    assert off[1] < min(1e-6, off[0] / 30)


@pytest.mark.parametrize(("method", "integrator"), RULES)
def test_steps_end_at_events(method: str, integrator: str, tmp_path: Path) -> None:
    path, damping, height = tmp_path / "bounce.yaml", 2.0, 0.5
    path.write_text(bouncing_text(damping, height), encoding="utf-8")
    sim = cutjoint.load(path, method=method, integrator=integrator).reset(dt=5e-3 if (method, integrator) in EQUAL else None)
    _, switched = exact_bounces(np.array([0.0, 1.5]), damping, height)
    times = []
    while (event := sim.advance_to_event(1.5)) is not None:
        assert event == "floor"
        times.append(sim.time)
    assert len(times) == switched
    assert times[0] == pytest.approx(np.sqrt(2 * height / 9.81), abs=1e-9)
    assert sim.time == 1.5
    heights, _ = exact_bounces(np.array([0.0, 1.5]), damping, height)
    assert sim.outputs["mass.z"] == pytest.approx(heights[-1], abs=1e-4)


@pytest.mark.parametrize(("method", "integrator"), EQUAL)
def test_a_time_that_rounding_parts_from_the_end_of_a_step_is_reached(method: str, integrator: str, tmp_path: Path) -> None:
    path = tmp_path / "bounce.yaml"
    path.write_text(bouncing_text(2.0, 0.5), encoding="utf-8")
    sim = cutjoint.load(path, method=method, integrator=integrator).reset(dt=5e-3)
    assert sim.advance_to_event(np.nextafter(5e-3, 1.0)) is None
    assert sim.time == pytest.approx(5e-3, rel=1e-15)


@pytest.mark.parametrize(("method", "integrator"), RULES)
def test_restored_moments_go_on_the_same(method: str, integrator: str, tmp_path: Path) -> None:
    path = tmp_path / "bounce.yaml"
    path.write_text(bouncing_text(2.0, 0.5), encoding="utf-8")
    sim = cutjoint.load(path, method=method, integrator=integrator).reset()
    for _ in range(5):
        sim.run(13)
        other = sim.copy()
        assert np.array_equal(sim.run(20), other.run(20))


def test_coupled_stages_of_a_loop_go_on_the_same_with_kept_factors() -> None:
    """A copy has the tangent of the moment, and the length of step for which its terms are parted."""
    sim = cutjoint.load(PRESS, method="recursive-newton", integrator="radau5-fixed").reset(dt=2e-3)
    for _ in range(3):
        sim.run(13)
        other = sim.copy()
        assert np.array_equal(sim.run(20), other.run(20))


@pytest.mark.parametrize(("method", "integrator"), RULES)
def test_who_looks_on_changes_nothing(method: str, integrator: str) -> None:
    sim = cutjoint.load(PRESS, method=method, integrator=integrator).reset(dt=2e-3)
    other = sim.copy()
    for _ in range(50):
        sim.step()
        other.step()
        assert sim.accelerations["pin.angle_rate"] != 0.0
        assert sim.outputs["slider.x"] != 0.0
    assert np.array_equal(sim.coordinates.array, other.coordinates.array)
    assert np.array_equal(sim.accelerations.array, other.accelerations.array)


@pytest.mark.parametrize(("method", "integrator"), RULES)
def test_inputs_and_parameters_count_from_the_next_step_on(method: str, integrator: str, tmp_path: Path) -> None:
    path = tmp_path / "pushed.yaml"
    path.write_text(pushed_text(), encoding="utf-8")
    sim = cutjoint.load(path, method=method, integrator=integrator).reset(dt=0.01)
    x = v = 0.0
    for k, push in enumerate((3.0, -1.0, 4.0, 0.0)):
        sim.inputs["push"] = push
        sim.advance(0.1 * (k + 1))
        x, v = x + 0.1 * v + 0.005 * push / 2, v + 0.1 * push / 2
        assert sim.outputs["mass.ax"] == push / 2
        assert (sim.outputs["mass.x"], sim.outputs["mass.vx"]) == pytest.approx((x, v), abs=1e-13)
    sim.inputs["push"] = 6.0  # from the next step on, whether anybody has looked before or not
    assert (sim.outputs["mass.ax"], sim.accelerations["slide.displacement_rate"], sim.get_input("push")) == (0.0, 0.0, 6.0)
    sim.step()
    sim.inputs["push"] = 2.0
    assert (sim.outputs["mass.ax"], sim.accelerations["slide.displacement_rate"], sim.get_input("push")) == (3.0, 3.0, 2.0)
    press = cutjoint.load(PRESS, method=method, integrator=integrator).reset(dt=1e-3)
    press.run(10)
    press.parameters["stiffness"] = 2000.0
    other = cutjoint.load(PRESS, method=method, integrator=integrator).reset(dt=1e-3)
    other.parameters["stiffness"] = 2000.0
    other.set_state(press.time, press.coordinates.array.copy(), press.speeds.array.copy())
    press.run(10)
    other.run(10)
    assert press.outputs["slider.x"] == pytest.approx(other.outputs["slider.x"], abs=1e-7)


def test_a_fixed_number_of_newton_iterations_nears_the_converged_steps_of_loops(tmp_path: Path) -> None:
    path, states = tmp_path / "press.yaml", []
    path.write_text(PRESS.read_text().replace("{end: 2,", "{end: 2, numerics: {solver_tolerance: 1.0e-12},"))
    sim = cutjoint.load(path, method="recursive-newton", integrator="trapezoidal")
    for iterations in (0, 3, 1):
        sim.reset(dt=1e-3, iterations=iterations)
        sim.run(500)
        states.append(sim.coordinates.array.copy())
        assert iterations in (0, sim.last_step.iterations)
        assert sim.last_step.violation < 1e-13
    exact, three, one = states
    assert np.abs(three - exact).max() < 1e-11
    assert 1e-13 < np.abs(one - exact).max() < 1e-9


def test_what_an_integrator_has_not_is_refused() -> None:
    with pytest.raises(TypeError, match="iterations are of method recursive with trapezoidal or rk4"):
        cutjoint.load(PRESS, integrator="dop853").reset(iterations=3)
    with pytest.raises(TypeError, match="a tolerance is of integrators that choose their steps"):
        cutjoint.load(PRESS, integrator="trapezoidal").reset(tolerance=1e-6)
    with pytest.raises(TypeError, match="these steps do not end at events"):
        cutjoint.load(PRESS, integrator="trapezoidal").reset().advance_to_event(1.0)
    with pytest.raises(cutjoint.RunError, match="'radau5' is not one of C exports, trapezoidal, rk4, dormand-prince"):
        cutjoint.load(PRESS, integrator="radau5")


@pytest.mark.parametrize(("method", "integrator"), ADAPTIVE)
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_code_calls_mathematics_and_nothing_else(compiler: str, method: str, integrator: str, tmp_path: Path) -> None:
    place = write(standalone_of("press", integrator=integrator, method=method), tmp_path)
    assert not foreign_symbols(compile_object(place, "press", compiler=compiler, flags=("-O1",)), "press")


@pytest.mark.heavy
@pytest.mark.parametrize(("method", "integrator"), RULES)
def test_random_calls_under_sanitizers(method: str, integrator: str, tmp_path: Path) -> None:
    place = write(standalone_of("press", integrator=integrator, method=method), tmp_path)
    sanitize = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    compile_object(place, "press", flags=sanitize)
    adaptive = ("-DADAPTIVE",) if (method, integrator) in ADAPTIVE else ()
    program = link(place, "random", ["-I.", HERE / "random_calls.c", "press.o"], flags=(*sanitize, *adaptive, *DEFINITIONS[method]))
    good, _, calls, _ = run(program, str(RANDOM_CALLS)).split()
    assert int(calls) == RANDOM_CALLS
    assert RANDOM_CALLS / 4 < int(good) < RANDOM_CALLS
