// Failures of a start or a step: plain values, which a host can query and a driver can report.
#pragma once

namespace cutjoint {

/// The reason why a start or a step stopped, numbered from 0.  Numbers stay the same from version to version; new ones are added at the end.
/// Their meanings, for the headers of exports, are in `emit/statuses.py` of the compiler.
enum class Cause : int {
  none, not_converged, diverged, loops_not_closed, speeds_not_found, no_assembly, speeds_inconsistent, infinite_acceleration,
  no_equilibrium, guard_violated, tolerance_not_met, stiff, accelerations_not_finite, chattering, too_many_steps, mass_matrix_singular,
  newton_not_converged, newton_diverging, newton_infinite, forces_not_finite, tangent_not_finite, equations_not_finite, tangent_singular,
  tangent_not_positive, pose_singular, start_not_converged, start_inconsistent, stages_not_found, stage_not_converged, loops_violated,
  step_size_too_small, sample_not_finite, limit_exceeded, step_subdivided, simultaneous_events, speeds_jump, event_at_step_end,
  no_trim
};

/// The list that contains the number that failed most; `states` are speeds that are first-order states.
enum class FaultList : int { none = 0, speeds = 1, equations = 2, guards = 3, coordinates = 4, indicators = 5, controllers = 6, limits = 7, states = 8, aims = 9 };

/// A failure: none if the cause is none. `index` is the place of the worst number in its list, `value` its residual (SI units), `size` the
/// bound, `iterations` their number, `closer` whether the last iterations still reduced it, `equation` that of a violation beyond a limit. Lists are those
/// of the integrated mechanism or system, or, `at_start`, of the mechanism that finds the start.
struct Fault {
  Cause cause = Cause::none;
  FaultList list = FaultList::none;
  int index = -1;
  double t = 0.0;
  long step = 0;
  double value = 0.0;
  double size = 1.0;
  int iterations = 0;
  bool closer = false;
  bool at_start = false;
  int equation = -1;

