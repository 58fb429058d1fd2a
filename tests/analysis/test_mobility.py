"""Ranks that are known otherwise."""

from __future__ import annotations

import pytest

from cutjoint.analysis.mobility import Mobility, find_mobility
from cutjoint.formulate.recursive import formulate_recursive
from cutjoint.model.read import read_model_text
from cutjoint.pipeline import find_scene
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text


def mobility(text: str) -> Mobility:
    model = read_model_text(text, "model.yaml")
    scene = find_scene(model, next(iter(model.scenes)))
    return find_mobility(formulate_recursive(build_topology(model), scene, ()))


def test_iltis_has_10_degrees_of_freedom() -> None:
    """42 coordinates, 36 equations of which each revolute cut has one too many (Cuadrado et al. 2000)."""
    found = mobility((MODELS / "iltis.yaml").read_text())
    assert (found.speeds, found.equations, found.rank, found.degrees_of_freedom) == (42, 36, 32, 10)


@pytest.mark.parametrize("windows", [1, 2, 10])
def test_the_n_four_bar_has_one_degree_of_freedom(windows: int) -> None:
    """Planar: 2N + 1 angles, 2N independent closures among 6N equations in space."""
    found = mobility(four_bar_text(windows))
    assert (found.speeds, found.equations, found.rank) == (2 * windows + 1, 6 * windows, 2 * windows)
