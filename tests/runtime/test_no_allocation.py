"""No allocation in a step."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_model, compile_scene
from cutjoint.methods import INTEGRATORS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, with_heavy
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import completed

Count = Callable[..., tuple[int, Trajectory]]
Check = Callable[..., None]


@pytest.fixture
def count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Count:
    """Runs without rows between their ends, and counts how often their steps take memory."""
    library, counts = tmp_path / "count.so", tmp_path / "counts"
    source = Path(__file__).with_name("count_allocations.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O1", source, "-o", library], check=True)

    def count_run(artifact: Artifact, end: float, **how: str | float) -> tuple[int, Trajectory]:
        with monkeypatch.context() as preloaded:
            preloaded.setenv("LD_PRELOAD", str(library))
            preloaded.setenv("ALLOCATIONS", str(counts))
            sparse = replace(artifact, scene=replace(artifact.scene, output_step=end))
            run = completed(simulate(sparse, end=end, error=False, **how))  # type: ignore[arg-type]
        taken, in_steps, looks = map(int, counts.read_text().split())
        assert run.steps >= 100
        assert (taken > 100, looks) == (True, 2)  # the counter works, and has seen where the steps begin and end
        return in_steps, run

    return count_run


@pytest.fixture
def check(count: Count) -> Check:
    """Checks that the steps of a run take no memory."""

    def check_run(artifact: Artifact, end: float, **how: str | float) -> None:
        assert count(artifact, end, **how)[0] == 0

    return check_run


RECURSIVE = [{}, {"integrator": "rk4"}, {"integrator": "dormand-prince", "tolerance": 1e-10}, {"integrator": "dop853", "tolerance": 1e-12}]
IMPLICIT = [i.name for i in INTEGRATORS.values() if i.methods == ("recursive-newton",)]
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
        ("rk4", "recursive"), ("dormand-prince", "recursive"), ("dop853", "recursive"), ("trapezoidal", "recursive"),
        *((name, "recursive-newton") for name in ("trapezoidal", *IMPLICIT)),
    ],
)  # fmt: skip
def test_events_do_not_allocate(integrator: str, method: str, check: Check) -> None:
    model = read_model_text(bouncing_text(0.0, 0.5), "bounce.yaml")
    artifact = compile_scene(model, find_scene(model, None), CompileOptions(method=method))
    check(artifact, 7.0, integrator=integrator, tolerance=1e-8, events="located")


@cache
def vehicle(method: str, closure: str = "penalty") -> Artifact:
    """Four suspensions in lanes, tyres, a road of steps, bumpers; with the closure "proximal" no bumpers, as in test_proximal.py."""
    model = read_model(MODELS / "iltis.yaml")
    scene = find_scene(model, "simul1s" if closure == "penalty" else "simul1")
    return compile_scene(model, with_closure(scene, closure), CompileOptions(method=method))


LAGRANGIAN = [(method, "penalty", {"dt": 5e-3}) for method in ("augmented", "classical")]
VEHICLE = [
    ("recursive", "penalty", {"dt": 2.5e-3}),
    ("recursive", "penalty", {"dt": 2.5e-3, "iterations": 4}),
    ("recursive", "penalty", {"dt": 2.5e-3, "events": "located"}),
    ("recursive", "penalty", {"integrator": "rk4", "dt": 2.5e-3}),
    ("recursive", "penalty", {"integrator": "dormand-prince", "tolerance": 1e-6}),
    ("recursive", "proximal", {"dt": 2.5e-3}),
    ("recursive-newton", "penalty", {"dt": 5e-3}),
    ("recursive-newton", "penalty", {"integrator": "generalised-alpha", "dt": 5e-3, "events": "located"}),
    ("recursive-newton", "penalty", {"integrator": "radau5-fixed", "dt": 5e-3}),
    ("recursive-newton", "penalty", {"integrator": "radau5", "tolerance": 1e-6}),
    *LAGRANGIAN,
]


@pytest.mark.parametrize(("method", "closure", "how"), with_heavy(VEHICLE, *LAGRANGIAN))
def test_steps_of_the_vehicle_do_not_allocate(method: str, closure: str, how: dict[str, str | float], check: Check) -> None:
    check(vehicle(method, closure), 2.0, **how)


def test_steps_in_parts_do_not_allocate(count: Count) -> None:
    taken, run = count(vehicle("recursive-newton"), 10.0, dt=0.02)
    assert run.statistics.substeps > 0
    assert run.statistics.pivoting_fallbacks == 0
    assert taken == 0


def test_pivoting_takes_memory_at_its_first_use_alone(count: Count) -> None:
    taken, run = count(vehicle("recursive-newton"), 10.0, dt=0.05)
    assert run.statistics.pivoting_fallbacks > taken > 0


@pytest.mark.heavy
def test_what_takes_memory_in_steps(count: Count) -> None:
    """Known: Eigen's L U."""
    taken, run = count(compile_model(MODELS / "slider_crank.yaml", method="classical", additions=["eigen-lu"]), 1.0, solver="eigen-lu")
    assert taken > run.steps