  explicit operator bool() const { return cause != Cause::none; }
};

/// Whether a fault concerns the result of a step, not the step itself.
constexpr bool has_made_step(const Fault& fault) {
  return fault.cause == Cause::guard_violated || fault.cause == Cause::loops_violated || fault.cause == Cause::sample_not_finite ||
         fault.cause == Cause::limit_exceeded;
}

/// The message of a cause.
constexpr const char* text_of(Cause cause) {
  switch (cause) {
    case Cause::none: return "success";
    case Cause::not_converged: return "the fixed point did not converge";
    case Cause::diverged: return "the fixed point diverged to infinity";
    case Cause::loops_not_closed: return "the loops cannot be closed";
    case Cause::speeds_not_found: return "no speeds keep the loops closed";
    case Cause::no_assembly: return "the loop cannot close from the given coordinates";
    case Cause::speeds_inconsistent: return "the given speeds contradict the loops";
    case Cause::infinite_acceleration: return "an acceleration has no finite value at the start";
    case Cause::guard_violated: return "a guard is violated: the force would act, or the equation stands open";
    case Cause::tolerance_not_met:
    case Cause::stiff: return "no step is small enough for the tolerance";
    case Cause::accelerations_not_finite: return "the accelerations have no finite value";
    case Cause::chattering: return "a force switches to and fro without end";
    case Cause::mass_matrix_singular: return "the equations of motion cannot be solved";
    case Cause::too_many_steps: return "a call would take more steps than it may";
    case Cause::no_equilibrium: return "no static equilibrium was found near the given pose";
    case Cause::no_trim: return "no start near that of the model file meets the conditions of the trim, within the bounds of what is found";
    case Cause::newton_not_converged: return "Newton's iteration did not converge";
    case Cause::newton_diverging: return "Newton's iteration diverges";
    case Cause::newton_infinite: return "Newton's iteration diverged to infinity";
    case Cause::forces_not_finite: return "the equations of motion have no finite value";
    case Cause::tangent_not_finite: return "the tangent has no finite value";
    case Cause::equations_not_finite: return "an equation has no finite value";
    case Cause::tangent_singular: return "the tangent is singular";
    case Cause::tangent_not_positive: return "a pivot of the tangent is not positive";
    case Cause::pose_singular: return "the pose is singular, or nearly: equations depend on each other for a moment";
    case Cause::start_not_converged: return "the accelerations at the start do not converge";
    case Cause::start_inconsistent: return "the start does not satisfy an equation";
    case Cause::stages_not_found: return "Newton's iteration converges with no step, however small";
    case Cause::stage_not_converged: return "Newton's iteration did not converge in a stage";
    case Cause::loops_violated: return "a loop is torn: guides move where it cannot close, or its position residual exceeds a hundredth of the mechanism's size, or of a radian";
    case Cause::sample_not_finite: return "a controller computes a value that is not finite";
    case Cause::limit_exceeded: return "a step exceeds a limit";
    case Cause::step_subdivided: return "the step has no derivative: it ended at an event, or was divided into substeps";
    case Cause::simultaneous_events: return "the run has no derivative: two events coincide that other parameter values would separate, and they change the accelerations";
    case Cause::speeds_jump: return "the run has no derivative: velocities jump where a guide changes its formula";
    case Cause::event_at_step_end: return "the run has no derivative: an event lies exactly where a step ends or a controller takes a sample; other parameter values would move it away";
    case Cause::step_size_too_small: return "the run stands still: its steps have become too short for it to reach its end";
  }
  return "unknown cause";
}

/// Advice if Newton's iteration does not converge.
constexpr const char* advice_of_newton(const Fault& fault) {
  if (!(fault.value - fault.value == 0.0) || fault.cause == Cause::newton_infinite) return "try: a smaller dt";
  if (fault.closer) return "it was still getting closer; try: more iterations, or a smaller dt";
  if (fault.value <= 1e-4 * fault.size) return "the residual may be rounding; try: a larger tolerance";
  return "look at the forces on this coordinate, and whether it moves mass; try: a smaller dt";
}

/// Advice if a step is too long for the accelerations.
constexpr const char* shorter_steps = "try: a smaller dt, or compiling with the method recursive-newton, as for stiff models";

/// Advice; remedies follow "try: ".
constexpr const char* advice_of(const Fault& fault) {
  switch (fault.cause) {
    case Cause::none: return "";
    case Cause::not_converged: return fault.value <= 1e-4 * fault.size ? "the residual may be rounding; try: a larger tolerance" : shorter_steps;
    case Cause::diverged: return "a force, parameter or input may be out of its range; try: a smaller dt, or compiling with the method recursive-newton, as for stiff models";
    case Cause::loops_not_closed:
    case Cause::speeds_not_found: return "try: a smaller dt";
    case Cause::no_assembly:
    case Cause::speeds_inconsistent: return "check the joints' points, guides, and the given coordinates and speeds of this loop; give at most as many as there are degrees of freedom; near a dead centre give others";
    case Cause::infinite_acceleration: return "it may move no mass in this pose, as of massless links in line; try: another pose, or another method";
    case Cause::stages_not_found:
    case Cause::tolerance_not_met: return "look for an unbounded force, or for a singular pose, as where a massless body is aligned with the body it moves; try: a larger tolerance";
    case Cause::stiff: return "stability limits the steps, as of a stiff model; try: compiling with the method recursive-newton";
    case Cause::accelerations_not_finite: return shorter_steps;
    case Cause::chattering: return "make its law continuous there, or let steps go over it with events: crossed";
    case Cause::mass_matrix_singular: return "a motion may move no mass in this pose; or rounding takes the masses beside a given penalty; try: a smaller penalty";
    case Cause::too_many_steps: return "allow more steps or a larger tolerance; or the motion may have grown without bound";
    case Cause::guard_violated: return "use the full model";
    case Cause::no_equilibrium:
      if (fault.list == FaultList::states) return "the rate of this state does not vanish at rest, as of an integral or a cost: give a state far from 1 its nominal value, leave the state out of the model, or linearise about a motion";
      return "check that springs carry the weight near this pose, that no wheel stands far in the road, that every free coordinate has a spring or a given value, and which coordinates are given";
    case Cause::no_trim: return "cutjoint equilibrium, with the same values, searches further and says what is possible; set inputs that disturb the motion after the start";
    case Cause::newton_not_converged:
    case Cause::newton_diverging:
    case Cause::newton_infinite: return advice_of_newton(fault);
    case Cause::forces_not_finite:
    case Cause::tangent_not_finite:
    case Cause::equations_not_finite: return "values may have grown without bound; try: a smaller dt";
    case Cause::tangent_singular: return "this coordinate has neither mass nor stiffness, and no equation holds it";
    case Cause::tangent_not_positive:
      return "a negative stiffness or damping outweighs the mass over a step this long, or this coordinate has neither mass nor stiffness, and no "
             "equation holds it; try: a smaller dt";
    case Cause::pose_singular: return "try: another dt, or the methods augmented and recursive, which can cross such poses";
    case Cause::start_not_converged: return "look for an unbounded force, or for a pose in which a motion moves no mass; try: a larger penalty";
    case Cause::start_inconsistent: return "coordinates and speeds have to close the loops";
    case Cause::stage_not_converged: return "try: a smaller dt, or the integrator radau5, which chooses its steps";
    case Cause::loops_violated: return "a guide may go where the loop cannot close, or have jumped too far for one step; try: a smaller dt, or the closure proximal";
    case Cause::sample_not_finite: return "look for a division by zero, or a root or logarithm of a negative number, at this instant; or the loop is not stable";
    case Cause::limit_exceeded: return "the step is made, and the motion may go on; try: a smaller dt, or another limit";
    case Cause::step_subdivided: return "take this step without its derivative, or differentiate a run";
    case Cause::simultaneous_events: return "derivatives are one-sided there; move one of both, or let steps go over events by the integrator trapezoidal";
    case Cause::speeds_jump: return "make the motion of the guide smooth";
    case Cause::event_at_step_end: return "derivatives are one-sided there; try: another dt";
    case Cause::step_size_too_small:
      return "look for a force that jumps where a motion comes to rest, such as sign(rate), and make it steep instead, such as tanh(rate/0.01); or for "
             "a pose in which a motion moves no mass, as of massless links in line; try: a larger tolerance";
  }
  return "";
}

}  // namespace cutjoint
