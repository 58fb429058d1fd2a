"""A force kind of the tests alone, whose points have names of their own: it is drawn by its interaction, without a line of the viewer."""

from __future__ import annotations

from typing import Any

import pytest

from tests.model.test_new_kind import answers

#: A strut between a head on the follower and a foot on the base; registered before models are read.
KIND = """
from dataclasses import dataclass
from cutjoint.elements.force import ForceElement, ForceField, Law, LawForce, Shape
from cutjoint.elements.interaction import Carrier, Point
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.forces import FORCES

LAW = Law({"length": "m", "rate": "m/s"}, "N")

@dataclass(frozen=True, kw_only=True)
class Strut(LawForce):
    element = ForceElement(
        kind="strut", text="a force between a foot and a head",
        fields=(
            ForceField("bodies", Shape.BODIES), ForceField("foot", Shape.POINT), ForceField("head", Shape.POINT),
            ForceField("law", Shape.LAW),
        ),
        interaction=LineForce(start=Point(Carrier.BASE, "foot"), end=Point(Carrier.FOLLOWER, "head")), laws=("law",), forms=(LAW,),
    )
    base: str
    follower: str
    foot: tuple
    head: tuple

    @classmethod
    def read(cls, reader):
        return cls(
            **reader.common(), foot=reader.point("foot"), head=reader.point("head"),
            law=reader.law("law", law=LAW),
        )

FORCES["strut"] = Strut
"""

MODEL = """
cutjoint: 1
name: propped
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 2, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.2, 0.3]}
joints:
  pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  prop: {kind: strut, bodies: [ground, arm], foot: [1, 0, -2], head: [1, 0, 0], law: {stiffness: 100, free_length: 2.5}}
scenes: {still: {end: 1, output_step: 0.1, outputs: [prop.force, prop.length]}}
"""

READ = """
import json
import numpy as np
from cutjoint.topology.reading import read_model_text
from cutjoint.view.forces import Arrows
from cutjoint.model.expressions.quantities import bodies_of
from cutjoint.view.drawing import draw
from cutjoint.view.sliders import make_sliders
from cutjoint.view.views import _placed, show_start

model = read_model_text(MODEL, "propped.yaml")
shown = show_start(model, model.scenes["still"], {})
placed = _placed(shown, shown.poses, shown.t)
columns = {("prop", "force"): np.array([-50.0])}
arrow, = Arrows(
    model=model, scene=placed.scene, numbers=placed.numbers, sizes=placed.sizes, poses=placed.poses, columns=columns,
    up=np.array([0.0, 0.0, 1.0]),
).all()
(spring,) = (node for node in draw(placed, shown.t).nodes if node.name == "prop")
print(json.dumps({
    "spring": [spring.translation[0].tolist(), spring.scale[0].tolist()],
    "arrow": [arrow.translation[0].tolist(), arrow.about["newton"]],
    "bodies": bodies_of(model)["prop"],
    "sliders": [other["name"] for other in shown.sliders.facts["others"]],
}))
"""


@pytest.fixture(scope="module")
def seen() -> dict[str, Any]:
    """The answers of a process in which the kind is registered before models are read."""
    return answers(f"{KIND}\nMODEL = {MODEL!r}\n{READ}")


def test_a_line_is_a_spring_between_its_points(seen: dict[str, Any]) -> None:
    place, scale = seen["spring"]
    assert place == pytest.approx([1, 0, -2])
    assert scale == pytest.approx([1, 1, 2])


def test_an_external_wrench_is_an_arrow_on_the_follower(seen: dict[str, Any]) -> None:
    place, newton = seen["arrow"]
    assert place == pytest.approx([1, 0, 0])
    assert newton == pytest.approx(50)


def test_it_belongs_to_its_bodies_and_follows_sliders(seen: dict[str, Any]) -> None:
    assert seen["bodies"] == ["arm"]
    assert seen["sliders"] == ["prop"]
