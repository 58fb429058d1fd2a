"""Runs that are as exact as wanted, and how wrong a run is: the differences to the same run with other steps show it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import copysign, inf

import numpy as np

from cutjoint.methods import INTEGRATORS
from cutjoint.model.expressions.units import PLACES
from cutjoint.model.ranges import count_steps
from cutjoint.package.locations import AnyPath, path_of
from cutjoint.run.fallbacks import follow_up
from cutjoint.run.record import RunFile, Settings
from cutjoint.run.results import Array, Columns, EnergyBalance, ErrorEstimate, NearJump, Trajectory
from cutjoint.run.simulator import Progress, SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start

#: From one difference to the next no more than this share of the first is believed to have gone: by more, two runs agree by chance.
_BELIEVED = 6 / 7
#: The largest share of an error that steps once finer are taken to leave, and the one where nothing is known.
_LEFT_AT_MOST = 0.6
#: A difference that is this much smaller than the steps explain is so by chance.
_FASTER = 1.25
#: Of a difference so many times the share is left that finer steps leave of the defect of work and energy, and at least the second share.
_BY_DEFECT, _LEAST_BY_DEFECT = 2.5, 0.3
#: The tolerance of iterations with steps once shorter, as a share: in a run that tells the error of another, and in one of a row of runs.
_BESIDE, _IN_ROW = 1e-2, 1e-1
#: Iterations are not asked for a smaller tolerance in several times, and are no more than so many.
_LEAST, _ITERATIONS = 1e-10, 100


@dataclass(frozen=True, kw_only=True)
class Change:
    """A way to finer steps: a setting's factor, and the share of the error that is left at least by order 2.

    A run is taken again with finer steps ``levels`` times at most; where ``heals``, also after one that failed for its steps.  Of a smaller
    share than ``trusted`` nothing is promised: with a tenth of the tolerance errors fall now by two and now by fifty.
    """

    setting: str
    factor: float
    left: float
    trusted: float
    levels: int
    heals: bool


SHORTER = Change(setting="dt", factor=0.5, left=0.25, trusted=0.25, levels=8, heals=True)
STRICTER = Change(setting="tolerance", factor=0.1, left=0.1, trusted=0.5, levels=5, heals=False)


def run_accurately(
    plan: SimulatorRun, *, out: AnyPath | None = None, steps: AnyPath | None = None, tangents: AnyPath | None = None,
    progress: Progress | None = None, estimate: bool = True, go_over: bool = True, advise: bool = False,
) -> Trajectory:  # fmt: skip
    """Run a simulator to its end, with steps that keep the run's ``goal`` if it has one; the run can say how wrong it is.

    Without ``estimate`` there is one run without a balance of work and energy, and the goal is not looked at.  Where a run fails whose
    plan is free, another integrator takes over if it can, unless ``go_over`` is False.  To ``advise`` is to try what may help.  Files and
    errors as of `simulator_run.start`.
    """
    plan = plan.with_checks() if estimate else plan
    begin = partial(start, out=path_of(out), steps=path_of(steps), tangents=path_of(tangents), progress=progress)
    execute = partial(_execute, begin=begin, estimate=estimate)
    return follow_up(plan, execute(plan), execute, go_over=go_over and plan.is_free, advise=advise)


def _execute(plan: SimulatorRun, *, begin: Callable[[SimulatorRun], Trajectory], estimate: bool) -> Trajectory:
    if estimate and plan.goal is not None:
        return _reach(plan, plan.goal, begin)
    run = begin(plan)
    return replace(run, estimator=partial(estimate_error, plan)) if estimate else run


def _reach(plan: SimulatorRun, goal: float, begin: Callable[[SimulatorRun], Trajectory]) -> Trajectory:
    """Make steps finer until two runs agree so well that the better one keeps the goal, or until they come no nearer.

    A run with coarser steps comes before the first one, so that two differences show whether they fall, which alone is convergence.
    """
    change = _change_of(plan)
    last, before, errors = start(plan), None, dict[str, float]()
    reached, slow = False, tuple[str, ...]()
    coarser = _try(plan, change, -1) if last.failure is None else None
    runs = [last] if coarser is None else [coarser, last]
    if coarser is not None:
        before = differences(plan.jumps, coarser, last)
    for level in range(1, change.levels + 1):
        run = begin(_finer(plan, change, level))
        if run.failure is not None:
            if last.failure is None:
                return _last_kept(_finer(plan, change, level - 1), goal, begin)
            if change.heals and level < change.levels:
                continue
            return _with_estimate(run, _judged(plan, run, _unknown(run), converged=False))
        if last.failure is None:
            apart = differences(plan.jumps, last, run)
            if _are_bound(change, last, run) and (other := _unlike(_finer(plan, change, level), run)) is not None:
                errors = differences(plan.jumps, run, other)
                return _with_estimate(run, _judged(plan, run, errors, converged=_keeps(run, errors, goal), others=[other]))
            left = defect_left(last, run)
            errors = {name: _left(change, apart[name], None if before is None else before[name], left) for name in apart}
            if before is not None:
                slow = find_slow(run, before, apart)
                reached = _keeps(run, errors, goal) and not _judged_by(run, errors).keys() & slow
                if (reached and not slow) or not any(falls(run[name], before[name], apart[name]) for name in apart):
                    break
            before = apart
        last = run
        runs = [*runs[-1:], run]
    others = [other for other in runs if other is not run]
    return _with_estimate(run, _judged(plan, run, errors or _unknown(run), converged=reached, others=others, slow=slow))


def _last_kept(plan: SimulatorRun, goal: float, begin: Callable[[SimulatorRun], Trajectory]) -> Trajectory:
    """The finest run that comes to its end, judged as one with given steps, and by the goal."""
    run = begin(plan)
    found = estimate_error(plan, run)
    return _with_estimate(run, replace(found, converged=found.converged and _keeps(run, found.max_error, goal)))


def _with_estimate(run: Trajectory, estimate: ErrorEstimate) -> Trajectory:
    return replace(run, estimator=lambda _: estimate)


def _change_of(plan: SimulatorRun) -> Change:
    return STRICTER if INTEGRATORS[plan.run_file.settings.integrator].adaptive else SHORTER


def _left(change: Change, apart: float, before: float | None, defect: float) -> float:
    """The error of a run by its distance ``apart`` from a coarser one, and by that one's distance ``before`` from a still coarser one.

    Where differences fall faster than the order explains, or than tolerances promise, they say nothing themselves.  The defect of work and
    energy does: ``defect`` is the share that the finer steps leave of it, 1 where nothing shows it.
    """
    ratio = _LEFT_AT_MOST if before is None or not before > 0 else apart / before
    if before is None or ratio * _FASTER >= change.trusted:
        ratio = min(max(ratio, change.trusted), _LEFT_AT_MOST)
        return apart * ratio / (1 - ratio)
    share = min(max(_BY_DEFECT * max(defect, ratio), _LEAST_BY_DEFECT), 1.0)
    return share * max(apart, min(1 - _BELIEVED, defect) * before)


def _keeps(run: Trajectory, errors: Mapping[str, float], goal: float) -> bool:
    """Return whether the outputs that are judged by a goal keep it."""
    return all(errors[name] <= goal * size for name, size in _judged_by(run, errors).items())


def _judged_by(run: Trajectory, errors: Mapping[str, float]) -> dict[str, float]:
    """The sizes of the outputs that are judged by a goal: of places and angles one, of a run without any all outputs with their own."""
    judged = {name: 1.0 / PLACES[run.units[name]] for name in errors if run.units[name] in PLACES}
    return judged or {name: float(np.max(np.abs(run[name]))) for name in errors}


def _unknown(run: Trajectory) -> dict[str, float]:
    return dict.fromkeys(run.columns, inf)


def _judged(
    plan: SimulatorRun, run: Trajectory, errors: Mapping[str, float], *, converged: bool, others: Sequence[Trajectory] = (),
    slow: Sequence[str] = (),
) -> ErrorEstimate:  # fmt: skip
    """The errors of a run, with the effect of open loops, jumps beside rows, and warnings.

    ``others`` are runs of the same with other steps, the last the nearest; outputs that are ``slow`` come no nearer by them.
    """
    gap, warnings = find_open_gap(run, others), [find_imbalance(run, others)]
    jumps = uncertain_jumps(run, others[-1], plan.run_file.jumps_within or 0.0) if others else {}
    errors = {name: max(error, jumps.get(name, 0.0)) for name, error in errors.items()}
    if gap > 0.0:
        closed = _controlled(plan)
        apart = {} if closed is None else differences(plan.jumps, run, closed)
        errors = {name: max(error, apart.get(name, 0.0)) for name, error in errors.items()}
        converged = converged and closed is not None and (plan.goal is None or _keeps(run, errors, plan.goal))
        warnings.append(open_loops(gap, is_known=closed is not None))
    return ErrorEstimate(
        max_error=Columns(errors), units=run.units, converged=converged, warnings=tuple(filter(None, warnings)),
        rough=tuple(dict.fromkeys((*_rough(run, errors), *slow))), goal=plan.goal,
    )  # fmt: skip


#: Outputs with larger errors, as shares of what they reach, have not converged, whatever places do; those that reach less than the second
#: share of what others of their unit do are zero by symmetry.
_ROUGH, _LITTLE = 0.1, 1e-3


def _rough(run: Trajectory, errors: Mapping[str, float]) -> tuple[str, ...]:
    """The outputs with errors that are a large share of their largest values."""
    reach = _reach_of(run)
    sizes = {name: max(float(np.max(np.abs(run[name]), initial=0.0)), _LITTLE * reach[run.units[name]]) for name in errors}
    return tuple(name for name, e in errors.items() if max(_ROUGH * sizes[name], _ROUNDING * reach[run.units[name]]) < e < inf)


def _reach_of(run: Trajectory) -> dict[str, float]:
    """The largest value of the outputs of each unit, of angles at least a radian: nothing else says what is small for them."""
    reach = {unit: 1.0 / PLACES[unit] for unit in ("rad", "mrad", "deg")}
    for name, values in run.columns.items():
        reach[run.units[name]] = max(reach.get(run.units[name], 0.0), float(np.max(np.abs(values), initial=0.0)))
    return reach


def estimate_error(plan: SimulatorRun, run: Trajectory) -> ErrorEstimate:
    """The error of each output of a run, as `compare` finds it, with what open loops change.

    Raises:
        Interrupted, Terminated: a signal has ended a run.
    """
    change = _change_of(plan)

    def again(times: int) -> Trajectory | None:
        other = _try(plan, change, times)
        bound = times > 0 and other is not None and _are_bound(change, run, other)
        return (_unlike(plan, run) if bound else None) or other

    compared = compare(run, again, left=change.left, jumps=plan.jumps)
    return _judged(plan, run, compared.estimate.max_error, converged=compared.estimate.converged, others=compared.others)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The ``estimate`` of a run's errors by ``others``, runs of the same with other steps; infinite errors where there are none."""

    estimate: ErrorEstimate
    others: Sequence[Trajectory]


