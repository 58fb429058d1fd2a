"""Guides that a host steers: what it holds is followed as a law is, loops stay closed, a torn one is a fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile import c_export as standalone
from cutjoint.stepping.simulation import Simulation
from tests.conftest import needs_cpp
from tests.mechanisms.steered import law, steered_text

from .c_exports import ALONE

pytestmark = needs_cpp

#: All ways to take steps, and settings of the scene.
WAYS = [
    *((method, "trapezoidal", "") for method in ALONE), ("recursive", "trapezoidal", ", closure: proximal"), ("recursive", "rk4", ""),
    ("recursive", "dormand-prince", ""), ("recursive-newton", "radau5", ""),
]  # fmt: skip

ways = pytest.mark.parametrize(("method", "integrator", "more"), WAYS)

#: A step, and what may differ from a law that is integrated as exactly, after a second.
DT, LEFT = 1e-3, {"rail.displacement": 1e-6, "pivot.angle": 4e-6, "cart.y": 5e-7, "cart.vy": 1e-6}


def load(place: Path, scene: str = "free", method: str = "recursive", integrator: str = "trapezoidal", more: str = "") -> Simulation:
    """The steered rack."""
    path = place / "steered.yaml"
    path.write_text(steered_text(more))
    return cutjoint.load(path, scene=scene, method=method, integrator=integrator)


def begin(sim: Simulation, rack: float = 0.0) -> Simulation:
    """The simulation at time 0, steered to a place."""
    sim.set_input("rack", rack)
    return sim.reset(dt=DT)


@ways
def test_a_law_that_is_held_step_by_step_is_followed(tmp_path: Path, method: str, integrator: str, more: str) -> None:
    """Momentum too: the cart goes as the rack's accelerations push it."""
    lawful, sim = load(tmp_path, "lawful", method, integrator, more).reset(dt=DT), begin(load(tmp_path, "free", method, integrator, more))
    for _ in range(1000):
        sim.inputs["rack"] = law(sim.time + DT)
        sim.step()
    lawful.advance(1.0)
    assert abs(lawful.outputs["cart.y"]) > 1e-3
    for name, left in LEFT.items():
        assert sim.outputs[name] == pytest.approx(lawful.outputs[name], abs=left), name
    assert sim.constraint_violation[0] < 1e-6


@pytest.mark.parametrize("interval", [0.002, 0.005, 0.0025])
def test_a_law_that_is_held_over_several_steps_is_followed(tmp_path: Path, interval: float) -> None:
    """At the end of a call the guide is where the host has it; its rate is that of the call's middle."""
    lawful, sim = load(tmp_path, "lawful").reset(dt=DT), begin(load(tmp_path))
    for k in range(round(1 / interval)):
        sim.inputs["rack"] = law((k + 1) * interval)
        sim.advance((k + 1) * interval)
    lawful.advance(1.0)
    for name in ("rail.displacement", "pivot.angle", "cart.y"):
        assert sim.outputs[name] == pytest.approx(lawful.outputs[name], abs=LEFT[name]), name
    assert sim.constraint_violation[0] < 1e-6


def test_rates_without_accelerations_are_followed(tmp_path: Path) -> None:
    lawful, sim = load(tmp_path, "lawful").reset(dt=DT), begin(load(tmp_path))
    for _ in range(1000):
        t = sim.time
        sim.set_input("rack", law(t), (law(t + 1e-6) - law(t - 1e-6)) / 2e-6)
        sim.step()
    lawful.advance(1.0)
    for name, left in LEFT.items():
        assert sim.outputs[name] == pytest.approx(lawful.outputs[name], abs=2 * left), name
    assert sim.constraint_violation[0] < 1e-6


@ways
def test_a_jump_is_made_in_two_steps_without_going_beyond(tmp_path: Path, method: str, integrator: str, more: str) -> None:
    sim, other = begin(load(tmp_path, "free", method, integrator, more)), begin(load(tmp_path, "free", method, integrator, more), 0.03)
    sim.run(10)
    sim.inputs["rack"] = 0.03
    places = []
    for _ in range(3):
        sim.step()
        places.append(sim.outputs["rail.displacement"])
    np.testing.assert_allclose(places, [0.015, 0.03, 0.03], atol=1e-9)
    assert sim.outputs["rail.displacement_rate"] == pytest.approx(0, abs=1e-9)
    assert sim.outputs["pivot.angle"] == pytest.approx(other.outputs["pivot.angle"], abs=2e-6)
    sim.run(100)
    assert sim.outputs["pivot.angle"] == pytest.approx(other.outputs["pivot.angle"], abs=2e-6)
    assert sim.constraint_violation[0] < 1e-6


def test_a_rack_that_the_rod_cannot_reach_is_a_fault_that_names_the_loop(tmp_path: Path) -> None:
    """At once it leaves the state as it was; creeping there tears the loop at last."""
    sim = begin(load(tmp_path))
    sim.run(10)
    before = sim.snapshot()
    sim.inputs["rack"] = 0.7
    with pytest.raises(cutjoint.SimulationError, match=r"'outer.*steered\.yaml:18") as caught:
        sim.step()
    assert caught.value.status > 0
    sim.inputs["rack"] = 0.0
    sim.step()
    other = sim.copy()
    other.restore(before)
    other.step()
    assert np.array_equal(sim.outputs.array, other.outputs.array)


def test_a_loop_that_tears_slowly_is_a_fault_that_names_it(tmp_path: Path) -> None:
    """Steps of a fixed number of iterations end whatever they leave."""
    sim = begin(load(tmp_path)).reset(iterations=3)

    def creep() -> None:
        for k in range(3000):
            sim.inputs["rack"] = 0.3e-3 * k
            sim.step()

    with pytest.raises(cutjoint.SimulationError, match=r"torn.*'outer") as caught:
        creep()
    assert caught.value.status == 29
    gap, equation = sim.constraint_violation
    assert gap > 0.005
    assert equation is not None
    assert equation.startswith("outer.")


