"""Runs to a required accuracy, and error estimates from runs with other steps."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import copysign, inf, lcm, log10
from typing import Any

import numpy as np

from cutjoint.methods import INTEGRATORS
from cutjoint.model.expressions.units import ACCELERATION, ANGULAR_SPEED, PLACES, SPEED, TIME, measure
from cutjoint.model.ranges import count_steps
from cutjoint.model.targets import OBJECTIVES, split_target
from cutjoint.package.locations import AnyPath, path_of
from cutjoint.run.fallbacks import retry_failed
from cutjoint.run.outputs import is_stream
from cutjoint.run.record import Settings
from cutjoint.run.results import Array, Columns, ErrorEstimate, Trajectory, distance_of
from cutjoint.run.simulator import Progress, SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start

#: From one difference to the next, at most this share of the first can vanish: a larger drop is chance.
_BELIEVED = 6 / 7
#: The largest share of an error that halving the steps is assumed to leave, and the default.
_LEFT_AT_MOST = 0.6
#: A difference smaller than the steps explain by this factor is small by chance.
_FASTER = 1.25
#: The share that finer steps leave is at most this multiple of the share of the energy defect, and at least the second number.
_BY_DEFECT, _LEAST_BY_DEFECT = 2.5, 0.3
#: Relative iteration tolerance of runs with halved steps: for an error estimate, and in a sequence of refinements.
_FOR_ESTIMATE, _IN_SEQUENCE = 1e-2, 1e-1
#: Smallest tolerance of iterations, and their largest number.
_LEAST, _ITERATIONS = 1e-10, 100
#: An accuracy that is asked for: the first tolerance is so many times the goal, up to the second number; a coarser run returns whose error
#: is below this share of the goal.
_ABOVE, _COARSEST, _SURE = 100.0, 1e-2, 0.7

_Begin = Callable[[SimulatorRun], Trajectory]
_ANGLES = ("rad", "mrad", "deg")
#: Outputs with larger relative errors have not converged, even if positions have; those below the second share of the largest value of
#: their unit are zero by symmetry.
_ROUGH, _LITTLE = 0.1, 1e-3
#: A tenth of the tolerance takes at least this many times the steps if the tolerance limits them: 10^(1/8) for dop853.
_BOUND = 1.1
#: Differences of runs fall at least by this factor with finer steps, if they are caused by the steps.
_FALLING = 1.5
#: Differences below this share of an output's largest value are small even if they fall no further.
_SMALL = 1e-5
#: Differences below this share of the largest output of the unit are rounding errors, for example of zeros by symmetry.
_ROUNDING = 1e-8
#: The error of a jump's time is at most this multiple of the difference between two runs.
_LATE = 1.5
#: A smaller share of the run's energy causes no warning.
_SMALL_SHARE = 1e-3
#: A mechanism with the energy of a smaller speed (m/s, rad/s) is at rest: a start at rest may accelerate by as much in a second, and the
#: default absolute tolerance of steps has this size.
_REST = 1e-6
#: Steps explain a defect of this many times its change between two runs, since that may be small by chance, and between more runs.
_EXPLAINED_BY_ONE, _EXPLAINED = 100.0, 10.0
#: A smaller violation, m or rad, causes no warning.
_SMALL_VIOLATION = 1e-6
#: Violations of runs with other steps that differ by less than this factor are not caused by the steps.
_SAME = 1.5


@dataclass(frozen=True, kw_only=True)
class Change:
    """One kind of refinement: the factor of a setting, and the least share of the error that one refinement leaves at order 2.

    A run is refined at most ``levels`` times; if ``retries_failures``, also after failures caused by the steps. Reductions below the share
    ``trusted`` are not relied on: with a tenth of the tolerance errors may fall by two or by fifty.
    """

    setting: str
    factor: float
    remaining: float
    trusted: float
    levels: int
    retries_failures: bool


SHORTER = Change(setting="dt", factor=0.5, remaining=0.25, trusted=0.25, levels=8, retries_failures=True)
STRICTER = Change(setting="tolerance", factor=0.1, remaining=0.1, trusted=0.5, levels=5, retries_failures=False)


def run_accurately(
    plan: SimulatorRun, *, out: AnyPath | None = None, steps: AnyPath | None = None,
    progress: Progress | None = None, estimate: bool = True, allow_switch: bool = True, advise: bool = False,
) -> Trajectory:  # fmt: skip
    """Run a simulator to its end, with steps that meet the run's ``goal`` if it has one, and estimate the error.

    Without ``estimate`` there is one run without energy balance, and the goal is ignored. If a run fails whose plan is free, another
    integrator takes over, unless ``allow_switch`` is False. With ``advise`` possible remedies are tried. Files and errors as of
    `simulator_run.start`.
    """
    plan = plan.with_checks() if estimate else plan
    begin = partial(_start, out=path_of(out), steps=path_of(steps), progress=progress)
    files = [file for file in map(path_of, (out, steps)) if file is not None]
    search = partial(_start, progress=progress) if files else begin
    execute = partial(_execute, begin=begin, search=search, once=any(map(is_stream, files)), estimate=estimate)
    run = retry_failed(plan, execute(plan), execute, allow_switch=allow_switch and plan.is_free, advise=advise)
    return _with_columns(run, {name: values for name, values in run.columns.items() if name in plan.units}) if plan.targets else run


def _start(plan: SimulatorRun, **how: Any) -> Trajectory:
    """A run with a constant column for each target that is an objective; its error follows as that of others does."""
    run = start(plan, **how)
    objectives = {name: split_target(name) for name in plan.targets if split_target(name)[0]} if run.t.size else {}
    values = {name: np.full(run.t.size, OBJECTIVES[objective](run[column])) for name, (objective, column) in objectives.items()}
    return _with_columns(run, {**run.columns, **values}) if values else run


def _with_columns(run: Trajectory, columns: Mapping[str, Array]) -> Trajectory:
    return replace(run, columns=Columns(columns), units=Columns({name: run.units[split_target(name)[1]] for name in columns}))


def _execute(plan: SimulatorRun, *, begin: _Begin, search: _Begin, once: bool, estimate: bool) -> Trajectory:
    if estimate and plan.goal is not None:
        return _refine_to_goal(plan, begin, search, once=once)
    run = begin(plan)
    return replace(run, estimator=partial(estimate_error, plan)) if estimate else run


def _refine_to_goal(plan: SimulatorRun, begin: _Begin, search: _Begin, *, once: bool) -> Trajectory:
    """Refine steps until two runs agree so well that one of them meets the goal, or until refinement no longer helps.

    Runs with coarser steps come first, so that two differences show convergence. The finer of the two returns; if the accuracy is asked
    for, the coarser one where it surely meets the goal. ``search`` begins a run without files, ``begin`` with files, which are written
    ``once`` into streams.
    """
    change, asked, level = _change_of(plan), plan.is_asked, _coarsest_level(plan)
    written, last, at, before, errors = level - 1, None, level, None, dict[str, float]()
    reached, slow, runs = False, tuple[str, ...](), list[Trajectory]()
    while True:
        trial = _finer(plan, change, level)
        expected = _returns_next(plan, change, last, before) if asked else level > 0
        writes = expected and not once
        attempt = begin if writes else search if asked or level > 0 else _start
        written = level if writes else written
        run = _completed(trial, attempt) if level < 0 else attempt(trial)
        plan = plan.begun_as(run)
        if run is None or run.failure is not None:
            if level > 0 and last is not None:
                return _finest_completed(_finer(plan, change, at), begin)
            if run is not None and level > 0 and not (change.retries_failures and level < change.levels):
                break
            last, before, runs, level = None, None, [], level + 1
            errors, reached, slow = {}, False, ()
            continue
        bound = last is not None and _are_bound(change, last, run)
        if last is not None:
            difference = differences(plan.jumps, last, run)
            if bound and level > 0 and (other := _run_with_other_steps(trial, run)) is not None:
                errors, runs, slow = differences(plan.jumps, run, other), [other], ()
                reached = _meets_goal(plan, run, errors)
                break
            remaining = remaining_defect(last, run)
            errors = {
                name: _remaining_error(change, apart, None if before is None else before[name], remaining)
                for name, apart in difference.items()
            }
            slow = () if before is None else find_not_converging(run, before, difference)
            own = _own_errors(change.remaining, difference, before or {})
            coarse = asked and not bound and (before is not None or level > at + 1)
            suffices = coarse and _meets_goal(plan, last, own, _SURE) and not _find_unmet(plan, last, own, slow)
            if before is not None and (level > 0 or not bound):
                reached = _meets_goal(plan, run, errors) and not _allowed(plan, run, errors).keys() & slow
                unmet = _find_unmet(plan, run, errors if level <= 0 else {}, slow)
                if reached and not unmet and (expected or not suffices):
                    break
            if suffices:
                run, level, errors, reached, runs = last, at, own, True, [*runs[:-1], run]
                break
            if before is not None and level > 0 and not any(decreases(run[name], before[name], difference[name]) for name in difference):
                break
            before = difference
        last, at, runs = run, level, [*runs[-1:], run]
        if level == change.levels:
            break
        if bound and level < 0:  # they agree by common steps: a much finer run shows their errors
            before, level = None, level + 1
        level += 1
    run = run if written == level or search is begin else begin(_finer(plan, change, level))
    others = [other for other in runs if other is not run]
    estimate = _judged(plan, run, errors or dict.fromkeys(run.columns, inf), converged=reached, others=others, slow=slow)
    return replace(run, estimator=lambda _: estimate)


def _returns_next(plan: SimulatorRun, change: Change, last: Trajectory | None, before: Mapping[str, float] | None) -> bool:
    """Return whether the next run meets the goal if errors fall as steps explain; ``before``: how far the last is from a coarser one."""
    if last is None or before is None:
        return False
    own, following = (
        _own_errors(change.remaining, {name: share * apart for name, apart in before.items()}, earlier)
        for share, earlier in ((change.remaining, before), (change.remaining**2, {}))
    )
    return _meets_goal(plan, last, following) and not _meets_goal(plan, last, own, _SURE)


def _coarsest_level(plan: SimulatorRun) -> int:
    """The level of the first run: one refinement coarser than the settings; for an accuracy that is asked for, a tolerance above that."""
    if plan.goal is None or not (plan.is_asked and INTEGRATORS[plan.run_file.settings.integrator].adaptive):
        return -1
    first = _COARSEST if plan.targets else min(_COARSEST, _ABOVE * plan.goal)
    return min(-1, round(log10(plan.run_file.settings.tolerance / first)))


def _finest_completed(plan: SimulatorRun, begin: _Begin) -> Trajectory:
    """The finest run that reaches its end, with its error as for given steps, and compared with the goal."""
    run = begin(plan)
    found = estimate_error(plan, run)
    met = replace(found, converged=found.converged and _meets_goal(plan, run, found.max_error))
    return replace(run, estimator=lambda _: met)


def _change_of(plan: SimulatorRun) -> Change:
    return STRICTER if INTEGRATORS[plan.run_file.settings.integrator].adaptive else SHORTER


def _remaining_error(change: Change, difference: float, before: float | None, defect: float) -> float:
    """The error of a run by its distance ``difference`` from a coarser one, and by that one's distance ``before`` from a still coarser one.

    If differences fall faster than the order or the tolerances explain, the energy defect is used instead: ``defect`` is the share of it
    that the finer steps leave, 1 if unknown.
    """
    ratio = _LEFT_AT_MOST if before is None or not before > 0 else difference / before
    if before is None or ratio * _FASTER >= change.trusted:
        ratio = min(max(ratio, change.trusted), _LEFT_AT_MOST)
        return difference * ratio / (1 - ratio)
    share = min(max(_BY_DEFECT * max(defect, ratio), _LEAST_BY_DEFECT), 1.0)
    return share * max(difference, min(1 - _BELIEVED, defect) * before)


def _own_errors(remaining: float, difference: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    """The errors of a run by its distances from a finer one, which leaves a share of them, and from a coarser one if known."""
    return {name: max(apart / (1 - remaining), (1 - _BELIEVED) * before.get(name, 0.0)) for name, apart in difference.items()}


def _meets_goal(plan: SimulatorRun, run: Trajectory, errors: Mapping[str, float], share: float = 1.0) -> bool:
    return all(errors[name] <= share * most for name, most in _allowed(plan, run, errors).items())


def _allowed(plan: SimulatorRun, run: Trajectory, errors: Mapping[str, float]) -> Mapping[str, float]:
    """The targets, else the goal of positions and angles; without any, the goal's share of the largest value of each output."""
    goal = plan.goal or 0.0
    judged = plan.targets or {name: goal / PLACES[run.units[name]] for name in errors if run.units[name] in PLACES}
    return judged or {name: goal * float(np.max(np.abs(run[name]))) for name in errors}


