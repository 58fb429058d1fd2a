"""Parts of a simulation that Python holds: views that stay current, copies, and simulations that are copied or pickled."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

import cutjoint
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

PRESS = MODELS / "press.yaml"


@pytest.fixture
def press() -> cutjoint.Simulation:
    return cutjoint.load(PRESS, integrator="trapezoidal").reset(dt=1e-3)


@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_what_is_held_stays_current(integrator: str) -> None:
    sim = cutjoint.load(PRESS, integrator=integrator).reset(dt=1e-3)
    q, v, out = sim.coordinates, sim.speeds, sim.outputs
    places, copied, accelerated = q.array, out.array, sim.accelerations
    before = out["slider.x"], accelerated.array.copy()
    sim.advance(0.1)
    fresh = cutjoint.load(PRESS, integrator=integrator).reset(dt=1e-3)
    fresh.advance(0.1)
    assert out["slider.x"] == dict(out)["slider.x"] == fresh.outputs["slider.x"] != before[0]
    assert np.array_equal(places, fresh.coordinates.array)
    assert np.array_equal(v.array, fresh.speeds.array)
    assert copied[out.place("slider.x")] == before[0]
    assert np.array_equal(accelerated.array, before[1])
    assert not np.array_equal(sim.accelerations.array, before[1])
    sim.reset()
    assert (sim.coordinates is q, sim.speeds is v, sim.outputs is out) == (True, True, True)
    assert out["slider.x"] == before[0]
    with pytest.raises(TypeError, match=r"'slider\.x' is an output, which follows from the state"):
        out["slider.x"] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        q["pin.angle"] = 1.0


NEXT = """
import pickle, sys
sim = pickle.load(sys.stdin.buffer)
sim.step()
sys.stdout.buffer.write(pickle.dumps((sim.time, sim.coordinates.array.copy(), sim.speeds.array.copy(), sim)))
"""


def test_a_pickled_simulation_goes_on_in_another_process(press: cutjoint.Simulation) -> None:
    press.parameters["stiffness"] = 2500.0
    press.set_limits(evaluations=1000)
    press.run(20)
    done = subprocess.run([sys.executable, "-c", NEXT], input=pickle.dumps(press), capture_output=True, check=True)
    time, q, v, back = pickle.loads(done.stdout)
    press.step()
    assert time == press.time
    assert np.array_equal(q, press.coordinates.array)
    assert np.array_equal(v, press.speeds.array)
    press.step()
    back.step()
    assert back.snapshot() == press.snapshot()
    assert back.last_step == press.last_step


def test_copies_of_all_kinds_are_apart(press: cutjoint.Simulation) -> None:
    press.run(10)
    for made in (press.copy(), copy.copy(press), copy.deepcopy({"sim": press})["sim"], pickle.loads(pickle.dumps(press))):
        assert made.snapshot() == press.snapshot()
        made.step()
        assert made.time > press.time
    unborn = cutjoint.load(PRESS, integrator="trapezoidal")
    unborn.parameters["stiffness"] = 1500.0
    other = pickle.loads(pickle.dumps(unborn))
    assert other.parameters["stiffness"] == 1500.0
    with pytest.raises(cutjoint.SimulationError, match="call reset"):
        _ = other.outputs


def test_a_pickled_simulation_brings_its_library_where_it_is_gone(press: cutjoint.Simulation) -> None:
    press.run(10)
    made = pickle.loads(pickle.dumps(press).replace(b"libpress.so", b"libgones.so"))
    assert pickle.loads(pickle.dumps(made)).snapshot() == made.snapshot() == press.snapshot()
    made.step()
    press.step()
    assert made.snapshot() == press.snapshot()