def compare(run: Trajectory, again: Callable[[int], Trajectory | None], *, left: float, jumps: Sequence[float] = ()) -> Comparison:
    """The error of each output of a run; ``again(n)`` is the run with steps n times finer, coarser for n < 0, None if it fails.

    Of a run's error ``left`` is left with steps once finer.  The run's difference from that one is its error, but for the smaller error of
    that second run.  A third, coarser one, or a still finer one where that fails, shows whether differences fall.  They do not where a
    motion is chaotic, or goes another way at a singular pose, and need not where they are rounding.  Where they fall by more than orders of
    integrators explain, two runs agree by chance, and a share of the third's difference is the error.  Where no finer run comes to its end,
    the error is at most the difference from a coarser one.
    """
    finer = again(1) if run.failure is None else None
    coarser = again(-1) if run.failure is None else None
    if finer is None:
        apart = _unknown(run) if coarser is None else differences(jumps, coarser, run)
        coarsest = None if coarser is None else again(-2)
        falling = coarser is not None and coarsest is not None and not find_slow(run, differences(jumps, coarsest, coarser), apart)
        estimate = ErrorEstimate(max_error=Columns(apart), units=run.units, converged=falling)
        return Comparison(estimate=estimate, others=[] if coarser is None else [coarser])
    apart = differences(jumps, run, finer)
    if coarser is not None:
        before, after = differences(jumps, coarser, run), apart
    else:
        finest = again(2)
        before, after = apart, _unknown(run) if finest is None else differences(jumps, finer, finest)
    errors = {name: difference / (1 - left) for name, difference in apart.items()}
    if coarser is not None:
        errors = {name: max(error, (1 - _BELIEVED) * before[name]) for name, error in errors.items()}
    converged = not find_slow(run, before, after)
    estimate = ErrorEstimate(max_error=Columns(errors), units=run.units, converged=converged, rough=_rough(run, errors))
    return Comparison(estimate=estimate, others=[finer] if coarser is None else [coarser, finer])


