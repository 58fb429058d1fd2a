"""Degrees of freedom: the rank of the cut joints' equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.formulate.records import Equations
from cutjoint.program.interpret import RoadTable, interpret_blocks

Array: TypeAlias = NDArray[np.float64]

#: A singular value below this share of the largest counts as zero.
TOLERANCE = 1e-9


@dataclass(frozen=True, kw_only=True)
class Mobility:
    """Unknown speeds, cut-joint equations and how many of them are independent in the design position."""

    speeds: int
    equations: int
    rank: int

    @property
    def degrees_of_freedom(self) -> int:
        """Speeds that the equations leave free."""
        return self.speeds - self.rank


class _NoRoad:
    """A flat road; the closures never look at it."""

    def height(self, x: float, y: float) -> float:
        """Height, m."""
        return 0.0

    def slope(self, x: float, y: float) -> float:
        """dz/dx."""
        return 0.0


def find_mobility(equations: Equations) -> Mobility:
    """The mobility in the design position with default parameters, guides standing still."""
    jacobian = closure_jacobian(equations, design_coordinates(equations))
    values = np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else np.zeros(0)
    rank = int(np.sum(values > TOLERANCE * values.max())) if values.size else 0
    return Mobility(speeds=equations.speeds, equations=len(equations.equation_names), rank=rank)


def design_coordinates(equations: Equations) -> Array:
    """q of the design position: zeros and unit quaternions."""
    q = np.zeros(equations.coordinates)
    for chart in equations.charts:
        if chart.ball:
            q[chart.q + chart.scalars] = 1.0
    return q


def closure_jacobian(equations: Equations, q: Array) -> Array:
    """d rate / d v of the cut joints, (equations, speeds): exact, since the rate is linear in v."""
    n = equations.speeds
    still = _rate(equations, q, np.zeros(n))
    columns = [_rate(equations, q, np.eye(n)[i]) - still for i in range(n)]
    return np.stack(columns, axis=1) if columns else np.zeros((still.size, 0))


def _rate(equations: Equations, q: Array, v: Array) -> Array:
    close = next(f for f in equations.functions if f.name == "close")
    rates = [block for target, block in close.results.items() if target.startswith("rate:")]
    roads: dict[str, RoadTable] = {name: _NoRoad() for name in equations.roads}
    values = interpret_blocks(rates, make_inputs(equations, q, v), roads)
    return np.concatenate([values[block].ravel() for block in rates]) if rates else np.zeros(0)


def make_inputs(equations: Equations, q: Array, v: Array) -> dict[str, Array]:
    """The interpreter's inputs for coordinates and speeds at t = 0, everything else at its default."""
    numerics = equations.scene.numerics
    inputs = {
        "t": np.zeros(1),
        "motion": np.zeros(1),
        "parameters": np.array([p.value for p in equations.parameters]),
        "numerics": np.array([numerics.penalty, numerics.damping_ratio, numerics.frequency]),
    }
    for chart in equations.charts:
        inputs[f"q:{chart.joint}"] = q[chart.q : chart.q + len(chart.coordinate_names)]
        inputs[f"v:{chart.joint}"] = v[chart.v : chart.v + len(chart.speed_names)]
        inputs[f"vdot:{chart.joint}"] = np.zeros(len(chart.speed_names))
    for closure in equations.closures:
        inputs[f"lambda:{closure.joint}"] = np.zeros(len(closure.names))
    return inputs
