"""Directions that depend on parameters: constants are known, what stays open is refused where other directions are derived from it."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.topology.build import build_topology

TEXT = """\
cutjoint: 1
name: leaning
gravity: [0, 0, -9.81]
parameters: {lean: {value: 0.3, binding: BINDING}}
bodies: {plate: {mass: 1, centre_of_mass: [0.2, 0, 0], inertia: [1, 1, 1]}}
joints:
  slide: {kind: planar, bodies: [ground, plate], at: [0, 0, 0], axis: [0, sin(lean), cos(lean)]}
scenes: {run: {end: 1}}
"""
ROD = TEXT.replace("planar", "distance").replace("axis: [0, sin(lean), cos(lean)]", "to: [lean, 0, 1], cut: false")
FLIGHT = "  flight: {kind: free, bodies: [ground, plate], at: [0, 0, 0]}"
CUT = TEXT.replace("planar", "cylindrical").replace("cos(lean)]}", f"cos(lean)], cut: true}}\n{FLIGHT}")


def model(text: str, binding: str) -> Model:
    return read_model_text(text.replace("BINDING", binding), "m.yaml")


@pytest.mark.parametrize("text", [TEXT, ROD, CUT], ids=["planar", "distance", "cut"])
def test_constants_are_known(text: str) -> None:
    found = model(text, "const")
    assert formulate_recursive(build_topology(found), found.scenes["run"], ()).functions
    axes = found.joints[0].axes
    assert not any(component.free_symbols for axis in axes for component in axis)
    if axes:
        np.testing.assert_allclose(np.array(axes[0], dtype=float), [0, np.sin(0.3), np.cos(0.3)], rtol=1e-15)


@pytest.mark.parametrize(("text", "kind"), [(TEXT, "planar"), (ROD, "distance"), (CUT, "cylindrical")], ids=["planar", "distance", "cut"])
def test_open_parameters_are_refused_with_the_joints_place(text: str, kind: str) -> None:
    found = model(text, "param")
    with pytest.raises(ModelError) as caught:
        formulate_recursive(build_topology(found), found.scenes["run"], ())
    assert str(caught.value) == (
        f"m.yaml:7:3: joint 'slide': the direction of this {kind} joint depends on the tunable parameter 'lean', but needs two others "
        "across it; give the parameter binding: const"
    )


def test_other_axes_may_stay_open() -> None:
    found = model(TEXT.replace("planar", "revolute"), "param")
    assert formulate_recursive(build_topology(found), found.scenes["run"], ()).functions