def _controlled(plan: SimulatorRun) -> Trajectory | None:
    """The run by an integrator with error control, which closes loops after each step; None if the program has none, or it fails."""
    other = next((settings for settings in plan.others if INTEGRATORS[settings.integrator].adaptive), None)
    return None if other is None else _whole(replace(plan, run_file=replace(plan.run_file, settings=other)))


def _try(plan: SimulatorRun, change: Change, times: int) -> Trajectory | None:
    """The run with steps that are so many times finer, its rows at the same times; None if it fails.

    Its iterations go further, or no further where rounding leaves more than that.
    """
    shares = (_BESIDE, _IN_ROW, 1.0) if times > 0 and change.setting == "dt" else (1.0,)
    runs = (_whole(_finer(plan, change, times, share)) for share in shares)
    return next((run for run in runs if run is not None), None)


def _are_bound(change: Change, run: Trajectory, finer: Trajectory) -> bool:
    """Return whether something else than the tolerance bounds nearly all steps of a run, as samples of controllers do."""
    return change is STRICTER and finer.steps < _BOUND * run.steps


#: A tenth of the tolerance takes at least so many times the steps where the tolerance bounds them: 10^(1/8) by dop853.
_BOUND = 1.1


def _unlike(plan: SimulatorRun, run: Trajectory) -> Trajectory | None:
    """A run with other steps than one whose steps are bound: by another integrator, else by a tolerance so small that it bounds them."""
    if (other := _controlled(plan)) is not None:
        return other
    stricter = (_try(plan, STRICTER, times) for times in (2, 4, 6))
    return next((other for other in stricter if other is not None and not _are_bound(STRICTER, run, other)), None)


