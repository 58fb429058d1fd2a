"""Runs whose outcome is known beforehand, and whether they end as they should."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError, ToolchainError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Array
from cutjoint.run.scenes import with_settings
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.cases import make_case
from cutjoint_bench.cutjoint_contenders import has_added, identity
from cutjoint_bench.failures.outcomes import Truth, exact_truth, identify, try_run
from cutjoint_bench.progress import Say, silently
from cutjoint_bench.records import Case
from cutjoint_bench.store import Store


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A pose that is hard: a column that vanishes there, and when the exact motion is there for the first time, s."""

    column: str
    time: float


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A run by a method with a step of ``dt`` s, the outcomes that are right and the reason in words.

    ``settings`` are numerical ones instead of the scene's.  With ``lands`` the step is the nearest with which one ends on the pose.
    """

    method: str
    dt: float
    expected: tuple[str, ...]
    because: str
    settings: Mapping[str, float] = field(default_factory=dict)
    precision: str = "double"
    lands: bool = False


@dataclass(frozen=True, kw_only=True)
class Situation:
    """A mechanism that is hard to compute, and what is tried: a model file with one scene.
    ``end`` in s, ``motion`` is the exact one over times."""

    name: str
    words: str
    text: str
    end: float
    motion: Callable[[Array], Mapping[str, Array]]
    trials: tuple[Trial, ...]
    pose: Pose | None = None


def try_situation(situation: Situation, store: Store, say: Say = silently) -> list[dict[str, Any]]:
    """The end of each trial of a situation, as plain data for JSON; what the store has is not run again."""
    case = case_of(situation)
    truth = exact_truth(situation.motion, situation.end)
    artifacts: dict[tuple[str, str], Artifact | str] = {}
    rows = []
    for trial in situation.trials:
        key = (trial.method, trial.precision)
        if key not in artifacts:
            say(f"{situation.name}: compiling {trial.method} in {trial.precision}")
            artifacts[key] = _compiled(case, trial)
        say(f"{situation.name}: {trial.method} at {1e3 * trial.dt:g} ms")
        made = artifacts[key]
        code = {} if isinstance(made, str) else dict(identity(made.source, added=has_added(made)))
        rows.append({**_about(situation, trial), "code": code, **_result(situation, case, trial, made, truth, store)})
    return [{**row, "as_expected": row["outcome"] in row["expected"]} for row in rows]


def case_of(situation: Situation) -> Case:
    """The situation's model as a case."""
    with temporary_folder() as folder:
        path = folder / "model.yaml"
        path.write_text(situation.text, encoding="utf-8")
        return make_case(path, end=situation.end)


def _compiled(case: Case, trial: Trial) -> Artifact | str:
    """The simulator, or why there is none."""
    try:
        return compile_scene(case.model, case.scene, CompileOptions(method=trial.method, outputs=case.outputs, precision=trial.precision))
    except (RunError, ModelError, ToolchainError) as error:
        return str(error)


def _about(situation: Situation, trial: Trial) -> dict[str, Any]:
    return {
        "name": situation.name, "words": situation.words, "method": trial.method, "precision": trial.precision, "lands": trial.lands,
        "figures": dict(trial.settings), "expected": list(trial.expected), "because": trial.because,
    }  # fmt: skip


def _result(situation: Situation, case: Case, trial: Trial, artifact: Artifact | str, truth: Truth, store: Store) -> dict[str, Any]:
    if isinstance(artifact, str):
        return {"dt": trial.dt, "outcome": "diverged", "message": artifact}
    pose = situation.pose if trial.lands else None
    of = {
        **identify(case, artifact), "dt": trial.dt, "figures": dict(trial.settings),
        "pose": None if pose is None else {"column": pose.column, "time": pose.time},
    }  # fmt: skip
    return store.get(of, partial(_try, case, trial, artifact, truth, pose))


def _try(case: Case, trial: Trial, artifact: Artifact, truth: Truth, pose: Pose | None) -> dict[str, Any]:
    dt = trial.dt if pose is None else landing_step(artifact, pose, trial.dt, trial.settings)
    row = dt * max(1, round(case.scene.output_step / dt))
    return {"dt": dt, **try_run(case, artifact, truth, dt=dt, row=row, settings=trial.settings).as_record()}


def landing_step(artifact: Artifact, pose: Pose, dt: float, settings: Mapping[str, float] | None = None) -> float:
    """The step near ``dt`` (s) with which a step of the computed motion ends on a pose, to the last digits, by the secant method.

    The pose is met at another time than in the exact motion, by the error of the method.  Where a run fails, the last step that was
    tried lands nearly enough to make it fail.
    """
    count = round(pose.time / dt)
    scene = with_settings(artifact.scene, artifact.method, settings or {})

    def miss(step: float) -> float | None:
        end = step * count * (1 - 1e-12)
        with_rows = replace(artifact, scene=replace(scene, output_step=step * count))
        run = simulate(with_rows, dt=step, end=end, integrator="trapezoidal", events="crossed", check=False)
        return None if run.failure is not None else float(run[pose.column][-1])

    before, now = (pose.time / count * (1 - share) for share in (2e-5, 1e-5))
    off_before, off = miss(before), miss(now)
    for _ in range(12):
        if off_before is None or off is None or off in (off_before, 0.0):
            break
        before, now, off_before = now, now - off * (now - before) / (off - off_before), off
        off = miss(now)
    return now
