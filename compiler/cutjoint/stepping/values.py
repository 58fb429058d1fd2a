"""Numbers by name in the memory of a simulation, and the matrices of its motion near a state."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def find_place(places: Mapping[str, int], name: str) -> int:
    """The place of a name.

    Raises:
        KeyError: there is none.
    """
    try:
        return places[name]
    except KeyError:
        near = difflib.get_close_matches(name, places, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else f"; there is {', '.join(places) or 'none'}"
        raise KeyError(f"no '{name}'{hint}") from None


class Values(MutableMapping[str, float]):
    """Numbers by name, in the memory of a simulation: ``array`` is a view of them, in SI units."""

    def __init__(self, names: Sequence[str], array: Array, units: Mapping[str, str] | None = None) -> None:
        self.array, self.units = array, units
        self._places = {name: i for i, name in enumerate(names)}

    def place(self, name: str) -> int:
        """The place of a name in ``array``.

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

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return f"<{', '.join(f'{name}: {self[name]:.6g}' for name in list(self)[:8])}{', ...' if len(self) > 8 else ''}>"


class Outputs(Values):
    """The outputs of the present state by name, whenever they are read; ``array`` copies all of them.

    ``refresh`` brings their memory up to date.
    """

    def __init__(self, names: Sequence[str], memory: Array, units: Mapping[str, str], refresh: Callable[[], object]) -> None:
        super().__init__(names, memory, units)
        self._refresh = refresh

    @property
    def array(self) -> Array:
        """A copy of the numbers of the present state."""
        self._refresh()
        return self._memory.copy()

    @array.setter
    def array(self, memory: Array) -> None:
        self._memory = memory

    def __getitem__(self, name: str) -> float:
        self._refresh()
        return float(self._memory[find_place(self._places, name)])

    def __setitem__(self, name: str, value: float) -> None:
        raise TypeError(f"'{name}' is an output, which follows from the state")


@dataclass(frozen=True, kw_only=True)
class Effort:
    """The effort of a step: the ``gap`` (m or rad) of the ``equation`` that stands open by the largest share of its limit, and the largest
    ``rate`` (m/s or rad/s) at which one opens; the ``change`` of the accelerations by the last iteration, as a share of 1 + the largest of
    them; the smallest ``pivot`` of the factors, as a share of its column, infinity by a method without factors; ``iterations`` (tries of
    explicit steps) and ``evaluations``."""

    gap: float
    rate: float
    change: float
    pivot: float
    iterations: int
    evaluations: int
    equation: str | None


class Poses:
    """The poses of bodies, markers and wheels by ``names``, in global axes and SI units: views of ``array`` (names, 16), which the
    simulation owns.

    ``position`` (names, 3) is that of a body's centre of mass or of a marker, ``attitude`` (names, 4) a unit quaternion w, x, y, z with
    w >= 0 that is 1, 0, 0, 0 in the design position, ``velocity`` (names, 3) the point's, ``angular_velocity`` (names, 3) the body's, and
    ``point`` (names, 3) where the point is in the design position.  A wheel's position is that of its contact, its attitude has x along the
    rolling direction, y to the left and z along the road's normal, its velocities are the wheel's there, and its ``point`` is 0.
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
class StateSpace:
    """x' = A x + B u + B_rate u' + B_acceleration u'', y = C x + D u + D_rate u' + D_acceleration u'', of changes x of states, u of inputs
    and y of outputs from a state that a simulation was in.

    ``A`` (2f, 2f), ``B`` (2f, inputs), ``C`` (outputs, 2f), ``D`` (outputs, inputs) with f degrees of freedom, in SI units.  Rates and
    accelerations of inputs count where an input moves a joint, and are zero elsewhere.  ``states``, ``inputs`` and ``outputs`` are names:
    the independent coordinates, their rates, then first-order states.  ``x`` (2f) are the states about which it holds, so that
    ``simulation.states.array - near.x`` is the change.
    """

    A: Array
    B: Array
    B_rate: Array
    B_acceleration: Array
    C: Array
    D: Array
    D_rate: Array
    D_acceleration: Array
    x: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<StateSpace: states {', '.join(self.states)}, inputs {', '.join(self.inputs) or 'none'}, {len(self.outputs)} outputs>"

    def transfer(self, s: complex) -> NDArray[np.complex128]:
        """The transfer matrix (outputs, inputs) at a complex frequency s (1/s): y = transfer(s) u for u that goes with exp(s t).

        Raises:
            numpy.linalg.LinAlgError: s is an eigenvalue of A.
        """
        states = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B + s * self.B_rate + s * s * self.B_acceleration)
        return np.asarray(self.C @ states + self.D + s * self.D_rate + s * s * self.D_acceleration, dtype=np.complex128)


@dataclass(frozen=True, kw_only=True)
class StepDerivative:
    """Derivatives of the states at the end of a step: by those at its beginning, ``by_state`` (states, states), by each input under a
    zero-order hold, ``by_input`` (states, inputs), and by parameters, ``by_parameter`` (states, parameters), in SI units.  ``start`` and
    ``end`` are the states of the step, the others names.

    The hold shifts the input's value by the same amount from the step's beginning to its end.  Rate and acceleration of an input that moves
    a joint stay: the joint is displaced during all of the step, and does not move there.
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
        return f"<StepDerivative: states {', '.join(self.states)}, inputs {', '.join(self.inputs) or 'none'}>"


