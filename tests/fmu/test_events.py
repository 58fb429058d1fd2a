"""Event mode, early return and intermediate updates of co-simulation by FMI 3: times of events and motions against closed forms."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.bouncing import exact_bounces, exact_switches

from .slaves import ERROR, OK, Slave, fmu_of, packed, started, text_of, write

pytestmark = needs_cpp

END, COMMUNICATION = 1.5, 0.05
TOLERANCE = {"integrator__relative_tolerance": 1e-11, "integrator__absolute_tolerance": 1e-11}


def bouncing(integrator: str = "dormand-prince", **host: object) -> Slave:
    """A mass above a stop; its steps are exact to about 1e-11."""
    slave = Slave(fmu_of("bounce", 3, integrator=integrator), **host)  # type: ignore[arg-type]
    if integrator == "dormand-prince":
        assert slave.set(**TOLERANCE) == OK
    assert slave.initialise() == OK, slave.log
    return slave


def to_step_mode(slave: Slave) -> None:
    """Events of the host's are over."""
    flags = [ctypes.c_bool(True) for _ in range(5)]
    assert slave.call("UpdateDiscreteStates", *map(ctypes.byref, flags), ctypes.byref(ctypes.c_double())) == OK, slave.log
    assert not any(flag.value for flag in flags)
    assert slave.call("EnterStepMode") == OK, slave.log


def run(slave: Slave, *, events: bool) -> tuple[list[float], list[float]]:
    """Times of events, and heights at communication points; steps that end early go on to the next point."""
    times, heights = [], []
    for i in range(round(END / COMMUNICATION)):
        point, until = i * COMMUNICATION, (i + 1) * COMMUNICATION
        while point < until:
            assert slave.step(point, until - point) == OK, slave.log
            assert slave.event == (slave.early and events)
            if slave.early:
                times.append(slave.last)
                assert slave.get("time") == [slave.last]
            if slave.event:
                assert slave.call("EnterEventMode") == OK
                to_step_mode(slave)
            point = slave.last if slave.early else until
        heights += slave.get("mass.z")
    return times, heights


@pytest.mark.parametrize("events", [False, True])
def test_steps_end_at_events_and_the_motion_stays(events: bool) -> None:
    slave = bouncing(events=events, early=True)
    if events:
        to_step_mode(slave)
    times, heights = run(slave, events=events)
    points = COMMUNICATION * np.arange(1, round(END / COMMUNICATION) + 1)
    known = exact_switches(END, 5.0, 0.3)
    assert len(known) > 5
    assert times == pytest.approx(known, abs=1e-9)
    assert heights == pytest.approx(exact_bounces(points, 5.0, 0.3)[0], abs=1e-8)
    assert heights == pytest.approx(run(bouncing(), events=False)[1], abs=1e-9)


def test_events_are_handled_inside_unless_steps_may_end_early() -> None:
    slave, alone = bouncing(events=True), bouncing()
    to_step_mode(slave)
    assert slave.step(0.0, 0.4) == alone.step(0.0, 0.4) == OK
    assert (slave.event, slave.early, slave.last) == (False, False, 0.4)
    assert slave.get() == pytest.approx(alone.get(), abs=1e-9)


def test_an_event_at_a_communication_point_ends_no_step_early() -> None:
    slave = bouncing(events=True, early=True)
    to_step_mode(slave)
    assert slave.step(0.0, 0.2) == OK
    saved = slave.save()
    assert slave.step(0.2, 0.1) == OK
    assert slave.early
    met = slave.last
    assert slave.restore(saved) == OK
    assert slave.step(0.2, met - 0.2) == OK
    assert not slave.early
    assert slave.get("time") == pytest.approx([met], abs=1e-12)


