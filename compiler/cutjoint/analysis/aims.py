"""The start of a scene with aims: coordinates at which the loops are closed and quantities have the wanted values."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy

from cutjoint.analysis.closing import (
    Array,
    close_loops,
    design_coordinates,
    evaluate_closures,
    flat_roads,
    free_directions,
    make_inputs,
    retract,
)
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import join_and
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.records import VALUE, Aim, Model, Output, Scene, Signal
from cutjoint.package.errors import RunError
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.build import build_topology

_REACHED = 1e-11  #: a quantity is as wanted within this (m, rad), in units of its size above one
_DIFFERENCE = 1e-5  #: a step of differences by which places change, rad and m: central ones err by their square
_FARTHEST = 0.3  #: the largest change of a coordinate in one step, rad and m
_ITERATIONS = 200
#: The damping that steps begin with, as a share of the places' largest change, and the share of its distance that the last step gains.
_DAMPING, _GAIN = 1e-9, 1e-9
_SEEN = 1e-7  #: a place whose value is further away than this (m, rad) is named among those that were not reached
_TRIALS, _STRAY = 12, 1.2  #: random steps from the design position, and how far these go, rad and m
_STAGES = 17  #: steps of the continuation from the design position to the given coordinates
_ALIKE, _ENOUGH = 1e-3, 4  #: the search ends after so many trials whose residuals equal the best one within this share


@dataclass(frozen=True, kw_only=True)
class _Reached:
    """Coordinates that close the loops, and the distance (m, rad) of each place from the wanted one."""

    q: Array
    left: Array

    @property
    def distance(self) -> float:
        """The norm of the residual."""
        return float(np.linalg.norm(self.left))


def with_aims(model: Model, aims: Sequence[tuple[Aim, sympy.Expr]]) -> tuple[Model, tuple[Output, ...]]:
    """The model with a signal of an expression for each aim, and its output; without aims the model itself."""
    signals = tuple(  # no name of a file begins with an underscore
        Signal(name=f"_aim{i}", symbol=quantity_symbol(f"_aim{i}", VALUE), value=value, unit=aim.unit, span=aim.span, reported=True)
        for i, (aim, value) in enumerate(aims)
    )
    outputs = tuple(Output(element=signal.name, quantity=VALUE, span=signal.span, name=signal.name) for signal in signals)
    return replace(model, signals=(*model.signals, *signals)) if signals else model, outputs


class AimedStart:
    """The places that a scene wants, as functions of the coordinates."""

    def __init__(self, model: Model, scene: Scene) -> None:
        self._scene = scene
        acting = replace(scene, switches={force.name: True for force in model.forces})
        measured, outputs = with_aims(model, [(aim, aim.expression) for aim in scene.assemble])
        self._equations = formulate_recursive(build_topology(measured), acting, outputs)

    def find(self, parameters: Mapping[str, float], prescribed: Mapping[str, float], wanted: Sequence[float]) -> dict[str, float]:
        """All coordinates by "joint.coordinate", such that places have the ``wanted`` values.
        ``prescribed`` coordinates (SI units) stay unchanged; ``parameters`` are values of tunable parameters. Raises RunError: no pose
        has them, or none that closes the loops was found near the design position."""
        search, found = self._search(parameters, prescribed, wanted)
        if found is None:
            where = f"{self._scene.span}: scene '{self._scene.name}'"
            raise RunError(f"{where}: the loops cannot close from its positions; give others, or fewer")
        if found.distance > 0:
            missed, free = self._missed(found, wanted), search.degrees_of_freedom(found.q)
            count = f"; values wanted: {len(wanted)}, {free} can be chosen there" if len(wanted) > free else ""
            nearest = join_and([words for _, words in missed])
            words = f"no pose that closes the loops was found with these values; the nearest has {nearest}{count}; write others, or fewer"
            raise RunError(f"{missed[0][0].span}: scene '{self._scene.name}': assemble: {words}")
        return dict(zip(self._equations.coordinate_names, self._with_reversed_attitudes(found.q).tolist(), strict=True))

    def describe_nearest(self, parameters: Mapping[str, float], prescribed: Mapping[str, float], wanted: Sequence[float]) -> str:
        """The places that are missed in the nearest pose that closes the loops, in words; "" for none, or without such a pose."""
        _, found = self._search(parameters, prescribed, wanted)
        return "" if found is None else join_and([words for _, words in self._missed(found, wanted)])

    def describe_nearest_rates(self, parameters: Mapping[str, float], prescribed: Mapping[str, float], wanted: Mapping[str, float]) -> str:
        """The rates that the nearest motion with closed loops has in place of the ``wanted`` ones, in words; "" where a guide moves."""
        q, free = self._coordinates_of(prescribed)
        equations, names = self._with(parameters), self._equations.speed_names
        start = PoseSearch(equations, free, np.zeros(0)).by_continuation(q)
        if start is None or any(t.joint.guide is not None for t in self._equations.topology.tree):
            return ""
        moves = PoseSearch(equations, np.ones_like(free), np.zeros(0)).moves(start.q)
        rows, given = [names.index(name) for name in wanted], np.array([*wanted.values()])
        got = moves[rows] @ np.linalg.lstsq(moves[rows], given)[0]
        every = zip(wanted, given.tolist(), got.tolist(), rows, strict=True)
        unit = ("m/s", "rad/s")
        missed = [
            f"{name} = {there:.6g} in place of {value:.6g} {unit[self._equations.angular[row]]}"
            for name, value, there, row in every if abs(there - value) > _SEEN * max(1.0, abs(value))
        ]  # fmt: skip
        return join_and(missed)

    def _search(
        self, parameters: Mapping[str, float], prescribed: Mapping[str, float], wanted: Sequence[float]
    ) -> "tuple[PoseSearch, _Reached | None]":  # fmt: skip
        q, free = self._coordinates_of(prescribed)
        search = PoseSearch(self._with(parameters), free, np.array(wanted))
        start = search.by_continuation(q)
        return search, None if start is None else search.find(start)

    def follows(self, parameter: str, parameters: Mapping[str, float]) -> bool:
        """Return whether loops or aims depend on a tunable parameter: they are undefined without its value."""
        search = PoseSearch(self._with({**parameters, parameter: np.nan}), np.ones(self._equations.speeds, dtype=bool), np.zeros(0))
        return bool(np.isnan(search.equations_at(design_coordinates(self._equations))).any())

    def places_at(self, parameters: Mapping[str, float], q: Array, v: Array) -> Array:
        """The places (rows, places) at coordinates and speeds (rows, speeds)."""
        search = PoseSearch(self._with(parameters), np.ones(self._equations.speeds, dtype=bool), np.zeros(0))
        return search.values(np.broadcast_to(q, (len(v), len(q))), v)

    def _with(self, parameters: Mapping[str, float]) -> RecursiveEquations:
        return replace(self._equations, parameters=tuple(replace(p, value=parameters[p.name]) for p in self._equations.parameters))

    def _coordinates_of(self, prescribed: Mapping[str, float]) -> tuple[Array, Array]:
        """The design position with the given coordinates, and whether each speed is free."""
        q, free = design_coordinates(self._equations), np.ones(self._equations.speeds, dtype=bool)
        places = {name: i for i, name in enumerate(self._equations.coordinate_names)}
        for name, value in prescribed.items():
            q[places[name]] = value
        for chart in self._equations.charts:
            names = self._equations.coordinate_names[chart.q : chart.q + len(chart.coordinate_names)]
            free[chart.v : chart.v + chart.scalars] = [name not in prescribed for name in names[: chart.scalars]]
            if chart.ball:
                free[chart.v + chart.scalars : chart.v + chart.scalars + 3] = names[chart.scalars] not in prescribed
        return self._with_reversed_attitudes(q, prescribed), free

    def _with_reversed_attitudes(self, q: Array, of: Collection[str] | None = None) -> Array:
        """Coordinates with attitudes, all or those of names ``of``, inverted.
        They describe the follower relative to the base, or the outer relative to the inner body."""
        turned = q.copy()
        for chart in self._equations.charts:
            first = chart.q + chart.scalars
            if chart.ball and chart.reversed and (of is None or self._equations.coordinate_names[first] in of):
                turned[first + 1 : first + 4] *= -1
        return turned

    def _missed(self, found: _Reached, wanted: Sequence[float]) -> list[tuple[Aim, str]]:
        """The places that a pose misses, in words."""
        every = zip(self._scene.assemble, wanted, found.left, strict=True)
        missed = [(aim, value, value + left) for aim, value, left in every if abs(left) > _SEEN * max(1.0, abs(value))]
        return [(a, f"{a.name} = {got / a.size:.6g} in place of {value / a.size:.6g} {a.unit}".rstrip()) for a, value, got in missed]


class PoseSearch:
    """Searches for coordinates that close the loops and have the ``wanted`` values of ``places``.
    Speeds that are not ``free`` keep their coordinates."""

    def __init__(self, equations: RecursiveEquations, free: Array, wanted: Array, places: slice = slice(None)) -> None:
        self._equations, self._free, self._wanted = equations, free, wanted
        self._places = list(equations.function("report").results.values())[places]

    def find(self, start: _Reached) -> _Reached:
        """The wanted pose nearest to the start, else the pose with the smallest residual, from the start and from random steps near it."""
        best, alike = self._approach(start), 0
        rng, moves = np.random.default_rng(0), self.moves(start.q)
        for _ in range(_TRIALS if moves.size else 0):
            if best.distance == 0 or alike == _ENOUGH:
                break
            move = moves @ rng.uniform(-1, 1, moves.shape[1])
            begun = self.reach(retract(self._equations, start.q, _STRAY * move / np.abs(move).max()))
            if begun is None:
                continue
            found = self._approach(begun)
            alike += abs(found.distance - best.distance) <= _ALIKE * best.distance
            best = min(best, found, key=lambda reached: reached.distance)
        return best

    def close(self, q: Array) -> Array | None:
        """The pose near q that closes the loops and has the wanted places, by steps for both at once; None if these do not converge."""
        found = close_loops(self._equations, q, free=self._free, evaluate=self.equations_with_aims)
        return None if found is None else found[0]

    def equations_with_aims(self, q: Array) -> tuple[Array, Array]:
        """The residuals of loops and places, and their derivatives (rows, speeds)."""
        residual, jacobian = evaluate_closures(self._equations, q)
        left = self.values(q[np.newaxis])[0] - self._wanted
        return np.concatenate([residual, left]), np.concatenate([jacobian, self._derivatives(q)])

    def reach(self, q: Array) -> _Reached | None:
        """The pose near q that closes the loops; None if the iteration does not converge."""
        found = close_loops(self._equations, q, free=self._free)
        if found is None:
            return None
        left = self.values(found[0][np.newaxis])[0] - self._wanted
        return _Reached(q=found[0], left=np.where(np.abs(left) <= _REACHED * np.maximum(1.0, np.abs(self._wanted)), 0.0, left))

    def by_continuation(self, q: Array) -> _Reached | None:
        """The pose near given coordinates whose other coordinates move least. It comes from a direct search or from continuation from the
        design position. As runtime core/start/start.hpp: a direct search from far away may end in another configuration."""
        direct, design = self.reach(q), design_coordinates(self._equations)
        if self._free.all() or (direct is not None and np.array_equal(direct.q, q)):
            return direct
        at = design
        for share in np.linspace(0.0, 1.0, _STAGES):
            at = np.where(q != design, (1 - share) * design + share * q, at)  # free coordinates are those of the design position
            for chart in (chart for chart in self._equations.charts if chart.ball):
                ball = slice(chart.q + chart.scalars, chart.q + chart.scalars + 4)
                at[ball] /= np.linalg.norm(at[ball])
            found = close_loops(self._equations, at, free=self._free)
            if found is None:
                return direct
            at = found[0]
        continued = self.reach(at)
        if continued is None or direct is None:
            return continued or direct
        one, other = np.abs(continued.q - design), np.abs(direct.q - design)
        seen = one + other > _SEEN
        return continued if np.sum((one - other)[seen] / (one + other)[seen]) < -1e-3 else direct

    def degrees_of_freedom(self, q: Array) -> int:
        """The number of degrees of freedom that the given coordinates leave."""
        return int(self.moves(q).shape[1])

    def _approach(self, at: _Reached) -> _Reached:
        """Minimise the residual of the places from a pose, by steps along closed loops (Levenberg, Q. Appl. Math. 2, 1944)."""
        damping = _DAMPING
        for _ in range(_ITERATIONS):
            if at.distance == 0:
                break
            moves = self.moves(at.q)
            derivatives = self._derivatives(at.q) @ moves
            weight = np.sqrt(damping * max(float(np.vdot(derivatives, derivatives)), 1e-12)) * np.eye(moves.shape[1])
            step = -moves @ np.linalg.lstsq(np.vstack([derivatives, weight]), np.concatenate([at.left, np.zeros(len(weight))]))[0]
            step *= min(1.0, _FARTHEST / max(np.abs(step).max(initial=0.0), 1e-300))
            after = self.reach(retract(self._equations, at.q, step))
            if after is not None and after.distance < at.distance:
                gained, at, damping = at.distance - after.distance, after, damping / 8
                if gained < _GAIN * at.distance:
                    break
            elif (damping := 8 * damping) > 1e6:
                break
        return at

    def moves(self, q: Array) -> Array:
        """The motions (speeds, n) that keep loops closed and given coordinates fixed."""
        directions = free_directions(evaluate_closures(self._equations, q)[1][:, self._free])
        moves = np.zeros((len(self._free), directions.shape[1]))
        moves[self._free] = directions
        return moves

    def _derivatives(self, q: Array) -> Array:
        """The changes of the places (places, speeds) by each speed, by central differences."""
        steps = _DIFFERENCE * np.eye(len(self._free))
        values = self.values(retract(self._equations, np.broadcast_to(q, (2 * len(steps), len(q))), np.concatenate([steps, -steps])))
        return np.asarray((values[: len(steps)] - values[len(steps) :]).T / (2 * _DIFFERENCE))

    def equations_at(self, q: Array) -> Array:
        """The loops' residuals and the places at coordinates."""
        return np.concatenate([evaluate_closures(self._equations, q)[0], self.values(q[np.newaxis])[0]])

    def values(self, q: Array, v: Array | None = None) -> Array:
        """The places (rows, places) at coordinates (rows, coordinates), in motion at speeds (rows, speeds) or at rest."""
        still = np.zeros(self._equations.speeds) if v is None else v
        inputs = {**make_inputs(self._equations, q, still), "motion": np.full(1, float(v is not None))}
        found = interpret_blocks(self._places, inputs, flat_roads(self._equations))
        values = [np.broadcast_to(found[block][..., 0, 0], len(q)) for block in self._places]
        return np.reshape(values, (len(values), len(q))).T
