"""Named numbers in the memory of a simulation, and results of linearisation."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.package.renamed import with_old_members

Array = NDArray[np.float64]


def find_place(places: Mapping[str, int], name: str, otherwise: str = "") -> int:
    """The index of a name; with a remedy ``otherwise``, no name of another element is proposed. Raises KeyError: there is none."""
    try:
        return places[name]
    except KeyError:
        element = name.rpartition(".")[0]
        near = [x for x in difflib.get_close_matches(name, places, n=1) if not otherwise or x.rpartition(".")[0] == element]
        hint = f"did you mean '{near[0]}'?" if near else "" if otherwise else f"there is {', '.join(places) or 'none'}"
        raise KeyError(f"no '{name}'; {' '.join(filter(None, (hint, otherwise)))}") from None


def find_number(places: Mapping[str, int], name: str) -> int:
    """The index of a number to differentiate by; errors as of `find_place`."""
    words = f"a constant of that name becomes a parameter by tunable=['{name}'], on the command line --tunable {name}"
    return find_place(places, name, words if "." in name else "")


class Values(MutableMapping[str, float]):
    """Numbers by name, in the memory of a simulation: ``array`` is a view of them, in SI units."""

    def __init__(self, names: Sequence[str], array: Array, units: Mapping[str, str] | None = None) -> None:
        self.array, self.units = array, units
        self._places = {name: i for i, name in enumerate(names)}

    def place(self, name: str) -> int:
        """The index of a name in ``array``.

        Raises:
            KeyError: there is none.
        """
        return find_place(self._places, name)

    def __getitem__(self, name: str) -> float:
        return float(self.array[find_place(self._places, name)])

    def __setitem__(self, name: str, value: float) -> None:
        self.array[find_place(self._places, name)] = value

    def __delitem__(self, name: str) -> None:
        raise TypeError("numbers of a simulation cannot be deleted")

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places  # else by the KeyError, which looks for similar names

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return f"<{', '.join(f'{name}: {self[name]:.6g}' for name in list(self)[:8])}{', ...' if len(self) > 8 else ''}>"


class Outputs(Values):
    """Outputs by name, evaluated at the present state on access; ``array`` is a copy of all. ``refresh`` updates their memory."""

    def __init__(self, names: Sequence[str], memory: Array, units: Mapping[str, str], refresh: Callable[[], object]) -> None:
        super().__init__(names, memory, units)
        self._refresh = refresh

    @property
    def array(self) -> Array:
        """A copy of the values at the present state."""
        self._refresh()
        return self._memory.copy()

    @array.setter
    def array(self, memory: Array) -> None:
        self._memory = memory

    def place(self, name: str) -> int:
        """The index of a name in ``array``; KeyError: the scene has no such output."""
        words = "it is not among the scene's outputs: add it to 'outputs' of the model file"
        return find_place(self._places, name, words if "." in name else "")

    def __getitem__(self, name: str) -> float:
        self._refresh()
        return float(self._memory[self.place(name)])

    def __setitem__(self, name: str, value: float) -> None:
        raise TypeError(f"'{name}' is an output, which follows from the state")


@with_old_members
@dataclass(frozen=True, kw_only=True)
class StepStatistics:
    """Statistics of a step.

    ``violation`` (m or rad) is that of the ``equation`` with the largest violation relative to its limit; ``violation_rate`` (m/s or
    rad/s) is the largest rate.  ``change`` is the change of the accelerations in the last iteration, relative to 1 + the largest one.
    ``pivot`` is the smallest pivot relative to its column; infinity if the method has none.  ``iterations`` (attempts of explicit
    steps) and ``evaluations`` are counts.
    """

    violation: float
    violation_rate: float
    change: float
    pivot: float
    iterations: int
    evaluations: int
    equation: str | None


class Poses:
    """Poses of bodies, markers and wheels in global axes and SI units: views of the simulation's ``array`` (names, 16).

    For a body, the reference point is its centre of mass.  ``position``, ``velocity``: of the point, (names, 3).  ``attitude``: unit
    quaternion w, x, y, z (names, 4) with w >= 0, identity in the design position.  ``angular_velocity``: of the body, (names, 3).
    ``point``: the point in the design position, (names, 3).  For a wheel, the position is that of the contact.  Its attitude has x along
    the rolling direction, y to the left, z along the road's normal.  Its velocities are the wheel's there, and ``point`` is 0.
    """

    def __init__(self, names: Sequence[str], array: Array) -> None:
        self.names, self.array = tuple(names), array
        array.flags.writeable = False
        self.position, self.attitude, self.velocity, self.angular_velocity, self.point = np.split(array, (3, 7, 10, 13), axis=1)
        self._places = {name: i for i, name in enumerate(names)}

    def place(self, name: str) -> int:
        """The row of a body, a marker or a wheel.

        Raises:
            KeyError: there is none.
        """
        return find_place(self._places, name)


@dataclass(frozen=True, kw_only=True)
class StepDerivatives:
    """Derivatives of the states at the end of a step; SI units.

    Attributes:
        by_state: (states, states).
        by_input: (states, inputs), of a constant shift during the step (zero-order hold).
        by_parameter: (states, parameters).
        start, end: (states,) the states before and after the step.
        states, inputs, parameters: names.
    """

    by_state: Array
    by_input: Array
    by_parameter: Array
    start: Array
    end: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<StepDerivatives: states {', '.join(self.states)}, inputs {', '.join(self.inputs) or 'none'}>"


@with_old_members
@dataclass(frozen=True, kw_only=True)
class StateSensitivities:
    """A pose at rest or a start, and its derivatives; SI units.

    Attributes:
        values: (outputs,).
        derivatives: (outputs, by).
        states: (states, by).
    """

    values: Array
    derivatives: Array
    states: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<StateSensitivities: {', '.join(self.outputs)} by {', '.join(self.by)}>"


@with_old_members
@dataclass(frozen=True, kw_only=True)
class EigenvalueSensitivities:
    """Eigenvalues of the linear model at a state, and their derivatives; SI units.

    Attributes:
        values: (modes,) complex, 1/s, by magnitude; of a pair the one with positive imaginary part.
        derivatives: (modes, by) complex.
    """

    values: NDArray[np.complex128]
    derivatives: NDArray[np.complex128]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<EigenvalueSensitivities: {len(self.values)} modes by {', '.join(self.by)}>"

    @property
    def frequencies(self) -> tuple[Array, Array]:
        """Damped frequencies (Hz, (modes,)), 0 for real eigenvalues, and their derivatives (modes, by)."""
        return self.values.imag / (2 * np.pi), self.derivatives.imag / (2 * np.pi)


@with_old_members
@dataclass(frozen=True, kw_only=True)
class EventSensitivities:
    """Events of a run and their derivatives; SI units.

    Attributes:
        names: elements whose formula changes.
        times: (events,) s.
        derivatives_of_times: (events, by).
        values: (events, outputs), right after the event.
        derivatives: (events, outputs, by), at the moving time of the event.
    """

    names: tuple[str, ...]
    times: Array
    derivatives_of_times: Array
    values: Array
    derivatives: Array

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} at {t:.6g} s" for name, t in zip(self.names[:4], self.times, strict=False))
        return f"<EventSensitivities: {shown or 'no event'}{', ...' if len(self.names) > 4 else ''}>"


class _OverTime(property):
    """An objective of outputs over time, and its derivatives."""

    def __init__(self, objective: str, words: str) -> None:
        super().__init__(lambda run: run._of(objective))
        self.__doc__ = words

    def __get__(self, run: Any, owner: type | None = None) -> tuple[Array, Array]:  # type: ignore[override]
        return super().__get__(run, owner)  # type: ignore[no-any-return]


@with_old_members
@dataclass(frozen=True, kw_only=True)
class ForwardSensitivities:
    """Outputs of a run and their derivatives, from `Simulation.forward_sensitivities`; SI units.

    The properties reduce outputs over time: each is a value (outputs,) and its derivatives (outputs, by).
    `ValueError`: one has no derivative, such as a maximum that two samples have, or the run has no length.

    Attributes:
        times: (samples,) s, from the beginning on.
        values: (samples, outputs).
        derivatives: (samples, outputs, by).
        events: the events that were asked for, or None.
    """

    times: Array
    values: Array
    derivatives: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]
    events: EventSensitivities | None = None

    def __repr__(self) -> str:
        return f"<ForwardSensitivities: {', '.join(self.outputs)} by {', '.join(self.by)}, {len(self.times)} rows>"

    end = _OverTime("end", "The values at the end.")
    integral = _OverTime("integral", "Integrals over time by the trapezoidal rule.")
    mean = _OverTime("mean", "Means over time.")
    rms = _OverTime("rms", "Root mean squares over time.")
    maximum = _OverTime("maximum", "Largest values of the samples.")
    minimum = _OverTime("minimum", "Smallest values of the samples.")

    def _of(self, objective: str) -> tuple[Array, Array]:
        found, weights = weigh(objective, self.times, self.values, self.outputs)
        for i, rows in ties(objective, self.values).items():
            derivatives = self.derivatives[rows, i]
            if not np.array_equal(derivatives, np.broadcast_to(derivatives[0], derivatives.shape)):
                raise ValueError(tie_message(self.times[rows], self.outputs[i], found[i]))
        return found, np.einsum("ro,rop->op", weights, self.derivatives)


#: The points of a fourth-order difference, in steps.
DIFFERENCE_STEPS = (-2, -1, 1, 2)


def difference(found: Sequence[Array], h: float) -> Array:
    """The derivative of a function, to fourth order, from its values at the steps `DIFFERENCE_STEPS` of size h."""
    return (found[0] - 8 * found[1] + 8 * found[2] - found[3]) / (12 * h)


#: Largest relative disagreement of differences of two widths; relative size of rounding and iteration errors.
_APART, _ROUNDED = 1e-5, 1e-8

#: Largest relative disagreement of one-sided derivatives: a smooth function has curvature over the step.
_NON_SMOOTH = 0.1


def is_non_smooth(found: Sequence[Array], h: float) -> bool:
    """Return whether a function jumps or is not smooth there, row by row, from its values at the steps `DIFFERENCE_STEPS` of size h.
    If it is smooth, one-sided and central derivatives over one and two steps agree."""
    left, near_left, near_right, right = found
    narrow, wide = (near_right - near_left) / (2 * h), (right - left) / (4 * h)
    sides = (right - near_right) / h + (left - near_left) / h  # 3 h f''; at a non-smooth point the change of the derivative
    size = np.max(np.maximum(np.abs(narrow), np.abs(wide)), axis=-1, keepdims=True, initial=0.0)
    rounding = _ROUNDED / h * np.max(np.abs(found), axis=(0, -1), keepdims=True, initial=0.0)[0]
    return bool((np.abs(narrow - wide) > _APART * size + rounding).any() or (np.abs(sides) > _NON_SMOOTH * size + rounding).any())


#: Relative to the largest eigenvalue: magnitudes that count as zero, and distances at which two count as equal.
_NOUGHT, _REPEATED = 1e-7, 1e-7


def find_eigenvalues(
    A: Array, changes: Sequence[Array], modes: Sequence[int] | None
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:  # fmt: skip
    """Eigenvalues of a matrix by magnitude, one of each pair, and their derivatives, (modes) and (modes, changes).
    They are w dA v / (w v) with left and right eigenvectors w and v.  ``modes`` are indices; default: all nonzero eigenvalues.

    Raises:
        ValueError: one of them repeats.
        KeyError: there is no such mode.
    """
    all_values, right = np.linalg.eig(A)
    left_values, left = np.linalg.eig(A.T)
    upper = np.flatnonzero(all_values.imag >= 0.0)
    ordered = upper[np.lexsort((all_values[upper].real, np.abs(all_values[upper])))]
    size = np.abs(all_values).max(initial=0.0)
    chosen = [i for i in ordered if abs(all_values[i]) > _NOUGHT * size] if modes is None else []
    for number in modes or ():
        if not 0 <= number < len(ordered):
            raise KeyError(f"no mode {number}: there are {len(ordered)}")
        chosen.append(ordered[number])
    derivatives = np.zeros((len(chosen), len(changes)), dtype=np.complex128)
    for row, i in zip(derivatives, chosen, strict=True):
        value, away = all_values[i], np.abs(all_values - all_values[i])
        v, w = right[:, i], left[:, np.argmin(np.abs(left_values - value))]
        if np.sum(away <= _REPEATED * size) > 1 or abs(w @ v) <= _REPEATED:
            raise ValueError(f"the eigenvalue {value:.6g} 1/s repeats: it has no derivative; name other modes")
        row[:] = [w @ change @ v / (w @ v) for change in changes]
    return all_values[chosen].astype(np.complex128), derivatives


#: Objectives of each output of a run.
OBJECTIVES = ("end", "integral", "mean", "rms", "maximum", "minimum")


def weigh(objective: str, times: Array, values: Array, outputs: Sequence[str]) -> tuple[Array, Array]:
    """The values (outputs,) of an objective of `OBJECTIVES` and its derivatives (rows, outputs) by the ``values`` of each output.
    If several rows share an extreme value, the first counts. Raises ValueError: there is no such objective, or it has no derivative."""
    if objective not in OBJECTIVES:
        raise ValueError(f"no objective '{objective}'; there is {', '.join(OBJECTIVES)}")
    weights = np.zeros(values.shape)
    if objective == "end":
        weights[-1] = 1.0
        return values[-1], weights
    if objective in ("maximum", "minimum"):
        rows = (np.argmax if objective == "maximum" else np.argmin)(values, axis=0)
        columns = np.arange(values.shape[1])
        weights[rows, columns] = 1.0
        return values[rows, columns], weights
    pieces = np.diff(times) / 2
    weights[:] = (np.append(pieces, 0.0) + np.append(0.0, pieces))[:, None]
    if objective != "integral":
        if not (length := times[-1] - times[0]) > 0.0:
            raise ValueError("a run of no step has no mean")
        weights /= length
    if objective != "rms":
        return (weights * values).sum(axis=0), weights
    roots = np.sqrt((weights * values**2).sum(axis=0))
    for name, root in zip(outputs, roots, strict=True):
        if root == 0.0:
            raise ValueError(f"'{name}' is 0 all the time: its root mean square has no derivative")
    return roots, weights * values / roots


def weigh_each(objective: str, times: Array, values: Array, outputs: Sequence[str]) -> Array:
    """Weights of an objective of each output in turn, (outputs, rows, outputs).
    Raises ValueError: it has no derivative, or rows share an extreme."""
    found, weights = weigh(objective, times, values, outputs)
    for i, rows in ties(objective, values).items():
        raise ValueError(tie_message(times[rows], outputs[i], found[i]))
    return weights.T[:, :, None] * np.eye(len(outputs))[:, None, :]


def ties(objective: str, values: Array) -> dict[int, NDArray[np.intp]]:
    """The rows that share an extreme value, by the index of the output, if there are several."""
    if objective not in ("maximum", "minimum"):
        return {}
    extremes = (np.max if objective == "maximum" else np.min)(values, axis=0)
    rows = {i: np.flatnonzero(values[:, i] == extreme) for i, extreme in enumerate(extremes)}
    return {i: found for i, found in rows.items() if len(found) > 1}


def tie_message(times: Array, name: str, value: float) -> str:
    """The error message for an extreme value that several samples share."""
    at = " and ".join(f"{time:.6g} s" for time in times[:2])
    return f"'{name}' is the same {value:.6g} at {at}, with other derivatives: the extreme value has no derivative"


@with_old_members
@dataclass(frozen=True, kw_only=True)
class AdjointSensitivities:
    """Objectives of a run and their derivatives, from `Simulation.adjoint_sensitivities`; SI units.

    Attributes:
        times: (samples,) s.
        values: (samples, outputs).
        objectives: (objectives,) sum(weights*values); with weights dJ/dy of a cost J, this is not J.
        derivatives: (objectives, by).
        by: names of the parameters, inputs and initial states.
    """

    times: Array
    values: Array
    objectives: Array
    derivatives: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<AdjointSensitivities: {len(self.objectives)} objectives by {len(self.by)} numbers, {len(self.times)} rows>"
