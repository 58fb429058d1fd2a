"""The statuses of the C interface and the statistics with limits, as the headers of the core number them."""

from collections.abc import Iterable
from dataclasses import dataclass

#: The header of the core that numbers the causes of failures.
FAULTS = "cutjoint/core/simulation/fault.hpp"

#: The statistics of a step that hosts limit, in the order of the core's ``limit_names``.
LIMITED = ("violation", "violation_rate", "change", "pivot", "iterations", "evaluations")


@dataclass(frozen=True, kw_only=True)
class Status:
    """A positive status: its ``cause`` in the core, its number and its meaning."""

    cause: str
    number: int
    text: str

    @property
    def name(self) -> str:
        """The name in C, without the model's prefix."""
        return self.cause.upper()


#: All positive statuses by cause; the numbers count from 1 and stay the same from version to version.
STATUSES = {
    cause: Status(cause=cause, number=number, text=text)
    for number, (cause, text) in enumerate((
        ("not_converged", "the iteration of a step does not end"),
        ("diverged", "the iteration of a step goes to infinity"),
        ("loops_not_closed", "no positions near by close the loops"),
        ("speeds_not_found", "no speeds near by keep the loops closed"),
        ("no_assembly", "the loops cannot close from the given coordinates"),
        ("speeds_inconsistent", "the given speeds do not keep the loops closed"),
        ("infinite_acceleration", "an acceleration is not finite"),
        ("no_equilibrium", "no pose near the given one is at rest"),
        ("guard_violated", "a force that was left out of the model would act"),
        ("tolerance_not_met", "no step is small enough for the tolerance"),
        ("stiff", "the same, where stability and not accuracy limits the steps"),
        ("accelerations_not_finite", "an acceleration within a step is not finite"),
        ("chattering", "a force switches to and fro between its formulas"),
        ("too_many_steps", "a call would take more steps than it may"),
        ("mass_matrix_singular", "the elimination of the equations of motion ends in no number"),
        ("newton_not_converged", "Newton's iteration does not end"),
        ("newton_diverging", "the changes by Newton's iteration grow"),
        ("newton_infinite", "Newton's iteration goes to infinity"),
        ("forces_not_finite", "the equations of motion have no finite value"),
        ("tangent_not_finite", "the tangent has no finite value"),
        ("equations_not_finite", "an equation of the loops has no finite value"),
        ("tangent_singular", "the tangent is singular"),
        ("tangent_not_positive", "the symmetric tangent is not positive definite"),
        ("pose_singular", "equations of the loops depend on each other for a moment"),
        ("start_not_converged", "the iteration for the accelerations at the start does not end"),
        ("start_inconsistent", "the start does not satisfy the equations of the loops"),
        ("stages_not_found", "Newton's iteration converges with no step, however small"),
        ("stage_not_converged", "Newton's iteration does not end in a stage of a step of given length"),
        ("loops_violated", "a loop stands open by more than a hundredth of the mechanism's size, or guides go where it cannot close"),
        ("step_size_too_small", "steps are so short that the rest of the run would have no end"),
        ("sample_not_finite", "a controller computes a value that is not finite"),
        ("limit_exceeded", "the step is made, and exceeds a limit that the host has set"),
        ("step_subdivided", "a step was taken in parts, as at an event, so that it has no derivative"),
        ("simultaneous_events", "events at the same instant that other numbers would separate, so that the run has no derivative"),
        ("speeds_jump", "speeds jump at an event, so that the run has no derivative"),
        ("event_at_step_end", "an event that moves lies where a step ends or a sample is taken, so that the run has no derivative"),
    ), start=1)
}  # fmt: skip


def statuses_in(code: Iterable[str]) -> list[Status]:
    """The statuses whose causes some C++ ``code`` names, by number."""
    texts = list(code)
    return [status for status in STATUSES.values() if any(f"Cause::{status.cause}" in text for text in texts)]
