"""Which components of reactions mechanics determines where equations of cut joints depend on each other.

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

#: A component that changes by less than this share of the most that any does is determined.
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
    changes = [_changes(equations, pose) for pose in _regular(explore(equations))]
    sizes = np.max([np.abs(change).max(axis=0, initial=0.0) for change in changes], axis=0)
    return tuple(output.column for output, size in zip(asked, sizes, strict=True) if size > _PART * sizes.max())


def _regular(poses: Sequence[Pose]) -> list[Pose]:
    """The poses that are not singular for a moment."""
    rank = max(pose.rank for pose in poses)
    return [pose for pose in poses if pose.rank == rank]


def _changes(equations: RecursiveEquations, pose: Pose) -> Array:
    """What unit multipliers of the null space, by rows, change of each column."""
    null = np.linalg.svd(pose.jacobian)[0][:, pose.rank :].T
    still = make_inputs(equations, pose.q, np.zeros(equations.speeds))
    pushed = {f"lambda:{c.joint}": null[:, c.first : c.first + len(c.names)] for c in equations.closures}
    results = equations.function("report").results
    roads = {name: FlatRoad() for name in equations.roads}
    with_null, without = (interpret_blocks(results.values(), inputs, roads) for inputs in ({**still, **pushed}, still))
    columns = [np.broadcast_to(with_null[block][..., 0, 0] - without[block][..., 0, 0], len(null)) for block in results.values()]
    return np.stack(columns, axis=1)