def _whole(plan: SimulatorRun) -> Trajectory | None:
    """A run that goes to its end; None if it fails."""
    try:
        run = start(plan)
    except SimulatorError:
        return None
    return run if run.failure is None else None


def _finer(plan: SimulatorRun, change: Change, times: int, further: float = _IN_ROW) -> SimulatorRun:
    """The run with steps that are so many times finer, and with shorter ones iterations that go ``further`` each time."""
    return replace(plan, run_file=_changed(plan.run_file, change, times, further))


def _changed(run_file: RunFile, change: Change, times: int, further: float) -> RunFile:
    """A run file after a change, so many times.

    A tolerance of steps is that of their iterations too.  With shorter steps iterations end by a tolerance that falls beside them: what
    they leave does not fall with the step, so that two runs would agree by it.
    """
    settings, factor = run_file.settings, change.factor**times
    if change.setting == "dt":
        stride = count_steps(settings.dt, run_file.end, run_file.output_step).stride
        finer = replace(settings, dt=settings.dt * factor)
        finer = _iterated_further(finer, times, further) if times > 0 else finer
        return replace(run_file, settings=finer, output_step=settings.dt * stride)
    return run_file.with_tolerance(factor)


def _iterated_further(settings: Settings, times: int, further: float) -> Settings:
    """Settings of iterations that leave next to nothing of what those of given ones do, as many as that takes."""
    tolerance = min(settings.tolerance * further, max(settings.tolerance * further**times, _LEAST))
    absolute = settings.absolute_tolerance
    return replace(
        settings, tolerance=tolerance, absolute_tolerance=None if absolute is None else absolute * tolerance / settings.tolerance,
        iterations=max(settings.iterations, _ITERATIONS), fixed_cost=False,
    )  # fmt: skip


#: Differences of runs fall at least by this factor, from steps to finer ones, where the steps are what is wrong with them.
_FALLING = 1.5
#: Differences that are this share of what an output reaches are small even where they fall no further.
_SMALL = 1e-5
#: Differences below this share of what outputs of the unit reach are rounding, as of what is zero by symmetry.
_ROUNDING = 1e-8
#: The error of a jump's time is at most so many times what two runs differ by.
_LATE = 1.5


def differences(jumps: Sequence[float], one: Trajectory, other: Trajectory) -> dict[str, float]:
    """The largest difference of each column over the times that both runs have rows of, but for those at which something jumps."""
    tick = 1e-6 * float(one.t[-1] - one.t[0]) / one.t.size or 1.0
    times, here, there = np.intersect1d(np.rint(one.t / tick), np.rint(other.t / tick), return_indices=True)
    smooth = ~np.isin(times, np.rint(np.asarray(jumps, dtype=float) / tick))
    gaps = {name: np.abs(one[name][here] - other[name][there])[smooth] for name in one.columns}
    return {name: float(np.max(gap, initial=0.0)) for name, gap in gaps.items()}


