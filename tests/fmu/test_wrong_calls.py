"""Wrong calls of an FMU: an error with a message, and nothing has happened."""

from __future__ import annotations

import ctypes
import math
import subprocess
from pathlib import Path

import pytest

from tests.conftest import needs_cpp, with_heavy
from tests.physics.simulation import is_generated

from .slaves import ERROR, OK, Slave, advanced, fmu_of, started

pytestmark = needs_cpp


@pytest.fixture(params=[2, 3])
def slave(request: pytest.FixtureRequest) -> Slave:
    return started(fmu_of("press", request.param, integrator="trapezoidal"))


def said(slave: Slave) -> str:
    """The last message, without the name of the function."""
    return slave.log[-1].partition(": ")[2]


def test_values_that_cannot_be_set(slave: Slave) -> None:
    before = [slave.get(), slave.get("stiffness")]
    for reference, value, words in (
        (1, math.nan, "the value is not finite: value reference 1"),
        (1, math.inf, "the value is not finite: value reference 1"),
        (2, -1.0, "the value must be positive: value reference 2"),
        (3, 1.0, "a fixed parameter can be set before the first step only: value reference 3"),
        (4, 1.0, "only parameters and inputs can be set, which is none: value reference 4"),
        (0, 1.0, "only parameters and inputs can be set, which is none: value reference 0"),
        (99, 1.0, "there is no variable with value reference 99"),
    ):
        assert slave.set_reference(reference, value) == ERROR
        assert said(slave) == words
    assert slave.get_reference(4_000_000_000) == ERROR
    assert [slave.get(), slave.get("stiffness")] == before


def test_one_wrong_value_leaves_the_others(slave: Slave) -> None:
    assert slave.set(stiffness=3000.0, integrator__step=math.nan) == ERROR
    assert slave.get("stiffness", "integrator.step") == [2000.0, 0.001]


def test_steps_that_cannot_be(slave: Slave) -> None:
    advanced(slave, 2, 0.01)
    before = slave.get()
    for point, size, words in (
        (0.01, 0.01, "the communication point is 0.01 s, but the instance is at 0.02"),
        (math.nan, 0.01, "the communication point is nan s"),
        (0.02, 0.0, "the communication step must be positive"),
        (0.02, -0.01, "the communication step must be positive"),
        (0.02, math.nan, "the communication step must be positive"),
        (0.02, 1e300, "a number is not finite, or out of its range"),
    ):
        assert slave.step(point, size) == ERROR
        assert said(slave).startswith(words)
    assert slave.get() == before
    assert slave.step(0.02, 0.01) == OK


@pytest.mark.parametrize("version", [2, 3])
def test_calls_out_of_order(version: int) -> None:
    slave = Slave(fmu_of("press", version))
    for call in (lambda: slave.step(0.0, 0.01), lambda: slave.call("ExitInitializationMode"), lambda: slave.call("Terminate")):
        assert call() == ERROR
        assert said(slave) == "not allowed before initialization mode"
    assert slave.get_reference(slave.references["slider.x"]) == ERROR
    assert said(slave) == "outputs have no values before initialization mode"
    assert slave.initialise(start=1.0) == ERROR
    assert said(slave) == "the model begins at time 0, so that the start time must be 0"
    assert slave.initialise(stop=0.015) == OK
    assert slave.call("ExitInitializationMode") == ERROR
    assert said(slave) == "not allowed in step mode"
    assert slave.step(0.0, 0.01) == OK
    assert slave.step(0.01, 0.01) == ERROR
    assert said(slave).startswith("the step would go beyond the stop time, 0.015")
    assert slave.call("Terminate") == OK
    assert slave.step(0.01, 0.001) == slave.set(stiffness=1.0) == ERROR
    assert said(slave) == "not allowed after termination"


def test_null_pointers(slave: Slave) -> None:
    name, more = ("Real", ()) if slave.fmu.version == 2 else ("Float64", (ctypes.c_size_t(1),))
    for function in (f"Get{name}", f"Set{name}"):
        assert slave.call(function, None, ctypes.c_size_t(1), None, *more) == ERROR
        assert said(slave) == "an array is a null pointer"
    assert slave.restore(None) == ERROR
    slave.free()
    assert slave.set(stiffness=1.0) == slave.step(0.0, 0.01) == slave.initialise() == ERROR
    slave.free()


