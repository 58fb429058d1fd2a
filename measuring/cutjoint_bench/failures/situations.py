"""Situations that are known to be hard, with what each method should do in them and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from math import inf

from cutjoint_bench.cutjoint_contenders import TOLERANCES
from cutjoint_bench.exact.chain import Chain, chain_motion, singular_times, write_chain
from cutjoint_bench.exact.crank import SLIDER_CRANK, slider_crank_motion, upright_time
from cutjoint_bench.exact.pendulum import PENDULUM, pendulum_motion
from cutjoint_bench.failures.trials import Pose, Situation, Trial

#: Right outcomes: to the point, on the right motion, a message, and anything but a wrong result.
GOOD = ("converged",)
FAIR = ("converged", "inaccurate")
STOPS = ("diverged",)
HONEST = (*FAIR, *STOPS)

#: Steps (s) across a singular pose, those near which a step is to end on the pose, and the largest that a fixed penalty of 1e4 allows.
CROSSING = (1e-4, 1e-3, 5e-3, 2e-2)
LANDING = (1.4e-4, 3.6e-4, 5e-4, 1e-3, 3.6e-3, 7.1e-3)
LIGHT = 1e-3

#: Steps (s) that are too short across a singular pose, with a penalty that follows them.
FINE = (2e-5, 4e-5)

#: Settings of the recursive method that do not follow the step.
FIXED = {"penalty": 1e4, "frequency": 200.0}


def all_situations() -> Iterator[Situation]:
    """Every situation."""
    yield cross_chain(2, CROSSING, LANDING, FINE)
    yield cross_chain(40, (1e-3, 5e-3), (1e-3,))
    yield cross_dead_centre()
    yield close_twice()
    yield step_finely()
    yield swing_long()
    yield sway_long()
    yield from (place_far(offset) for offset in (1e3, 1e6))
    yield weigh_nothing()


def cross_chain(windows: int, steps: Sequence[float], landing: Sequence[float], fine: Sequence[float] = ()) -> Situation:
    """The N-four-bar through the poses in which all bars are in line; ``fine`` are steps (s) too short there for the method recursive."""
    chain = Chain(windows=windows)
    too_fine = (
        Trial(
            method="recursive", dt=dt, expected=STOPS,
            because="The penalty grows by the inverse square of the step, and the rounding of closed loops with it: beside the pose what "
            "is left of an iteration is more than its tolerance.",
        )
        for dt in fine
    )  # fmt: skip
    return Situation(
        name=f"singular pose, {windows} windows",
        words=f"An N-four-bar of {windows} windows turns through poses in which all its bars are in line.  There each loop loses a "
        "direction, and other motions branch off; the exact one stays a parallelogram.",
        text=write_chain(chain), end=4.0, motion=partial(chain_motion, chain), trials=(*_cross(steps, landing), *too_fine),
        pose=Pose(column="crank_0.bar.y", time=singular_times(chain)[0]),
    )  # fmt: skip


def cross_dead_centre() -> Situation:
    """The slider-crank with equal bars through its dead centre."""
    return Situation(
        name="dead centre",
        words="A slider-crank whose rod is as long as its crank.  With the crank upright the slider is at the crank's pin, where it may go "
        "on or stay while both bars turn; the exact motion goes on.",
        text=SLIDER_CRANK, end=4.0, motion=slider_crank_motion, trials=tuple(_cross(CROSSING, LANDING, lost=1e-3)),
        pose=Pose(column="slider.x", time=upright_time()),
    )  # fmt: skip


def _cross(steps: Sequence[float], landing: Sequence[float], *, lost: float = inf) -> Iterator[Trial]:
    """All methods across a singular pose; from a step of ``lost`` s on one that ends there takes `recursive-newton` onto another branch."""
    for dt, lands in (*((dt, False) for dt in steps), *((dt, True) for dt in landing)):
        yield from _cross_recursively(dt, lands)
        yield _cross_by_newton(dt, lands, loses=lands and dt >= lost)
        yield Trial(
            method="augmented", dt=dt, lands=lands, expected=FAIR,
            because="Its tangent is positive definite whatever the rank of the Jacobian is.",
        )  # fmt: skip
        yield Trial(
            method="classical", dt=dt, lands=lands, expected=HONEST if lands else FAIR,
            because="Its tangent is singular in the pose.  A run that meets it stops and says so; one that passes beside it goes on."
            if lands else "No step ends on the pose, and beside it the tangent is regular.",
        )  # fmt: skip
    yield Trial(
        method="recursive", dt=LIGHT, expected=STOPS, settings={"penalty": 1e8},
        because="Beside the pose a heavy penalty asks for accelerations that change faster than the fixed point can follow.",
    )


def _cross_by_newton(dt: float, lands: bool, *, loses: bool) -> Trial:
    """A known fault is expected, until it is mended."""
    if loses:
        because = (
            "Where a step ends on the pose the motion does not tell its branch, and the check that equations are independent sees nothing: "
            "it goes on along the other one silently."
        )
        return Trial(method="recursive-newton", dt=dt, lands=lands, expected=("wrong",), because=because)
    because = "Its multipliers settle only where equations are independent: near the pose it stops and says so, unless a step leaps over."
    return Trial(method="recursive-newton", dt=dt, lands=lands, expected=HONEST, because=because)


def _cross_recursively(dt: float, lands: bool) -> Iterator[Trial]:
    """With the scene's own penalty, which follows the step, and with one that does not."""
    yield Trial(
        method="recursive", dt=dt, lands=lands, expected=FAIR,
        because="A penalty by the inverse square of the step and a frequency by its inverse keep the fixed point contracting.",
    )  # fmt: skip
    yield Trial(
        method="recursive", dt=dt, lands=lands, expected=GOOD if dt <= LIGHT else STOPS, settings=FIXED,
        because="The fixed point contracts across the pose while step times root of penalty over mass is below about 0.1: with 1e4 N/m and "
        "1 kg up to 1 ms.",
    )  # fmt: skip


