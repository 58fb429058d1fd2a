"""The components of reactions that mechanics determines where equations of cut joints depend on each other.

Multipliers lambda of a motion are determined but for the null space of the transposed Jacobian: A^T n = 0 moves nothing.  A component of a
reaction that some such n changes is statically indeterminate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from cutjoint.analysis.closing import Array, FlatRoad, make_inputs
from cutjoint.analysis.poses import Pose, explore
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.quantities import quantities
from cutjoint.model.records import Model, Output, Reaction, Scene
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.records import Topology

#: A component that changes by less than this share of what its multipliers do to it one by one is determined: the rest is rounding.
_PART = 1e-6


def reaction_outputs(model: Model) -> tuple[Output, ...]:
    """All components of all reactions of a model."""
    return tuple(
        Output(element=reaction.name, quantity=quantity, span=reaction.span)
        for reaction in model.reactions if isinstance(reaction, Reaction) for quantity in quantities(reaction)
    )  # fmt: skip


def find_indeterminate(topology: Topology, scene: Scene, outputs: Iterable[Output]) -> tuple[str, ...]:
    """The columns among ``outputs`` that are components of reactions and indeterminate, in the design position or in poses near it."""
    names = {reaction.name for reaction in topology.model.reactions if isinstance(reaction, Reaction)}
    asked = tuple(output for output in outputs if output.element in names)
    if not asked or not topology.closing:
        return ()
    equations = formulate_recursive(topology, scene, asked)
    shares = np.max([_shares(equations, pose) for pose in _regular(explore(equations))], axis=0)
    return tuple(output.column for output, share in zip(asked, shares, strict=True) if share > _PART)


def _regular(poses: Sequence[Pose]) -> list[Pose]:
    """The poses that are not singular for a moment."""
    rank = max(pose.rank for pose in poses)
    return [pose for pose in poses if pose.rank == rank]


def _shares(equations: RecursiveEquations, pose: Pose) -> Array:
    """The largest change of each column by unit multipliers of the null space, beside the changes by single multipliers together."""
    null, changes = np.linalg.svd(pose.jacobian)[0][:, pose.rank :].T, _changes(equations, pose)
    sizes = np.linalg.norm(changes, axis=0)
    shares: Array = np.abs(null @ changes).max(axis=0, initial=0.0) / np.where(sizes > 0, sizes, 1.0)
    return shares


def _changes(equations: RecursiveEquations, pose: Pose) -> Array:
    """The change of each column by single multipliers of 1, by rows."""
    each = np.eye(len(equations.equation_names))
    still = make_inputs(equations, pose.q, np.zeros(equations.speeds))
    pushed = {f"lambda:{c.joint}": each[:, c.first : c.first + len(c.names)] for c in equations.closures}
    results = equations.function("report").results
    roads = {name: FlatRoad() for name in equations.roads}
    with_each, without = (interpret_blocks(results.values(), inputs, roads) for inputs in ({**still, **pushed}, still))
    columns = [np.broadcast_to(with_each[block][..., 0, 0] - without[block][..., 0, 0], len(each)) for block in results.values()]
    return np.stack(columns, axis=1)
