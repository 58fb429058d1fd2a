"""Results of tasks other than runs as objectives of a study: kinematics of an axle, modes, responses, inverse dynamics, trims.

`TASKS` has what makes each of them of a model and a scene with options (SI units): a function from the values of parameters and inputs to
a `Result`.  A task of another kind is a row there, and its options a class of `document`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from cutjoint.analysis.modes import Mode
from cutjoint.model.errors import nearest
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import find_trim
from cutjoint.stepping.response import find_scene_linear_model
from cutjoint.stepping.state_space import LinearModel
from cutjoint.sweeps.document import REDUCTIONS
from cutjoint.sweeps.kernel import Kernel
from cutjoint.sweeps.objectives import reduce_series
from cutjoint.sweeps.records import Array, Kind, Objective, Study, TaskRequest
from cutjoint.tasks.inverse import InverseDynamics
from cutjoint.tasks.kinematics.sweep import LEADING, find_kinematics
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes

#: Reductions of numbers, of figures of an axle over its travel, and of drives over time.
_AT = ("percentile", "crossing", "frequency", "integral")
_OF_TRAVEL = ("value", "slope", "minimum", "maximum", "range", "mean", "rms", "deviation")
REDUCTIONS_OF = {
    "kinematics": _OF_TRAVEL, "modes": ("value",), "response": ("value",), "inverse": tuple(r for r in REDUCTIONS if r not in _AT),
    "equilibrium": ("value",),
}  # fmt: skip
_OF_MODE = {"frequency": "Hz", "damping": "", "real": "1/s"}
#: The smallest modal assurance criterion of a tracked mode, and the smallest part into which its parameter path is divided.
_ALIKE, _LEAST_PART = 0.9, 1 / 64


@dataclass(frozen=True, kw_only=True)
class Result:
    """The results of a task: numbers by name, or series over an ``axis`` (rows,), with ``units`` of all names."""

    units: Mapping[str, str]
    find: Callable[[str], Any]
    axis: Array = field(default_factory=lambda: np.zeros(0))
    axis_unit: str = ""

    def reduce(self, objective: Objective) -> float:
        """The number of an objective, in its unit."""
        values, axis = self.find(objective.of), self.axis
        if objective.reduction == "slope":
            return objective.factor * float(np.gradient(values, axis)[_design(axis)])
        if objective.reduction == "value":
            return objective.factor * float(values[_design(axis)] if axis.size else values)
        return float(reduce_series(objective, values[np.newaxis], axis, axis[1] - axis[0])[0])

    def unit_of(self, name: str, reduction: str) -> str:
        """The unit of a reduction of a result. Raises RunError: there is no such result."""
        if name not in self.units:
            raise RunError(f"the task has no result '{name}'; {nearest(name, self.units, 'results')}")
        return f"{self.units[name] or 1}/{self.axis_unit}" if reduction == "slope" else self.units[name]


def _design(axis: Array) -> int:
    return int(np.abs(axis).argmin())


Task: TypeAlias = Callable[[Mapping[str, float]], Result]


def _kinematics(model: Model, scene: Scene, options: Mapping[str, Any], parameters: Mapping[str, float]) -> Result:
    over = options.get("over", "travel")
    task_options = {name: value for name, value in options.items() if name != "over"}
    found = find_kinematics(model, parameters=parameters, only=(over,), **task_options)
    if over not in found.sweeps:
        raise RunError(f"axle '{found.axle.name}' is not steered: it has no kinematics over {over}")
    if found.limits:
        raise RunError(found.limits[0])
    units = {name: "" if unit == "1" else unit for name, unit in found.units.items()}
    columns, lead = found.sweeps[over], LEADING[over]
    return Result(units=units, find=columns.__getitem__, axis=columns[lead], axis_unit=found.units[lead])


def _modes(model: Model, scene: Scene, options: Mapping[str, Any]) -> Task:
    usual = {p.name: p.value for p in model.parameters}

    def modes_at(parameters: Mapping[str, float]) -> Sequence[Mode]:
        return find_scene_modes(model, scene, parameters=parameters, **options).modes

    first = modes_at({})

    def find(parameters: Mapping[str, float]) -> Result:
        found = modes_at(parameters)
        numbers = {"lowest.frequency": min((m.frequency for m in found if m.frequency > 0.0), default=np.nan)}
        numbers["least.damping"] = min((m.damping_ratio for m in found), default=np.nan)
        numbers["largest.real"] = max((m.eigenvalue.real for m in found), default=np.nan)
        units = {"lowest.frequency": "Hz", "least.damping": "", "largest.real": "1/s"}
        units |= {f"{i}.{name}": unit for i in range(1, len(first) + 1) for name, unit in _OF_MODE.items()}

        def modes_at_share(share: float) -> Sequence[Mode]:
            return found if share == 1.0 else modes_at({n: usual[n] + share * (x - usual[n]) for n, x in parameters.items()})

        def number(name: str) -> float:
            if name in numbers:
                return numbers[name]
            place, _, quantity = name.partition(".")
            mode = _track_mode(first[int(place) - 1], modes_at_share)
            return {"frequency": mode.frequency, "damping": mode.damping_ratio, "real": mode.eigenvalue.real}[quantity]

        return Result(units=units, find=number)

    return find


def _track_mode(mode: Mode, modes_at_share: Callable[[float], Sequence[Mode]]) -> Mode:
    """A mode at the end of a parameter path, which is subdivided until successive mode shapes are similar; it may mix with another one."""
    share, part = 0.0, 1.0
    while share < 1.0:
        part = min(part, 1.0 - share)
        found = modes_at_share(share + part)
        alike = [_modal_assurance(mode, other) for other in found]
        if max(alike, default=0.0) >= _ALIKE:
            mode, share, part = found[int(np.argmax(alike))], share + part, 2 * part
        elif part > _LEAST_PART:
            part /= 2
        else:
            raise RunError("a mode cannot be followed: it mixes with another one; take lowest.frequency, least.damping or largest.real")
    return mode


def _modal_assurance(one: Mode, other: Mode) -> float:
    """The modal assurance criterion of two modes by displacements and velocities, weighted by kinetic energy."""
    scale = abs(one.eigenvalue)
    a, b = (np.array([np.sqrt(abs(p.share)) * np.exp(1j * np.angle(p.amplitude)) for p in mode.shape.values()]) for mode in (one, other))
    a, b = np.append(a, one.eigenvalue / scale * a), np.append(b, other.eigenvalue / scale * b)
    return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))


def _response(model: Model, scene: Scene, options: Mapping[str, Any], parameters: Mapping[str, float]) -> Result:
    inputs, outputs = ([options[name]] if name in options else [] for name in ("input", "output"))
    at, band = options.get("at"), {name: options.get(name) for name in ("from_", "to")}
    near: LinearModel = find_scene_linear_model(model, scene, at=at, inputs=inputs, outputs=outputs, parameters=parameters)
    frequencies, units = near.frequencies(from_=band["from_"], to=band["to"]) if any(band.values()) else None, dict[str, str]()
    for output in near.outputs:
        for source in near.inputs:
            above, below = near.units.get(output, ""), near.units.get(source, "")
            gain = f"({above or 1})/({below})" if below else above
            numbers = {"peak": gain, "peak_frequency": "Hz", "bandwidth": "Hz", "gain_margin": "", "phase_margin": "deg"}
            units |= {f"{output}/{source}.{name}": unit for name, unit in numbers.items()}
    return Result(units=units, find=lambda name: _number_of(near, name, frequencies))


def _number_of(near: LinearModel, name: str, frequencies: Array | None) -> float:
    """A number of a response, by the name "output/input.number"."""
    output, _, rest = name.partition("/")
    source, _, number = rest.rpartition(".")
    if number in ("peak", "peak_frequency"):
        return near.peak(output, source, frequencies)[number != "peak"]
    if number == "bandwidth":
        return near.bandwidth(output, source, frequencies)
    margins = near.margins(output, source, frequencies)
    return margins.gain if number == "gain_margin" else margins.phase


def _inverse(model: Model, scene: Scene, options: Mapping[str, Any], parameters: Mapping[str, float]) -> Result:
    found = InverseDynamics(model, scene, dict(parameters), tuple(options.get("drives", ()))).find(None)
    return Result(units=found.units, find=found.forces.__getitem__, axis=found.t, axis_unit="s")


def _equilibrium(model: Model, scene: Scene, options: Mapping[str, Any], parameters: Mapping[str, float]) -> Result:
    found = find_scene_equilibrium(model, scene, parameters=parameters)
    numbers, units = dict(found.values), dict(found.units)
    if found.trim is not None:
        numbers |= found.trim.unknowns
        units |= found.trim.units
    return Result(units=units, find=numbers.__getitem__)


#: Functions that make the tasks whose results can be objectives. Modes of runs are tracked from those that are found once.
TASKS: Mapping[str, Callable[[Model, Scene, Mapping[str, Any]], Task]] = {
    "modes": _modes,
    **{name: partial(partial, find) for name, find in (
        ("kinematics", _kinematics), ("response", _response), ("inverse", _inverse), ("equilibrium", _equilibrium),
    )},
}  # fmt: skip


def make_task(asked: TaskRequest, model: Model, scene: Scene) -> Task:
    """A task of a model in a scene."""
    return TASKS[asked.task](model, scene, dict(asked.options))


class Tasks:
    """The tasks of a study in each of its scenes, and the objectives that take their results."""

    def __init__(self, study: Study) -> None:
        asked = {o.asked: None for o in study.objectives if o.asked is not None}
        self._objectives, self._study = study.objectives, study
        self._made = [{one: make_task(one, study.model, scene) for one in asked} for scene in study.scenes]

    def find(self, scene: int, values: Array) -> dict[int, float]:
        """The objectives of tasks, by their places, of a run with values (variables,) in a scene.
        Raises CutjointError: a task has no result."""
        settings = _settings(self._study, values)
        results = {one: task(settings) for one, task in self._made[scene].items()}
        return {i: results[o.asked].reduce(o) for i, o in enumerate(self._objectives) if o.asked is not None}


def _settings(study: Study, values: Array) -> dict[str, float]:
    return {v.name: float(values[i]) for i, v in enumerate(study.variables) if v.kind in (Kind.PARAMETER, Kind.INPUT)}


def find_trimmed_start(study: Study, kernels: Sequence[Kernel], scene: int, values: Array) -> Array:
    """The values of a run in a scene with what its trim finds. Raises RunError: there is no such start."""
    if not kernels[scene].starts:
        return values
    found = find_trim(study.model, study.scenes[scene], _settings(study, values))[2]
    numbers = {**found.unknowns, **found.coordinates, **found.rates, **found.states}
    return np.append(values, [numbers[name] for name in kernels[scene].starts])
