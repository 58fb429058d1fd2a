"""The failure atlas and the hard situations: methods fail where they must and say so, and hold where they should."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.package.errors import RunError
from cutjoint.run.results import Array, FailureReport, Trajectory
from cutjoint_bench.cases import make_case
from cutjoint_bench.exact.chain import Chain, chain_motion, crank_motion, singular_times, write_chain
from cutjoint_bench.exact.crank import SLIDER_CRANK, slider_crank_motion
from cutjoint_bench.exact.pendulum import PENDULUM, pendulum_motion
from cutjoint_bench.failures.atlas import Grid, describe_cells, map_case, suggest_grid
from cutjoint_bench.failures.outcomes import exact_truth, judge, try_run
from cutjoint_bench.failures.situations import all_situations, cross_chain
from cutjoint_bench.failures.trials import Situation, Trial, try_situation
from cutjoint_bench.records import Case, Errors
from cutjoint_bench.reference import Reference
from cutjoint_bench.report.atlas_charts import COLOURS, draw_atlas
from cutjoint_bench.store import Store
from tests.conftest import DATA
from tests.physics.simulation import read_reference

CHAIN = Chain(windows=2)

#: One mass of 1 kg on a spring: x = cos(sqrt(k) t).
SPRING = """\
cutjoint: 1
name: spring
gravity: [0, 0, 0]
parameters: {stiffness: {value: 1, unit: N/m, binding: param}}
bodies: {mass: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0], spring: {stiffness: stiffness}}}
scenes: {swing: {end: 1, output_step: 0.01, positions: {rail.displacement: 1}, numerics: {dt: 0.001}}}
"""


def case_of(folder: Path, text: str, end: float) -> Case:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return make_case(path, end=end)


def reference_of(motion: Callable[[Array], Mapping[str, Array]], case: Case) -> Reference:
    rows = round(case.scene.end / case.scene.output_step)
    return exact_truth(motion, case.scene.end).at(np.arange(rows + 1) * case.scene.output_step)


def spring_motion(case: Case) -> Reference:
    rate = np.sqrt(case.parameters["stiffness"])

    def motion(t: Array) -> dict[str, Array]:
        still = np.zeros_like(t)
        return {"mass.x": np.cos(rate * t), "mass.vx": -rate * np.sin(rate * t), **{f"mass.{q}": still for q in ("y", "z", "vy", "vz")}}

    return reference_of(motion, case)


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The atlas of two windows over one second and two singular poses, and its store."""
    folder = tmp_path_factory.mktemp("atlas")
    case, store = case_of(folder, write_chain(CHAIN), 1.4), folder / "store.jsonl"
    return map_crossing(case, store), store


def map_crossing(case: Case, store: Path) -> dict[str, Any]:
    grid = Grid(methods=("recursive", "augmented", "classical"), precisions=("double",), steps=(1e-3, 2e-2), penalties=(None, 1e8))
    return map_case(case, grid, Store(store), refer=partial(reference_of, partial(chain_motion, CHAIN)))


def cell(atlas: Mapping[str, Any], method: str, dt: float, penalty: float | None) -> Mapping[str, Any]:
    (found,) = (c for c in atlas["cells"] if (c["method"], c["dt"], c["penalty"]) == (method, dt, penalty))
    return found


def test_recursive_crosses_with_a_heavy_penalty(crossing: tuple[dict[str, Any], Path]) -> None:
    """A plain fixed point would stop at the pose."""
    found = cell(crossing[0], "recursive", 1e-3, 1e8)
    assert (found["outcome"], found["message"]) == ("converged", "")


@pytest.mark.parametrize(("method", "coarse"), [("recursive", "converged"), ("augmented", "inaccurate"), ("classical", "inaccurate")])
def test_all_methods_cross(crossing: tuple[dict[str, Any], Path], method: str, coarse: str) -> None:
    """The recursive method's penalty follows the step."""
    assert [cell(crossing[0], method, dt, None)["outcome"] for dt in (1e-3, 2e-2)] == ["converged", coarse]


def test_classical_is_tried_once_for_all_penalties(crossing: tuple[dict[str, Any], Path]) -> None:
    assert [c["penalty"] for c in crossing[0]["cells"] if c["method"] == "classical"] == [None, None]


def test_what_is_in_the_store_is_not_run_again(crossing: tuple[dict[str, Any], Path], tmp_path: Path) -> None:
    atlas, store = crossing
    kept = store.read_text()
    assert map_crossing(case_of(tmp_path, write_chain(CHAIN), 1.4), store) == atlas
    assert store.read_text() == kept
    assert len(kept.splitlines()) == len(atlas["cells"]) == 10