def _find_unmet(plan: SimulatorRun, run: Trajectory, errors: Mapping[str, float], slow: Sequence[str]) -> Collection[str]:
    """The outputs that are rough or do not converge, of those with targets if there are any."""
    return plan.targets.keys() & slow if plan.targets else (*slow, *_find_rough(run, errors))


def _judged(
    plan: SimulatorRun, run: Trajectory, errors: Mapping[str, float], *, converged: bool, others: Sequence[Trajectory] = (),
    slow: Sequence[str] = (),
) -> ErrorEstimate:  # fmt: skip
    """The errors of a run, with the effect of loop violations, jumps near samples, and warnings.

    ``others`` are the same run with other steps, the closest last; ``slow`` outputs do not converge.
    """
    violation, warnings = find_common_violation(run, others), [find_imbalance(run, others)]
    jumps = uncertain_jumps(run, others[-1], plan.run_file.jumps_within or 0.0) if others else {}
    errors = {name: max(error, jumps.get(name, 0.0)) for name, error in errors.items()}
    converged = converged and (not plan.targets or _meets_goal(plan, run, errors))
    if violation > 0.0:
        closed = _controlled(plan)
        difference = {} if closed is None else differences(plan.jumps, run, closed)
        errors = {name: max(error, difference.get(name, 0.0)) for name, error in errors.items()}
        converged = converged and closed is not None and (plan.goal is None or _meets_goal(plan, run, errors))
        counted = "the errors include its effect, found by a run with error control"
        effect = "the errors do not include its effect" if closed is None else counted
        words = f"constraint violation of loops up to {violation:.2g} m or rad, with other steps too: {effect}"
        warnings.append(f"{words}; use closure proximal")
    if run.failure is None and inf in errors.values():
        warnings.append(_describe_failure_of_finer(plan))
    return ErrorEstimate(
        max_error=Columns(errors), units=run.units, converged=converged, warnings=tuple(filter(None, warnings)),
        rough=tuple(dict.fromkeys((*_find_rough(run, errors), *slow))), goal=None if plan.targets else plan.goal, targets=plan.targets,
    )  # fmt: skip