def test_fmpy_with_event_mode_has_the_run_of_the_command_line(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model = read_model_text(text_of("bounce"), "bounce.yaml")
    known = simulate(compile_scene(model, find_scene(model, None)), integrator="dormand-prince", tolerance=1e-11, error=False)
    file = write(fmu_of("bounce", 3, integrator="dormand-prince"), tmp_path)
    table = fmpy.simulate_fmu(
        str(file), stop_time=END, output_interval=COMMUNICATION, use_event_mode=True, early_return_allowed=True,
        start_values={name.replace("__", "."): value for name, value in TOLERANCE.items()},
    )  # fmt: skip
    rows = np.searchsorted(table["time"], known.t - 1e-9)
    assert len(table) >= len(known.t)
    assert table["time"][rows] == pytest.approx(known.t, abs=1e-12)
    for column in known.columns:
        assert table[column][rows] == pytest.approx(known[column], abs=1e-8), column


def test_fmpy_finds_nothing_wrong(tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    for kind in ("cs", "both"):
        file = write(fmu_of("bounce", 3, integrator="rk4", kind=kind), tmp_path, sources=True, binary=False)
        assert validation.validate_fmu(str(file)) == []


def test_updates_come_after_each_step_of_the_integrator_and_at_events() -> None:
    seen: list[tuple[float, float, float]] = []

    def look(time: float) -> None:
        seen.append((time, *slave.get("time", "mass.z")))
        assert slave.step(time, 0.1) == slave.set(integrator__step=0.1) == slave.call("Reset") == slave.call("EnterEventMode") == ERROR
        assert slave.call("GetFMUState", ctypes.byref(ctypes.c_void_p())) == ERROR
        assert slave.log[-1] == "fmi3GetFMUState: not allowed in intermediate update mode"

    slave = bouncing("rk4", update=look, intermediate=["mass.z"])
    other = bouncing("rk4")
    assert slave.step(0.0, 0.4) == other.step(0.0, 0.4) == OK
    assert not slave.early
    met = math.sqrt(2 * 0.3 / 9.81)
    times = [time for time, _, _ in seen]
    assert times[:25] == pytest.approx([*(0.01 * np.arange(1, 25)), met], abs=1e-9)
    assert times == sorted(times)
    assert times[-1] == pytest.approx(0.4, abs=1e-12)
    assert [now for _, now, _ in seen] == times
    for time, _, height in seen[:25]:
        assert height == pytest.approx(0.3 - 9.81 * time**2 / 2, abs=1e-9)
    assert slave.get() == pytest.approx(other.get(), abs=1e-4)  # order 4, with other steps after the event


@pytest.mark.parametrize(("wanted", "reached"), [(0.03, 0.03), (0.034, 0.034), (0.0, 0.02), (9.0, 0.1)])
def test_steps_end_where_an_update_wants_it(wanted: float, reached: float) -> None:
    slave = bouncing("rk4", early=True, update=lambda time: wanted if time > 0.015 else None)
    assert slave.step(0.0, 0.1) == OK
    assert slave.early == (reached < 0.1)
    assert not slave.event
    assert slave.last == pytest.approx(reached, abs=1e-12)
    assert slave.get("mass.z") == pytest.approx([0.3 - 9.81 * slave.last**2 / 2], abs=1e-12)


@pytest.mark.parametrize("integrator", with_heavy(["dormand-prince", "rk4"], "rk4"))
def test_nobody_ends_a_step_that_must_not_end_early(integrator: str) -> None:
    slave = bouncing(integrator, update=lambda time: time)
    assert slave.step(0.0, 0.1) == OK
    assert (slave.early, slave.last) == (False, 0.1)


@pytest.mark.parametrize("integrator", ["rk4", "dormand-prince"])
def test_inputs_jump_in_event_mode(integrator: str) -> None:
    """2 kg that 2 N push from rest, until the event at a spring of 50 N/m, where the force goes to 0."""
    slave = Slave(fmu_of("pushed", 3, integrator=integrator), events=True, early=True)
    assert slave.set(push=2.0, **(TOLERANCE if integrator == "dormand-prince" else {})) == slave.initialise() == OK
    to_step_mode(slave)
    assert slave.step(0.0, 1.0) == OK
    assert (slave.event, slave.early) == (True, True)
    met = math.sqrt(0.6)
    assert slave.last == pytest.approx(met, abs=1e-9)
    before, begin = slave.get(), slave.last
    assert slave.call("EnterEventMode") == OK
    assert slave.set(push=0.0) == OK
    assert slave.get() == before  # outputs are those of the last step
    to_step_mode(slave)
    assert slave.step(begin, 0.2) == OK
    speed, w = met, 5.0
    assert slave.get("mass.x", "mass.vx") == pytest.approx([0.3 + speed / w * math.sin(w * 0.2), speed * math.cos(w * 0.2)], abs=1e-6)


def test_states_in_event_mode_go_on_there() -> None:
    slave = bouncing(events=True, early=True)
    to_step_mode(slave)
    assert slave.step(0.0, 0.5) == OK
    assert slave.call("EnterEventMode") == OK
    state = slave.save()
    to_step_mode(slave)
    begin = slave.last
    assert slave.step(begin, 0.1) == OK
    known = slave.get("time", "mass.z")
    assert slave.restore(state) == OK
    to_step_mode(slave)
    assert slave.step(begin, 0.1) == OK
    assert slave.get("time", "mass.z") == known
    other = bouncing()
    assert other.restore(other.deserialise(slave.serialise(state))[1]) == ERROR
    assert other.log[-1] == "restore: the state is one in event mode, without which the instance was made"


def test_a_step_without_end_is_refused() -> None:
    slave = bouncing("rk4", update=lambda time: None)
    assert slave.step(0.0, 1e300) == ERROR
    assert slave.log[-1] == "fmi3DoStep: a number is not finite, or out of its range"
    assert slave.step(0.0, 0.1) == OK


@pytest.mark.parametrize("kind", ["cs", "both"])
def test_wrong_calls(kind: str) -> None:
    fmu = fmu_of("bounce", 3, integrator="rk4", kind=kind)
    slave = started(fmu, events=True)
    assert slave.step(0.0, 0.1) == slave.call("EnterEventMode") == ERROR
    assert slave.log[-1] == "fmi3EnterEventMode: not allowed in event mode"
    places = [ctypes.byref(ctypes.c_bool()) for _ in range(5)]
    assert slave.call("UpdateDiscreteStates", *places, None) == ERROR
    assert slave.call("EnterContinuousTimeMode") == ERROR
    to_step_mode(slave)
    assert slave.call("EnterStepMode") == slave.call("UpdateDiscreteStates", *places, ctypes.byref(ctypes.c_double())) == ERROR
    assert slave.log[-1] == "fmi3UpdateDiscreteStates: not allowed in step mode"
    without = started(fmu)
    assert without.call("EnterEventMode") == ERROR
    assert without.log[-1] == "fmi3EnterEventMode: the instance was made without event mode"
    assert without.step(0.0, 0.1) == OK
    refused = Slave(fmu, intermediate=["integrator.step"])
    assert not refused.exists
    assert refused.log[-1].endswith("a value reference of an intermediate variable is that of no output")


def test_steps_that_find_no_events_have_no_event_mode() -> None:
    for name, version, integrator in (("bounce", 3, "trapezoidal"), ("press", 3, "rk4"), ("bounce", 2, "rk4")):
        fmu = fmu_of(name, version, integrator=integrator)
        assert not fmu.subject.stops_at_events
        assert b"hasEventMode" not in packed(fmu, sources=True, binary=False)
    assert not Slave(fmu_of("press", 3), events=True).exists