def test_words_count_the_outcomes(crossing: tuple[dict[str, Any], Path]) -> None:
    assert crossing[0]["words"].startswith(
        "recursive converges in 4 of 4 runs, with steps up to 20 ms in double; 0 stop with a message, 0 drift, "
        "none ends wrong silently. augmented converges in "
    )


def test_chart_is_the_same_every_time_and_has_every_outcome(crossing: tuple[dict[str, Any], Path]) -> None:
    chart = draw_atlas(crossing[0])
    assert chart == draw_atlas(crossing[0])
    assert all(f">{name}</text>" in chart for name in COLOURS)
    assert list(COLOURS) == list(crossing[0]["outcomes"])


def test_a_stiffness_that_the_step_does_not_resolve_ends_wrong(tmp_path: Path) -> None:
    """Steps of 1 ms: a period of 2.5e6 N/m is four of them, of 1e7 N/m two."""
    case = case_of(tmp_path, SPRING, 1.0)
    grid = Grid(methods=("recursive",), precisions=("double",), steps=(1e-3,), parameter="stiffness", values=(1.0, 2.5e6, 1e7))
    atlas = map_case(case, grid, Store(tmp_path / "store.jsonl"), refer=spring_motion)
    assert [c["outcome"] for c in atlas["cells"]] == ["converged", "wrong", "wrong"]
    assert atlas["own"]["recursive"] == {"dt": 1e-3, "value": 1.0}
    assert "2 end wrong silently" in atlas["words"]
    assert "stiffness [N/m]" in draw_atlas(atlas)


def test_suggested_axes(tmp_path: Path) -> None:
    case = case_of(tmp_path, SPRING, 1.0)
    grid = suggest_grid(case)
    assert grid.steps == (1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)
    assert grid.penalties[0] is None
    assert suggest_grid(case, parameter="stiffness").values == (0.01, 0.1, 1.0, 10.0, 100.0)
    with pytest.raises(RunError, match="model 'spring' has no parameter 'stifness'; did you mean 'stiffness'"):
        suggest_grid(case, parameter="stifness")


def test_a_step_without_common_rows_is_refused(tmp_path: Path) -> None:
    grid = Grid(methods=("recursive",), precisions=("double",), steps=(0.0123457,))
    with pytest.raises(RunError, match=r"spring/swing: a step of 0\.0123457 s shares too few rows with rows of 0\.01 s"):
        map_case(case_of(tmp_path, SPRING, 1.0), grid, Store(tmp_path / "store.jsonl"))


def run_to(end: float, failure: FailureReport | None = None) -> Trajectory:
    return Trajectory(t=np.array([0, end]), columns={}, units={}, steps=1, evaluations=1, seconds=0.0, undetermined=(), failure=failure)


@pytest.mark.parametrize(
    ("position", "residual", "outcome"),
    [(1e-3, 0, "converged"), (3e-3, 0, "inaccurate"), (1e-3, 1.1e-3, "drifted"), (0.21, 1, "wrong"), (nan, 0, "wrong"), (inf, 0, "wrong")],
)
def test_limits_of_the_outcomes_in_a_motion_of_two_metres(position: float, residual: float, outcome: str) -> None:
    assert judge(run_to(1), Errors(position=position), residual, 2.0).outcome == outcome


def test_a_gap_of_a_small_mechanism_has_drifted_earlier() -> None:
    assert judge(run_to(1), Errors(position=0.0), 2e-5, 0.01).outcome == "drifted"


def test_a_failure_is_reported_whatever_the_error() -> None:
    failure = FailureReport(message="it stopped", time=1.1, step=2, element="pin", residual=1.0, advice="try less")
    found = judge(run_to(1, failure), Errors(position=nan), nan, 1.0)
    assert (found.outcome, found.reached) == ("diverged", 1.0)
    assert found.message == "it stopped at t = 1.1 s (step 2); worst at 'pin' with 1; try less"
    assert found.as_record()["position"] is None


def crossing_by(*trials: Trial) -> Situation:
    whole = cross_chain(2, (), ())
    return replace(whole, trials=trials, end=1.4)


def test_a_step_that_ends_on_the_pose(tmp_path: Path) -> None:
    """0.714355529292960 s; classical has no tangent there and says so."""
    situation = crossing_by(
        Trial(method="classical", dt=1e-3, lands=True, expected=("diverged",), because="its tangent is singular"),
        Trial(method="augmented", dt=1e-3, lands=True, expected=("converged",), because="its tangent is not"),
        Trial(method="recursive", dt=1e-3, lands=True, expected=("converged",), because="its penalty is light"),
    )
    rows = try_situation(situation, Store(tmp_path / "store.jsonl"))
    assert [row["outcome"] for row in rows] == ["diverged", "converged", "converged"]
    assert all(row["as_expected"] and row["dt"] == pytest.approx(1e-3, rel=1e-2) for row in rows)
    assert "classical: the pose is singular, or nearly: rates that satisfy the equations are a leap away" in rows[0]["message"]
    assert rows[0]["reached"] == pytest.approx(0.714355529292960, abs=1.1e-3)
    assert "try: another dt, or method augmented" in rows[0]["message"]