def _describe_failure_of_finer(plan: SimulatorRun) -> str:
    """The failure of a run with finer steps, with settings that continue past it; "" if it completes."""
    finer = _finer(plan, _change_of(plan), 1)
    try:
        failure = retry_failed(finer, start(finer), start, allow_switch=False, advise=True).failure
    except SimulatorError as error:
        return f"with finer steps: {error}"
    return "" if failure is None else f"with finer steps: {failure}"


def _find_rough(run: Trajectory, errors: Mapping[str, float]) -> tuple[str, ...]:
    largest = _largest_by_unit(run)
    sizes = {name: max(float(np.max(np.abs(run[name]), initial=0.0)), _LITTLE * largest[run.units[name]]) for name in errors}
    return tuple(name for name, e in errors.items() if max(_ROUGH * sizes[name], _ROUNDING * largest[run.units[name]]) < e < inf)


def _largest_by_unit(run: Trajectory) -> dict[str, float]:
    """The largest value among the outputs of each unit, of angles at least a radian: the scale for what is small. Rates and accelerations
    have at least that which takes the run's time to reach the largest length, or a radian: at rest all of them are rounding."""
    largest = {unit: 1.0 / PLACES[unit] for unit in _ANGLES}
    for name, values in run.columns.items():
        largest[run.units[name]] = max(largest.get(run.units[name], 0.0), float(np.max(np.abs(values), initial=0.0)))
    length = max((value * PLACES[unit] for unit, value in largest.items() if unit in PLACES and unit not in _ANGLES), default=0.0)
    rate = 1.0 / (float(np.ptp(run.t) if run.t.size else 0.0) or inf)
    least = {SPEED: length * rate, ACCELERATION: length * rate**2, ANGULAR_SPEED: rate, ANGULAR_SPEED / TIME: rate**2}
    for unit in set(run.units.values()):
        one = measure(1.0, unit or "1")
        largest[unit] = max(largest.get(unit, 0.0), least.get(one.dimension, 0.0) / one.value)
    return largest


