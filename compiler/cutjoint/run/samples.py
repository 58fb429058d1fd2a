"""Equal steps and the samples of controllers: steps end where a controller is due."""

from __future__ import annotations

from collections.abc import Sequence
from math import fmod

from cutjoint.methods import INTEGRATORS, join_or
from cutjoint.model.records import Controller, Model, Scene
from cutjoint.package.errors import RunError

#: The most samples of a controller in a run.
MOST_SAMPLES = 1e8

#: The largest distance of a number of steps from a whole one.
_WHOLE = 1e-6


def require_sampling(model: Model, scene: Scene, integrator: str) -> None:
    """Check that an integrator ends its steps at samples, if there are any, and that these are not too many.

    Raises:
        RunError: it does not, or there are.
    """
    for controller in model.controllers:
        if scene.end > MOST_SAMPLES * controller.every:
            words = f"controller '{controller.name}': a run of {scene.end:.9g} s has more than {MOST_SAMPLES:.0e} samples, one each"
            raise RunError(f"{controller.span}: {words} {controller.every:.9g} s; write a longer every, or an earlier end")
    if model.controllers and integrator not in (known.name for known in INTEGRATORS.values()):
        first = model.controllers[0]
        words = f"the integrator {integrator} takes no samples, which the controller '{first.name}' needs"
        raise RunError(f"{first.span}: {words}; use {join_or(tuple(known.name for known in INTEGRATORS.values()))}")


def require_fitting_steps(model: Model, scene: Scene, dt: float) -> None:
    """Check that equal steps of ``dt`` (s) divide the intervals and the first times of all samples.

    Raises:
        RunError: they do not.
    """
    times = [time for controller in model.controllers for time in (controller.every, controller.offset) if time > 0]
    for controller in model.controllers:
        for name, time in (("every", controller.every), ("offset", controller.offset)):
            if not _divides(dt, time):
                raise RunError(f"{scene.span}: scene '{scene.name}': {_fault(controller, name, time, dt)}; {_cure(times, dt)}")


def _divides(dt: float, time: float) -> bool:
    return abs(time / dt - round(time / dt)) <= _WHOLE


def _fault(controller: Controller, name: str, time: float, dt: float) -> str:
    return f"steps of {dt:.9g} s do not divide {name}, {time:.9g} s, of the controller '{controller.name}' (line {controller.span.line})"


def _cure(times: Sequence[float], dt: float) -> str:
    """The nearest step that divides all times."""
    whole = times[0]
    for time in times[1:]:
        whole = _common(whole, time)
    if whole < 1e-6 * min(times):
        return "no steps divide all intervals: write others, or leave dt out for steps that end at samples by themselves"
    nearest = min((whole / n for n in {max(1, int(whole / dt)), int(whole / dt) + 1}), key=lambda step: abs(step - dt))
    return f"the nearest steps that do are dt: {nearest:.9g}"


def _common(a: float, b: float) -> float:
    """The largest time of which both are multiples."""
    smallest = 1e-7 * min(a, b)
    while b > smallest:
        rest = fmod(a, b)
        a, b = b, 0.0 if b - rest < smallest else rest
    return a
