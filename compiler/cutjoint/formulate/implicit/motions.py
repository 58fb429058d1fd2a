"""The elementary motions of all joints, and how a step of one moves what it carries.

The unknown of a step is vdot; with it change v by ``damping`` and q by ``stiffness`` (dt/2 and dt^2/4 of the trapezoidal rule).  Motion k
with the column s_k, which turns and shifts its outer bodies by xi_k = stiffness s_k, lies between two frames: before it (parent p, or the
motions of the same joint before it) with twist V_b, and after it with V_a, A_a.  Seen from a frame that goes along with xi_k, the twist
and the acceleration of any body i that it carries change by

    DV_k = damping s_k + V_a x xi_k             DA_i = c_k + DV_k x V_i,    c_k = s_k + damping V_b x s_k - xi_k x A_a - DV_k x V_a

the same for all i.  (The derivatives of the Newton-Euler recursion, as in Carpentier, Mansard 2018, and Echeandia, Wensing 2021, with
both of its arguments tied to the acceleration.)  The pole goes along with a free root: where one is displaced, nothing moves but the
pole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics, halves, motion_cross
from cutjoint.kernels.joints import elementary_motions
from cutjoint.model.records import GROUND
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.vary import Inputs, Variation


@dataclass(frozen=True, kw_only=True)
class StepWeights:
    """Blocks of the weights of a tangent: what multiplies dQ/dv, dQ/dq and the equations' penalty."""

    damping: Block
    stiffness: Block
    constraint: Block


@dataclass(frozen=True, kw_only=True)
class Motion:
    """An elementary motion, or one of the three directions of a ball.

    ``row`` is its place among all speeds, ``index`` that within its joint, ``group`` that of its motion within the joint (those of a ball
    share one), ``share`` how much of its coordinate it turns; motions that share a coordinate have one row.  ``s`` (6, 1) is its column,
    ``shift`` (6, 1) the same by the unknown of a ball, ``xi`` (6, 1) the displacement, ``after`` (6, 1) the twist behind it, ``DV`` and
    ``c`` (6, 1) as above.
    """

    body: str
    row: int
    index: int
    group: int
    share: float
    s: Block
    shift: Block
    xi: Block
    after: Block
    DV: Block
    c: Block

    @property
    def key(self) -> tuple[int, int]:
        """A pair of numbers that distinguishes the motion from all others."""
        return self.row, self.group


@dataclass(frozen=True, kw_only=True)
class Motions:
    """All motions by the body that they carry, in the order of the tree, and each body's carriers from itself to the root."""

    k: Kinematics
    weights: StepWeights
    of_body: Mapping[str, tuple[Motion, ...]]
    chains: Mapping[str, tuple[str, ...]]

    def all(self) -> Iterator[Motion]:
        """Every motion."""
        for motions in self.of_body.values():
            yield from motions

    def turns(self, k: Motion, j: Motion) -> bool:
        """Return whether motion k carries the column of motion j along."""
        if k.body == j.body:
            return k.group < j.group
        return k.body in self.chains[j.body]

    def variations(self) -> dict[tuple[int, int], Variation]:
        """The changes of blocks with each motion's acceleration, by its key."""
        inputs = Inputs()
        return {motion.key: self._variation(motion, inputs) for motion in self.all()}

    def _variation(self, m: Motion, inputs: Inputs) -> Variation:
        k, b = self.k, self.k.builder
        chart = k.motions[m.body].chart
        assert chart is not None
        v, w = halves(b, m.xi)
        turns: dict[Block, Block] = {}
        changes: dict[Block, Block] = {}
        for body, frame in k.frames.items():
            if body == GROUND or m.body not in self.chains[body]:
                continue
            if frame.R.op != "const":
                turns[frame.R] = w
            if frame.r.op != "const":
                changes[frame.r] = b.add(v, b.cross(w, frame.r))
            if frame.Z.op != "const":
                changes[frame.Z] = b.add(b.scale(self.weights.damping, m.s), motion_cross(b, m.xi, b.sub(frame.Z, m.after)))
        q = b.symbol(f"q:{chart.joint}", chart.scalars + 4 * chart.ball, BindingTime.ITERATION)
        speed = b.symbol(f"v:{chart.joint}", len(chart.speed_names), BindingTime.ITERATION)
        damping, stiffness = (b.mul(b.number(m.share), weight) for weight in (self.weights.damping, self.weights.stiffness))
        changes[speed] = _unit(b, len(chart.speed_names), m.index, damping)
        # only the scalars among a joint's coordinates: whatever depends on a quaternion does so through a rotation
        for i in range(chart.scalars):
            changes[b.element(q, i)] = stiffness if i == m.index else b.zero(1)
        return Variation(b, inputs, frozenset({f"q:{chart.joint}", f"v:{chart.joint}"}), changes, turns)


