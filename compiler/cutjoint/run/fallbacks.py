"""Fallbacks of a failed run: other settings of the same program are tried up to a little after the failure."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf
from time import monotonic

from cutjoint.methods import CLOSURES, INTEGRATORS, METHODS, join_and, join_or
from cutjoint.model.ranges import StepsError, count_steps
from cutjoint.run.results import UNTRIED, FailureReport, Trajectory
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start

#: Messages of loops that may have no pose beyond this point, which no settings avoid.
_OPEN = (
    "the loops cannot be closed", "no speeds keep the loops closed",
    "the run stands still: its steps have become too short for it to reach its end",
)  # fmt: skip
_BEYOND = "the guide of {} may exceed the reach of the links: inspect the last pose with `cutjoint simulate --view`"
#: The message of a step over an event, where steps that end at events may help.
_OVER = "a force may change its formula within the step, as at the first touch of a contact: use an integrator that locates it"
#: The message at singular poses: other integrators may continue, but only other methods cross the pose accurately.
_SINGULAR = "the pose is singular, or nearly: equations depend on each other for a moment"
#: Seconds for all trials, unless the run itself took longer.
_SECONDS = 2.0
#: A trial has to pass the failure by this many equal steps, and by this share of the time up to it.
_STEPS, _SHARE = 20, 0.02


@dataclass(frozen=True, kw_only=True)
class Fallback:
    """Other settings for a run: their description and the ``plan`` with them; ``free`` ones need no number to be chosen."""

    words: str
    plan: SimulatorRun
    free: bool = False


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Trials of fallbacks up to the time ``past`` (s): ``helped`` passed the failure, ``failed`` did not, ``skipped`` had no time."""

    past: float
    helped: tuple[Fallback, ...]
    failed: tuple[Fallback, ...]
    skipped: tuple[Fallback, ...]


def try_fallbacks(plan: SimulatorRun, run: Trajectory) -> Trials | None:
    """Try each fallback from the start to a little after the failure; None if other settings cannot help, as at a start.
    Raises Interrupted, Terminated: a signal has ended a run."""
    failure = run.failure
    if failure is None or failure.step == 0 or failure.guards or not failure.time < inf:
        return None
    past, budget = _time_past(plan, failure), max(_SECONDS, run.seconds)
    end = monotonic() + budget
    found: dict[bool | None, list[Fallback]] = {True: [], False: [], None: []}
    for fallback in _fallbacks(plan):
        left = min(end - monotonic(), budget / 2)
        found[_continues_past(fallback.plan, past, left) if left > 0 else None].append(fallback)
    beyond_reach = plan.leading and failure.message in _OPEN[:2]  # for any method
    for fallback in () if beyond_reach or (found[True] and failure.message != _SINGULAR) else _by_other_methods(plan):
        found[_continues_past(fallback.plan, past, budget)].append(fallback)
    return Trials(past=past, helped=tuple(found[True]), failed=tuple(found[False]), skipped=tuple(found[None]))


def retry_failed(
    plan: SimulatorRun, run: Trajectory, execute: Callable[[SimulatorRun], Trajectory], *, allow_switch: bool, advise: bool
) -> Trajectory:  # fmt: skip
    """Repeat a failed run by another integrator or across events (``allow_switch``), or try other settings (``advise``).
    Raises SimulatorError, OutputError, Interrupted, Terminated: as of a run."""
    if run.failure is None or not (allow_switch or advise) or (trials := try_fallbacks(plan, run)) is None:
        return run
    others = [fallback for fallback in trials.helped if fallback.free] if allow_switch else []
    for fallback in others:
        other = execute(fallback.plan)
        if other.failure is None:
            words = f"{fallback.words}, since {plan.run_file.settings.integrator} stopped: {run.failure.summary}"
            return replace(other, fallback="; ".join(filter(None, (words, run.failure.advice, other.fallback))))
    if others:
        run = execute(plan)  # which writes its rows into the files again
    return run if run.failure is None or not advise else replace(run, failure=with_trials(run.failure, plan, trials))