def estimate_error(plan: SimulatorRun, run: Trajectory) -> ErrorEstimate:
    """The error of each output of a run, as `compare` finds it, with the effect of loop violations.
    Raises Interrupted, Terminated: a signal has ended a run."""
    plan, change = plan.begun_as(run), _change_of(plan)

    def rerun(times: int) -> Trajectory | None:
        other = _try(plan, change, times)
        bound = times > 0 and other is not None and _are_bound(change, run, other)
        return (_run_with_other_steps(plan, run) if bound else None) or other

    estimate, others = compare(run, rerun, remaining=change.remaining, jumps=plan.jumps)
    return _judged(plan, run, estimate.max_error, converged=estimate.converged, others=others)


def compare(
    run: Trajectory, rerun: Callable[[int], Trajectory | None], *, remaining: float, jumps: Sequence[float] = ()
) -> tuple[ErrorEstimate, Sequence[Trajectory]]:  # fmt: skip
    """The errors of a run's outputs, and the same run with other steps, the closest last; infinite errors where it has none.

    ``rerun(n)`` repeats the run with steps refined n times (coarser for n < 0), None if it fails. One refinement leaves the share
    ``remaining`` of an error. The difference from the refined run is the error, up to the smaller error of the refined run. A third run,
    coarser or still finer, shows whether differences fall. They do not in chaotic motion or at a bifurcation, and need not at the level of
    rounding. If they fall faster than the integrator's order explains, the agreement is chance, and a share of the third run's difference
    is the error. If no finer run reaches its end, the difference from a coarser one bounds the error.
    """
    finer = rerun(1) if run.failure is None else None
    coarser = rerun(-1) if run.failure is None else None
    if finer is None:
        difference = dict.fromkeys(run.columns, inf) if coarser is None else differences(jumps, coarser, run)
        coarsest = None if coarser is None else rerun(-2)
        converged = False
        if coarser is not None and coarsest is not None:
            converged = not find_not_converging(run, differences(jumps, coarsest, coarser), difference)
        estimate = ErrorEstimate(max_error=Columns(difference), units=run.units, converged=converged)
        return estimate, [] if coarser is None else [coarser]
    difference = differences(jumps, run, finer)
    if coarser is not None:
        before, after = differences(jumps, coarser, run), difference
    else:
        finest = rerun(2)
        before, after = difference, dict.fromkeys(run.columns, inf) if finest is None else differences(jumps, finer, finest)
    errors = _own_errors(remaining, difference, {} if coarser is None else before)
    converged = not find_not_converging(run, before, after)
    estimate = ErrorEstimate(max_error=Columns(errors), units=run.units, converged=converged, rough=_find_rough(run, errors))
    return estimate, [finer] if coarser is None else [coarser, finer]


