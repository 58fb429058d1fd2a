"""The loops of a block as numbers: residuals, Jacobians and closed poses at many coordinates at once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cutjoint.analysis.closing import Array, design_coordinates, retract
from cutjoint.formulate.inputs import make_charts, tunable_parameters
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.recursive.embedding.open_geometry import BlockEquations, derive_block
from cutjoint.model.records import Joint
from cutjoint.program.blocks import Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import reachable_blocks
from cutjoint.topology.blocks import Block
from cutjoint.topology.geometry import TOLERANCE
from cutjoint.topology.records import Topology


class NoEmbeddingError(Exception):
    """A block that cannot be embedded; the text is the reason."""


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Closed poses of a block: coordinates ``q`` (n, coordinates), the loops' Jacobian (n, m, speeds) and residual (n, m)."""

    q: Array
    jacobian: Array
    residual: Array


@dataclass(frozen=True)
class BlockLoops:
    """The loops of a block as numbers; its drive, which has the time as its position in ``topology``, takes the values u."""

    topology: Topology
    block: Block

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """The charts of the whole tree."""
        return make_charts(self.topology)

    @cached_property
    def own(self) -> tuple[Chart, ...]:
        """The charts of the block's joints."""
        names = {joint.name for joint in self.block.joints}
        return tuple(chart for chart in self.charts if chart.joint in names)

    @property
    def coordinates(self) -> int:
        """The number of the tree's coordinates."""
        return sum(len(chart.coordinate_names) for chart in self.charts)

    @cached_property
    def speeds(self) -> dict[str, int]:
        """The place of each own chart's first speed among the block's."""
        places, n = {}, 0
        for chart in self.own:
            places[chart.joint] = n
            n += len(chart.speed_names)
        return places

    @property
    def size(self) -> int:
        """The number of the block's speeds."""
        return sum(len(chart.speed_names) for chart in self.own)

    @cached_property
    def is_rotation(self) -> Array:
        """Flags of the block's speeds that are rotations."""
        joints = {joint.name: joint for joint in self.block.joints}
        elements = [joints[c.joint].element for c in self.own]
        return np.array([flag for e in elements for flag in (*(name in e.angles for name in e.coordinates), *([True] * 3 * e.has_ball))])

    @cached_property
    def scales(self) -> Array:
        """A scale of each speed of the block: 1 of rotations, the block's size of displacements."""
        return np.asarray(np.where(self.is_rotation, 1.0, size_of(self.block)))

    @cached_property
    def cuts(self) -> tuple[Joint, ...]:
        """The cut joints of the block."""
        names = {joint.name for joint in self.block.joints}
        return tuple(joint for joint in self.topology.cuts if joint.name in names)

    @cached_property
    def _blocks(self) -> BlockEquations:
        return derive_block(Builder(), self.topology, self.block.joints, self.cuts)

    @cached_property
    def open(self) -> bool:
        """True where the geometry has tunable parameters."""
        reached = reachable_blocks([*self._blocks.residuals, *self._blocks.rates])
        return any(x.op == "symbol" and x.data == "parameters" for x in reached)

    def design(self, count: int = 1) -> Array:
        """q of the design position, (count, coordinates)."""
        return np.tile(design_coordinates(self), (count, 1))

    def evaluate(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Residual (n, m) and Jacobian (n, m, speeds) at coordinates (n, coordinates) and values of the drive (n,)."""
        residuals, rates = self._blocks.residuals, self._blocks.rates
        inputs = {
            "t": u[:, np.newaxis, np.newaxis], "motion": np.zeros(1), "numerics": np.ones(3),
            "parameters": np.array([p.value for p in tunable_parameters(self.topology.model)]),
        }
        unit = np.eye(self.size)
        for chart in self.charts:
            inputs[f"q:{chart.joint}"] = q[:, np.newaxis, chart.q : chart.q + len(chart.coordinate_names)]
            first, n = self.speeds.get(chart.joint), len(chart.speed_names)
            inputs[f"v:{chart.joint}"] = np.zeros(n) if first is None else unit[np.newaxis, :, first : first + n]
        values = interpret_blocks([*residuals, *rates], inputs, {})
        count = len(q)
        residual = [np.broadcast_to(values[x][..., 0], (count, 1, x.shape[0]))[:, 0] for x in residuals]
        jacobian = [np.broadcast_to(values[x][..., 0], (count, self.size, x.shape[0])).swapaxes(1, 2) for x in rates]
        return np.concatenate(residual, axis=1), np.concatenate(jacobian, axis=1)

    def moved(self, q: Array, step: Array) -> Array:
        """The coordinates after steps (n, speeds) of the block."""
        whole = np.zeros((len(q), sum(len(chart.speed_names) for chart in self.charts)))
        for chart in self.own:
            n, first = len(chart.speed_names), self.speeds[chart.joint]
            whole[:, chart.v : chart.v + n] = step[:, first : first + n]
        return retract(self, q, whole)

    def close(self, q: Array, u: Array, locked: int | None, across: Array | None = None, tolerance: float = 0.0) -> Poses | None:
        """Poses near coordinates that close the loops, with the speed ``locked`` fixed or by steps ``across`` a direction of speeds.
        Residuals are at most ``tolerance`` or rounding; None if an iteration does not converge."""
        best = np.inf
        for left in reversed(range(25)):
            residual, jacobian = self.evaluate(q, u)
            error = float(np.abs(residual).max(initial=0.0))
            if not np.isfinite(error):
                return None
            if error < tolerance or (error < 1e-12 and (error >= best / 2 or not left)):
                return Poses(q=q, jacobian=jacobian, residual=residual)
            best = min(best, error)
            free = _without(jacobian, locked)
            if across is not None:
                free = np.concatenate([free, np.broadcast_to(across / np.linalg.norm(across), (len(q), 1, self.size))], axis=1)
                residual = np.concatenate([residual, np.zeros((len(q), 1))], axis=1)
            step = -(np.linalg.pinv(free, rcond=TOLERANCE) @ residual[:, :, np.newaxis])[:, :, 0]
            if np.abs(step).max(initial=0.0) > 3.0:
                return None
            q = self.moved(q, _with_zero(step, locked))
        return None

    def derivatives(self, poses: Poses, independent: int) -> Array:
        """The block's speeds by that of the number ``independent``, (n, speeds)."""
        free = _without(poses.jacobian, independent)
        found = -(np.linalg.pinv(free, rcond=TOLERANCE) @ poses.jacobian[:, :, independent, np.newaxis])[:, :, 0]
        return _with_zero(found, independent, 1.0)


def _without(jacobian: Array, column: int | None) -> Array:
    return jacobian if column is None else np.delete(jacobian, column, axis=2)


def _with_zero(step: Array, column: int | None, value: float = 0.0) -> Array:
    return step if column is None else np.insert(step, column, value, axis=1)


def size_of(block: Block) -> float:
    """The largest distance of two joints of a block in the design position, m; 1 where parameters give it."""
    points = [joint.at for joint in block.joints]
    try:
        numbers = np.array([[float(x) for x in point] for point in points])
    except TypeError:
        return 1.0
    return float(np.linalg.norm(numbers[:, np.newaxis] - numbers[np.newaxis], axis=2).max()) or 1.0
