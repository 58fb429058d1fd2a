"""Directions by the names of axes, and parameters with the names of laws' variables."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.names import VARIABLES
from cutjoint.model.records import Model
from cutjoint.topology.reading import read_model_text
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_model, simulate

#: A model with every field that is a direction.
MODEL = """
cutjoint: 1
name: axes
gravity: [0, 0, -9.81]
points: {{P: {{sum: [[1, 0, 0], {{along: {y}, by: 0.5}}]}}}}
bodies:
  arm: {{mass: 1, centre_of_mass: P, inertia: {{principal: [1, 2, 2], x: {x}, y: any}}}}
  hand: {{mass: 1, centre_of_mass: P, inertia: {{matrix: [1, 2, 2.5], x: {x}, z: {z}}}}}
  shaft: {{massless: true, inertia: {{axial: 0.1, axis: {y}}}}}
  block: {{shapes: [{{box: [1, 2, 3], mass: 2, at: P, x: {y}, y: {x}}}, {{cylinder: {{radius: 1, length: 2}}, mass: 1, at: P, axis: {z}}}]}}
joints:
  hinge: {{kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: {y}}}
  cross: {{kind: universal, bodies: [arm, hand], at: P, axis: {x}, axis_2: {z}}}
  spin: {{kind: revolute, bodies: [hand, shaft], at: P, axis: {y}}}
  slide: {{kind: prismatic, bodies: [hand, block], at: P, axis: {z}}}
forces:
  push: {{kind: axial_force, bodies: [ground, arm], origin: [0, 0, 0], point: P, axis: {x}, law: 3}}
  mount: {{kind: bushing, bodies: [arm, hand], at: P, x: {y}, z: {z}, stiffness: [1, 2, 3, 1, 2, 3], damping: [0, 0, 0, 0, 0, 0]}}
reactions:
  felt: {{joint: hinge, axes_of: arm, direction: {z}}}
scenes: {{run: {{end: 1}}}}
"""

VECTORS = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}
OPPOSITE = {"x": "[-1, 0, 0]", "y": "[0, -1, 0]", "z": "[0, 0, -1]"}


def read(**axes: str) -> Model:
    return read_model_text(MODEL.format(**axes), "axes.yaml")


@pytest.mark.parametrize(("names", "vectors"), [
    ({"x": "x", "y": "y", "z": "z"}, VECTORS), ({"x": "-x", "y": "'-y'", "z": "-z"}, OPPOSITE),
])  # fmt: skip
def test_a_named_axis_is_its_vector(names: dict[str, str], vectors: dict[str, str]) -> None:
    named, written = read(**names), read(**vectors)
    for section in ("bodies", "joints", "forces", "reactions"):
        for one, other in zip(getattr(named, section), getattr(written, section), strict=True):
            parts = [{k: v for k, v in vars(element).items() if k != "span"} for element in (one, other)]
            assert parts[0] == parts[1]


#: An arm on a spring with five parameters.
ARM = """
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters:
  {0}: {{value: 0.6, unit: m, binding: param}}
  {1}: {{value: 40, binding: param}}
  {2}: 0.1
  {3}: {{value: 0.2, binding: input}}
  {4}: {0}/2
bodies:
  rod: {{mass: 1 + {2}, centre_of_mass: [{4}, 0, 0], inertia: [0.01, 0.1, 0.1]}}
joints:
  hinge: {{kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: y}}
forces:
  coil: {{kind: joint_force, joint: hinge, law: "-{1}*{2}*position - {2}*rate"}}
  wind: {{kind: load, body: rod, at: [{0}, 0, 0], force: [{3}, 0, "-{3}*vx"]}}
outputs: [hinge.angle]
scenes: {{run: {{end: 0.5, output_step: 0.1, inputs: {{{3}: "sin(t) + {2}"}}}}}}
"""

PLAIN = ("a", "b", "c", "d", "e")


#: Names of the five parameters, and what the laws have in place of their variables of these names.
FREE = [
    (("x", "length", "z", "travel", "y"), {}), (("vy", "wx", "wy", "length", "wz"), {}),
    (("vx", "vz", "wx", "rate", "position"), {"*position": "", "*rate": "", "*vx": "*vy"}),
]  # fmt: skip


@needs_cpp
@pytest.mark.parametrize(("names", "instead"), FREE)
def test_parameters_may_have_the_names_of_variables(names: tuple[str, ...], instead: dict[str, str], tmp_path: Path) -> None:
    text, found = ARM, []
    for old, new in instead.items():
        text = text.replace(old, new)
    for i, given in enumerate((PLAIN, names)):
        file = tmp_path / f"arm_{i}.yaml"
        file.write_text(text.format(*given), encoding="utf-8")
        found.append(simulate(compile_model(file), parameters={given[1]: 50.0}, error=False)["hinge.angle"])
    assert found[0].tolist() == found[1].tolist()


def test_all_variables_but_the_time_are_free() -> None:
    assert {*chain.from_iterable(names for names, _ in FREE), "t"} == set(VARIABLES)


@pytest.mark.parametrize(("names", "place"), [
    (("a", "position", "c", "d", "e"), "force 'coil': law: "), (("rate", "b", "c", "d", "e"), "force 'coil': law: "),
    (("a", "b", "c", "vx", "e"), "force 'wind': force: "),
])  # fmt: skip
def test_a_law_with_a_variable_of_the_same_name_refuses_it(names: tuple[str, ...], place: str) -> None:
    with pytest.raises(ModelError) as raised:
        read_model_text(ARM.format(*names), "arm.yaml")
    name = next(name for name in names if name in VARIABLES)
    cure = f"call the parameter by another name, such as '{name}_0'"
    lines = [line.partition(": ")[2] for line in str(raised.value).splitlines()]
    assert set(lines) == {f"{place}'{name}' is a variable of this law and a parameter; {cure}"}
