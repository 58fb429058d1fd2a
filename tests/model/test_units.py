"""Units that are known without pint are what pint says."""

import math
from random import Random
from typing import Any

import pint
import pytest

from cutjoint.commands.options import read_parameters
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions import units
from cutjoint.model.expressions.units import UnitError, measure
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import parameter_values

REGISTRY: Any = pint.UnitRegistry()
NAMES = (
    "kg", "g", "t", "m", "km", "dm", "cm", "mm", "s", "ms", "min", "h", "Hz", "N", "kN", "MN", "J", "kJ", "W", "kW", "Pa", "kPa", "MPa",
    "bar", "rad", "mrad", "deg",
)  # fmt: skip


COMPOSED = ("N/m", "kN/mm", "N*s/m", "N s/m", "kN*s/m", "N*m/deg", "deg/s", "rad/s^2", "kg*m^2", "kg*mm**2", "1/s")


@pytest.mark.parametrize("unit", NAMES + COMPOSED)
def test_common_units_have_the_bits_of_pint(unit: str) -> None:
    for value in (1.0, 30.0, -0.1, 1 / 3):
        expected = REGISTRY.Quantity(value, unit).to_base_units()
        assert measure(value, unit).value == float(expected.magnitude)


def test_products_and_powers_of_common_units_are_those_of_pint() -> None:
    random = Random(1)
    for _ in range(1000):
        first, *others = random.choices(NAMES, k=random.choice((1, 2, 3)))
        text = first + random.choice(("", "^2", "**3", "^-1"))
        text += "".join(random.choice(("*", "/", " ", " / ")) + x + random.choice(("", "^2", "^-1")) for x in others)
        value, expected = measure(2.5, text), REGISTRY.Quantity(2.5, text).to_base_units()
        assert math.isclose(value.value, expected.magnitude, rel_tol=2e-15)  # pint's powers of powers of ten are a little off
        assert value.dimension == units._dimension(expected)


@pytest.mark.parametrize("unit", ["MN^99*MN^99", "kN^99*kN^10"])
def test_a_size_without_a_float_is_out_of_range(unit: str) -> None:
    with pytest.raises(UnitError, match="out of range"):
        measure(1.0, unit)


@pytest.mark.parametrize(("written", "meant"), [("Nm", "N*m"), ("kNm", "kN*m"), ("mNm/deg", "N*mm/deg"), ("Nm/A", "N*m/A"),
                                                ("Nms", "N*m*s"), ("kNms/rad", "kN*m*s/rad")])  # fmt: skip
def test_a_newton_metre_may_be_written_in_one_word(written: str, meant: str) -> None:
    """Pint's own Nm is a unit of yarns: 1000 m/kg."""
    found, expected = measure(3.0, written), measure(3.0, meant)
    assert math.isclose(found.value, expected.value, rel_tol=1e-15)
    assert found.dimension == expected.dimension


CART = """
cutjoint: 1
name: cart
gravity: [0, 0, 0]
parameters:
  k: {value: 100, unit: N/m}
  c: {value: 5, unit: N*s/m}
  rest: {value: 20, unit: mm}
  level: {value: 3, unit: m}
bodies:
  a: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  slide: {kind: cylindrical, bodies: [ground, a], at: [0, 0, 0], axis: x}
forces:
  spring: {kind: joint_force, joint: slide, coordinate: displacement, law: "-c*rate"}
scenes:
  run: {end: 1, output_step: 0.1}
"""


@pytest.mark.parametrize(("law", "got"), [
    ("-k*rate", "needs N, got kg*m/s^3"), ("-c*rate - k*position", ""), ("-100*rate - position", ""), ("-k*(position - rest)", ""),
    ("-c*rate + level", "N and m cannot be added"), ("-c*position", "needs N, got kg*m/s"), ("-c*rate*tanh(rate/0.1)", ""),
    ("where(position > rest, -k*rate, k*rest)", "cannot be added"), ("-c*rate - k*(rate - rest)", "m/s and m cannot be added"),
    ("-rate", ""),
])  # fmt: skip
def test_laws_have_the_dimensions_of_their_variables_beside_units(law: str, got: str) -> None:
    """Bare numbers fit everywhere; beside a parameter with a unit a variable has its own."""
    text = CART.replace("-c*rate", law)
    notes = [note for note in read_model_text(text, "m.yaml").notes if "force 'spring'" in note]
    if not got:
        assert notes == []
        return
    (note,) = notes
    assert note.startswith(f"m.yaml:{text[:text.index(law)].count(chr(10)) + 1}:")
    assert got in note


