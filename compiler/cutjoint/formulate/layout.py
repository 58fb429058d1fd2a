"""The layout of a state: the segments of its arrays, which formulations define and all code that handles states reads.

``q`` has the coordinates of each segment, ``v`` their speeds, then the first-order states, ``lambda`` a multiplier for each equation.  In
relative coordinates the segments are the charts of joints; natural coordinates are the integrals of their own speeds.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cutjoint.model.records import VALUE, FirstOrderState


@dataclass(frozen=True, kw_only=True)
class Slot:
    """The place of a symbol's column among a generated function's arguments: ``array`` from ``offset`` on; a name for each element."""

    array: str
    offset: int
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Chart:
    """The chart of one joint: its coordinates and its speeds. ``scalars`` coordinates start at ``q``, their rates at ``v``; a ball adds a
    quaternion (scalar first) after them whose angular velocity, in the inner body's axes, follows the rates. The quaternion is that of the
    outer body relative to the inner one, which is the follower of a ``reversed`` joint."""

    joint: str
    q: int
    v: int
    scalars: int
    ball: bool
    reversed: bool
    coordinate_names: tuple[str, ...]
    speed_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Closure:
    """The equations of one cut joint or gear, ``joint``: rows ``first`` to ``first + len(names)`` of the residual."""

    joint: str
    first: int
    names: tuple[str, ...]


class Entry(NamedTuple):
    """An element of a state's array: its name, and the element of the model that it belongs to."""

    name: str
    element: str


@dataclass(frozen=True, kw_only=True)
class StateLayout:
    """The entries of a state's arrays.  ``charts`` and ``closures`` are those of relative coordinates; ``states`` are the last of ``v``."""

    q: tuple[Entry, ...]
    v: tuple[Entry, ...]
    equations: tuple[Entry, ...]
    states: tuple[FirstOrderState, ...] = ()
    charts: tuple[Chart, ...] = ()
    closures: tuple[Closure, ...] = ()

    @property
    def speeds(self) -> int:
        """The number of speeds, states left out."""
        return len(self.v) - len(self.states)

    def state_slots(self, arrays: Mapping[str, str]) -> dict[str, Slot]:
        """The places of the first-order states: of ``symbol:state`` in the array of each symbol."""
        return {
            f"{symbol}:{state.name}": Slot(array=array, offset=self.speeds + i, names=(VALUE,))
            for i, state in enumerate(self.states) for symbol, array in arrays.items()
        }  # fmt: skip

    def chart_slots(self, coordinates: Mapping[str, str], speeds: Mapping[str, str]) -> dict[str, Slot]:
        """The places of ``symbol:joint``, by the arrays of symbols of coordinates and of speeds; those of states among the speeds."""
        slots = {
            f"{symbol}:{c.joint}": Slot(array=array, offset=offset, names=names)
            for c in self.charts
            for arrays, offset, names in ((coordinates, c.q, c.coordinate_names), (speeds, c.v, c.speed_names))
            for symbol, array in arrays.items()
        }  # fmt: skip
        return slots | self.state_slots(speeds)

    def closure_slots(self, arrays: Iterable[str]) -> dict[str, Slot]:
        """The places of ``array:joint`` in arrays with an element for each equation."""
        arrays = tuple(arrays)
        return {f"{array}:{c.joint}": Slot(array=array, offset=c.first, names=c.names) for c in self.closures for array in arrays}


def relative_layout(charts: tuple[Chart, ...], closures: tuple[Closure, ...], states: Sequence[FirstOrderState]) -> StateLayout:
    """The layout in relative coordinates."""
    return StateLayout(
        q=tuple(Entry(f"{c.joint}.{name}", c.joint) for c in charts for name in c.coordinate_names),
        v=(*(Entry(f"{c.joint}.{name}", c.joint) for c in charts for name in c.speed_names), *state_entries(states)),
        equations=tuple(Entry(f"{c.joint}.{name}", c.joint) for c in closures for name in c.names),
        states=tuple(states), charts=charts, closures=closures,
    )  # fmt: skip


def state_entries(states: Iterable[FirstOrderState]) -> tuple[Entry, ...]:
    """The entries of first-order states."""
    return tuple(Entry(state.entry, state.name) for state in states)
