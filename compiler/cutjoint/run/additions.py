"""Interfaces for other packages: exports to other simulators, and backends in place of generated code."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Output, Scene
    from cutjoint.run.artifact import Artifact


@dataclass(frozen=True, kw_only=True)
class Export:
    """Files by name, and notes on what the other simulator models differently."""

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


@dataclass(frozen=True, kw_only=True)
class Backend:
    """An implementation of models beside generated code and its interpreter.

    ``compile`` makes a simulator ready for a model in a scene by a method. ``code`` are the folders of its sources; cached runs depend on
    them. ``solvers`` are the linear solvers of methods that have one. It is imported for cached runs too, and so imports modules that
    compile at their first use.
    """

    name: str
    compile: Callable[[Model, Scene, str], Artifact]
    code: tuple[Path, ...]
    solvers: Mapping[str, str]