@dataclass(frozen=True, kw_only=True)
class RestDerivative:
    """A pose at rest, or a start, and how it changes with ``by``, in SI units: ``values`` (outputs) with their ``slopes`` (outputs, by),
    and the changes of ``states`` (states, by)."""

    values: Array
    slopes: Array
    states: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<RestDerivative: {', '.join(self.outputs)} by {', '.join(self.by)}>"


@dataclass(frozen=True, kw_only=True)
class ModeDerivative:
    """Eigenvalues of the motion near a state, of which each pair has the one that turns forwards, and how they change: ``values`` (1/s,
    modes), by their size, and ``slopes`` (modes, by), complex numbers in SI units."""

    values: NDArray[np.complex128]
    slopes: NDArray[np.complex128]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<ModeDerivative: {len(self.values)} modes by {', '.join(self.by)}>"

    @property
    def frequencies(self) -> tuple[Array, Array]:
        """Frequencies (Hz, modes) of motions that decay, 0 of those that do not turn, with their derivatives (modes, by)."""
        return self.values.imag / (2 * np.pi), self.slopes.imag / (2 * np.pi)


@dataclass(frozen=True, kw_only=True)
class EventDerivative:
    """Events of a run, where forces, guides or drives change their formulas, in SI units: ``names`` of these elements, ``times`` (s,
    events) with ``time_slopes`` (events, by), and outputs right behind, ``values`` (events, outputs), with ``slopes`` (events, outputs,
    by), each at the time of its event, which moves."""

    names: tuple[str, ...]
    times: Array
    time_slopes: Array
    values: Array
    slopes: Array

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} at {t:.6g} s" for name, t in zip(self.names[:4], self.times, strict=False))
        return f"<EventDerivative: {shown or 'no event'}{', ...' if len(self.names) > 4 else ''}>"


@dataclass(frozen=True, kw_only=True)
class RunDerivative:
    """Outputs of a run and their derivatives by ``by``, numbers where it began, in SI units: ``values`` (rows, outputs) and ``slopes``
    (rows, outputs, by) at ``times`` (s, rows), the first of which is the beginning; ``events`` that were asked for.

    Methods give a value for each output, (outputs), with its derivatives, (outputs, by).
    """

    times: Array
    values: Array
    slopes: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]
    events: EventDerivative | None = None

    def __repr__(self) -> str:
        return f"<RunDerivative: {', '.join(self.outputs)} by {', '.join(self.by)}, {len(self.times)} rows>"

    @property
    def end(self) -> tuple[Array, Array]:
        """The values at the end."""
        return self._of("end")

    @property
    def integral(self) -> tuple[Array, Array]:
        """Integrals over time, by the trapezoidal rule from row to row."""
        return self._of("integral")

    @property
    def mean(self) -> tuple[Array, Array]:
        """Means over time: integrals as shares of it.

        Raises:
            ValueError: the run has no length.
        """
        return self._of("mean")

    @property
    def rms(self) -> tuple[Array, Array]:
        """Roots of the means over time of squares.

        Raises:
            ValueError: an output is 0 all the time, where the root has no derivative, or the run has no length.
        """
        return self._of("rms")

    @property
    def largest(self) -> tuple[Array, Array]:
        """The largest values of rows.

        Raises:
            ValueError: two rows have the largest value of an output, with different derivatives.
        """
        return self._of("largest")

    @property
    def smallest(self) -> tuple[Array, Array]:
        """The smallest values of rows.

        Raises:
            ValueError: two rows have the smallest value of an output, with different derivatives.
        """
        return self._of("smallest")

    def _of(self, objective: str) -> tuple[Array, Array]:
        found, weights = weigh(objective, self.times, self.values, self.outputs)
        for i, rows in ties(objective, self.values).items():
            slopes = self.slopes[rows, i]
            if not np.array_equal(slopes, np.broadcast_to(slopes[0], slopes.shape)):
                raise ValueError(told_tie(self.times[rows], self.outputs[i], found[i]))
        return found, np.einsum("ro,rop->op", weights, self.slopes)


#: The steps of a difference of fourth order.
STEPS_BESIDE = (-2, -1, 1, 2)


def difference(found: Sequence[Array], h: float) -> Array:
    """The slope of what is found so many steps h (`STEPS_BESIDE`) from a number, to fourth order."""
    return (found[0] - 8 * found[1] + 8 * found[2] - found[3]) / (12 * h)