def _controlled(plan: SimulatorRun) -> Trajectory | None:
    """The run by the first adaptive integrator among the alternatives of the plan; None if there is none or the run fails."""
    other = next((settings for settings in plan.others if INTEGRATORS[settings.integrator].adaptive), None)
    return None if other is None else _completed(replace(plan, run_file=replace(plan.run_file, settings=other)))


def _try(plan: SimulatorRun, change: Change, times: int) -> Trajectory | None:
    """The run with refined steps and samples at the same times, its iterations too unless rounding prevents that.

    None if it fails, or if no sample of the run is at the end of one of its steps, except the first.
    """
    if times < 0 and change is SHORTER:
        file, longer = plan.run_file, 2**-times
        steps = count_steps(file.settings.dt, file.end, file.output_step)
        if steps.number % longer and lcm(steps.stride, longer) > steps.number:
            return None
    shares = (_FOR_ESTIMATE, _IN_SEQUENCE, 1.0) if times > 0 and change.setting == "dt" else (1.0,)
    runs = (_completed(_finer(plan, change, times, share)) for share in shares)
    return next((run for run in runs if run is not None), None)


def _are_bound(change: Change, run: Trajectory, finer: Trajectory) -> bool:
    """Return whether something else than the tolerance limits nearly all steps of a run, such as samples of controllers."""
    return change is STRICTER and finer.steps < _BOUND * run.steps


