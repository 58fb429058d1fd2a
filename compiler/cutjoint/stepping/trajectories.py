"""Input trajectories: the cubics that a library evaluates, and derivatives with respect to the values that define them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cutjoint.run.inputs import rates_at, read_table
from cutjoint.stepping.values import Array, find_place

#: Values, each for the same number of steps (zero-order hold), or a table over time as of `simulate`.
InputTrajectoryLike: TypeAlias = ArrayLike | Mapping[str, Any]

#: The largest number of consecutive knots on which a piece depends.
_KNOTS = 4


@dataclass(frozen=True, kw_only=True)
class Knots:
    """The ``number`` knots that define a trajectory; each piece depends on up to four consecutive ones, ``which`` (4, pieces).
    ``derivatives`` (4, pieces, 4) are those of the pieces' coefficients with respect to these knots."""

    number: int
    derivatives: Array
    which: NDArray[np.intp]

    def as_matrix(self) -> Array:
        """Derivatives of the pieces' coefficients with respect to the knots, (knots, pieces, 4)."""
        found = np.zeros((self.number, *self.derivatives.shape[1:]))
        for derivatives, which in zip(self.derivatives, self.which, strict=True):
            found[which, np.arange(len(which))] += derivatives
        return found

    def apply_transposed(self, by_pieces: Array) -> Array:
        """Derivatives with respect to knots, (objectives, knots), from those with respect to coefficients, (objectives, pieces, 4)."""
        found = np.zeros((len(by_pieces), self.number))
        for derivatives, which in zip(self.derivatives, self.which, strict=True):
            np.add.at(found.T, which, np.einsum("opk,pk->po", by_pieces, derivatives))
        return found


@dataclass(frozen=True, kw_only=True)
class InputTrajectory:
    """The input of index ``place`` as cubics that begin at ``times`` (s).  ``numbers`` (pieces, 4): value and three derivatives there.
    ``jumps`` is whether the pieces may be discontinuous.  ``knots`` are the defining numbers, by name."""

    place: int
    times: Array
    numbers: Array
    jumps: bool
    knots: Mapping[str, Knots]


def make_trajectories(
    names: Sequence[str], inputs: Mapping[str, InputTrajectoryLike], start: float, steps: int, dt: float
) -> tuple[InputTrajectory, ...]:  # fmt: skip
    """Make trajectories for a run of so many steps from a start time (s), from ``inputs`` by name.

    Raises:
        KeyError: there is no such input.
        RunError: a table does not hold together, or is shorter than the run.
        ValueError: values are not held for equal numbers of steps each.
    """
    places = {name: i for i, name in enumerate(names)}
    return tuple(_make(name, find_place(places, name), each, start, steps, dt) for name, each in inputs.items())


def _make(name: str, place: int, trajectory: InputTrajectoryLike, start: float, steps: int, dt: float) -> InputTrajectory:
    if not isinstance(trajectory, Mapping):
        values = np.asarray(trajectory, dtype=np.float64)
        if values.ndim != 1 or not len(values) or steps % len(values):
            raise ValueError(f"input '{name}': {values.shape} values: their number does not divide {steps} steps")
        times: Array = start + np.arange(float(len(values))) * ((steps // len(values)) * dt)
        return _linear(place, times, lambda knots: np.column_stack([knots[name], np.zeros((len(times), 3))]), {name: values}, jumps=True)
    table = read_table(f"input '{name}'", trajectory, start, start + steps * dt * (1 - 1e-12))
    t, rate = np.array(table["t"]), f"{name}.rate"
    knots = {name: np.array(table["value"]), **({rate: np.array(table["rate"])} if "rate" in table else {})}

    def pieces(knots: Mapping[str, Array]) -> Array:
        if table["interpolation"] == "linear":
            return _cubics(t, knots[name], None)
        return _cubics(t, knots[name], knots[rate] if rate in knots else rates_at(t, knots[name]))

    return _linear(place, t[:-1], pieces, knots, jumps=False)


def _cubics(t: Array, values: Array, rates: Array | None) -> Array:
    """Coefficients of cubics through values at times, with given rates; without rates, of straight lines."""
    length = np.diff(t)
    slope = np.diff(values) / length
    if rates is None:
        return np.column_stack([values[:-1], slope, np.zeros((len(slope), 2))])
    begin, end = rates[:-1], rates[1:]
    return np.column_stack([values[:-1], begin, 2 * (3 * slope - 2 * begin - end) / length, 6 * (begin + end - 2 * slope) / length**2])


def _linear(
    place: int, times: Array, pieces: Callable[[Mapping[str, Array]], Array], knots: Mapping[str, Array], *, jumps: bool
) -> InputTrajectory:  # fmt: skip
    """A trajectory whose pieces depend linearly on up to four consecutive knots each; found by evaluating unit knots."""
    found = {}
    for kind, values in knots.items():
        first = np.clip(np.arange(len(times)) - 1, 0, max(len(values) - _KNOTS, 0))
        which = np.minimum(np.array([first + (k - first) % _KNOTS for k in range(_KNOTS)]), len(values) - 1)
        ones = [{other: np.zeros(len(each)) for other, each in knots.items()} for _ in range(_KNOTS)]
        for k, each in enumerate(ones):
            each[kind][k::_KNOTS] = 1.0
        found[kind] = Knots(number=len(values), derivatives=np.array([pieces(each) for each in ones]), which=which)
    return InputTrajectory(place=place, times=times, numbers=pieces(knots), jumps=jumps, knots=found)


@dataclass(frozen=True, kw_only=True)
class Columns:
    """The quantities with respect to which a run is differentiated: ``names`` of columns.  A trajectory in ``by`` has a column for
    each of its knots, ``name[0]``, ``name[1]``, ...  ``plain`` are the names of other columns.  ``of_knots`` has, for each
    trajectory, its first column, its index and its knots."""

    names: tuple[str, ...]
    plain: Mapping[int, str]
    of_knots: tuple[tuple[int, int, Knots], ...]

    @classmethod
    def of(cls, by: Sequence[str], trajectories: Sequence[InputTrajectory]) -> "Columns":
        """The columns of the quantities ``by``."""
        known = {name: (i, knots) for i, trajectory in enumerate(trajectories) for name, knots in trajectory.knots.items()}
        names: list[str] = []
        plain, of_knots = {}, []
        for name in by:
            if name in known:
                of_knots.append((len(names), *known[name]))
                names += [f"{name}[{k}]" for k in range(known[name][1].number)]
            else:
                plain[len(names)] = name
                names.append(name)
        return cls(names=tuple(names), plain=plain, of_knots=tuple(of_knots))

    def parts(self, trajectory: int) -> Iterator[tuple[slice, Knots]]:
        """The columns that belong to a trajectory, by its index, and their knots."""
        for first, i, knots in self.of_knots:
            if i == trajectory:
                yield slice(first, first + knots.number), knots

    def changes(self, trajectories: Sequence[InputTrajectory]) -> list[Array | None]:
        """Derivatives of each trajectory's coefficients with respect to all columns, (columns, pieces, 4); None if there are none."""
        found: list[Array | None] = []
        for i, trajectory in enumerate(trajectories):
            parts = list(self.parts(i))
            change = np.zeros((len(self.names), *trajectory.numbers.shape)) if parts else None
            for columns, knots in parts:
                assert change is not None
                change[columns] = knots.as_matrix()
            found.append(change)
        return found