@pytest.mark.parametrize(("rate", "radians"), [("60 Hz", None), ("1 kHz", None), ("60 turn/s", 120 * math.pi), ("60 rpm", 2 * math.pi),
                                               ("60 rad/s", 60.0), ("60 1/s", 60.0)])  # fmt: skip
def test_hertz_are_no_angular_speed(rate: str, radians: float | None) -> None:
    text = CART.replace("output_step: 0.1", f"output_step: 0.1, rates: {{slide.angle_rate: {rate}}}")
    if radians is not None:
        assert float(read_model_text(text, "m.yaml").scenes["run"].rates["slide.angle_rate"]) == pytest.approx(radians, rel=1e-15)
        return
    with pytest.raises(ModelError, match=r"m.yaml:17:\d+: scene 'run': rates: 'slide.angle_rate': Hz leaves open whether"):
        read_model_text(text, "m.yaml")


@pytest.mark.parametrize(("added", "place"), [
    ("rates: {slide.angle_rate: spin}", r"17:\d+: scene 'run': rates: 'slide.angle_rate': the parameter 'spin'"),
    ("trim: {find: [slide.angle_rate], hold: {slide.angle_rate: 5 Hz}}", r"17:\d+: scene 'run': trim: 'slide.angle_rate'"),
    ("trim: {find: [slide.angle_rate], bounds: {slide.angle_rate: [0, 5 Hz]}}", r"17:\d+: scene 'run': trim: 'slide.angle_rate'"),
    ("outputs: [{turning: {value: a.wx, unit: Hz}}]", r"17:\d+: output 'turning'"),
    ("rates: {slide.angle_rate: 2*pi*spin}, outputs: [{turning: {value: a.wx/(2*pi), unit: Hz}}]", None),
])  # fmt: skip
def test_hertz_beside_an_angular_speed(added: str, place: str | None) -> None:
    text = CART.replace("output_step: 0.1", f"output_step: 0.1, {added}")
    text = text.replace("  level:", "  spin: {value: 60, unit: Hz, binding: param}\n  level:")
    if place is None:
        assert read_model_text(text, "m.yaml").scenes["run"].rates["slide.angle_rate"].free_symbols
        return
    with pytest.raises(ModelError, match=rf"m.yaml:{place.replace('17', '18')}: Hz leaves open whether"):
        read_model_text(text, "m.yaml")


@pytest.mark.parametrize(("unit", "typed", "fault"), [
    ("rad/s", "60Hz", "Hz leaves open"), ("Hz", "600rpm", "'600rpm' counts angles; write Hz"), ("1/s", "60Hz", None),
    ("Hz", "60 1/s", None), ("rad/s", "60rpm", None),
])  # fmt: skip
def test_hertz_that_are_typed(unit: str, typed: str, fault: str | None) -> None:
    """For a parameter in a unit, and a rate of the file as a parameter."""
    text = CART.replace("  level:", f"  spin: {{value: 1, unit: {unit}, binding: param}}\n  level:")
    text = text.replace("output_step: 0.1", "output_step: 0.1, rates: {slide.angle_rate: 3}")
    model, (value,) = read_model_text(text, "m.yaml", tunable=["run.rates.*"]), read_parameters((f"spin={typed}",)).values()
    for name in ("spin", *(["run.rates.slide.angle_rate"] if unit == "rad/s" else [])):
        if fault is None:
            assert parameter_values(model, {name: value})[name] == value
            continue
        with pytest.raises(RunError, match=f"parameter '{name}' is in {unit}: {fault}"):
            parameter_values(model, {name: value})


def test_the_time_beside_a_unit_is_the_tonne() -> None:
    """`2 rad/s*t` was said to be in N*s/m, without a reason."""
    text = """
cutjoint: 1
name: crank
gravity: [0, 0, 0]
bodies: {crank: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: z, guide: "2 rad/s * t"}}
outputs: [pin.angle]
scenes: {turn: {end: 1}}
"""
    with pytest.raises(ModelError, match="got N\\*s/m; beside a unit 't' is the tonne: write the law in SI numbers"):
        read_model_text(text, "crank.yaml")
