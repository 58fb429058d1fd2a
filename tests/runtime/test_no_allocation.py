"""No allocation in a step: a run of twice as many takes memory as often."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from cutjoint.methods import IMPLICIT
from cutjoint.model.read import read_model_text
from cutjoint.pipeline import Artifact, compile_model, compile_scene, simulate
from cutjoint.run.scenes import find_scene, with_closure
from tests.conftest import MODELS
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import completed

Counter = Callable[..., tuple[int, int]]


@pytest.fixture
def counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Counter:
    """Steps of a run without rows between its ends, and how often it takes memory."""
    library, counts = tmp_path / "count.so", tmp_path / "count"
    source = Path(__file__).with_name("count_allocations.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O1", source, "-o", library], check=True)

    def count(artifact: Artifact, end: float, **how: str | float) -> tuple[int, int]:
        with monkeypatch.context() as preloaded:
            preloaded.setenv("LD_PRELOAD", str(library))
            preloaded.setenv("ALLOCATIONS", str(counts))
            run = completed(simulate(replace(artifact, scene=replace(artifact.scene, output_step=end)), end=end, **how))  # type: ignore[arg-type]
        return run.steps, int(counts.read_text())

    return count


def check(counted: Counter, artifact: Artifact, end: float, **how: str | float) -> None:
    """The summary's numbers may take a longer text."""
    (few, at_start), (many, taken) = counted(artifact, end, **how), counted(artifact, 2 * end, **how)
    assert at_start > 100  # the counter works
    assert many >= few + 50
    assert taken <= at_start + 2


RECURSIVE = [{}, {"integrator": "rk4"}, {"integrator": "dormand-prince", "tolerance": 1e-10}]
NEWTON = [{}, *({"integrator": integrator, "tolerance": 1e-8} for integrator in IMPLICIT)]


@pytest.mark.parametrize(
    ("method", "how"),
    [*(("recursive", how) for how in RECURSIVE), *(("recursive-newton", how) for how in NEWTON), ("augmented", {}), ("classical", {})],
)
def test_steps_do_not_allocate(method: str, how: dict[str, str | float], counted: Counter) -> None:
    check(counted, compile_model(MODELS / "slider_crank.yaml", method=method), 1.0, **how)


def test_projected_steps_do_not_allocate(counted: Counter) -> None:
    model = read_model_text((MODELS / "four_bar.yaml").read_text(encoding="utf-8"), "four_bar.yaml")
    check(counted, compile_scene(model, with_closure(find_scene(model, None), "proximal")), 1.0)


@pytest.mark.parametrize("integrator", ["rk4", "dormand-prince"])
def test_events_do_not_allocate(integrator: str, counted: Counter) -> None:
    model = read_model_text(bouncing_text(0.0, 0.5), "bounce.yaml")
    check(counted, compile_scene(model, find_scene(model, None)), 5.0, integrator=integrator)