def _run_with_other_steps(plan: SimulatorRun, run: Trajectory) -> Trajectory | None:
    """A run with other steps than one whose steps are limited: by another integrator, else with a tolerance that limits them."""
    if (other := _controlled(plan)) is not None:
        return other
    stricter = (_try(plan, STRICTER, times) for times in (2, 4, 6))
    return next((other for other in stricter if other is not None and not _are_bound(STRICTER, run, other)), None)


def _completed(plan: SimulatorRun, begin: _Begin = _start) -> Trajectory | None:
    try:
        run = begin(plan)
    except SimulatorError:
        return None
    return run if run.failure is None else None


def _finer(plan: SimulatorRun, change: Change, times: int, further: float = _IN_SEQUENCE) -> SimulatorRun:
    """The run with steps refined so many times; shorter steps reduce the iteration tolerance by ``further`` each time.

    Otherwise two runs would agree by their common iteration error. A tolerance of steps is that of their iterations too.
    """
    run_file, settings, factor = plan.run_file, plan.run_file.settings, change.factor**times
    if change is STRICTER:
        return replace(plan, run_file=run_file.with_tolerance(factor))
    steps = count_steps(settings.dt, run_file.end, run_file.output_step)  # to the same end, which can lie beyond that of the settings
    finer = replace(settings, dt=settings.dt * factor)
    finer = _iterated_further(finer, times, further) if times > 0 else finer
    output_step = settings.dt * lcm(steps.stride, 2 ** max(0, -times))  # where steps of both end
    return replace(plan, run_file=replace(run_file, settings=finer, end=settings.dt * steps.number, output_step=output_step))


def _iterated_further(settings: Settings, times: int, further: float) -> Settings:
    """Settings whose iterations reduce the residual further, with as many iterations as that takes."""
    tolerance = min(settings.tolerance * further, max(settings.tolerance * further**times, _LEAST))
    absolute = settings.absolute_tolerance
    return replace(
        settings, tolerance=tolerance, absolute_tolerance=None if absolute is None else absolute * tolerance / settings.tolerance,
        iterations=max(settings.iterations, _ITERATIONS), fixed_cost=False,
    )  # fmt: skip


