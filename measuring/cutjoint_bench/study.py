"""A bench from end to end: cases, contenders, points, limits, drift; resumable, with progress."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import isnan
from statistics import median
from typing import Any

from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError, ToolchainError
from cutjoint.run.artifact import Artifact
from cutjoint.run.settings import accuracy_of
from cutjoint_bench.asked_contenders import AccuracyRunner, AutoRunner
from cutjoint_bench.cases import falling_steps
from cutjoint_bench.choices import Entry, find_choices
from cutjoint_bench.cutjoint_contenders import OwnRunner, tolerated_steps
from cutjoint_bench.drift import compile_for_drift, measure_drift
from cutjoint_bench.failures.atlas import Grid, map_case, suggest_grid, with_value
from cutjoint_bench.failures.conditions import find_conditions
from cutjoint_bench.failures.outcomes import identify
from cutjoint_bench.failures.trials import Situation, try_situation
from cutjoint_bench.findings import TARGETS, describe_setting
from cutjoint_bench.fixed_point import predict_limit
from cutjoint_bench.machine import machine
from cutjoint_bench.measure import extent, largest_step, measure_point
from cutjoint_bench.paper import PAPER_STEPS
from cutjoint_bench.progress import Say, part_of, silently
from cutjoint_bench.records import Case, Contender, Runner
from cutjoint_bench.reductions import NoReductionError
from cutjoint_bench.reference import Reference, find_reference
from cutjoint_bench.store import Record, Store

#: Steps are tried up to this multiple of a scene's own step; a run of more steps than ``MOST_STEPS`` is not begun.
LONGEST = 25.0
MOST_STEPS = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The work of a bench.

    ``steps`` (s) are tried instead of those that suit a scene, which go down to the share ``shortest`` of its own; runs that would take
    longer than ``most_seconds`` are not begun.  ``reference`` is the number type in which references are integrated, "quad" or "extended",
    or "none".  ``vary`` is a parameter of the model that the atlas varies in place of the penalty, ``precisions`` are its number
    types in place of those that suit a case, ``situations`` are hard ones to try; ``title`` stands beside the cases' names.
    """

    cases: Sequence[Case]
    contenders: Sequence[Contender]
    repetitions: int = 5
    steps: Sequence[float] = ()
    shortest: float = 0.02
    most_seconds: float = 10.0
    reference: str = "quad"
    limits: bool = True
    drift: bool = False
    atlas: bool = False
    vary: str = ""
    precisions: Sequence[str] = ()
    situations: Sequence[Situation] = ()
    title: str = ""


def perform(plan: Plan, store: Store, say: Say = silently) -> dict[str, Any]:
    """Measure what the store does not have, and return everything as plain data for JSON."""
    return {
        "machine": dict(machine()),
        "cases": [_case(plan, case, store, part_of(say, i, len(plan.cases))) for i, case in enumerate(plan.cases)],
        "drifts": [d for case in plan.cases if (d := find_drift(case, store, say))] if plan.drift else [],
        "atlases": [_atlas(plan, case, store, say) for case in plan.cases] if plan.atlas else [],
        "situations": [row for situation in plan.situations for row in try_situation(situation, store, say)],
    }  # fmt: skip


def _atlas(plan: Plan, case: Case, store: Store, say: Say) -> Record:
    grid = grid_of(plan, case)
    mapped = map_case(case, grid, store, say, refer=atlas_reference(plan, say))
    say(f"{case.name}: modes and poses along the motion")
    found = [find_conditions(with_value(case, grid.parameter, value)) for value in mapped["axes"]["value"]]
    return {**mapped, "conditions": plain([asdict(conditions) for conditions in found])}


def atlas_reference(plan: Plan, say: Say = silently) -> Callable[[Case], Reference]:
    """Finds the references of a plan's atlas, which cannot do without, as its cases' points can."""
    return partial(find_reference, precision="quad" if plan.reference == "none" else plan.reference, say=say)


def case_reference(plan: Plan, case: Case, say: Say = silently) -> Reference | None:
    """The reference of a case's points; None where the plan asks for none."""
    return None if plan.reference == "none" else find_reference(case, precision=plan.reference, say=say)


def grid_of(plan: Plan, case: Case) -> Grid:
    """The axes of a case's atlas."""
    grid = suggest_grid(case, parameter=plan.vary)
    return replace(grid, precisions=tuple(plan.precisions)) if plan.precisions else grid


