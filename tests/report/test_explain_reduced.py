"""Explanations of reduced models: what passes did, guards, sensors of rods, columns that stand for others; no export of them."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.reduce.guards import guard_forces
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.sequence import reduction_sequence
from cutjoint.report.explain.document import explain
from cutjoint_bench.export.mechanism import build_mechanism
from tests.conftest import MODELS
from tests.reduce.test_guards import TEXT as HAMMER
from tests.reduce.test_passes import SPATIAL, WELDED


def line_of(text: str, words: str) -> int:
    return next(i for i, line in enumerate(text.splitlines(), 1) if words in line)


@pytest.mark.parametrize("method", METHODS)
def test_guards(method: str) -> None:
    model = read_model_text(HAMMER, "hammer.yaml")
    outcome = guard_forces(model, model.scenes["swing"])
    text = explain(outcome.model, outcome.scene, method, done=outcome.done)
    assert "### Reduced model" in text
    assert f"| `wall` | hammer.yaml:{line_of(HAMMER, 'wall: {')} | `3.3 - position` |" in text
    assert "is taken out, guarded by" in text


def test_sensors_of_rods() -> None:
    model = read_model_text(SPATIAL, "spatial.yaml")
    outcome = shorten_links(model, model.scenes["fall"])
    text = explain(outcome.model, outcome.scene, done=outcome.done)
    assert f"| `pull` | spatial.yaml:{line_of(SPATIAL, 'pull: {')} | 1 `rod` |" in text
    assert "`link_1` + " in text
    assert f"| `link` | spatial.yaml:{line_of(SPATIAL, 'link: {mass')} | becomes two distances that keep a point on a circle |" in text


def test_columns_that_stand_for_others() -> None:
    model = read_model_text(WELDED, "welded.yaml")
    variant = reduction_sequence(model, model.scenes["fall"])[-1]
    text = explain(variant.model, variant.scene, done=variant.done)
    assert "| `bob.roll` | 1 `rod.roll` |" in text


def test_a_model_as_its_file_has_it_says_nothing_of_passes() -> None:
    model = read_model_text(WELDED, "welded.yaml")
    assert "Reduced model" not in explain(model, model.scenes["fall"])


def test_the_command_explains_the_last_exact_model() -> None:
    done = CliRunner().invoke(main, ["explain", str(MODELS / "flyball.yaml"), "--reduced"])
    assert done.exit_code == 0, done.output
    assert "does not move: 'right.ball' becomes a part of 'right.rod'" in done.output


def test_reduced_models_are_not_exported() -> None:
    model = read_model_text(HAMMER, "hammer.yaml")
    outcome = guard_forces(model, model.scenes["swing"])
    with pytest.raises(RunError, match=r"hammer\.yaml: peers know neither guards nor .* of reduced models; export the full model"):
        build_mechanism(outcome.model, outcome.scene, {})
