"""Ranges of settings on the command line, in Python and in model files; limits on the number of steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, inf

# Ranges

LARGEST_INTEGER = 2**31 - 1  #: the largest integer that a simulator reads

_INTEGER = {"least": 0, "most": LARGEST_INTEGER}

#: The range of each setting; see `fault_of`.  Times and their squares have a value in double precision.
RANGES: Mapping[str, Mapping[str, float]] = {
    "dt": {"above": 0.0, "least": 1e-100, "most": 1e100},
    "output_step": {"above": 0.0, "least": 1e-100, "most": 1e100},
    "end": {"least": 0.0, "most": 1e100},
    "at": {"least": 0.0, "most": 1e100},
    "penalty": {"above": 0.0, "most": 1e100},
    "damping_ratio": {"least": 0.0, "most": 1e100},
    "frequency": {"least": 0.0, "most": 1e100},
    "accuracy": {"above": 0.0},
    "tolerance": {"above": 0.0},
    "absolute_tolerance": {"above": 0.0},
    "loop_tolerance": {"least": 1e-12, "most": 1e-2},
    "loop_terms": {"least": 6, "most": 60},
    "spectral_radius": {"least": 0.0, "most": 1.0},
    "iterations": {**_INTEGER, "above": 0.0},
    "c99_iterations": {"least": 1, "most": 100},
    "multiplier_updates": _INTEGER,
    "threads": {"above": 0.0, "most": 4096},
    "replay": {"least": 0},
    "replays": {"least": 0, "most": 100},
    "repetitions": {"above": 0.0, "most": 1000},
    "travel": {"least": 1e-6, "most": 1.0},
    "steer_travel": {"least": 1e-6, "most": 10.0},
    "points": {"least": 3, "most": 1001},
    "priority": {"least": 1, "most": 99},
    "processor": {"least": 0, "most": 65535},
    "live": {"least": 1, "most": 65535},
    "radius": {"least": 1e-3, "most": 10.0},
    "share": {"least": 0.0, "most": 1.0},
    "speed": {"above": 0.0, "most": 1e3},
}

TIMES = frozenset({"dt", "output_step", "end", "at"})  #: settings in s
SOLVER_TOLERANCE = "solver_tolerance"  #: the name in files and calls of the tolerance of a solver, which is called tolerance inside
LENGTHS = frozenset({"travel", "radius"})  #: settings in m, and settings in m or rad
PLACES = frozenset({"accuracy", "tolerance", "steer_travel"})

#: Settings that count something.
WHOLE = frozenset(
    {
        "iterations", "c99_iterations", "multiplier_updates", "loop_terms", "threads", "replay", "replays", "repetitions", "points",
        "priority", "processor", "live",
    }
)
LARGEST_ANGLE = 1e6  #: angles beyond lose so many digits to whole turns that sine and cosine have an error of 1e-10
#: Positions (m) and speeds (m/s, rad/s) beyond are rounded to more than 0.1 mm; squares of smaller ones have a value in any precision.
LARGEST_COORDINATE = 1e12
MOST_STEPS = 2**53  #: with more steps, times of neighbouring steps are one number in double precision
MOST_ROWS = 10**8  #: the rows that a table has at most


def fault_of(value: float, *, above: float = -inf, least: float = -inf, most: float = inf) -> str:
    """The fault in a number and a number to write instead; "" without a fault."""
    if not -inf < value < inf:
        return f"{value:g} is not a finite number; write a plain number in SI units"
    if not value > above:
        return f"{_text(value)} is not above {above:g}; write a larger number"
    if not value >= least:
        return f"{_text(value)} is below {least:g}; write a larger number"
    return "" if value <= most else f"{_text(value)} is above {_text(most)}; write a smaller number"


def fault_of_setting(name: str, value: float) -> str:
    """The fault in the value of a setting; "" without one."""
    fault = fault_of(value, **RANGES[name])
    if not fault and name in WHOLE and value != int(value):
        return f"{value:g} is not a whole number; write one"
    return fault


def _text(value: float) -> str:
    """A number for a message; integers have all their digits unless these are many."""
    if not isinstance(value, int):
        return f"{value:g}"
    return str(value) if abs(value) < 10**15 else f"a number of {value.bit_length()} bits"


def fault_of_state(value: float, *, is_angle: bool = False, bounds: Sequence[float] = ()) -> str:
    """The fault in an initial coordinate, speed or state (SI units); "" without one, and of NaN, which has been noted before."""
    if bounds and (value < bounds[0] or value > bounds[1]):
        return f"{value:g} is outside of its bounds, {bounds[0]:g} to {bounds[1]:g}; write a number between them"
    if is_angle and abs(value) > LARGEST_ANGLE:
        return f"an angle of {value:g} rad has no exact sine and cosine; take whole turns away, so that it is at most {LARGEST_ANGLE:g} rad"
    if abs(value) > LARGEST_COORDINATE:
        return f"{value:g} is above {LARGEST_COORDINATE:g}, where rounding alone moves the model; write a smaller number"
    return ""


# Steps


class StepsError(ValueError):
    """No run has such steps."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """``number`` steps; a row of the table follows each ``stride`` of them and the last."""

    number: int
    stride: int

    @property
    def rows(self) -> int:
        """The rows of the table, that of the start among them."""
        return -(-self.number // self.stride) + 1


def count_steps(dt: float, end: float, output_step: float, *, row_each: bool = False) -> Steps:
    """The steps of a run of ``end`` (s) in steps of ``dt`` (s) with a row each ``output_step`` (s), or ``row_each`` step.
    The last step may go beyond ``end``. A run with ``end`` 0 has no steps and one row. read_settings.hpp counts the same. Raises
    StepsError: a time is out of its range, a step is longer than the run, or steps or rows are too many."""
    for name, value in (("dt", dt), ("end", end), ("output_step", output_step)):
        if fault := fault_of_setting(name, value):
            raise StepsError(f"{name}: {fault}")
    if end == 0:
        return Steps(number=0, stride=1)
    if not dt <= end * (1 + 1e-9):
        raise StepsError(f"dt: a step of {dt:g} s is longer than the run, which ends at {end:g} s; write a smaller dt or a later end")
    if not end / dt <= MOST_STEPS:
        raise StepsError(f"end: {end:g} s in steps of {dt:g} s are more than {MOST_STEPS:g} steps; write an earlier end or a larger dt")
    number = ceil(end / dt - 1e-9)
    steps = Steps(number=number, stride=1 if row_each else max(1, min(number, int(output_step / dt + 0.5))))
    if steps.rows > MOST_ROWS:
        longer = "larger dt" if row_each else "larger output_step"
        raise StepsError(
            f"end: {end:g} s with a row each {steps.stride * dt:g} s are more than {MOST_ROWS:g} rows; write an earlier end or a {longer}"
        )
    return steps