def differences(jumps: Sequence[float], one: Trajectory, other: Trajectory) -> dict[str, float]:
    """The largest difference of each column over the common samples of two runs, without those at jumps."""
    tick = 1e-6 * float(one.t[-1] - one.t[0]) / one.t.size or 1.0
    times, here, there = np.intersect1d(np.rint(one.t / tick), np.rint(other.t / tick), return_indices=True)
    smooth = ~np.isin(times, np.rint(np.asarray(jumps, dtype=float) / tick))
    difference = {name: distance_of(name, one[name][here], other[name][there])[smooth] for name in one.columns}
    return {name: float(np.max(apart, initial=0.0)) for name, apart in difference.items()}


def find_not_converging(run: Trajectory, before: Mapping[str, float], after: Mapping[str, float]) -> tuple[str, ...]:
    """The outputs whose differences neither fall with finer steps nor are rounding errors."""
    largest = _largest_by_unit(run)
    return tuple(c for c in after if after[c] > _ROUNDING * largest[run.units[c]] and not decreases(run.columns[c], before[c], after[c]))


def decreases(values: Array, before: float, after: float) -> bool:
    size = float(np.max(np.abs(values)))
    return after <= max(before / _FALLING, _SMALL * size)


def remaining_defect(before: Trajectory, after: Trajectory) -> float:
    """The share of the energy defect that finer steps leave, from two runs; 1 if unknown."""
    if before.energy is None or after.energy is None or not before.energy.defect > 0:
        return 1.0
    return min(1.0, after.energy.defect / before.energy.defect)


def uncertain_jumps(run: Trajectory, other: Trajectory, within: float) -> dict[str, float]:
    """The largest jump of each column near a sample that another run may have on the sample's other side.

    Jumps are searched for ``within`` a time (s) of samples.  A jump that the other run lacks there is at least that far away.
    """
    found: dict[str, float] = {}
    for jump in run.near_jumps:
        same = (j.after for j in other.near_jumps if j.column == jump.column and abs(j.time - jump.time) < within)
        late = _LATE * abs(jump.after - next(same, copysign(within, jump.after)))
        if abs(jump.after) <= late:
            found[jump.column] = max(found.get(jump.column, 0.0), jump.size)
    return found


# Energy balance


def find_imbalance(run: Trajectory, others: Sequence[Trajectory]) -> str:
    """The fault in the energy balance of a run, by runs with other steps; "" if there is none.

    Exact steps have no defect, so its change with the steps estimates it. A defect that does not change is no error of the steps.
    """
    balances = [other.energy for other in others if other.energy is not None and other.failure is None]
    energy = run.energy
    if energy is None or not balances or not energy.share > _SMALL_SHARE or energy.kinetic < energy.of_unit_speed * _REST**2:
        return ""
    change = max(abs(energy.defect - other.defect) for other in balances)
    explained = change * (_EXPLAINED_BY_ONE if len(balances) == 1 else _EXPLAINED)
    if not energy.defect > explained:  # also of a run whose defect is unknown
        return ""
    return (
        f"work and energy differ by {energy.defect:.2g} J, of {energy.kinetic + energy.exchanged:.2g} J in all, and with other "
        f"steps by {change:.1g} J more or less: the cause is not the step size but the loop closure or a guide that jumps; "
        "the errors do not include it"
    )


# Constraint violation of loops


def find_common_violation(run: Trajectory, others: Sequence[Trajectory]) -> float:
    """The largest violation (m or rad) of the loops that runs with other steps share; 0 if they do not.

    It occurs for example after a guide's rate jumps.
    """
    violation, violations = run.statistics.residuals.position, [other.statistics.residuals.position for other in others]
    return violation if violation > _SMALL_VIOLATION and any(violation / _SAME < other < violation * _SAME for other in violations) else 0.0