#: The share of a difference by which those of two widths may be apart, and of values what is rounding, or what iterations leave.
_APART, _ROUNDED = 1e-5, 1e-8

#: The share by which slopes on both sides may be apart: a smooth function bends over the step.
_BENT = 0.1


def is_kinked(found: Sequence[Array], h: float) -> bool:
    """Return whether what is found so many steps h (`STEPS_BESIDE`) from a number jumps or has a kink there, row by row.

    Slopes of one side and of both, over one step and over two, are alike where it is smooth.
    """
    left, near_left, near_right, right = found
    narrow, wide = (near_right - near_left) / (2 * h), (right - left) / (4 * h)
    sides = (right - near_right) / h + (left - near_left) / h  # 3 h f''; of a kink the change of the slope
    size = np.max(np.maximum(np.abs(narrow), np.abs(wide)), axis=-1, keepdims=True, initial=0.0)
    rounding = _ROUNDED / h * np.max(np.abs(found), axis=(0, -1), keepdims=True, initial=0.0)[0]
    return bool((np.abs(narrow - wide) > _APART * size + rounding).any() or (np.abs(sides) > _BENT * size + rounding).any())


#: Eigenvalues that count as nought, and those that count as the same, as shares of the largest.
_NOUGHT, _REPEATED = 1e-7, 1e-7


def find_eigenvalues(
    A: Array, changes: Sequence[Array], modes: Sequence[int] | None
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:  # fmt: skip
    """Eigenvalues of a matrix by their size, of each pair one, and how they change with it, (modes) and (modes, changes): w dA v / (w v)
    of left and right eigenvectors.  ``modes`` are the numbers of some; all but those that are nought by default.

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
    slopes = np.zeros((len(chosen), len(changes)), dtype=np.complex128)
    for row, i in zip(slopes, chosen, strict=True):
        value, away = all_values[i], np.abs(all_values - all_values[i])
        v, w = right[:, i], left[:, np.argmin(np.abs(left_values - value))]
        if np.sum(away <= _REPEATED * size) > 1 or abs(w @ v) <= _REPEATED:
            raise ValueError(f"the eigenvalue {value:.6g} 1/s repeats: it has no derivative; name other modes")
        row[:] = [w @ change @ v / (w @ v) for change in changes]
    return all_values[chosen].astype(np.complex128), slopes


#: Objectives of each output of a run.
OBJECTIVES = ("end", "integral", "mean", "rms", "largest", "smallest")


def weigh(objective: str, times: Array, values: Array, outputs: Sequence[str]) -> tuple[Array, Array]:
    """An objective of each output, (outputs), of `OBJECTIVES`, and its derivatives by the ``values`` of that in all rows, (rows, outputs).

    Of several rows with an extreme it is that of the first.

    Raises:
        ValueError: there is no such objective, or it has no derivative.
    """
    if objective not in OBJECTIVES:
        raise ValueError(f"no objective '{objective}'; there is {', '.join(OBJECTIVES)}")
    weights = np.zeros(values.shape)
    if objective == "end":
        weights[-1] = 1.0
        return values[-1], weights
    if objective in ("largest", "smallest"):
        rows = (np.argmax if objective == "largest" else np.argmin)(values, axis=0)
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
    """The weights of an objective of each output in turn, (outputs, rows, outputs).

    Raises:
        ValueError: it has no derivative, or rows share an extreme.
    """
    found, weights = weigh(objective, times, values, outputs)
    for i, rows in ties(objective, values).items():
        raise ValueError(told_tie(times[rows], outputs[i], found[i]))
    return weights.T[:, :, None] * np.eye(len(outputs))[:, None, :]


def ties(objective: str, values: Array) -> dict[int, NDArray[np.intp]]:
    """By an output's number, the rows that share its extreme, where there are several."""
    if objective not in ("largest", "smallest"):
        return {}
    extremes = (np.max if objective == "largest" else np.min)(values, axis=0)
    rows = {i: np.flatnonzero(values[:, i] == extreme) for i, extreme in enumerate(extremes)}
    return {i: found for i, found in rows.items() if len(found) > 1}


def told_tie(times: Array, name: str, value: float) -> str:
    """The message of an extreme that rows at some times share."""
    at = " and ".join(f"{time:.6g} s" for time in times[:2])
    return f"'{name}' is the same {value:.6g} at {at}, with other derivatives: that it is the extreme has none"


@dataclass(frozen=True, kw_only=True)
class RunAdjoint:
    """Objectives of a run and their derivatives by ``by``, numbers where it began, in SI units: of ``objectives``, sums of the outputs'
    ``values`` (rows, outputs) at ``times`` (s, rows) by weights, the ``slopes`` (objectives, by)."""

    times: Array
    values: Array
    objectives: Array
    slopes: Array
    outputs: tuple[str, ...]
    by: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<RunAdjoint: {len(self.objectives)} objectives by {len(self.by)} numbers, {len(self.times)} rows>"