def with_trials(failure: FailureReport, plan: SimulatorRun, trials: Trials) -> FailureReport:
    """The failure, with the results of trials as advice."""
    known = failure.advice.partition(UNTRIED)[0].rstrip("; ")
    seen = " ".join(fallback.words for fallback in (*trials.helped, *trials.failed, *trials.skipped))
    crosses = failure.message == _SINGULAR
    others = (name for name in METHODS[plan.method].alternatives if crosses or plan.method not in METHODS[name].alternatives)
    untried = [f"method {name}" for name in others if f"method {name}" not in seen]
    settings = plan.run_file.settings
    if plan.closes_loops and METHODS[plan.method].closures and not CLOSURES[settings.stabilisation.closure].penalty_of_each_cut:
        untried.insert(0, f"closure {INTEGRATORS[settings.integrator].closure}")
    reach = (crosses or failure.message in _OPEN) and plan.leading and not trials.helped
    goes = "goes" if len(trials.helped) == 1 else "go"
    words = (
        _OVER if not settings.events and any(c.plan.switches and c.plan.run_file.settings.events for c in trials.helped) else "",
        _BEYOND.format(join_or([f"'{name}'" for name in plan.leading])) if reach else "",
        known,
        f"tried up to {trials.past:.6g} s: {_listed(trials.helped)} {goes} on" if trials.helped else "",
        f"tried without success: {_listed(trials.failed)}" if trials.failed else "",
        f"{UNTRIED}{', '.join([*(c.words for c in trials.skipped), *untried])}" if trials.skipped or untried else "",
    )
    return replace(failure, advice="; ".join(filter(None, words)))


def _listed(fallbacks: tuple[Fallback, ...]) -> str:
    return join_and([fallback.words for fallback in fallbacks])


def _time_past(plan: SimulatorRun, failure: FailureReport) -> float:
    step = plan.run_file.settings.dt
    steps = 1 if INTEGRATORS[plan.run_file.settings.integrator].adaptive else _STEPS
    return float(min(plan.run_file.end, failure.time + max(steps * step, _SHARE * failure.time)))


def _fallbacks(plan: SimulatorRun) -> Iterator[Fallback]:
    """Other integrators of the program, then other settings of the same integrator."""
    file, settings = plan.run_file, plan.run_file.settings
    for other in plan.others:
        step = "" if INTEGRATORS[other.integrator].adaptive else f" with dt {other.dt:g}"
        yield Fallback(words=f"integrator {other.integrator}{step}", plan=replace(plan, run_file=replace(file, settings=other)), free=True)
    if not INTEGRATORS[settings.integrator].adaptive:
        dt = settings.dt
        stride = count_steps(dt, file.end, file.output_step).stride
        shorter = replace(file.with_settings(dt=dt / 10), output_step=stride * dt)
        yield Fallback(words=f"dt {dt / 10:g}", plan=replace(plan, run_file=shorter))
    for factor in (0.1, 10.0):
        yield Fallback(words=f"solver_tolerance {factor * settings.tolerance:g}", plan=replace(plan, run_file=file.with_tolerance(factor)))
    if plan.closes_loops and not CLOSURES[settings.stabilisation.closure].penalty_of_each_cut and settings.penalty is not None:
        for factor in (1e-2, 1e2):
            penalty = factor * settings.penalty
            changed = file.with_settings(penalty=penalty, stabilisation=replace(settings.stabilisation, penalty=penalty))
            yield Fallback(words=f"penalty {penalty:g}", plan=replace(plan, run_file=changed))
    if settings.events:
        yield Fallback(words="events crossed", plan=replace(plan, run_file=file.with_settings(events=False)), free=True)


def _by_other_methods(plan: SimulatorRun) -> Iterator[Fallback]:
    """The other methods that may continue, if trying them does not take minutes, with their adaptive integrators."""
    for name in METHODS[plan.method].alternatives if plan.by_method else ():
        if plan.by_method and (other := plan.by_method(name)):
            yield Fallback(words=f"method {name}", plan=other)
            for more in (each for each in other.others if INTEGRATORS[each.integrator].adaptive):
                by_steps = replace(other, run_file=replace(other.run_file, settings=more))
                yield Fallback(words=f"method {name} with integrator {more.integrator}", plan=by_steps)


def _continues_past(plan: SimulatorRun, past: float, seconds: float) -> bool | None:
    """Return whether a run reaches a time; None if that takes longer than so many seconds."""
    file = plan.run_file
    file = replace(file.with_settings(dt=min(file.settings.dt, past)), end=past)
    begin = monotonic()
    try:
        count_steps(file.settings.dt, past, file.output_step)
        run = start(replace(plan, run_file=file), seconds=seconds)
    except StepsError:
        return False
    except SimulatorError:
        return None if monotonic() - begin >= seconds else False
    return run.failure is None
