"""The body system with its cut joints, solved: for the forces of a motion, and for gaps of the cut joints alone.

Both solutions have the same matrix.  Blocks are hash-consed, so that the second one repeats of the elimination only what
depends on the right side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from cutjoint.formulate.inputs import Numbers
from cutjoint.formulate.recursive.branches import BranchSystem
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.formulate.recursive.loops import LoopClosure, add_loops, loop_errors
from cutjoint.formulate.recursive.recursion import BodySystem, condense, expand
from cutjoint.program.blocks import Block
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Of every tree joint with unknowns the accelerations ``vdot``, of every cut joint the ``errors`` A Zdd + s; by their names."""

    vdot: Mapping[str, Block]
    errors: Mapping[str, Block]


def solve(topology: Topology, system: BodySystem, k: Kinematics, loops: tuple[LoopClosure, ...], numbers: Numbers) -> Solution:
    """Add the cut joints to the bodies' system and solve it, which uses it up."""
    inside = {name for branch in topology.branches for name in branch.cuts}
    branches = [
        BranchSystem(branch=branch, system=system, k=k, numbers=numbers, loops=[x for x in loops if x.joint.name in branch.cuts])
        for branch in topology.branches
    ]  # fmt: skip
    of_body = {body: branch for branch in branches for body in branch.branch.bodies}
    coupling = tuple(x for x in loops if x.joint.name not in inside)
    add_loops(system, k, coupling, numbers)
    Zdd, zdd = expand(k, condense(system, k, of_body), k.builder, of_body)
    errors = loop_errors(k, coupling, Zdd)
    for branch in branches:
        errors |= branch.errors()
    return Solution(vdot={k.motions[body].tree_joint.joint.name: block for body, block in zdd.items()}, errors=errors)


def respond(
    topology: Topology, masses: Mapping[str, Block], k: Kinematics, loops: tuple[LoopClosure, ...], numbers: Numbers,
    gaps: Mapping[str, Block], mark: str,
) -> Solution:  # fmt: skip
    """What gaps of the cut joints alone do to bodies without velocity and forces: (M + A^T a A) z = -A^T a gap, errors A z + gap.

    ``masses`` are those of the bodies without cut joints; names of the blocks get a ``mark``.
    """
    b = k.builder
    still = replace(k, motions={body: replace(motion, d=b.zero(6)) for body, motion in k.motions.items()})
    system = BodySystem(builder=b, M=dict(masses), Q={body: b.zero(6) for body in masses})
    gaping = tuple(replace(x, s=gaps[x.joint.name], multipliers=b.zero(len(x.names))) for x in loops)
    with b.marked(mark):
        return solve(topology, system, still, gaping, numbers)
