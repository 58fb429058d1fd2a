"""The caller's options of a run, on the command line or from Python."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.methods import DEFAULT_INTEGRATOR, Events


@dataclass(frozen=True, kw_only=True)
class Options:
    """Settings that a caller gives in place of the scene's; None for what the scene, the method and the integrator have.

    ``dt`` and ``end`` are in s.  ``tolerance`` is the relative error of an adaptive integrator's step, else the relative change of the
    accelerations at which the iteration of a step ends.  ``iterations`` is the number that each step has, so that all cost the same.
    ``solver`` is the linear solver, ``integrator`` one of INTEGRATORS, ``events`` one of Events.
    """

    dt: float | None = None
    end: float | None = None
    penalty: float | None = None
    tolerance: float | None = None
    iterations: int | None = None
    solver: str | None = None
    integrator: str | None = None
    events: str | None = None


#: Equal steps by the default rule over events, whatever the scene says; also of tasks without steps.
PLAIN_STEPS = Options(integrator=DEFAULT_INTEGRATOR, events=Events.CROSSED)
