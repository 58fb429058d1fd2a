"""Shares of the time of a wait: the symbolic half's phases; their source is that of the pipeline."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.read import read_model
from cutjoint_bench.studies.waits import symbolic_phases
from tests.conftest import MODELS


@pytest.mark.parametrize("method", ["recursive", "classical"])
def test_phases_make_what_the_pipeline_generates(method: str, tmp_path: Path) -> None:
    place = MODELS / "slider_crank.yaml"
    times = symbolic_phases(place, "turn", method, tmp_path)
    assert set(times) > {"import SymPy", "read the model", "printing"}
    assert all(seconds >= 0 for seconds in times.values())
    model = read_model(place)
    scene = model.scenes["turn"]
    _, _, source = generate(model, scene, scene.outputs, method=method)
    written = {str(file.relative_to(tmp_path)): file.read_text(encoding="utf-8") for file in tmp_path.rglob("*") if file.is_file()}
    assert written == source.files
