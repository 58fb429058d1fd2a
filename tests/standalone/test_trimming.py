"""Trims that simulations solve themselves, for other numbers than those of the file: as the compiler finds them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from cutjoint import SimulationError, find_trim, load, read_model_text
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.stepping.simulation import Simulation
from tests.conftest import with_heavy
from tests.mechanisms.starts import CAR, LOADER, TRUCK
from tests.mechanisms.steady import HELICOPTER, HOOP, SIMPLE_MOTORCYCLE
from tests.mechanisms.trims import FIVE_BAR, MOTOR, OIL, SLED


def opened(text: str, **choices: str) -> Simulation:
    return load(read_model_text(text, "m.yaml"), **choices)


def as_compiled(sim: Simulation, text: str, parameters: Mapping[str, float], scene: str | None = None, within: float = 1e-11) -> None:
    """Whether the start of a simulation is what the compiler finds with the same parameters."""
    for name, value in parameters.items():
        sim.parameters[name] = value
    sim.reset()
    wanted = find_trim(read_model_text(text, "m.yaml"), scene=scene, parameters=parameters)
    of_sim = [sim.coordinates, sim.speeds, sim.inputs, sim.parameters]
    found = {name: float(values[name]) for values in of_sim for name in values}
    for name, value in {**wanted.coordinates, **wanted.rates, **wanted.states, **wanted.unknowns}.items():
        assert name not in found or np.isclose(found[name], value, rtol=within, atol=within), (name, found[name], value)


@pytest.mark.parametrize(
    ("text", "parameters"),
    with_heavy(
        [(MOTOR, {"length": 0.7}), (OIL, {"area": 15e-4, "load": 700.0}), (SLED, {"target": 25.0})],
        [(HOOP, {"speed": 5.3}), (LOADER, {"payload": 1600.0, "bore": 0.12}), (HELICOPTER, {"speed": 31.0}),
         (SIMPLE_MOTORCYCLE, {"lateral": 4.4}), (CAR, {"speed": 19.4, "lateral": 3.9}), (TRUCK, {"speed": 21.0})],
    ),
)  # fmt: skip
def test_other_parameters(text: str, parameters: Mapping[str, float]) -> None:
    scene = next(name for name, s in read_model_text(text, "m.yaml").scenes.items() if s.trim is not None)
    as_compiled(opened(text, scene=scene), text, parameters, scene)


@pytest.mark.heavy
def test_a_method_with_a_system() -> None:
    as_compiled(opened(SLED, method="recursive-newton"), SLED, {"target": 12.0})


def test_the_file_s_own_start_keeps_its_bits() -> None:
    """Also after another start: nothing is left of what was found then."""
    sim = opened(SLED)
    sim.reset()
    begun = sim.coordinates.array.copy(), sim.speeds.array.copy()
    sim.parameters["target"] = 30.0
    sim.reset()
    assert sim.speeds["way.displacement_rate"] == pytest.approx(30, rel=1e-12)
    sim.parameters["target"] = 20.0
    sim.reset()
    assert [x.tobytes() for x in begun] == [x.tobytes() for x in (sim.coordinates.array, sim.speeds.array)]
    assert np.isnan(sim.inputs["throttle"])  # it follows the scene again


def test_other_start_values() -> None:
    """A coordinate that the scene gives: a rod further out has the pressure of the same load, a pendulum less torque further up."""
    sim = opened(MOTOR)
    sim.reset(coordinates={"hinge.angle": 1.0})
    assert sim.coordinates["hinge.angle"] == 1.0
    assert sim.speeds["current.value"] == pytest.approx(-3 * 9.81 * 0.5 * np.cos(1.0) / 5, rel=1e-12)
    sim.reset()
    assert sim.speeds["current.value"] == pytest.approx(-3 * 9.81 * 0.5 * np.cos(np.pi / 6) / 5, rel=1e-12)


def test_what_the_host_sets_disturbs_what_is_found() -> None:
    """A sled that begins slower than its throttle drives it, of the file's target and of another; the next start is steady again."""
    sim = opened(SLED)
    for target, throttle in ((20.0, 280 / 900), (30.0, 630 / 900)):
        sim.parameters["target"] = target
        sim.reset(speeds={"way.displacement_rate": 12.0})
        assert sim.speeds["way.displacement_rate"] == 12.0
        assert sim.get_input("throttle") == pytest.approx(throttle, rel=1e-12)
        assert sim.accelerations["way.displacement_rate"] == pytest.approx((900 * throttle - 0.7 * 12**2) / 300, rel=1e-9)
    sim.reset()
    assert sim.speeds["way.displacement_rate"] == pytest.approx(30, rel=1e-12)


def test_bounds_that_what_is_found_would_leave() -> None:
    """A sled that shall be faster than its throttle allows does not start, and its parameters stay; the next start with others does."""
    sim = opened(SLED)
    sim.reset()
    sim.parameters["target"] = 90.0
    with pytest.raises(SimulationError, match=r"no start near that of the model file meets .*'throttle' \(m\.yaml:\d+"):
        sim.reset()
    assert sim.parameters["target"] == 90.0
    sim.parameters["target"] = 21.0
    sim.reset()
    assert sim.speeds["way.displacement_rate"] == pytest.approx(21, rel=1e-12)


def test_a_condition_that_nothing_meets_is_named() -> None:
    text = FIVE_BAR.replace("parameters:", "parameters:\n  wish: {value: 0, unit: m, binding: param}")
    sim = opened(text.replace("spring.length: 0.69 m", "spring.length - wish: 0.69 m"))
    sim.reset()
    sim.parameters["wish"] = 3.0
    with pytest.raises(SimulationError, match=r"spring\.length - wish.*m\.yaml:\d+"):
        sim.reset()


def test_only_trimmed_scenes_have_the_code() -> None:
    model = read_model_text(SLED.replace("scenes:", "scenes:\n  plain: {end: 1}"), "m.yaml")
    codes = {name: make_standalone(generate(model, model.scenes[name], (), trims=True)).files["sled.cpp"] for name in ("plain", "steady")}
    assert [name for name, code in codes.items() if "struct Trim {" in code and "::aims(" in code] == ["steady"]


@pytest.mark.heavy
def test_an_fmu_is_trimmed_for_its_parameters(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model = read_model_text(SLED, "m.yaml")
    fmu = make_fmu(model, model.scenes["steady"], version=3)
    (tmp_path / "sled.fmu").write_bytes(fmu.pack(sources=False, binary=True, target="baseline"))
    found = fmpy.simulate_fmu(str(tmp_path / "sled.fmu"), start_values={"target": 25.0}, output=["way.displacement_rate"], stop_time=0.5)
    assert found["way.displacement_rate"] == pytest.approx(25.0, rel=1e-9)
