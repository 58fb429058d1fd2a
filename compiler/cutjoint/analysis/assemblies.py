"""The ways in which closed loops assemble: closed poses from random starts, with the independent coordinates as they are given."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

from cutjoint.analysis.aims import AimedStart, PoseSearch
from cutjoint.analysis.closing import Array, explore, retract, speed_scales
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.records import Aim, Model, Scene
from cutjoint.topology.geometry import TOLERANCE

#: Random starts of a round, the fewest and the most of all, and how often each assembly has to be found.
_ROUND, _FEWEST, _MOST, _OFTEN = 64, 128, 512, 3
#: Two poses are one assembly if they differ by less, rad and arms; more assemblies than this are a continuum.
_SAME, _CONTINUUM = 1e-4, 64


@dataclass(frozen=True, kw_only=True)
class Assembly:
    """A way in which loops assemble: ``positions`` as a scene has them, and how many of the random starts ``found`` it."""

    positions: Mapping[str, str]
    found: int


@dataclass(frozen=True, kw_only=True)
class Assemblies:
    """The assemblies that random ``starts`` found, the one that is nearest to the scene's own positions first.
    ``kept`` are the independent coordinates, which stay; those that ``follow`` differ."""

    assemblies: tuple[Assembly, ...]
    starts: int
    kept: tuple[str, ...]
    follow: tuple[str, ...]

    @property
    def is_continuum(self) -> bool:
        """Whether there are so many that coordinates seem to be free."""
        return len(self.assemblies) >= _CONTINUUM


class AssembledStarts(AimedStart):
    """The poses in which loops are closed and a scene's aims are met; the positions of bodies tell one from another."""

    def __init__(self, model: Model, scene: Scene) -> None:
        places = (
            Aim(name=body.name, expression=quantity_symbol(body.name, axis), value=sympy.Integer(0), unit="m", size=1.0, span=body.span)
            for body in model.bodies for axis in "xyz"
        )  # fmt: skip
        super().__init__(model, replace(scene, assemble=(*scene.assemble, *places)))

    def find_all(
        self, parameters: Mapping[str, float], prescribed: Mapping[str, float], near: Collection[str], wanted: Sequence[float]
    ) -> Assemblies:  # fmt: skip
        """The assemblies with ``prescribed`` coordinates, where those ``near`` are a guess; other independent ones stay as drawn."""
        equations, aims = self._with(parameters), len(wanted)
        exact = {name: x for name, x in prescribed.items() if name not in near}
        q, free = self._coordinates_of(prescribed)[0], self._coordinates_of(exact)[1]
        kept, free = self._choose(equations, free, aims)
        search = PoseSearch(equations, free, np.array(wanted), slice(aims))
        bodies = PoseSearch(equations, free, np.zeros(0), slice(aims, None))
        single = [chart for chart in equations.charts if chart.scalars == 1 and not chart.ball]
        places, turns = [chart.q for chart in single], np.array(equations.angular)[[chart.v for chart in single]]
        found, marks, counts, starts = list[Array](), list[Array](), list[int](), 0
        random, sizes = qmc.Sobol(max(1, int(free.sum())), rng=np.random.default_rng(0)), speed_scales(equations)
        while starts < _MOST and (starts < _FEWEST or min(counts, default=0) < _OFTEN) and len(found) < _CONTINUUM:
            for shares in random.random(_ROUND):
                move = np.zeros(len(free))
                move[free] = np.pi * (2 * shares[: int(free.sum())] - 1) * (starts > 0)
                closed, starts = search.close(retract(equations, q, sizes * move)), starts + 1
                if closed is None:
                    continue
                angles, lengths = closed[places][turns], closed[places][~turns]
                lengths = np.append(lengths, bodies.values(closed[np.newaxis])[0]) / equations.topology.arm
                mark = np.concatenate([np.cos(angles), np.sin(angles), lengths])
                same = next((i for i, other in enumerate(marks) if np.abs(mark - other).max() < _SAME), len(marks))
                if same == len(marks):
                    found, marks, counts = [*found, self._unwound(search, closed, free)], [*marks, mark], [*counts, 0]
                counts[same] += 1
        texts = [dict(self._positions(self._with_reversed_attitudes(x))) for x in found]
        moving = [name for name, speeds in self._speeds() if free[speeds].any()]
        return Assemblies(
            assemblies=tuple(
                Assembly(positions={name: text[name] for name in (*kept, *moving)}, found=n) for text, n in zip(texts, counts, strict=True)
            ),
            starts=starts, kept=tuple(kept), follow=tuple(moving),
        )  # fmt: skip

    def _choose(self, equations: RecursiveEquations, free: Array, aims: int) -> tuple[list[str], Array]:
        """The coordinates of loops that stay, as near to ground as loops and aims permit, and the speeds of those that follow."""
        pose = max(explore(equations), key=lambda pose: pose.rank)
        J = PoseSearch(equations, free, np.zeros(aims), slice(aims)).equations_with_aims(pose.q)[1] * speed_scales(equations)
        in_loops, tolerance = (np.abs(J) > TOLERANCE * np.abs(J).max(initial=0.0)).any(axis=0), TOLERANCE * np.abs(J).max(initial=0.0)
        free, depth = free & in_loops, {equations.topology.tree[0].parent: 0}
        for tree in equations.topology.tree:
            depth[tree.child] = depth.get(tree.parent, 0) + 1
        by_joint = {tree.joint.name: depth[tree.child] for tree in equations.topology.tree}
        for _, i in sorted((by_joint[c.joint], i) for c in equations.charts for i in range(c.v, c.v + c.scalars)):
            fewer = free & (np.arange(len(free)) != i)
            if free[i] and np.linalg.matrix_rank(J[:, fewer], tol=tolerance) == np.linalg.matrix_rank(J[:, free], tol=tolerance):
                free = fewer
        return [name for name, speeds in self._speeds() if in_loops[speeds].any() and not free[speeds].any()], free

    def _unwound(self, search: PoseSearch, q: Array, free: Array) -> Array:
        """The pose with free angles between -180 and 180 deg, if these close the loops too, which gears do not permit."""
        turned = q.copy()
        for chart in self._equations.charts:
            for i in range(chart.scalars):
                if free[chart.v + i] and self._equations.angular[chart.v + i]:
                    turned[chart.q + i] = np.remainder(q[chart.q + i] + np.pi, 2 * np.pi) - np.pi
        closed = search.close(turned)
        return q if closed is None or np.abs(closed - turned).max() > _SAME else closed

    def _speeds(self) -> Iterator[tuple[str, slice]]:
        """The coordinates as a scene names them, with their speeds."""
        for chart in self._equations.charts:
            for i in range(chart.scalars):
                yield self._equations.coordinate_names[chart.q + i], slice(chart.v + i, chart.v + i + 1)
            if chart.ball:
                yield f"{chart.joint}.attitude", slice(chart.v + chart.scalars, chart.v + chart.scalars + 3)

    def _positions(self, q: Array) -> Iterator[tuple[str, str]]:
        """The coordinates as text of a scene."""
        for chart in self._equations.charts:
            ball = chart.q + chart.scalars
            for i in range(chart.q, ball):
                angle = self._equations.angular[chart.v + i - chart.q]
                text = f"{round(np.degrees(q[i]), 4) + 0.0:g} deg" if angle else f"{round(q[i], 6) + 0.0:g} m"
                yield self._equations.coordinate_names[i], text
            if chart.ball:
                vector = Rotation.from_quat(np.roll(q[ball : ball + 4], -1)).as_rotvec()
                yield f"{chart.joint}.attitude", f"{{rotation_vector: [{', '.join(f'{round(x, 6) + 0.0:g}' for x in vector)}]}}"
