"""The number of steps in a run, and in a row of its table."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

from cutjoint.model.ranges import fault_of_setting

#: With more steps, times of neighbouring steps are one number in double precision.
MOST_STEPS = 2**53

#: The rows that a table has at most.
MOST_ROWS = 10**8


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

    The last step may go beyond ``end``.  A run with ``end`` 0 has no steps and one row.  read_steps.hpp has the same.

    Raises:
        StepsError: a time is out of its range, a step is longer than the run, or steps or rows are too many.
    """
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
