"""Motions that are no runs: small ones about a state, closed loops and all, as a page plays them again and again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cutjoint.analysis.body_poses import BodyPose, find_poses
from cutjoint.analysis.closing import close_loops, retract
from cutjoint.analysis.modes import Complex
from cutjoint.export.numbers import Numbers
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.poses import derive_poses
from cutjoint.model.records import GROUND, Model, Scene
from cutjoint.run.inputs import with_held_inputs
from cutjoint.run.run_file import parameter_values
from cutjoint.topology.build import build_topology
from cutjoint.view.records import Array
from cutjoint.view.sizes import attached_points, find_sizes, point_of

#: A motion takes so many seconds on screen, and has so many frames.
PERIOD, FRAMES = 2.0, 33
#: A point moves by this share of the mechanism's extent at most, and a coordinate by so many rad or m.
_REACH, _LARGEST = 0.08, 0.5
#: A small step, rad and m, by which it is found how far points move.
_STEP = 1e-4


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A motion by a name that no other has: ``facts`` to read beside it, and the ``poses`` of all bodies over `motion_times`."""

    name: str
    facts: Sequence[tuple[str, str]]
    poses: Mapping[str, BodyPose]


def motion_times() -> Array:
    """The times of a motion's frames, s."""
    return np.linspace(0.0, PERIOD, FRAMES)


@dataclass(frozen=True, kw_only=True)
class Mover:
    """Moves a model in a scene with ``parameters`` (SI units) changed, at a ``time`` (s) of its guides."""

    model: Model
    scene: Scene
    parameters: Mapping[str, float]
    time: float = 0.0

    @cached_property
    def equations(self) -> RecursiveEquations:
        """The recursive equations with the values of the parameters as their defaults."""
        equations = formulate_recursive(build_topology(self.model), self.held_scene, ())
        values = parameter_values(self.model, self._held[1])
        return replace(equations, parameters=tuple(replace(p, value=values[p.name]) for p in equations.parameters))

    @cached_property
    def _held(self) -> tuple[Scene, dict[str, float]]:
        return with_held_inputs(self.model, self.scene, self.parameters)

    @property
    def held_scene(self) -> Scene:
        """The scene with inputs that are given as constants."""
        return self._held[0]

    def poses(self, q: Array) -> Mapping[str, BodyPose]:
        """The poses of all bodies at coordinates (rows, coordinates)."""
        equations = derive_poses(self.equations.topology, self.held_scene)
        return find_poses(equations, np.full(len(q), self.time), q, parameter_values(self.model, self._held[1]))

    def swing(self, q: Array, shape: Complex) -> Mapping[str, BodyPose]:
        """The poses over a period of a small motion about coordinates ``q``: ``shape`` (speeds,) has amplitudes and phases."""
        phases = np.exp(2j * np.pi * motion_times() / PERIOD)
        steps = self._amplitude(q, shape) * np.real(np.outer(phases, shape))
        return self.poses(np.array([self.closed(retract(self.equations, q, step), step) for step in steps]))

    def closed(self, q: Array, across: Array) -> Array:
        """Coordinates near q that close the loops, found across a direction (speeds,) if it has one; q itself where none are near."""
        size = float(np.abs(across).max(initial=0.0))
        found = close_loops(self.equations, q, across=across / size if size > _STEP else None, t=self.time)
        return q if found is None or np.abs(found[0] - q).max(initial=0.0) > _LARGEST else found[0]

    def _amplitude(self, q: Array, shape: Complex) -> float:
        """So large that the motion is seen, and no larger than that it is still like a small one."""
        largest = float(np.abs(shape).max())
        step = _STEP / largest
        rows = [q, *(retract(self.equations, q, step * part) for part in (shape.real, shape.imag))]
        poses = self.poses(np.array(rows))
        numbers = Numbers.of(self.model, self.scene, self.parameters)
        points = [*attached_points(self.model, self.scene), *((b.name, b.centre_of_mass) for b in self.model.bodies)]
        ways = [poses[body].place(point_of(numbers, point)) for body, point in points if body != GROUND]
        moved = max((float(np.hypot(*np.linalg.norm(way[1:] - way[0], axis=1))) for way in ways), default=0.0)
        extent = find_sizes(self.model, self.scene, numbers).extent
        return min(_LARGEST / largest, _REACH * extent * step / moved if moved > 0 else np.inf)