def find_drift(case: Case, store: Store, say: Say = silently) -> Record | None:
    """Losses of the methods in quantities that a mechanism keeps; at a step that all of them can take."""
    say(f"{case.name}: energy and momentum")
    artifacts = compile_for_drift(case)
    if not artifacts:
        return None
    dt = min(case.scene.numerics.of_method(method).step for method in METHODS)
    runs = {method: identify(case, artifact) for method, artifact in artifacts.items()}
    of = {"drift": case.name, "dt": dt, "end": case.scene.end, "row": case.scene.output_step, "runs": runs}
    return store.get(of, lambda: plain(measure_drift(case, artifacts, dt)))


def _case(plan: Plan, case: Case, store: Store, say: Say) -> Record:
    reference = case_reference(plan, case, say)
    lines: list[Record] = []
    runners: dict[str, Runner] = {}
    for i, contender in enumerate(plan.contenders):
        say(f"{case.name}: compiling {contender.label}", share=i / len(plan.contenders))
        try:
            runner = contender.prepare(case)
        except NoReductionError:
            continue
        except (RunError, ModelError, ToolchainError) as error:
            lines.append({"contender": contender.name, "label": contender.label, "group": contender.group, "refused": str(error)})
            continue
        runners[contender.name] = runner
        lines.append(_line(plan, case, contender, runner, reference, store, say))
    return {
        **_choices(plan, case, lines, runners, store, say),
        "name": case.name, "title": plan.title, "model": case.model.name, "scene": case.scene.name, "end": case.scene.end,
        "row": case.scene.output_step, "extent": extent(reference) if reference else 1.0, "reference": _about(reference), "lines": lines,
    }  # fmt: skip


def _choices(
    plan: Plan, case: Case, lines: Sequence[Record], runners: Mapping[str, Runner], store: Store, say: Say
) -> Record:  # fmt: skip
    """The choices of a case for which a command line is known, its settings timed again in turns."""
    if not case.command or plan.reference == "none":
        return {}
    known = {contender.name: contender for contender in plan.contenders}

    def time_again(entries: Sequence[Entry]) -> Sequence[float]:
        timed = [(entry.line["contender"], entry.point["dt"]) for entry in entries]
        say(f"{case.name}: timing in turns {', '.join(dict.fromkeys(known[name].label for name, _ in timed))}")
        of = [{**_identity(plan, case, known[name], runners[name]), "dt": dt} for name, dt in timed]
        found = store.get({"in turns": of}, lambda: _in_turns([(runners[name], dt) for name, dt in timed], plan))
        return [median(seconds) for seconds in found["seconds"]]

    return {"choices": find_choices(lines, "outputs" if case.watched else "position", time_again), "watched": list(case.watched)}


def _in_turns(wanted: Sequence[tuple[Runner, float]], plan: Plan) -> Record:
    """Seconds of runs, round after round, so that other load meets all alike."""
    rounds = [[runner(dt).seconds for runner, dt in wanted] for _ in range(plan.repetitions)]
    return {"seconds": [list(column) for column in zip(*rounds, strict=True)]}


def _about(reference: Reference | None) -> Record | None:
    if reference is None:
        return None
    apart = {"position_apart": reference.position_apart, "velocity_apart": reference.velocity_apart}
    about: Record = plain({**apart, "provenance": dict(reference.provenance)})
    return about


def _line(
    plan: Plan, case: Case, contender: Contender, runner: Runner, reference: Reference | None, store: Store, say: Say
) -> Record:  # fmt: skip
    """All that is measured of a contender on a case."""
    scene_step = _own_step(case, contender)
    identity = _identity(plan, case, contender, runner)
    points: list[Record] = []
    line: Record = {"contender": contender.name, "label": contender.label, "group": contender.group, "dt": scene_step,
                    "configuration": dict(runner.configuration), "points": points}  # fmt: skip
    for dt in _steps(plan, case, contender, scene_step):
        if points and _predicted(points[-1], dt, asked=contender.is_asked) > plan.most_seconds:
            break
        say(f"{case.name}: {contender.label}, {describe_setting(line, {'dt': dt})}")
        make = partial(_point, case, contender.name, runner, dt, reference, plan.repetitions)
        points.append({**store.get({**identity, "dt": dt}, make), **_command(case, contender, dt)})
    if has_limits(plan, contender):
        say(f"{case.name}: largest step of {contender.label}")
        line |= find_limits(plan, case, contender, runner, reference, store)
    return line


