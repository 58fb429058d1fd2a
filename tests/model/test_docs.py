"""The description of the format: its examples load, and it names all there is."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cutjoint.elements.force import Force
from cutjoint.elements.forces import FORCES
from cutjoint.model.document.model_file import json_schema
from cutjoint.model.document.values import MAX_COEFFICIENTS, MAX_GRID, MAX_TABLE
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.operations import FUNCTIONS
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES, QUANTITIES
from cutjoint.model.names import VARIABLES
from cutjoint.model.read import read_model, read_model_text
from tests.conftest import ROOT

from .pendulum import read, varied
from .test_instances import WING

PAGES = [(ROOT / "docs" / "reference" / f"{name}.md").read_text(encoding="utf-8") for name in ("model-file", "tyres-and-roads")]
TEXT = "\n".join(PAGES)
EXAMPLES = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
SPRING = "spring: {kind: point_spring, bodies: [ground, arm], from: [0, 0, 1], to: tip"
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'


def example(start: str) -> str:
    return next(text for text in EXAMPLES if text.startswith(start))


def test_the_first_example_is_a_model() -> None:
    model = read_model_text(EXAMPLES[0], "docs")
    assert [output.column for output in model.scenes["fall"].outputs] == ["hinge.angle", "arm.vz"]


def test_the_submodel_example_makes_two_wheels() -> None:
    head = "cutjoint: 1\nname: car\ngravity: [0, 0, -9.81]\nbodies: {chassis: {massless: true}}\n"
    joint = "joints: {base: {kind: free, bodies: [ground, chassis], at: [0, 0, 0]}}\n"
    model = read_model_text(head + joint + example("submodels:"), "docs")
    assert [body.name for body in model.bodies] == ["chassis", "left.wheel", "right.wheel"]


def test_the_parameter_and_point_examples_load() -> None:
    old = "  arm_mass: {value: 2, unit: kg, binding: param}\n"
    lines = example("parameters:").splitlines()[1:]
    assert len(read(old, old + "\n".join(line for line in lines if "arm_length:" not in line) + "\n").parameters) == 6
    lines = example("points:").splitlines()[1:]
    assert read("  tip: [arm_length, 0, 0]", "  tip: [0, 0, 0]\n" + "\n".join(lines)).bodies


def test_the_shapes_example_loads() -> None:
    shapes = example("shapes:").replace("\n", "\n    ")
    old = "arm: {mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]}"
    text = varied(old, f"arm:\n    {shapes}")
    points = "  tip: [arm_length, 0, 0]\n"
    assert read_model_text(varied(points, points + "  A: [0, 0, 1]\n  B: [1, 0, 0]\n  C: [0, 1, 0]\n", text), "docs").bodies


@pytest.mark.parametrize("line", example("law:").splitlines())
def test_the_examples_of_laws_load(line: str) -> None:
    law = line.removeprefix("law: ").split("  #")[0]
    if "position" in law:
        assert read('"-0.1*rate"', law).forces[0].law
    else:
        assert read(DRAG, f"{SPRING}, law: {law}}}").forces[0].law


def test_the_examples_of_files_load(tmp_path: Path) -> None:
    table = re.findall(r"```csv\n(.*?)```", TEXT, re.DOTALL)[0]
    law, points = (line.split("  #")[0] for line in example("law: {table: {file").splitlines())
    text = varied("points:\n  tip: [arm_length, 0, 0]", points.replace("}}", "}, tip: C}"))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "dampers.csv").write_text(table)
    (tmp_path / "hardpoints.csv").write_text("name, x, y, z [mm]\nA, 1, 0, 0\nB, 2, 0, 500\n")
    (tmp_path / "m.yaml").write_text(varied(DRAG, SPRING + f", {law}}}", text))
    model = read_model(tmp_path / "m.yaml")
    assert evaluate(model.forces[0].law, {variable("rate"): 0.5}) == pytest.approx(2350)
    assert tuple(map(float, model.markers[0].point)) == (1.5, 0, 0.25)


def test_the_road_example_loads() -> None:
    road = example("road:").replace("\n", "\n    ")
    assert len(read("fall: {end: 2}", f"fall:\n    end: 2\n    {road}").scenes["fall"].road.right) == 4


#: A force of every kind, and a load of either form.
EVERY_FORCE = (*read_model_text(WING, "m.yaml").forces, *read(DRAG, DRAG).forces)


def reported(force: Force) -> list[str]:
    """Quantities of a force as the table of outputs writes them: names, then their unit."""
    units = list(dict.fromkeys(force.quantities.values()))
    names = {unit: " ".join(name for name, own in force.quantities.items() if own == unit) for unit in units}
    return [f"{names[unit]} ({unit.replace('*', ' ')})" for unit in units]


@pytest.mark.parametrize("force", EVERY_FORCE, ids=lambda force: force.name)
def test_the_table_of_outputs_is_the_catalogue(force: Force) -> None:
    row = next(line for line in TEXT.splitlines() if line.startswith(f"| {force.element.kind} |"))
    cells = force.quantities if force.joint_of else reported(force)  # a joint's slopes have the units of its coordinate
    assert all(cell in row for cell in cells), cells


def test_a_force_of_every_kind_is_looked_at() -> None:
    assert {force.element.kind for force in EVERY_FORCE} == set(FORCES)


def test_everything_is_named() -> None:
    words = set(re.findall(r"[A-Za-z_0-9]+", TEXT))
    of_forces = (force.quantities for force in EVERY_FORCE)
    quantities = {name for names in (*QUANTITIES.values(), *JOINT_QUANTITIES.values(), *of_forces) for name in names}
    schema = json.loads(json_schema())
    fields = {name for part in (schema, *schema["$defs"].values()) for name in part["properties"]}
    assert fields <= words
    assert quantities | set(JOINT_QUANTITIES) | set(FUNCTIONS) | set(VARIABLES) <= words
    assert f"at most {MAX_COEFFICIENTS}" in TEXT
    assert f"at most {MAX_TABLE} points" in TEXT
    assert f"at most {MAX_GRID} points" in TEXT
