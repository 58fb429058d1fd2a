"""A joint kind of the tests alone: its record in the catalogue is all that units, checks, equations, exports and `explain` need."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.conftest import ROOT, needs_cpp
from tests.fuzz.press import environment

pytestmark = needs_cpp

#: A hinge whose angle is called ``turn``, and whose second axis has to lie across the first; registered before models are read.
KIND = """
from cutjoint.elements.joint import (
    ABOUT_AXIS, ON_LINE, Check, Direction, Fault, JointElement, JointField, Operations, Rotation, SameDirection, Translation,
)
from cutjoint.elements.joints import JOINTS

JOINTS["twister"] = JointElement(
    kind="twister", text="a turn about an axis, and a slide that is no displacement by its name",
    fields=(JointField("axis"), JointField("axis_2", check=Check("axis", Fault.NOT_PERPENDICULAR, "turn it"))),
    chain=(Translation("angle_of_nothing", Direction.AXIS), Rotation("turn", Direction.AXIS)),
    conditions=(ON_LINE, SameDirection(Direction.AXIS)),
    measures={"turn": ABOUT_AXIS},
    operations=Operations(placing=(70, 200), closing=(400, 700, 900)),
)
"""

MODEL = """
cutjoint: 1
name: twist
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 2, centre_of_mass: [0.5, 0.2, 0], inertia: [0.1, 0.2, 0.3, 0, 0, 0]}
joints:
  pin: {kind: twister, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 0, 1], axis_2: AXIS_2}
forces:
  coil: {kind: joint_force, joint: pin, coordinate: turn, law: {stiffness: 3 UNIT/rad, free_position: 0}}
  push: {kind: joint_force, joint: pin, coordinate: angle_of_nothing, law: {stiffness: 5 N/m, free_position: 0}}
scenes:
  still:
    end: 1
    output_step: 0.1
    outputs: [pin.turn, pin.turn_rate, coil.force, coil.stiffness, push.force, push.stiffness]
"""

READ = """
import json
from cutjoint.model.errors import ModelError
from cutjoint.topology.reading import read_model_text

def read(unit="N*m", across="[1, 0, 0]"):
    return read_model_text(MODEL.replace("UNIT", unit).replace("AXIS_2", across), "twist.yaml")

def problems(**how):
    try:
        read(**how)
    except ModelError as error:
        return [problem.message for problem in error.problems]
    return []

from cutjoint.compile.pipeline import generate
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.package.extensions import EXPORTERS
from cutjoint.report.explain.document import explain

model = read()
scene = model.scenes["still"]
print(json.dumps({
    "units": {o.column: unit_of(model, o) for o in scene.outputs},
    "wrong unit": problems(unit="N"),
    "wrong axes": problems(across="[1, 0, 1]"),
    "sources": {
        method: "coil" in "".join(generate(model, scene, scene.outputs, method=method)[2].files.values())
        for method in ("recursive", "recursive-newton", "augmented")
    },
    "page": explain(model, scene),
    "exudyn": "".join(EXPORTERS.load("exudyn").export(model, scene, {}, []).files.values()),
}))
"""


def answers(script: str) -> dict[str, Any]:
    """The object that a script prints as JSON, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment(), cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.fixture(scope="module")
def seen() -> dict[str, Any]:
    """The answers of a process in which the kind is registered before models are read."""
    return answers(f"{KIND}\nMODEL = {MODEL!r}\n{READ}")


def test_units_follow_from_the_chain_and_not_from_names(seen: dict[str, Any]) -> None:
    assert seen["units"] == {
        "pin.turn": "rad", "pin.turn_rate": "rad/s", "coil.force": "N*m", "coil.stiffness": "N*m/rad", "push.force": "N",
        "push.stiffness": "N/m",
    }  # fmt: skip


def test_a_law_in_the_wrong_unit_is_refused(seen: dict[str, Any]) -> None:
    assert seen["wrong unit"] == ["law.stiffness needs N*m, got N"]


def test_fields_are_checked_as_their_record_says(seen: dict[str, Any]) -> None:
    assert seen["wrong axes"] == ["axis and axis_2 are not perpendicular"]


def test_every_formulation_takes_the_kind(seen: dict[str, Any]) -> None:
    assert seen["sources"] == {"recursive": True, "recursive-newton": True, "augmented": True}


def test_explain_names_its_coordinates(seen: dict[str, Any]) -> None:
    (row,) = (line for line in seen["page"].splitlines() if "| twister |" in line)
    assert row.endswith("| `angle_of_nothing`, `turn` |")
    assert r"\cos \left(q_{\text{ pin },2}\right)" in seen["page"]


def test_exports_turn_where_the_coordinate_is_an_angle(seen: dict[str, Any]) -> None:
    coil, push = (line for line in seen["exudyn"].splitlines() if "mechanism.element(" in line)
    assert "turning(" in coil
    assert "sliding(" in push
