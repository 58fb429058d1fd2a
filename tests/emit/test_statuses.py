"""Statuses of exports: numbered as the core numbers its causes, and in a header only those that its method can return."""

from __future__ import annotations

import re

import pytest

from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.statuses import FAULTS, LIMITED, STATUSES
from cutjoint.model.read import read_model
from cutjoint.package.locations import runtime_folder
from tests.conftest import MODELS


def _core(header: str) -> str:
    return (runtime_folder() / "include" / header).read_text(encoding="utf-8")


def test_statuses_are_those_of_the_core() -> None:
    """The table has each cause of the core by its number, and the limits in the order of the core."""
    causes = _core(FAULTS).partition("enum class Cause : int {")[2].partition("}")[0]
    assert "=" not in causes
    numbers = {name: number for number, name in enumerate(re.findall(r"\w+", causes))}
    assert numbers == {"none": 0, **{cause: status.number for cause, status in STATUSES.items()}}
    limits = _core("cutjoint/core/stepping/step_statistics.hpp").partition("limit_names[] = {")[2].partition("}")[0]
    assert tuple(re.findall(r"\w+", limits)) == LIMITED


@pytest.mark.parametrize(("method", "integrator", "some", "others"), [
    ("recursive", "trapezoidal", {"NOT_CONVERGED", "NO_ASSEMBLY"}, {"NEWTON_DIVERGING", "TANGENT_SINGULAR", "STIFF", "SPEEDS_JUMP"}),
    ("recursive", "dormand-prince", {"STIFF", "CHATTERING"}, {"TANGENT_SINGULAR", "NEWTON_DIVERGING", "STAGES_NOT_FOUND"}),
    ("recursive-newton", "radau5", {"STAGES_NOT_FOUND", "TANGENT_SINGULAR"}, {"STIFF", "SPEEDS_JUMP"}),
])  # fmt: skip
def test_header_has_statuses_of_its_method(method: str, integrator: str, some: set[str], others: set[str]) -> None:
    """A header names what its code can return, and nothing that only others return."""
    model = read_model(MODELS / "press.yaml")
    scene = next(iter(model.scenes.values()))
    files = make_standalone(generate(model, scene, scene.outputs, method=method), integrator=integrator).files
    offered = dict(re.findall(r"  PRESS_(\w+) = (\d+), /\*", files["press.h"]))
    assert some <= offered.keys()
    assert not others & offered.keys()
    returned = set(re.findall(r"(?:\(|[^=!]= |[?:] )Cause::(\w+)", files["press.cpp"])) - {"none"}
    assert {cause.upper() for cause in returned} <= offered.keys()