def test_bytes_that_are_no_state(slave: Slave) -> None:
    state = slave.save()
    data = slave.serialise(state)
    for wrong in (data[:-1], data + b"x", bytes(len(data)), b""):
        assert slave.deserialise(wrong)[0] == ERROR
        assert said(slave) == "these bytes are no state of this FMU"
    for bit in range(0, 8 * len(data), 37):
        bad = bytearray(data)
        bad[bit // 8] ^= 1 << bit % 8
        assert slave.deserialise(bytes(bad))[0] == ERROR
    assert slave.free_state(state) == OK


def test_another_models_token(slave: Slave) -> None:
    other = Slave(slave.fmu, token="{0}")
    assert not other.exists
    assert said(other) in ("the GUID is not that of this binary", "the instantiation token is not that of this binary")
    assert other.step(0.0, 0.01) == ERROR


def test_variables_of_other_types(slave: Slave) -> None:
    kind = "Integer" if slave.fmu.version == 2 else "Int32"
    for function in (f"Get{kind}", f"Set{kind}"):
        assert slave.call(function, None, ctypes.c_size_t(0), None, ctypes.c_size_t(0)) == OK
        assert slave.call(function, None, ctypes.c_size_t(1), None, ctypes.c_size_t(1)) == ERROR
        assert said(slave).startswith("all variables are of type ")


def test_derivatives_of_inputs() -> None:
    slave = started(fmu_of("driven", 2, "free"))
    push = slave.references["push"]
    for reference, order, value, words in (
        (push, 3, 1.0, "derivatives are of order 1 or 2, not 3"),
        (push, 1, math.nan, f"the value is not finite: value reference {push}"),
        (push + 1, 1, 1.0, f"value reference {push + 1} is no input"),
    ):
        places, orders, values = (ctypes.c_uint * 1)(reference), (ctypes.c_int * 1)(order), (ctypes.c_double * 1)(value)
        assert slave.call("SetRealInputDerivatives", places, ctypes.c_size_t(1), orders, values) == ERROR
        assert said(slave) == words


_OF_CLOCKS = ("Clock", "IntervalDecimal", "IntervalFraction", "ShiftDecimal", "ShiftFraction")


@pytest.mark.parametrize("function", [verb + what for verb in ("Get", "Set") for what in _OF_CLOCKS])
def test_there_are_no_clocks(function: str) -> None:
    slave = started(fmu_of("press", 3))
    places, values = (ctypes.c_uint * 1)(1), (ctypes.c_uint64 * 2)()
    assert slave.call(function, places, ctypes.c_size_t(1), values, values) == ERROR
    assert slave.log == [f"fmi3{function}: the FMU has no clocks"]


SANITIZERS = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
RANDOM = [("press", 2, "cs", None), ("press", 3, "both", None), ("spinning", 3, "both", None), ("bounce", 3, "both", "rk4")]


@pytest.mark.parametrize(("name", "version", "kind", "integrator"), with_heavy(RANDOM, *(case for case in RANDOM if case[0] != "bounce")))
@pytest.mark.parametrize("sanitizers", [[], pytest.param(SANITIZERS, marks=pytest.mark.heavy)], ids=["plain", "sanitized"])
def test_random_calls(
    name: str, version: int, kind: str, integrator: str | None, sanitizers: list[str], tmp_path: Path
) -> None:  # fmt: skip
    fmu = fmu_of(name, version, kind=kind, integrator=integrator)
    for file, text in fmu.sources.items():
        (tmp_path / file).write_text(text)
    flags = ["-std=c++20", "-O1" if is_generated() else "-O0", *sanitizers, "-D_GLIBCXX_ASSERTIONS", "-I.",
             f"-DSTOPS={int(fmu.subject.stops_at_events)}"]  # fmt: skip
    program = Path(__file__).with_name("random_calls.cpp" if version == 2 else "random_calls_3.cpp")
    subprocess.run(["g++", *flags, program, f"{fmu.standalone.name}.cpp", "-o", "random"], cwd=tmp_path, check=True)
    calls, good = subprocess.run([tmp_path / "random", "50000"], capture_output=True, text=True, check=True).stdout.split()
    assert int(calls) / 4 < int(good) < int(calls)
