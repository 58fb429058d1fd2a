"""Controllers in FMUs: samples within communication steps, as events at times where a host integrates, and in saved states."""

from __future__ import annotations

import ctypes
import math
from functools import cache

import numpy as np
import pytest

from cutjoint.export.fmu.archive import Fmu, make_fmu
from tests.conftest import needs_cpp
from tests.physics.test_controllers import A, K, T, pole, pole_model, servo, servo_by_hand

from .exchange import Exchange
from .slaves import OK, Slave

pytestmark = needs_cpp

versions = pytest.mark.parametrize("version", [2, 3])


@cache
def sampled(name: str, version: int) -> Fmu:
    model = {"servo": servo, "pole": pole_model}[name]()
    kind, integrator = ("cs", "trapezoidal") if name == "servo" else ("both", "dormand-prince")
    return make_fmu(model, model.scenes["run"], version=version, kind=kind, integrator=integrator)


class Timed(Exchange):
    """An instance whose events at times the host meets: ``next`` is that of the next one, s."""

    next = 0.0

    def update(self) -> int:
        if self.fmu.version == 2:
            info = (ctypes.c_int * 8)()
            status = self.call("NewDiscreteStates", info)
            assert info[4]
            self.next = ctypes.c_double.from_buffer(info, 24).value
            return status
        flags, time = [ctypes.c_bool() for _ in range(5)], ctypes.c_double()
        status = self.call("UpdateDiscreteStates", *map(ctypes.byref, flags), ctypes.byref(time))
        assert flags[4].value
        self.next = time.value
        return status

    def go_to_event(self, begin: float) -> float:
        """Integrate to the next event, and let it happen."""
        end = self.next
        self.integrate(end, 20, begin)
        assert self.call("EnterEventMode") == self.update() == self.call("EnterContinuousTimeMode") == OK, self.log
        return end


@versions
def test_a_host_that_integrates_meets_the_discrete_pole(version: int) -> None:
    """Its Runge-Kutta steps of 5 ms err by (0.01)^5/120 each, 20 of them by 2e-11; a restored state goes on bit by bit."""
    instance = Timed(sampled("pole", version)).begin()
    time, levels, kept = 0.0, [], None
    for i in range(6):
        u, level = instance.get("loop.u", "level.value")
        assert u == -K * level
        levels.append(level)
        if i == 3:
            instance.integrate(time + T / 2, 10, time)
            kept, x, between = instance.save(), instance.x, instance.next
            instance.integrate(between, 10, time + T / 2)
            assert instance.call("EnterEventMode") == instance.update() == instance.call("EnterContinuousTimeMode") == OK
            known, time = instance.get(), between
            assert instance.restore(kept) == OK
            assert (instance.x == x).all()
            instance.integrate(between, 10, time - T / 2)
            assert instance.call("EnterEventMode") == instance.update() == instance.call("EnterContinuousTimeMode") == OK
            assert instance.get() == known
        else:
            time = instance.go_to_event(time)
    assert np.abs(np.array(levels[1:]) / levels[:-1] - pole(math.exp(-A * T))).max() < 1e-10
    assert time == pytest.approx(6 * T)


@versions
def test_communication_steps_have_the_samples_within_and_saved_states_go_on_bit_by_bit(version: int) -> None:
    slave = Slave(sampled("servo", version))
    assert slave.initialise() == OK, slave.log
    known = servo_by_hand(lambda t: 1.0)
    rows, state = [], None
    for i in range(40):
        rows.append(slave.get())
        if i == 7:
            state = slave.save()
        assert slave.step(i * 7.5e-3, 7.5e-3) == OK, slave.log
    assert np.abs(np.array(rows) - known[: 3 * 40 : 3]).max() < 1e-11
    other = Slave(sampled("servo", version))
    status, copy = other.deserialise(slave.serialise(state))
    assert status == OK
    for instance, own in ((slave, state), (other, copy)):
        assert instance.restore(own) == OK
        for i in range(7, 40):
            assert instance.get() == rows[i]
            assert instance.step(i * 7.5e-3, 7.5e-3) == OK
