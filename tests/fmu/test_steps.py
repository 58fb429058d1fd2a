"""Communication steps, inputs, states and memory of FMUs, against the model's own C interface."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import cutjoint
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.export.fmu.description import write_description
from cutjoint.model.read import read_model_text
from cutjoint.reduce.guards import guard_forces
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.mechanisms.driven import DRIVEN, LIFT, PUSH
from tests.reduce.test_guards import TEXT as HAMMER

from .slaves import DISCARD, OK, Slave, advanced, fmu_of, started

pytestmark = needs_cpp

versions = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture
def driven(tmp_path: Path) -> Path:
    path = tmp_path / "driven.yaml"
    path.write_text(DRIVEN)
    return path


@versions
def test_steps_of_any_length_are_those_of_the_interface(version: int) -> None:
    slave, sim = started(fmu_of("press", version)), cutjoint.load(MODELS / "press.yaml").reset()
    for until in (0.001, 0.0035, 0.0037, 0.1, 0.1234567):
        (now,) = slave.get("time")
        assert slave.step(now, until - now) == OK
        sim.advance(now + (until - now))
        assert slave.get() == list(sim.outputs.array)


@pytest.mark.parametrize(
    ("version", "method", "integrator"),
    [(2, "recursive-newton", "trapezoidal"), (3, "recursive-newton", "radau5-fixed"), (2, "recursive-newton", "radau5"),
     (3, "augmented", "trapezoidal"), (2, "classical", "trapezoidal"), (3, "recursive-newton", "generalised-alpha")],
)  # fmt: skip
def test_steps_by_newtons_iteration_are_those_of_the_interface(version: int, method: str, integrator: str) -> None:
    slave = started(fmu_of("press", version, integrator=integrator, method=method))
    sim = cutjoint.load(MODELS / "press.yaml", method=method, integrator=integrator).reset()
    for until in (0.001, 0.0035, 0.1, 0.1234567):
        (now,) = slave.get("time")
        assert slave.step(now, until - now) == OK
        sim.advance(now + (until - now))
        assert slave.get() == list(sim.outputs.array)


def test_a_method_without_fmus_is_refused() -> None:
    with pytest.raises(cutjoint.RunError, match="method: 'euler' has no FMUs; use recursive, augmented, classical or recursive-newton"):
        fmu_of("press", 2, method="euler")
    for method in ("augmented", "classical", "recursive-newton"):
        words = f"method: '{method}' has FMUs for co-simulation only; leave out --kind me, or use the method recursive"
        with pytest.raises(cutjoint.RunError, match=words):
            fmu_of("press", 2, kind="me", method=method)


def test_parameters_start_and_step_are_the_hosts() -> None:
    slave = Slave(fmu_of("press", 2, integrator="trapezoidal"))
    sim = cutjoint.load(MODELS / "press.yaml", integrator="trapezoidal")
    assert slave.set(stiffness=3000.0, start__pin__angle_rate=5.0, integrator__step=2e-3) == OK
    assert slave.initialise(enter_only=True) == OK
    sim.parameters["stiffness"] = 3000.0
    sim.reset(speeds={"pin.angle_rate": 5.0}, dt=2e-3)
    assert slave.get() == list(sim.outputs.array)
    assert slave.call("ExitInitializationMode") == OK
    advanced(slave, 10, 0.01)
    sim.advance(0.1)
    assert slave.get() == list(sim.outputs.array)
    assert slave.set(stiffness=1000.0) == OK
    sim.parameters["stiffness"] = 1000.0
    advanced(slave, 10, 0.01, 0.1)
    sim.advance(0.2)
    assert slave.get() == pytest.approx(list(sim.outputs.array), rel=1e-12)


@versions
def test_inputs_begin_with_the_scenes_value_and_are_held(version: int, driven: Path) -> None:
    fmu = fmu_of("driven", version, "lawful")
    described = ElementTree.fromstring(write_description(fmu.subject, fmu.interface, version))
    starts = {v.get("name"): next(iter(v), v).get("start") for v in described.iter("ScalarVariable" if version == 2 else "Float64")}
    assert {name: float(str(starts[name])) for name in ("lift", "push")} == {"lift": LIFT(0.0), "push": PUSH(0.0)}
    slave, sim = started(fmu), cutjoint.load(driven, scene="lawful")
    sim.set_input("lift", LIFT(0.0))
    sim.set_input("push", PUSH(0.0))
    sim.reset()
    assert slave.get() == list(sim.outputs.array)
    for i in range(4):
        assert slave.step(0.1 * i, 0.1) == OK
        sim.advance(0.1 * i + 0.1)
        assert slave.get() == list(sim.outputs.array)
    assert slave.get("lift", "push") == [LIFT(0.0), PUSH(0.0)]


def test_inputs_are_held_or_go_on_by_their_derivatives(driven: Path) -> None:
    slave, sim = started(fmu_of("driven", 2, "free")), cutjoint.load(driven, scene="free")
    for name in ("lift", "push"):
        sim.set_input(name, *slave.get(name))
    sim.reset()
    for i in range(20):
        push, rate, acceleration = np.cos(0.3 * i), 0.1 * i, -0.2 * i
        assert slave.set(push=push) == OK
        assert slave.slope("lift", rate, acceleration) == OK
        sim.set_input("push", push)
        sim.set_input("lift", *slave.get("lift"), rate, acceleration)
        assert slave.step(0.05 * i, 0.05) == OK
        sim.advance(0.05 * (i + 1))
        sim.set_input("lift", *slave.get("lift"))
        assert slave.get() == pytest.approx(list(sim.outputs.array), rel=1e-12, abs=1e-15)
    assert slave.get("lift") == pytest.approx([0.1 + sum(0.1 * i * 0.05 - 0.1 * i * 0.05**2 for i in range(20))], rel=1e-12)


@versions
@pytest.mark.parametrize("integrator", [None, "trapezoidal", "rk4"])
def test_outputs_stay_until_the_next_step(version: int, integrator: str | None) -> None:
    fmu = fmu_of("driven", version, "free", integrator)
    slave, other = started(fmu), started(fmu)
    known = advanced(slave, 3, 0.1)[-1]
    for i in range(3):
        assert other.step(0.1 * i, 0.1) == OK
    for instance in (slave, other):
        assert instance.set(push=3.0, lift=0.4) == OK
        assert instance.get() == known
        assert instance.step(0.3, 0.1) == OK
    assert slave.get() == other.get() != known


@versions
@pytest.mark.parametrize("name", ["press", "driven"])
def test_outputs_that_change_at_the_start_depend_on_what_was_set(version: int, name: str) -> None:
    fmu = fmu_of(name, version, "free" if name == "driven" else None)
    slave = Slave(fmu)
    assert slave.initialise(enter_only=True) == OK
    before = slave.get()
    for reference, variable in enumerate(fmu.interface.variables):
        if variable.start is None or variable.name.startswith("integrator"):
            continue
        assert slave.set_reference(reference, variable.start * 1.5 + 0.1) == OK
        changed = {v.name for v, old, new in zip(fmu.interface.outputs, before, slave.get(), strict=True) if old != new}
        assert changed <= {v.name for v in fmu.interface.outputs if reference in v.dependencies}, variable.name
        assert slave.set_reference(reference, variable.start) == OK
        assert slave.get() == before


@versions
def test_states_go_on_bit_by_bit_in_any_instance(version: int) -> None:
    fmu = fmu_of("press", version)
    slave = started(fmu)
    advanced(slave, 10, 0.0123)
    (now,) = slave.get("time")
    state = slave.save()
    known = advanced(slave, 10, 0.0123, now)
    assert slave.restore(state) == OK
    assert advanced(slave, 10, 0.0123, now) == known
    other = Slave(fmu)
    status, copy = other.deserialise(slave.serialise(state))
    assert (status, other.restore(copy)) == (OK, OK)
    assert advanced(other, 10, 0.0123, now) == known
    assert slave.free_state(state) == other.free_state(copy) == OK


@versions
def test_states_before_the_start_return_there(version: int) -> None:
    slave = Slave(fmu_of("press", version))
    assert slave.set(stiffness=2500.0) == OK
    state = slave.save()
    assert slave.initialise() == OK
    known = advanced(slave, 5, 0.01)
    assert slave.set(stiffness=100.0) == slave.restore(state) == OK
    assert slave.get("stiffness") == [2500.0]
    assert slave.initialise() == OK
    assert advanced(slave, 5, 0.01) == known


@versions
def test_instances_are_independent_and_reset(version: int) -> None:
    fmu = fmu_of("press", version)
    one, other = started(fmu), started(fmu)
    known = advanced(one, 5, 0.01)
    assert other.set(stiffness=100.0) == OK
    assert advanced(other, 5, 0.01) != known
    assert other.call("Reset") == other.initialise() == OK
    assert advanced(other, 5, 0.01) == known
    assert one.call("Terminate") == OK
    assert one.get() == known[-1]
    one.free()
    assert advanced(other, 1, 0.01, 0.05) != known


@versions
def test_a_step_that_fails_leaves_the_instance_as_it_was(version: int) -> None:
    fmu = fmu_of("press", version, integrator="trapezoidal")
    slave, undisturbed = started(fmu), started(fmu)
    advanced(slave, 5, 0.01)
    advanced(undisturbed, 5, 0.01)
    before = slave.get("time", "pin.angle", "slider.x", "slider.vx")
    assert slave.set(stiffness=1e300) == OK
    assert slave.step(0.05, 0.01) == DISCARD
    assert slave.log[-1].startswith(f"fmi{version}DoStep: at 0.05")
    assert slave.get("time", "pin.angle", "slider.x", "slider.vx") == before
    assert slave.set(stiffness=2000.0) == OK
    known = advanced(undisturbed, 5, 0.01, 0.05)
    assert np.array(advanced(slave, 5, 0.01, 0.05)) == pytest.approx(np.array(known), rel=1e-12)


@versions
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_a_step_of_fixed_length_that_fails_at_its_end_leaves_the_instance_as_it_was(version: int, method: str) -> None:
    model = read_model_text(HAMMER, "hammer.yaml")
    reduced = guard_forces(model, model.scenes["swing"], ("floor",))
    fmu = make_fmu(reduced.model, reduced.scene, version=version, integrator="trapezoidal", method=method)
    slave, undisturbed, step, steps = Slave(fmu), Slave(fmu), 1e-3, 0
    for each in (slave, undisturbed):
        assert each.set(depth=0.1, integrator__step=step) == each.initialise() == OK
    before = slave.get("time", *(v.name for v in fmu.interface.outputs))
    while (status := slave.step(steps * step, step)) == OK:
        steps, before = steps + 1, slave.get("time", *(v.name for v in fmu.interface.outputs))
    assert steps > 50
    assert status == DISCARD
    assert "a guard is violated" in slave.log[-1]
    assert slave.get("time", *(v.name for v in fmu.interface.outputs)) == before
    assert slave.step(steps * step, step) == DISCARD
    advanced(undisturbed, steps, step)
    for each in (slave, undisturbed):
        assert each.set(depth=1.0) == OK
    known = advanced(undisturbed, 20, step, steps * step)
    assert advanced(slave, 20, step, steps * step) == known


@versions
@pytest.mark.parametrize("steps", with_heavy([10_000, 1_000_000], 1_000_000))
def test_steps_take_no_memory(version: int, steps: int) -> None:
    slave = started(fmu_of("press", version))
    advanced(slave, 1000, 0.001)
    before = _resident()
    (begin,) = slave.get("time")
    for i in range(steps):
        assert slave.step(begin + i * 0.001, 0.001) == OK
    assert _resident() <= before + 256 * 1024  # the interpreter's own, in some pages


def _resident() -> int:
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
