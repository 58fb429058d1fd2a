"""Earlier names in Python: they still work, and a warning has the new one."""

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])
C = TypeVar("C", bound=type)

#: Names of the package.
NAMES: Mapping[str, str] = {
    "RunDerivative": "ForwardSensitivities", "RunAdjoint": "AdjointSensitivities", "RestDerivative": "StateSensitivities",
    "ModeDerivative": "EigenvalueSensitivities", "EventDerivative": "EventSensitivities", "StepDerivative": "StepDerivatives",
    "find_drives": "inverse_dynamics",
}  # fmt: skip

#: Keyword arguments of functions, and names of objectives.
WORDS: Mapping[str, str] = {
    "opened": "tunable", "pushed": "external_wrenches", "grounded": "terrain", "turn": "steer_travel", "begin": "initial_sensitivities",
    "beside": "compare", "gap": "violation", "rate": "violation_rate", "largest": "maximum", "smallest": "minimum",
}  # fmt: skip

_DERIVATIVES = {"slopes": "derivatives"}

#: Members of classes, by the names of these.
MEMBERS: Mapping[str, Mapping[str, str]] = {
    "Simulation": {
        "play": "run", "play_derivative": "forward_sensitivities", "play_adjoint": "adjoint_sensitivities",
        "step_derivative": "step_derivatives", "rest_derivative": "equilibrium_sensitivities",
        "start_derivative": "initial_state_sensitivities", "mode_derivative": "eigenvalue_sensitivities", "choose": "choose_independent",
        "is_poor": "is_ill_conditioned", "gap": "constraint_violation", "jacobian": "constraint_jacobian", "present_input": "get_input",
        "find_dynamics": "equations_of_motion", "find_point_jacobian": "point_jacobian",
    },
    **dict.fromkeys(("AdjointSensitivities", "StateSensitivities", "EigenvalueSensitivities"), _DERIVATIVES),
    "ForwardSensitivities": {**_DERIVATIVES, "largest": "maximum", "smallest": "minimum"},
    "EventSensitivities": {**_DERIVATIVES, "time_slopes": "derivatives_of_times"},
    "StepStatistics": {"gap": "violation", "rate": "violation_rate"},
    "Trajectory": {"effort": "statistics", "instead": "fallback", "held": "locking_forces"},
    "Batch": {"largest": "maximum", "smallest": "minimum"},
    "ErrorEstimate": {"largest": "max_error"},
    "Modes": {"held": "frozen_controllers", "indifferent": "rigid_body_modes", "freedoms": "degrees_of_freedom"},
    "StepTimes": {"took": "durations", "late": "lateness", "woke": "wakeup_latency"},
    "MechanismState": {"held": "locking_forces"}, "FailureReport": {"what": "summary"}, "Trimmed": {"strayed": "from_random_start"},
}  # fmt: skip


def renamed(old: str, names: Mapping[str, str] = WORDS) -> str:
    """The new name, with a warning; any other name stays."""
    if old in names:
        warnings.warn(f"'{old}' is now '{names[old]}'", FutureWarning, stacklevel=3)
    return names.get(old, old)


def accept_old_names(function: F) -> F:
    """The function with earlier names of its keyword arguments too."""

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        for name in [name for name in named if name in WORDS]:
            named[renamed(name)] = named.pop(name)
        return function(*arguments, **named)

    return cast(F, call)


class _Member:
    """An earlier name of a member."""

    def __init__(self, old: str, names: Mapping[str, str]) -> None:
        self._old, self._names = old, names

    def __get__(self, instance: object, owner: type) -> Any:
        found = getattr(owner if instance is None else instance, renamed(self._old, self._names))
        return accept_old_names(found) if callable(found) else found


def with_old_members(kind: C) -> C:
    """The class with earlier names of its members too."""
    names = MEMBERS[kind.__name__]
    for old in names:
        setattr(kind, old, _Member(old, names))
    return kind
