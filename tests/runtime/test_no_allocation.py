"""No allocation in a step."""

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

Check = Callable[..., None]


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Check:
    """Checks that the steps of a run without rows between its ends take no memory."""
    library, counts = tmp_path / "count.so", tmp_path / "counts"
    source = Path(__file__).with_name("count_allocations.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O1", source, "-o", library], check=True)

    def check_run(artifact: Artifact, end: float, **how: str | float) -> None:
        with monkeypatch.context() as preloaded:
            preloaded.setenv("LD_PRELOAD", str(library))
            preloaded.setenv("ALLOCATIONS", str(counts))
            run = completed(simulate(replace(artifact, scene=replace(artifact.scene, output_step=end)), end=end, **how))  # type: ignore[arg-type]
        taken, in_steps, looks = map(int, counts.read_text().split())
        assert run.steps >= 100
        assert (taken > 100, looks) == (True, 2)  # the counter works, and has seen where the steps begin and end
        assert in_steps == 0

    return check_run


RECURSIVE = [{}, {"integrator": "rk4"}, {"integrator": "dormand-prince", "tolerance": 1e-10}]
NEWTON = [{}, *({"integrator": integrator, "tolerance": 1e-8} for integrator in IMPLICIT)]


@pytest.mark.parametrize(
    ("method", "how"),
    [*(("recursive", how) for how in RECURSIVE), *(("recursive-newton", how) for how in NEWTON), ("augmented", {}), ("classical", {})],
)
def test_steps_do_not_allocate(method: str, how: dict[str, str | float], check: Check) -> None:
    check(compile_model(MODELS / "slider_crank.yaml", method=method), 1.0, **how)


def test_projected_steps_do_not_allocate(check: Check) -> None:
    model = read_model_text((MODELS / "four_bar.yaml").read_text(encoding="utf-8"), "four_bar.yaml")
    check(compile_scene(model, with_closure(find_scene(model, None), "proximal")), 1.0)


@pytest.mark.parametrize(
    ("integrator", "method"),
    [
        ("rk4", "recursive"), ("dormand-prince", "recursive"), ("trapezoidal", "recursive"),
        *((name, "recursive-newton") for name in ("trapezoidal", *IMPLICIT)),
    ],
)  # fmt: skip
def test_events_do_not_allocate(integrator: str, method: str, check: Check) -> None:
    model = read_model_text(bouncing_text(0.0, 0.5), "bounce.yaml")
    check(compile_scene(model, find_scene(model, None), method=method), 5.0, integrator=integrator, tolerance=1e-8, events="located")
