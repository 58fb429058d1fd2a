"""examples/fmu_c99.py: an FMU in C99 source code, built by FMPy, has the bits of the code itself and the outputs of the FMU in C++."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from numpy.typing import NDArray

from cutjoint.export.fmu.archive import make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_case
from tests.conftest import ROOT, needs_cpp
from tests.physics.simulation import is_generated
from tests.standalone.test_c99 import PUSHED, C, Code, exported

pytestmark = needs_cpp

SCRIPT = ROOT / "examples" / "fmu_c99.py"
STEP, SIZE, SAMPLES = 1e-3, 1e-2, 50


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of the pushed cart by rk4, unpacked, with a binary by FMPy, beside the code that it has."""
    place = tmp_path_factory.mktemp("fmu")
    (place / "pushed.yaml").write_text(PUSHED, encoding="utf-8")
    for file, text in exported("pushed rk4")[0].items():
        (place / "made" / file).parent.mkdir(parents=True, exist_ok=True)
        (place / "made" / file).write_text(text, encoding="utf-8")
    call = [sys.executable, str(SCRIPT), *(str(place / name) for name in ("pushed.yaml", "made", "pushed.fmu"))]
    said = subprocess.run(call, check=True, capture_output=True, text=True, env={**os.environ, "CUTJOINT_FLAGS": "-O0"}).stdout
    assert said.startswith("1 parameters, 1 inputs, 5 outputs in ")
    assert validate_fmu(str(place / "pushed.fmu")) == []
    fmpy.extract(str(place / "pushed.fmu"), str(place / "unpacked"))
    build_platform_binary(place / "unpacked", configuration="Release" if is_generated() else "Debug")  # the bits of both are one
    return place


def pushes() -> NDArray[np.void]:
    """A force that changes at each communication point."""
    return np.array([(k * SIZE, 3.0 * (-1) ** k + k) for k in range(SAMPLES)], dtype=[("time", float), ("push", float)])


def simulated(fmu: Path) -> NDArray[np.float64]:
    run = fmpy.simulate_fmu(
        str(fmu), stop_time=SAMPLES * SIZE, output_interval=SIZE, input=pushes(), start_values={"stiffness": 700.0},
        fmi_type="CoSimulation", output=["cart.x", "cart.vx", "bob.z", "bob.vy", "spring.force"],
    )  # fmt: skip
    return np.array(run.tolist())


def test_a_binary_by_fmpy_has_the_bits_of_the_code(built: Path) -> None:
    made = built / "made"
    subprocess.run(["gcc", *C, "-O1", "-ffp-contract=off", "-fPIC", "-shared", "pushed.c", "-lm", "-o", "made.so"], cwd=made, check=True)
    code = Code(made / "made.so", "pushed", (made / "pushed.h").read_text(encoding="utf-8"))
    assert code.call("set_parameter", 0, 700.0) == code.call("set_input", 0, 3.0, 0.0, 0.0) == code.call("start") == 0
    rows = [code.row()[:6]]
    for k in range(SAMPLES):
        assert code.call("set_input", 0, float(pushes()[k][1]), 0.0, 0.0) == 0
        assert [code.call("step") for _ in range(10)] == [0] * 10
        rows.append(code.row()[:6])
    run = simulated(built / "unpacked")
    assert len(run) == len(rows) == SAMPLES + 1
    assert np.ptp(run[:, 1]) > 1e-2
    assert run[:, 0] == pytest.approx(np.array(rows)[:, 0], abs=1e-12)
    assert (run[:, 1:] == np.array(rows)[:, 1:]).all()


@pytest.mark.heavy
def test_its_outputs_are_those_of_the_fmu_in_cpp(built: Path, tmp_path: Path) -> None:
    fmu = make_fmu(*find_case(read_model_text(PUSHED, "pushed.yaml"), None), version=3, integrator="rk4")
    (tmp_path / "cpp.fmu").write_bytes(fmu.pack(sources=False, binary=True))
    own, cpp = simulated(built / "unpacked"), simulated(tmp_path / "cpp.fmu")
    assert own == pytest.approx(cpp, rel=1e-10, abs=1e-10)


def test_all_functions_of_fmi_are_there(built: Path) -> None:
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3FunctionTypes.h").read_text(encoding="utf-8")
    wanted = set(re.findall(r"\b(fmi3\w+)TYPE\b", header))
    (binary,) = (built / "unpacked" / "binaries").rglob("*.so")
    said = subprocess.run(["nm", "-D", "--defined-only", binary], check=True, capture_output=True, text=True).stdout
    assert len(wanted) > 60
    assert wanted <= {line.split()[-1] for line in said.splitlines()}


def test_single_precision_is_refused(tmp_path: Path) -> None:
    """Its outputs are floats, which the wrapper would read as doubles."""
    (tmp_path / "pushed.h").write_text(exported("pushed rk4")[0]["pushed.h"].replace("double*", "float*"), encoding="utf-8")
    call = [sys.executable, str(SCRIPT), "pushed.yaml", ".", "pushed.fmu"]
    refused = subprocess.run(call, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert (refused.returncode, list(tmp_path.glob("*.fmu"))) == (1, [])
    assert refused.stderr == "pushed.h: has numbers of single precision, an FMU has doubles; compile without --precision single\n"


def slave(built: Path, said: list[str]) -> Any:
    description = fmpy.read_model_description(str(built / "unpacked"))
    made = FMU3Slave(
        guid=description.guid, unzipDirectory=str(built / "unpacked"), modelIdentifier="pushed", instanceName="one",
    )  # fmt: skip
    made.instantiate(logMessage=lambda _, status, category, message: said.append(message.decode()))
    return made


def test_wrong_calls_are_refused_and_change_nothing(built: Path) -> None:
    said: list[str] = []
    x = slave(built, said)
    wrong = [lambda: x.getFloat64([3]), lambda: x.doStep(0.0, SIZE), lambda: x.setFloat64([1], [np.nan]), lambda: x.setFloat64([4], [0.0])]
    texts = ["outputs have no values", "in a mode that does not allow it", "not finite", "no parameter and no input"]
    for call, text in zip(wrong, texts, strict=True):
        with pytest.raises(FMICallException):
            call()
        assert text in said.pop()
    x.enterInitializationMode()
    before = x.getFloat64([1, 2, 3, 5])
    x.exitInitializationMode()
    for point, size in ((0.0, 1.5 * STEP), (0.5, STEP), (0.0, 0.0), (0.0, -STEP), (0.0, np.nan)):
        with pytest.raises(FMICallException):
            x.doStep(point, size)
        assert "is no multiple of fixedInternalStepSize" in said.pop()
    assert x.getFloat64([0, 1, 2, 3, 5]) == [0.0, *before]
    x.doStep(0.0, 3 * STEP)
    assert x.getFloat64([0])[0] == pytest.approx(3 * STEP)
    with pytest.raises(FMICallException):
        x.getFMUState()
    x.reset()
    x.enterInitializationMode()
    assert x.getFloat64([0, 1, 2, 3, 5]) == [0.0, *before]
    x.freeInstance()
