"""The body system with its cut joints, solved: for the forces of a motion, and for violations of the cut joints alone.

Both solutions have the same matrix.  Blocks are hash-consed, so that the second one repeats only the elimination of the right side.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from cutjoint.formulate.inputs import Numbers
from cutjoint.formulate.recursive.branches import BranchSystem, HubSystem
from cutjoint.formulate.recursive.embedding.elimination import EmbeddedLoopSystem
from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.formulate.recursive.loops import Closing, LoopClosure, add_loops, loop_errors
from cutjoint.formulate.recursive.recursion import BodySystem, Branched, condense, expand
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class ClosingElements:
    """The blocks of the cut joints and of the gears."""

    loops: tuple[LoopClosure, ...]
    gears: tuple[GearClosure, ...]

    def all(self) -> tuple[Closing, ...]:
        """The cut joints, then the gears."""
        return *self.loops, *self.gears

    def without_multipliers(self, b: Builder) -> "ClosingElements":
        """Copy the elements without multipliers."""
        return ClosingElements(
            loops=tuple(replace(x, multipliers=b.zero(len(x.names))) for x in self.loops),
            gears=tuple(replace(x, multipliers=b.zero(len(x.names))) for x in self.gears),
        )

    def with_violations(self, b: Builder, violations: Mapping[str, Block]) -> "ClosingElements":
        """Copy the elements with violations alone: ``violations`` instead of s, no multipliers."""
        alone = self.without_multipliers(b)
        return ClosingElements(
            loops=tuple(replace(x, s=violations[x.joint.name]) for x in alone.loops),
            gears=tuple(replace(x, s=violations[x.element.name]) for x in alone.gears),
        )


@dataclass(frozen=True, kw_only=True)
class Solution:
    """The accelerations ``vdot`` of every tree joint with unknowns, by names. ``errors`` are A Zdd + s of every cut joint and gear."""

    vdot: Mapping[str, Block]
    errors: Mapping[str, Block]


def solve(topology: Topology, system: BodySystem, k: Kinematics, closing: ClosingElements, numbers: Numbers) -> Solution:
    """Add the cut joints and gears to the bodies' system and solve it, which uses it up."""
    inside = {name for branch in topology.branches for name in branch.cuts}
    systems: dict[str, BranchSystem] = {}
    for of in sorted(topology.branches, key=lambda each: bool(each.hub)):
        systems[of.bodies[0]] = BranchSystem(
            branch=of, system=system, k=k, numbers=numbers, loops=[x for x in closing.loops if x.joint.name in of.cuts],
            gears=[x for x in closing.gears if x.element.name in of.gears], hub=systems.get(of.hub),
        )  # fmt: skip
    branches = [systems[each.bodies[0]] for each in topology.branches]
    of_body: dict[str, Branched] = {}
    for own in (each for each in branches if each.hub is None):
        around = [each for each in branches if each.hub is own]
        whole = HubSystem(hub=own, around=around) if around else own
        of_body |= {body: whole for each in (own, *around) for body in each.branch.bodies}  # without rotors
    for embedded_loop in k.topology.model.embedded_loops:
        of_body |= dict.fromkeys(embedded_loop.bodies, EmbeddedLoopSystem(embedded_loop=embedded_loop, system=system, k=k))
    coupling = tuple(x for x in closing.loops if x.joint.name not in inside)
    add_loops(system, k, coupling, numbers)
    Zdd, zdd = expand(k, condense(system, k, of_body), k.builder, of_body)
    errors = loop_errors(k, coupling, Zdd)
    for branch in branches:
        errors |= branch.errors()
    return Solution(vdot={k.motions[body].tree_joint.joint.name: block for body, block in zdd.items()}, errors=errors)


def refine(
    topology: Topology, masses: Mapping[str, Block], k: Kinematics, closing: ClosingElements, numbers: Numbers,
    solution: Solution, times: int,
) -> Solution:  # fmt: skip
    """The solution with corrected multipliers, again and again: its errors, and their response added; ``errors`` are then the sum of all.
    Each time leaves a share 1/(1 + a S) of the errors, S = A M^-1 A^T, as an evaluation with corrected multipliers would, but repeats of
    it only the right side."""
    b, vdot, errors, last = k.builder, solution.vdot, solution.errors, solution.errors
    places = {name: span.place for name, span in topology.model.constraint_spans.items()}
    for n in range(times):
        response = respond(topology, masses, k, closing, numbers, last, mark="r" * (n + 1), origin=f"pass {n + 2}: errors of pass {n + 1}")
        vdot = _sums(b, "accelerations", "zdd <- zdd + dzdd", places, vdot, response.vdot)
        errors = _sums(b, "multipliers", "A Zdd + s, again with the corrected multipliers", places, errors, response.errors)
        last = response.errors
    return Solution(vdot=vdot, errors=errors)


def _sums(
    b: Builder, stage: str, equation: str, places: Mapping[str, str], one: Mapping[str, Block], other: Mapping[str, Block]
) -> dict[str, Block]:  # fmt: skip
    """The sums of two blocks for each joint or gear."""
    sums = {}
    for name, block in one.items():
        with b.section(stage, name, equation, places[name]):
            sums[name] = b.add(block, other[name])
    return sums


def respond(
    topology: Topology, masses: Mapping[str, Block], k: Kinematics, closing: ClosingElements, numbers: Numbers,
    violations: Mapping[str, Block], *, mark: str, origin: str, apply: Callable[[BodySystem], None] = lambda system: None,
) -> Solution:  # fmt: skip
    """The response of bodies at rest to violations and forces: (M + A^T a A) z = Q - A^T a violation.
    Violations are those of cut joints; the forces are those that ``apply``. It also has the errors A z + violation. ``masses`` are those
    of the bodies without cut joints; names of the blocks get a ``mark``, headings an ``origin``."""
    b, still = k.builder, without_speed(k)
    system = BodySystem(builder=b, M=dict(masses), Q={body: b.zero(6) for body in masses})
    apply(system)
    with_violations = closing.with_violations(b, violations)
    with b.marked(mark, origin):
        return solve(topology, system, still, with_violations, numbers)


def without_speed(k: Kinematics) -> Kinematics:
    """The bodies in their places, without velocities and guides."""
    still = k.builder.zero(6)
    return replace(k, motions={body: replace(motion, d=still) for body, motion in k.motions.items()})