@pytest.mark.parametrize("steps", [100, 120, 143, 200, 1429, 3000])
def test_a_whole_number_of_steps_to_the_pose(steps: int, tmp_path: Path) -> None:
    """A projection could take a leap onto another branch here: augmented stays, classical stays or says so, neither is silently wrong."""
    dt = singular_times(CHAIN)[0] / steps
    situation = crossing_by(
        Trial(method="augmented", dt=dt, expected=("converged", "inaccurate"), because="It leaves a direction that vanishes alone."),
        Trial(method="classical", dt=dt, expected=("converged", "inaccurate", "diverged"), because="It stays, or stops with a message."),
    )
    rows = try_situation(situation, Store(tmp_path / "store.jsonl"))
    assert all(row["as_expected"] for row in rows), [(row["method"], row["outcome"], row["message"]) for row in rows]


def test_silent_errors_are_expected_in_single_precision_and_where_one_is_known() -> None:
    for situation in all_situations():
        for trial in situation.trials:
            known = (situation.name, trial.method, trial.lands) == ("dead centre", "recursive-newton", True)
            assert "wrong" not in trial.expected or trial.precision == "single" or known, (situation.name, trial)


def test_situations_have_names_of_their_own_and_reasons() -> None:
    situations = list(all_situations())
    assert len({s.name for s in situations}) == len(situations) == 10
    assert all(trial.because.endswith(".") for s in situations for trial in s.trials)
    assert all(s.pose is not None for s in situations for trial in s.trials if trial.lands)


def test_a_long_chain_needs_more_corrections_of_its_multipliers(tmp_path: Path) -> None:
    """Ten windows in steps of 20 ms: with 4 a step what the loops lack does not reach the ends of the chain, with 8 it does."""
    chain = Chain(windows=10)
    case = case_of(tmp_path, write_chain(chain), 10.0)
    artifact = compile_scene(case.model, case.scene, CompileOptions(outputs=case.outputs))
    truth = exact_truth(partial(chain_motion, chain), 10.0)
    errors = [
        try_run(case, artifact, truth, dt=0.02, row=0.02, settings={"multiplier_updates": updates}).position
        for updates in (4, chain.multiplier_updates)
    ]
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 0.1


def test_chain_moves_as_published() -> None:
    published = read_reference(DATA / "ref_a02_fourbar_N2.csv")
    angle, rate = crank_motion(CHAIN, published["t"])
    assert np.sin(angle) == pytest.approx(published["x_B0"], abs=1e-11)
    assert rate * np.cos(angle) == pytest.approx(published["vx_B0"], abs=1e-10)
    assert singular_times(CHAIN) == pytest.approx((0.714355529292960, 1.228159393314123), abs=1e-14)


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        (PENDULUM, pendulum_motion), (SLIDER_CRANK, slider_crank_motion),
        (write_chain(CHAIN), partial(chain_motion, CHAIN)),
        (write_chain(Chain(windows=1, gravity=9.81, offset=5.0)), partial(chain_motion, Chain(windows=1, gravity=9.81, offset=5.0))),
    ],
    ids=["pendulum", "slider-crank", "turning", "swaying"],
)  # fmt: skip
def test_exact_motions(tmp_path: Path, text: str, motion: Callable[[Array], Mapping[str, Array]]) -> None:
    """Velocities are the rates of places, and every body is where the design has it at first."""
    t, h = np.linspace(0.1, 3, 50), 1e-4
    before, at, after = motion(t - h), motion(t), motion(t + h)
    case = case_of(tmp_path, text, 1.0)
    for body in case.model.bodies:
        start = motion(np.zeros(1))
        for q, place in zip("xyz", body.centre_of_mass, strict=True):
            # the third derivative of these motions stays below 1e3 m/s3, so the difference is good to h^2/6 of that
            assert (after[f"{body.name}.{q}"] - before[f"{body.name}.{q}"]) / (2 * h) == pytest.approx(at[f"{body.name}.v{q}"], abs=2e-6)
            assert start[f"{body.name}.{q}"][0] == pytest.approx(float(place), abs=1e-12)


def test_words_of_a_method_that_never_converges() -> None:
    cells = [{"method": "classical", "outcome": "wrong", "dt": 1.0, "penalty": None, "precision": "double"}]
    assert describe_cells(cells) == (
        "classical converges in 0 of 1 runs; 0 stop with a message, 0 drift, 1 end wrong silently."
    )  # fmt: skip