def _command(case: Case, contender: Contender, dt: float) -> Record:
    """The command line that makes a point's run, where there is one."""
    options = contender.options(case, dt) if case.command and contender.options is not None else []
    return {"command": f"{case.command} {shlex.join(options)}"} if options else {}


def _own_step(case: Case, contender: Contender) -> float:
    """The scene's step for the method, or its accuracy for a contender that is given one."""
    if contender.is_asked:
        return accuracy_of(case.scene)
    return case.scene.numerics.of_method(contender.name.partition("/")[0]).step


def _identity(plan: Plan, case: Case, contender: Contender, runner: Runner) -> Record:
    """Identity of a contender's figures."""
    return {
        "case": case.name, "input": case.input_digest(contender.name.partition("/")[0]), "contender": contender.name,
        "configuration": dict(runner.configuration), "end": case.scene.end, "row": case.scene.output_step,
        "repetitions": plan.repetitions, "reference": plan.reference, **({"watched": sorted(case.watched)} if case.watched else {}),
    }  # fmt: skip


def has_limits(plan: Plan, contender: Contender) -> bool:
    """True if a plan looks for the largest step of a contender."""
    return plan.limits and contender.group == "generated"


def find_limits(
    plan: Plan, case: Case, contender: Contender, runner: Runner, reference: Reference | None, store: Store
) -> Record:  # fmt: skip
    """The largest step that converges; with a fixed point the predicted one too."""
    identity = _identity(plan, case, contender, runner)
    limit = partial(_limit, case, runner, reference, _own_step(case, contender))
    found: Record = {"largest_step": store.get({**identity, "limit": "largest step"}, limit)["dt"]}
    if isinstance(runner, OwnRunner) and not METHODS[runner.artifact.method].has_system:
        found["predicted"] = store.get({**identity, "limit": "predicted"}, partial(_prediction, case, runner.artifact))
    return found


def _prediction(case: Case, artifact: Artifact) -> Record:
    """Empty where there is none."""
    found = predict_limit(case, artifact)
    return {} if found is None else asdict(found)


def _steps(plan: Plan, case: Case, contender: Contender, scene_step: float) -> list[float]:
    if contender.is_asked:
        return list(TARGETS)
    if plan.steps:
        return list(plan.steps)
    if contender.adaptive:
        return tolerated_steps(scene_step)
    shortest = max(plan.shortest * scene_step, case.scene.end / MOST_STEPS)
    steps = falling_steps(case.scene.output_step, min(LONGEST * scene_step, case.scene.end / 8), shortest)
    paper = PAPER_STEPS.get(case.name, {}).get(contender.name.partition("/")[0])
    return sorted({*steps, scene_step, *([paper] if paper else [])}, reverse=True)


def _point(
    case: Case, name: str, runner: Runner, dt: float, reference: Reference | None, repetitions: int
) -> Record:  # fmt: skip
    record: Record = plain(asdict(measure_point(case, name, runner, dt, reference, repetitions)))
    return {**record, "about": plain(runner.about.get(dt, {}))} if isinstance(runner, AccuracyRunner | AutoRunner) else record


def _predicted(last: Record, dt: float, *, asked: bool) -> float:
    """The seconds of a run at a smaller step than the last, or at least with a smaller accuracy than the last.
    The steps of an accuracy follow from it by a high order."""
    return float((1.0 if asked else last["dt"] / dt) * max(last["seconds"], default=0.0))


def _limit(case: Case, runner: Runner, reference: Reference | None, scene_step: float) -> Record:
    """From the scene's own step upwards; where that is too large, from below."""
    high = min(scene_step * 64, case.scene.end / 4)
    found = largest_step(case, runner, reference, low=scene_step, high=high)
    return {"dt": found or largest_step(case, runner, reference, low=scene_step / 64, high=scene_step)}


def plain(value: Any) -> Any:
    """Data that JSON can hold: numbers that are none become null."""
    if isinstance(value, Mapping):
        return {name: plain(x) for name, x in value.items()}
    if isinstance(value, list | tuple):
        return [plain(x) for x in value]
    if isinstance(value, float) and (isnan(value) or value in (float("inf"), float("-inf"))):
        return None
    return value