def find_slow(run: Trajectory, before: Mapping[str, float], after: Mapping[str, float]) -> tuple[str, ...]:
    """The outputs with differences that do not fall from steps to finer ones, nor are rounding beside what outputs of their unit reach."""
    reach = _reach_of(run)
    return tuple(c for c in after if after[c] > _ROUNDING * reach[run.units[c]] and not falls(run.columns[c], before[c], after[c]))


def falls(values: Array, before: float, after: float) -> bool:
    size = float(np.max(np.abs(values)))
    return after <= max(before / _FALLING, _SMALL * size)


def defect_left(before: Trajectory, after: Trajectory) -> float:
    """The share of the defect of work and energy that finer steps leave, by two runs of the same; 1 where nothing shows it."""
    if before.energy is None or after.energy is None or not before.energy.defect > 0:
        return 1.0
    return min(1.0, after.energy.defect / before.energy.defect)


def uncertain_jumps(run: Trajectory, other: Trajectory, within: float) -> dict[str, float]:
    """The largest jump of each column beside a row of a run that may stand on its other side, by another run of the same with other steps.

    Jumps are looked for ``within`` a time (s) of rows; one that the other run has not there is at least as far away.
    """
    found: dict[str, float] = {}
    for jump in run.near_jumps:
        late = _LATE * abs(jump.after - _after(other, jump, within))
        if abs(jump.after) <= late:
            found[jump.column] = max(found.get(jump.column, 0.0), jump.size)
    return found


def _after(run: Trajectory, sought: NearJump, within: float) -> float:
    """The time (s) after the same row a run has the jump."""
    same = (jump for jump in run.near_jumps if jump.column == sought.column and abs(jump.time - sought.time) < within)
    found = next(same, None)
    return copysign(within, sought.after) if found is None else found.after


# The balance of work and energy

#: A smaller share of the energy in a run is no reason for a warning.
_SMALL_SHARE = 1e-3
#: A mechanism whose energy is that of a smaller speed (m/s, rad/s) rests: a start at rest may accelerate by as much in a second, and the
#: absolute tolerance of steps is this by default.
_REST = 1e-6
#: Steps explain so many times the change by one other run, whose defect may be the same by chance, and by more runs.
_EXPLAINED_BY_ONE, _EXPLAINED = 100.0, 10.0


def find_imbalance(run: Trajectory, others: Sequence[Trajectory]) -> str:
    """The fault in the balance of a run, beside runs of the same with other steps; "" without one.

    The defect of exact steps is zero, so that the change by other steps is an estimate of it.  The rest is no error of the steps.
    """
    balances = [other.energy for other in others if other.energy is not None and other.failure is None]
    if run.energy is None or not balances or not run.energy.share > _SMALL_SHARE:
        return ""
    if run.energy.kinetic < run.energy.of_unit_speed * _REST**2:
        return ""
    change = max(abs(run.energy.defect - other.defect) for other in balances)
    explained = change * (_EXPLAINED_BY_ONE if len(balances) == 1 else _EXPLAINED)
    return _imbalance(run.energy, change) if run.energy.defect > explained else ""


def _imbalance(energy: EnergyBalance, change: float) -> str:
    return (
        f"work and energy differ by {energy.defect:.2g} J, of {energy.kinetic + energy.exchanged:.2g} J in all, and with other steps by "
        f"{change:.1g} J more or less: not the steps but what holds the loops, or a guide that jumps, does work that it should not; "
        "errors of the steps do not see it"
    )


# The gap of loops

#: A smaller gap, m or rad, is no reason for a warning.
_SMALL_GAP = 1e-6
#: Gaps of runs with other steps that differ by less than this factor do not come from the steps.
_SAME = 1.5


def find_open_gap(run: Trajectory, others: Sequence[Trajectory]) -> float:
    """The largest gap (m or rad) of the loops of a run where runs of the same with other steps have it too; 0 where they do not.

    It is an error that all these runs share, as behind a guide whose rate jumps.
    """
    gap, gaps = run.statistics.residuals.position, [other.statistics.residuals.position for other in others]
    return gap if gap > _SMALL_GAP and any(gap / _SAME < other < gap * _SAME for other in gaps) else 0.0


def open_loops(gap: float, *, is_known: bool) -> str:
    """The warning of such a gap; ``is_known`` tells that the errors of the run include its effect."""
    counted = "a run with error control, whose loops are closed, shows what that changes, and the errors count it"
    known = counted if is_known else "errors of the steps do not see what that changes"
    return f"loops stand open by up to {gap:.2g} m or rad, with other steps too: {known}; the closure proximal closes them"