#: A rack that goes on at a rate, m/s, to where the rod cannot follow.
RATES = (0.05, 0.3, -0.3, 2.0)


@ways
def test_a_ramp_to_where_the_loop_cannot_close_tears_it(tmp_path: Path, method: str, integrator: str, more: str) -> None:
    """Steps fail a little earlier, where the wheel would turn without bound."""
    for rate in RATES:
        sim = begin(load(tmp_path, "free", method, integrator, more))

        before = sim.coordinates.array.copy()

        def creep(sim: Simulation = sim, before: np.ndarray = before, rate: float = rate) -> None:
            for k in range(round(0.2 / abs(rate) / DT)):
                sim.inputs["rack"] = rate * DT * k
                before[:] = sim.coordinates.array
                sim.step()

        with pytest.raises(cutjoint.SimulationError, match=r"torn.*'(outer|wheel|rod)") as caught:
            creep()
        assert caught.value.status == 29
        assert np.array_equal(sim.coordinates.array, before)


@pytest.mark.parametrize("method", ALONE)
def test_another_fault_blames_no_loop(tmp_path: Path, method: str) -> None:
    """A force without a number stops steps beside a guide that is well."""
    sim = begin(load(tmp_path, method=method))
    sim.inputs["rack"] = 0.001
    sim.inputs["push"] = 1e308
    with pytest.raises(cutjoint.SimulationError) as caught:
        sim.run(20)
    assert caught.value.status not in {0, 29}


#: Jumps, m, the time of the call, in steps, what the next one adds, m, and its steps.
JUMPS = ((0.049, 0.5, 1e-6, 7), (-0.047, 0.5, -1e-6, 3), (0.04, 0.7, 1e-5, 1), (0.03, 0.3, -1e-6, 5), (0.049, 0.5, 0.0, 2))


@ways
def test_a_jump_in_short_steps_ends_where_it_was_to_end(tmp_path: Path, method: str, integrator: str, more: str) -> None:
    """Nothing goes beyond, however long the next call is and whatever it is given."""
    for jump, length, further, steps in JUMPS:
        sim = begin(load(tmp_path, "free", method, integrator, more))
        sim.inputs["rack"] = jump
        sim.advance(length * DT)
        sim.inputs["rack"] = jump + further
        end, places = sim.time + steps * DT, []
        while sim.time < end - 1e-9:
            other = sim.copy()
            other.advance(end)
            places.append(other.outputs["rail.displacement"])
            sim.inputs["rack"] = jump + further
            sim.advance(min(end, sim.time + DT / 4))
            places.append(sim.outputs["rail.displacement"])
        assert max(np.abs(places)) < abs(jump) * 1.001
        assert sim.outputs["rail.displacement"] == pytest.approx(jump, abs=2e-5)


@pytest.mark.parametrize("method", ALONE)
def test_a_reset_forgets_derivatives(tmp_path: Path, method: str) -> None:
    sim, fresh = begin(load(tmp_path, method=method)), load(tmp_path, method=method)
    sim.set_input("rack", 0.004, 0.1, -0.5)
    sim.set_input("push", 3.0, 1.0)
    sim.run(30)
    sim.reset()
    fresh.set_input("rack", 0.004)
    fresh.set_input("push", 3.0)
    fresh.reset(dt=DT)
    assert np.array_equal(sim.outputs.array, fresh.outputs.array)
    assert np.array_equal(sim.run(20), fresh.run(20))
    sim.set_input("rack", 0.004, 0.1)  # given now, they hold from the new start on
    sim.reset()
    assert sim.outputs["rail.displacement_rate"] == pytest.approx(0.1)


def test_an_input_that_is_released_goes_back_to_the_scene(tmp_path: Path) -> None:
    sim, lawful = load(tmp_path, "lawful").reset(dt=DT), load(tmp_path, "lawful").reset(dt=DT)
    lawful.run(100)
    sim.run(50)
    sim.inputs["rack"] = law(0.05) + 1e-4
    sim.run(25)
    sim.inputs["rack"] = np.nan
    sim.run(25)
    assert sim.outputs["rail.displacement"] == pytest.approx(law(0.1), abs=1e-15)
    assert sim.outputs["pivot.angle"] == pytest.approx(lawful.outputs["pivot.angle"], abs=1e-6)


def test_simulations_in_lanes_follow_as_one_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    sim = begin(load(tmp_path))
    for k in range(20):
        sim.inputs["rack"] = 2e-5 * k
        sim.step()
    racks = [0.02, 0.12, -0.01, 0.7, 0.03, -0.11]
    rows = cutjoint.rollout(sim, 15, inputs={"rack": racks})
    for rack, found in zip(racks, rows, strict=True):
        one = sim.copy()
        one.inputs["rack"] = rack
        if rack == 0.7:
            assert np.isnan(found).all()
        else:
            np.testing.assert_allclose(found, one.run(15), rtol=1e-8, atol=1e-9)


def test_lanes_that_go_alone_change_no_bit_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    sim = begin(load(tmp_path))
    sim.run(5)
    alone = cutjoint.rollout(sim, 15, inputs={"rack": [0.02, 0.12]})
    beside = cutjoint.rollout(sim, 15, inputs={"rack": [0.7, 0.12, 0.02, -0.11]})
    assert np.array_equal(alone[0], beside[2])
    assert np.array_equal(alone[1], beside[1])
