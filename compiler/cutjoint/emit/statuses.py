"""The statuses of the C interface and the statistics with limits, as the headers of the core number them."""

from dataclasses import dataclass

FAULTS = "cutjoint/core/simulation/fault.hpp"  #: the header of the core that numbers the causes of failures

#: The statistics of a step that hosts may limit, in the order of the core's ``limit_names``.
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
        ("not_converged", "the iteration of a step did not converge"),
        ("diverged", "the iteration of a step diverged"),
        ("loops_not_closed", "no positions near the present ones close the loops"),
        ("speeds_not_found", "no velocities near the present ones keep the loops closed"),
        ("no_assembly", "the loops cannot close from the given coordinates"),
        ("speeds_inconsistent", "the given speeds do not keep the loops closed"),
        ("infinite_acceleration", "an acceleration is not finite"),
        ("no_equilibrium", "no pose near the given one is at rest"),
        ("guard_violated", "a reduced model has left its range of validity: an omitted force would act"),
        ("tolerance_not_met", "no step is small enough for the tolerance"),
        ("stiff", "no step is small enough for the tolerance: the equations are stiff"),
        ("accelerations_not_finite", "an acceleration within a step is not finite"),
        ("chattering", "a force alternates between its formulas without end"),
        ("too_many_steps", "a call would take more steps than it may"),
        ("mass_matrix_singular", "the mass matrix is singular: an acceleration is not determined"),
        ("newton_not_converged", "Newton's iteration did not converge"),
        ("newton_diverging", "Newton's iteration diverges"),
        ("newton_infinite", "Newton's iteration reached infinity"),
        ("forces_not_finite", "the equations of motion have no finite value"),
        ("tangent_not_finite", "the Jacobian of the step has no finite value"),
        ("equations_not_finite", "an equation of the loops has no finite value"),
        ("tangent_singular", "the Jacobian of the step is singular"),
        ("tangent_not_positive", "the symmetric Jacobian of the step is not positive definite"),
        ("pose_singular", "the equations of the loops are linearly dependent in this pose"),
        ("start_not_converged", "the iteration for the accelerations at the start did not converge"),
        ("start_inconsistent", "the start does not satisfy the equations of the loops"),
        ("stages_not_found", "Newton's iteration fails at every step size that was tried"),
        ("stage_not_converged", "Newton's iteration did not converge in a stage of a step of fixed size"),
        ("loops_violated", "a constraint violation exceeds 1 % of the mechanism's size, or a guide goes where the loop cannot close"),
        ("step_size_too_small", "the step size has become too small for the run to reach its end"),
        ("sample_not_finite", "a controller computes a value that is not finite"),
        ("limit_exceeded", "the step was taken; a statistic exceeds the limit that the host has set"),
        ("step_subdivided", "the step was divided, as at an event: it has no derivative"),
        ("simultaneous_events", "two events coincide, and a small change would separate them: the run has no derivative"),
        ("speeds_jump", "velocities jump at an event: the run has no derivative"),
        ("event_at_step_end", "an event lies exactly where a step ends or a sample is taken: the run has no derivative"),
        ("no_trim", "no start near that of the model file meets the conditions of the trim"),
    ), start=1)
}  # fmt: skip
