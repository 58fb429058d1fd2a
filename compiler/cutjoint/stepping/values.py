"""Numbers by name in the memory of a simulation."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, MutableMapping, Sequence

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