def _unit(b: Builder, size: int, index: int, value: Block) -> Block:
    return b.stack([[value if i == index else b.zero(1)] for i in range(size)])


def derive_motions(k: Kinematics, Zdd: Mapping[str, Block], weights: StepWeights) -> Motions:
    """The motions of all joints with unknowns; ``Zdd`` are the bodies' accelerations, less that of gravity."""
    chains: dict[str, tuple[str, ...]] = {}
    of_body: dict[str, tuple[Motion, ...]] = {}
    for body, motion in k.motions.items():
        chains[body] = (body, *chains.get(motion.tree_joint.parent, ()))
        joint = motion.tree_joint.joint
        with k.builder.section(
            "tangent", joint.name, "DV = damping s + V x xi, c = s + damping V_b x s - xi x A - DV x V", joint.span.place
        ):
            of_body[body] = tuple(_motions(k, body, motion, Zdd, weights)) if motion.b is not None else ()
    return Motions(k=k, weights=weights, of_body=of_body, chains=chains)


def _motions(k: Kinematics, body: str, motion: JointMotion, Zdd: Mapping[str, Block], weights: StepWeights) -> Iterator[Motion]:
    b, parent = k.builder, motion.tree_joint.parent
    assert motion.b is not None
    assert motion.chart is not None
    chart, elementary, parts = motion.chart, elementary_motions(motion.tree_joint), _columns(b, motion)
    takes_pole_along = motion.tree_joint.joint.element.is_free and parent == GROUND
    vdot = b.symbol(f"vdot:{chart.joint}", motion.b.shape[1], BindingTime.ITERATION)
    before, A_before = k.frames[parent].Z, Zdd[parent]
    for n, part in enumerate(elementary):
        columns = dict(zip(part.places, parts[n], strict=True))
        shifts = _shifts(k, motion, columns)
        if n == len(elementary) - 1:
            after, A_after = k.frames[body].Z, Zdd[body]
        else:
            added = b.total([b.scale(motion.rate[i], column) for i, column in columns.items()])
            after = b.add(before, added)
            pushed = b.total([b.scale(b.element(vdot, i), column) for i, column in columns.items()])
            A_after = b.add(A_before, b.add(pushed, motion_cross(b, before, added)))
        for i, column in columns.items():
            still = takes_pole_along and i < chart.scalars
            xi = b.zero(6) if still else b.scale(weights.stiffness, shifts[i])
            DV = b.add(b.scale(weights.damping, column), motion_cross(b, after, xi))
            c = b.add(column, b.scale(weights.damping, motion_cross(b, before, column)))
            c = b.sub(b.sub(c, motion_cross(b, xi, A_after)), motion_cross(b, DV, after))
            which = (chart.speed_names[i], *([] if part.share == 1 else [str(n)]))
            for block, symbol in ((xi, "xi"), (DV, "DV"), (c, "c")):
                b.name(block, symbol, chart.joint, which=which)
            yield Motion(
                body=body, row=chart.v + i, index=i, group=n, share=part.share, s=column, shift=shifts[i], xi=xi, after=after, DV=DV,
                c=c,
            )  # fmt: skip
        before, A_before = after, A_after


def _columns(b: Builder, motion: JointMotion) -> list[list[Block]]:
    """The columns of each elementary motion: three of a ball."""
    columns = motion.b if motion.columns is None else motion.columns
    assert columns is not None
    elementary = elementary_motions(motion.tree_joint)
    places = [each.places if motion.columns is None else (n,) for n, each in enumerate(elementary)]
    return [[b.take(columns, (0, 6), (i, i + 1)) for i in each] for each in places]


def _shifts(k: Kinematics, motion: JointMotion, columns: Mapping[int, Block]) -> Mapping[int, Block]:
    """The columns of a motion by its unknowns.  A ball's unknowns are those of a rotation vector from the pose before the step: the
    turns that they make are T (3, 3) times as large, see runtime/include/cutjoint/core/retraction.hpp."""
    b, chart = k.builder, motion.chart
    assert chart is not None
    if not chart.ball or chart.scalars not in columns:
        return columns
    elements = b.symbol(f"turn:{chart.joint}", 9, BindingTime.ITERATION)
    T = b.stack([[b.element(elements, 3 * i + j) for j in range(3)] for i in range(3)])
    ball = b.mul(b.stack([list(columns.values())]), T)
    return {chart.scalars + i: b.take(ball, (0, 6), (i, i + 1)) for i in range(3)}
