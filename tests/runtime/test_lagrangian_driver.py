"""Tasks of the driver of the Lagrangian methods besides simulating."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.results import read_statistics, read_table
from cutjoint.run.run_file import make_run_file
from cutjoint.run.simulator import call_simulator
from cutjoint.toolchain.build import build
from cutjoint.toolchain.drivers import Kind
from cutjoint_bench.driver import ADDED_SOLVERS
from tests.conftest import MODELS, needs_cpp
from tests.runtime.points import (
    AUGMENTED,
    CLASSICAL,
    DOUBLE_PENDULUM,
    METHODS,
    ORIGIN,
    PENDULUM,
    SOLVERS,
    completed,
    points_source,
    run_file,
    start,
    summary_of,
)

pytestmark = needs_cpp

WEIGHTS = {"damping": 0.5, "stiffness": 0.25, "constraint": 30.0}


def random_state(seed: int, size: int) -> dict[str, Any]:
    """A state of the double pendulum, off its equations."""
    random = np.random.default_rng(seed)
    vectors = {name: list(random.normal(size=6)) for name in ("q", "v", "vdot")}
    return {
        "t": 0.3, **vectors, "lambda": list(random.normal(size=2)), "penalty": 7.0, "weights": WEIGHTS, "w": list(random.normal(size=2)),
        "relative": {"q": [], "v": []}, "right": list(random.normal(size=size)),
    }  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_evaluate_gives_the_functions_of_a_system(method: str, tmp_path: Path) -> None:
    """Against the same system in NumPy, with a spring of 10 N/m and a damper of 2 Ns/m on the second point."""
    system = {**DOUBLE_PENDULUM, "method": method, "springs": [{"a": 1, "b": ORIGIN, "stiffness": 10.0, "damping": 2.0}]}
    size = 6 if method == AUGMENTED else 8
    states = [random_state(seed, size) for seed in range(3)]
    for solver in SOLVERS[method]:
        found = summary_of(tmp_path, run_file(system, "evaluate", states=states, solver=solver))["results"]
        for state, result in zip(states, found, strict=True):
            check_functions(method, state, {name: np.array(x) for name, x in result.items() if name != "placed"})
            assert result["placed"] == {"q": [1, 0, 0, 1, 1, 0], "v": [0, 0.5, 0.3, 0.4, 0.5, -0.6]}


def check_functions(method: str, state: dict[str, Any], found: dict[str, np.ndarray]) -> None:
    (p, q), (v, w), (a, b) = (np.array(state[name]).reshape(2, 3) for name in ("q", "v", "vdot"))
    multipliers, penalty, pulls = np.array(state["lambda"]), state["penalty"], np.array(state["w"])
    J = np.array([[*p, 0, 0, 0], [*(p - q), *(q - p)]])
    mass, spring = np.diag([1.5] * 3 + [0.5] * 3), np.diag([0.0] * 3 + [1.0] * 3)
    residual = np.array([p @ p - 1, (q - p) @ (q - p) - 1]) / 2
    weight = 9.81 * np.array([0, 0, 1.5, 0, 0, 0.5])
    forces = spring @ (10 * np.concatenate([p, q]) + 2 * np.concatenate([v, w]))
    expected = {
        "residual": residual, "rate": J @ np.concatenate([v, w]), "force": J.T @ pulls,
        "curvature": J @ np.concatenate([a, b]) + [v @ v, (w - v) @ (w - v)],
        "force_residual": mass @ np.concatenate([a, b]) + weight + forces + J.T @ (penalty * residual + multipliers),
        "columns": np.concatenate([p, q, v, w, a, b, multipliers], axis=None),
    }  # fmt: skip
    expected |= {"linearised_force_residual": expected["force_residual"], "linearised_residual": residual, "closed_residual": residual}
    A, c = mass + spring * (WEIGHTS["damping"] * 2 + WEIGHTS["stiffness"] * 10), WEIGHTS["constraint"]
    whole = A + c * J.T @ J if method == AUGMENTED else np.block([[A, c * J.T], [c * J, np.zeros((2, 2))]])
    expected["solution"] = np.linalg.solve(whole, state["right"])
    for name, values in expected.items():
        assert np.abs(found[name] - values).max() < 1e-10 * max(1.0, np.abs(values).max()), name
    entries = np.tril(whole) if method == AUGMENTED else whole
    assert np.sort(found["tangent"][found["tangent"] != 0]) == pytest.approx(np.sort(entries[entries != 0]), rel=1e-12)
    assert found["breakdown"] == -1


@pytest.mark.parametrize("method", METHODS)
def test_factor_gives_a_figure_for_each_part(method: str, tmp_path: Path) -> None:
    for solver in SOLVERS[method]:
        file = run_file({**DOUBLE_PENDULUM, "method": method}, "factor", solver=solver, repetitions=2, batches=3)
        summary = summary_of(tmp_path, file)
        assert summary["solver"] == solver
        assert summary["size"] == (6 if method == AUGMENTED else 8)
        assert all(summary[part] >= 0.0 for part in ("analyse", "assemble", "factor", "solve"))


@pytest.mark.parametrize("method", METHODS)
def test_equilibrium_is_the_start_at_rest(method: str, tmp_path: Path) -> None:
    """Accelerations of a pendulum that lies: g downwards, and nothing along the rod."""
    summary = summary_of(tmp_path, run_file({**PENDULUM, "method": method}, "equilibrium"))
    columns = summary["columns"]
    assert (columns["p0.ax"], columns["p0.az"], columns["lambda0"]) == pytest.approx((0.0, -9.81, 0.0), abs=1e-6)


@pytest.mark.heavy
def test_compiles_with_clang(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without warnings, and with the same motion."""
    expected = completed(tmp_path, DOUBLE_PENDULUM, CLASSICAL, end=0.1)
    monkeypatch.setenv("CXX", "clang++")
    binary = build(points_source(), kind=Kind(additions=ADDED_SOLVERS))
    assert "clang" in binary.compiler
    out = tmp_path / "clang.csv"
    done = start(tmp_path, run_file({**DOUBLE_PENDULUM, "method": CLASSICAL}, "simulate", end=0.1, out=str(out)), binary.path)
    assert done.returncode == 0, done.stderr
    _, columns = read_table(out)
    assert np.abs(columns["p1.z"] - expected["p1.z"]).max() < 1e-12


def test_steps_of_the_recursive_method_are_measured_when_asked_for(tmp_path: Path) -> None:
    artifact = compile_model(MODELS / "four_bar.yaml", scene="swing")
    tables = []
    places: tuple[dict[str, str], ...] = ({}, {"steps_out": str(tmp_path / "steps.csv")})
    for more in places:
        out = tmp_path / "table.csv"
        file = make_run_file(artifact.topology.model, artifact.scene, {}, task="simulate", out=str(out))
        summary = call_simulator(artifact.binary.path, {**file.entries(), **more, "end": 0.5})
        statistics = read_statistics(summary)
        assert statistics.solver == ""
        assert statistics.iterations == summary["evaluations"]
        assert np.isfinite(statistics.residuals.position) == bool(more)
        tables.append(out.read_bytes())
    assert tables[0] == tables[1]
    t, steps = read_table(tmp_path / "steps.csv")
    assert set(steps) == {"iterations", "position", "velocity"}
    assert len(t) == summary["steps"]
    assert steps["iterations"].sum() == summary["evaluations"]
    assert steps["position"].max() == statistics.residuals.position < 1e-6