#: The chain of one window that sways about the upright, far from its singular pose.
SWAYING = Chain(windows=1, gravity=9.81)


def _sway(name: str, words: str, trials: Iterator[Trial], *, end: float, chain: Chain = SWAYING) -> Situation:
    return Situation(
        name=name, words=words, text=write_chain(chain), end=end, motion=partial(chain_motion, chain), trials=tuple(trials)
    )  # fmt: skip


def close_twice() -> Situation:
    """A window with redundant equations."""
    reasons = {
        "recursive": ((1e-3, 2e-3), "A penalty on six equations of rank two is as good as one on two."),
        "augmented": ((1e-3, 2e-2), "Multipliers of equations that depend on each other share what one would carry."),
        "classical": ((1e-3, 2e-2), "Equations that always depend on others are left out when the model is compiled."),
    }
    return _sway(
        "redundant equations", "A window of spatial revolutes that moves in a plane: four of the six equations that close it always hold.",
        (Trial(method=m, dt=dt, expected=FAIR, because=why) for m, (steps, why) in reasons.items() for dt in steps), end=4.0,
    )  # fmt: skip


def step_finely() -> Situation:
    """Small steps with heavy penalties."""
    return _sway(
        "small steps, heavy penalties", "The window in steps down to 10 us with penalties up to 1e12 N/m beside masses of 1 kg.",
        (trial for dt in (1e-3, 1e-4, 1e-5) for trial in _fine_steps(dt)), end=1.0,
    )  # fmt: skip


def _fine_steps(dt: float) -> Iterator[Trial]:
    resolved = "The unknowns are accelerations: small steps cost no digits."
    yield Trial(method="classical", dt=dt, expected=GOOD, because=resolved)
    for penalty in (1e9, 1e12):
        noise = penalty * 1e-16
        yield Trial(method="augmented", dt=dt, settings={"penalty": penalty}, expected=GOOD, because=resolved)
        yield Trial(
            method="recursive", dt=dt, settings={"penalty": penalty}, expected=GOOD if noise < 1e-6 else STOPS,
            because=f"Rounding is enlarged by penalty over mass, to {noise:.0e} of the accelerations; a step is to settle to 1e-6.",
        )  # fmt: skip


def swing_long() -> Situation:
    """The pendulum over 1000 s."""
    steps = {"recursive": 5e-3, "augmented": 1e-3, "classical": 1e-3}
    because = "The trapezoidal rule keeps the size of the swing.  Its period is a little off, which adds up to centimetres."
    return Situation(
        name="long run, pendulum", words="A pendulum that swings for 1000 s: nothing may drive or damp it.", text=PENDULUM, end=1000.0,
        motion=pendulum_motion, trials=tuple(Trial(method=m, dt=dt, expected=FAIR, because=because) for m, dt in steps.items()),
    )  # fmt: skip


def sway_long() -> Situation:
    """A window over 1000 s."""
    projected = "Projections keep the loop closed.  The period is a little off, which adds up to centimetres."
    reasons = {
        "recursive": (2e-3, "Stabilisation holds the loop, at the price of a little energy."),
        "augmented": (5e-3, projected), "classical": (5e-3, projected),
    }  # fmt: skip
    return _sway(
        "long run, closed loop", "The window over 1000 s: the loop may neither open nor cost energy.",
        (Trial(method=m, dt=dt, expected=FAIR, because=why) for m, (dt, why) in reasons.items()), end=1000.0,
    )  # fmt: skip


def place_far(offset: float) -> Situation:
    """A window far from the origin of the world."""
    chain = Chain(windows=1, gravity=9.81, offset=offset)
    return _sway(
        f"{offset:.0e} m from the origin", f"The window {offset:.0e} m away along x: the same motion, with places of more digits.",
        _far_places(offset), end=4.0, chain=chain,
    )  # fmt: skip


def _far_places(offset: float) -> Iterator[Trial]:
    for precision, digit in {"single": 6e-8, "double": 1.1e-16}.items():
        place = digit * offset
        settings = {"tolerance": TOLERANCES["single"]} if precision == "single" else {}
        light = {**settings, "penalty": 100.0, "frequency": 10.0} if precision == "single" else {}
        yield Trial(
            method="recursive", dt=1e-3, precision=precision, settings=light, expected=GOOD if place < 1e-4 else ("inaccurate", "wrong"),
            because=f"Each branch is computed from its own first joint; only places in the table are rounded, to {place:.0e} m.",
        )  # fmt: skip
        for method in ("augmented", "classical"):
            yield Trial(
                method=method, dt=1e-3, precision=precision, settings=settings,
                expected=GOOD if place < 1e-12 else FAIR if place < 1e-9 else ("inaccurate", "wrong", "diverged"),
                because=f"Coordinates are places in the world, rounded to {place:.0e} m; over a step of 1 ms that is "
                f"{place / 2.5e-7:.0e} m/s2 of acceleration.",
            )  # fmt: skip


def weigh_nothing() -> Situation:
    """A window whose coupler weighs next to nothing."""
    because = "The loop gives the coupler the inertia of its cranks before anything is divided by its own."
    return _sway(
        "a rod of 1e-9 kg", "The window with a coupler of 1e-9 kg between cranks of 1 kg.",
        (Trial(method=m, dt=1e-3, expected=GOOD, because=because) for m in ("recursive", "augmented", "classical")), end=4.0,
        chain=Chain(windows=1, gravity=9.81, coupler=1e-9),
    )  # fmt: skip
