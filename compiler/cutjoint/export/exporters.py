"""The contract of an export to another simulator, which another package adds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Output, Scene


@dataclass(frozen=True, kw_only=True)
class Export:
    """Files by name, and sentences on what the other simulator cannot have the same."""

    files: Mapping[str, str]
    differences: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Exporter:
    """Another simulator for which models become programs.

    ``export`` makes the files of a model in a scene with changed parameters (SI units) and the outputs to report.  ``known_outputs`` are
    those of some outputs that the simulator reports, or others where it reports none of them.
    """

    name: str
    export: Callable[[Model, Scene, Mapping[str, float], Sequence[Output]], Export]
    known_outputs: Callable[[Model, Sequence[Output]], tuple[Output, ...]]
