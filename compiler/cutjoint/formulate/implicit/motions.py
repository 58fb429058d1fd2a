"""The elementary motions of all joints, and the change of all outer bodies with a step of each.

The unknown of a step is vdot; it changes v ``damping`` and q ``stiffness`` times as much (dt/2 and dt^2/4 in the trapezoidal rule). Motion
k with the column s_k, which displaces its outer bodies by xi_k = stiffness s_k, lies between two frames: before it (parent p, or the
motions of the same joint before it) with twist V_b, and after it with V_a, A_a. In a frame displaced by xi_k, twist and acceleration of
every outer body i change by

    DV_k = damping s_k + V_a x xi_k             DA_i = c_k + DV_k x V_i,    c_k = s_k + damping V_b x s_k - xi_k x A_a - DV_k x V_a

the same for all i. (The derivatives of the Newton-Euler recursion, as in Carpentier, Mansard 2018, and Echeandia, Wensing 2021, with q and
v as functions of the acceleration.) The pole moves with a free root body: displacing that body only moves the pole.

The joints of an embedded loop depend on one coordinate q. With s_j = derivative_j column_j their motions share the row of q and change
together: coordinates by stiffness derivative, speeds by damping derivative + stiffness d(rate)/dq, accelerations likewise.

Gears act on joint coordinates only.  The Jacobian of a gear with a law varies with these coordinates.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics, halves, motion_cross
from cutjoint.kernels.joints import elementary_motions
from cutjoint.model.records import GROUND
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.differentiate import Inputs, Variation


@dataclass(frozen=True, kw_only=True)
class StepWeights:
    """Blocks of the weights of a tangent: the factors of dQ/dv, dQ/dq and the equations' penalty."""

    damping: Block
    stiffness: Block
    constraint: Block


@dataclass(frozen=True, kw_only=True)
class Motion:
    """An elementary motion, or one of the three rotations of a ball joint.

    ``row`` is its place among all speeds, ``index`` that within its joint, ``group`` that of its motion within the joint (those of a ball
    share one), ``share`` its fraction of its coordinate; motions that share a coordinate have one row. ``s`` (6, 1) is its column,
    ``shift`` (6, 1) the same by the unknown of a ball, ``xi`` (6, 1) the displacement, ``after`` (6, 1) the twist of its outer frame,
    ``moved`` (6, 1) the change of its own speed, ``DV`` and ``c`` (6, 1) as above. In a dependent joint ``derivative`` scales the column.
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
    moved: Block
    DV: Block
    c: Block
    derivative: Block | None = None
    derivative_change: Block | None = None
    is_embedded: bool = False

    @property
    def key(self) -> tuple[int, int]:
        """A key that motions share if they change together, as those of an embedded loop do."""
        return self.row, -1 if self.is_embedded else self.group


@dataclass(frozen=True, kw_only=True)
class Motions:
    """All motions by the body that they carry, in the order of the tree, and each body's carriers from itself to the root.
    ``Zdd`` are the accelerations of the bodies, ``gravity`` (6, 1)."""

    k: Kinematics
    Zdd: Mapping[str, Block]
    gravity: Block
    weights: StepWeights
    of_body: Mapping[str, tuple[Motion, ...]]
    chains: Mapping[str, tuple[str, ...]]

    def all(self) -> Iterator[Motion]:
        """Every motion."""
        for motions in self.of_body.values():
            yield from motions

    def carries(self, k: Motion, j: Motion) -> bool:
        """Return whether motion k displaces the column of motion j."""
        return k.group < j.group if k.body == j.body else k.body in self.chains[j.body]

    def columns(self) -> dict[tuple[int, int], list[Motion]]:
        """The motions that change together, by their key."""
        found: dict[tuple[int, int], list[Motion]] = {}
        for motion in self.all():
            found.setdefault(motion.key, []).append(motion)
        return found

    def variations(self) -> dict[tuple[int, int], Variation]:
        """The change of blocks with the acceleration of each motion, by its key."""
        inputs = Inputs()
        return {key: self._variation(motions, inputs) for key, motions in self.columns().items()}

    def _variation(self, motions: Sequence[Motion], inputs: Inputs) -> Variation:
        k, b = self.k, self.k.builder
        rotations: dict[Block, Block] = {}
        changes: dict[Block, Block] = {}
        # whatever depends on a quaternion does so through rotations, but for accelerations by columns behind a ball
        behind_ball = any(k.motions[m.body].tree_joint.has_columns_behind_ball for m in motions)
        for body, frame in k.frames.items():
            moving = [m for m in motions if body != GROUND and m.body in self.chains[body]]
            if not moving:
                continue
            v, w = halves(b, b.total([m.xi for m in moving]))
            if frame.R.op != "const":
                rotations[frame.R] = w
            if frame.r.op != "const":
                changes[frame.r] = b.add(v, b.cross(w, frame.r))
            if frame.Z.op != "const":
                changes[frame.Z] = b.total([b.add(m.moved, motion_cross(b, m.xi, b.sub(frame.Z, m.after))) for m in moving])
            if behind_ball:
                turned = (b.add(motion_cross(b, m.DV, frame.Z), motion_cross(b, m.xi, b.sub(self.Zdd[body], self.gravity))) for m in moving)
                changes[self.Zdd[body]] = b.total([b.add(m.c, each) for m, each in zip(moving, turned, strict=True)])
        m, chart = next((m, c) for m in motions if (c := k.motions[m.body].chart) is not None)
        q = b.symbol(f"q:{chart.joint}", chart.scalars + 4 * chart.ball, BindingTime.ITERATION)
        speed = b.symbol(f"v:{chart.joint}", len(chart.speed_names), BindingTime.ITERATION)
        damping, stiffness = (b.mul(b.number(m.share), weight) for weight in (self.weights.damping, self.weights.stiffness))
        changes[speed] = _unit(b, len(chart.speed_names), m.index, damping)
        acceleration = b.symbol(f"vdot:{chart.joint}", len(chart.speed_names), BindingTime.ITERATION)
        changes[acceleration] = _unit(b, len(chart.speed_names), m.index, b.number(m.share))
        # only the scalars among a joint's coordinates, see above
        for i in range(chart.scalars):
            changes[b.element(q, i)] = stiffness if i == m.index else b.zero(1)
        for follower in motions:
            places = k.motions[follower.body].position
            if follower.derivative is not None and follower.index < len(places):
                changes[places[follower.index]] = b.mul(stiffness, follower.derivative)
        return Variation(b, inputs, frozenset({f"q:{chart.joint}", f"v:{chart.joint}", f"vdot:{chart.joint}"}), changes, rotations)


def _unit(b: Builder, size: int, index: int, value: Block) -> Block:
    return b.stack([[value if i == index else b.zero(1)] for i in range(size)])


def derive_motions(k: Kinematics, Zdd: Mapping[str, Block], gravity: Block, weights: StepWeights) -> Motions:
    """The motions of all joints with unknowns."""
    proper = {body: k.builder.sub(each, gravity) for body, each in Zdd.items()}
    chains: dict[str, tuple[str, ...]] = {}
    of_body: dict[str, tuple[Motion, ...]] = {}
    embedded_loops = _EmbeddedLoops(k=k, weights=weights)
    for body, motion in k.motions.items():
        chains[body] = (body, *chains.get(motion.tree_joint.parent, ()))
        joint = motion.tree_joint.joint
        with k.builder.section(
            "tangent", joint.name, "DV = damping s + V x xi, c = s + damping V_b x s - xi x A - DV x V", joint.span.place
        ):
            speeds = embedded_loops.speeds(motion)
            of_body[body] = tuple(_motions(k, body, motion, proper, speeds)) if speeds else ()
    return Motions(k=k, Zdd=Zdd, gravity=gravity, weights=weights, of_body=of_body, chains=chains)


@dataclass(frozen=True, kw_only=True)
class _Speed:
    """A speed of a joint as a function of the unknown of ``row``; factors that are None are 1.

    * ``derivative``: of the joint's coordinate with respect to the unknown's coordinate, ``derivative_change``: its change in a step.
    * ``position_change``, ``velocity_change``, ``acceleration_change``: those of coordinate, speed and acceleration.
    """

    row: int
    derivative: Block | None
    derivative_change: Block | None
    position_change: Block
    velocity_change: Block
    acceleration_change: Block | None
    acceleration: Block
    is_embedded: bool


@dataclass(frozen=True, kw_only=True)
class _EmbeddedLoops:
    """The dependent joints of embedded loops."""

    k: Kinematics
    weights: StepWeights
    _changes: dict[str, Variation] = field(default_factory=dict)
    _inputs: Inputs = field(default_factory=Inputs)

    def speeds(self, motion: JointMotion) -> list[_Speed]:
        """The speeds of a joint as functions of the unknowns that they depend on."""
        b, model, joint = self.k.builder, self.k.topology.model, motion.tree_joint.joint
        if motion.chart is not None:
            size = len(motion.chart.speed_names)
            vdot = b.symbol(f"vdot:{joint.name}", size, BindingTime.ITERATION)
            is_independent = any(embedded_loop.independent == joint.name for embedded_loop in model.embedded_loops)
            return [
                _Speed(
                    row=motion.chart.v + i, derivative=None, derivative_change=None, position_change=self.weights.stiffness,
                    velocity_change=self.weights.damping, acceleration_change=None, acceleration=b.element(vdot, i),
                    is_embedded=is_independent,
                )
                for i in range(size)
            ]  # fmt: skip
        if motion.own is None or motion.derivative is None:
            return []
        independent = model.dependent_joints[joint.name].independent
        chart = next(m.chart for m in self.k.motions.values() if m.chart is not None and m.chart.joint == independent)
        vdot, change = b.symbol(f"vdot:{independent}", 1, BindingTime.ITERATION), self._change(independent)
        found = []
        for i, (rate, second_rate) in enumerate(zip(motion.rate, motion.acceleration, strict=True)):
            derivative = b.element(motion.derivative, i)
            derivative_change = change.of(derivative)
            acceleration_change = b.total([derivative, change.of(second_rate), b.mul(vdot, derivative_change)])
            found.append(
                _Speed(
                    row=chart.v, derivative=derivative, derivative_change=derivative_change, velocity_change=change.of(rate),
                    position_change=b.mul(self.weights.stiffness, derivative), acceleration_change=acceleration_change,
                    acceleration=b.add(b.mul(derivative, vdot), second_rate), is_embedded=True,
                )
            )  # fmt: skip
        return found

    def _change(self, independent: str) -> Variation:
        """The changes of functions of an independent coordinate and its speed."""
        if independent not in self._changes:
            b = self.k.builder
            q, v = (b.symbol(f"{name}:{independent}", 1, BindingTime.ITERATION) for name in ("q", "v"))
            changes = {q: self.weights.stiffness, v: self.weights.damping}
            self._changes[independent] = Variation(b, self._inputs, frozenset({f"q:{independent}", f"v:{independent}"}), changes, {})
        return self._changes[independent]


def _motions(k: Kinematics, body: str, motion: JointMotion, Zdd: Mapping[str, Block], speeds: Sequence[_Speed]) -> Iterator[Motion]:
    b, parent, joint = k.builder, motion.tree_joint.parent, motion.tree_joint.joint
    elementary, parts = elementary_motions(motion.tree_joint.joint, motion.tree_joint.reversed), _columns(b, motion)
    takes_pole_along = joint.element.is_free and parent == GROUND
    before, A_before = k.frames[parent].Z, Zdd[parent]
    for n, part in enumerate(elementary):
        columns = dict(zip(part.places, parts[n], strict=True))
        shifts = _shifts(k, motion, columns)
        if n == len(elementary) - 1:
            after, A_after = k.frames[body].Z, Zdd[body]
        else:
            added = b.total([b.scale(motion.rate[i], column) for i, column in columns.items()])
            after = b.add(before, added)
            relative = b.total([b.scale(speeds[i].acceleration, column) for i, column in columns.items()])
            A_after = b.add(A_before, b.add(relative, motion_cross(b, before, added)))
        for i, column in columns.items():
            speed, still = speeds[i], takes_pole_along and i < len(joint.element.coordinates)
            xi = b.zero(6) if still else b.scale(speed.position_change, shifts[i])
            moved = b.scale(speed.velocity_change, column)
            DV = b.add(moved, motion_cross(b, after, xi))
            c = b.add(times(b, speed.acceleration_change, column), b.scale(speed.velocity_change, motion_cross(b, before, column)))
            c = b.sub(b.sub(c, motion_cross(b, xi, A_after)), motion_cross(b, DV, after))
            which = (joint.element.speeds[i], *([] if part.share == 1 else [str(n)]))
            for block, symbol in ((xi, "xi"), (DV, "DV"), (c, "c")):
                b.name(block, symbol, joint.name, which=which)
            s, shift = times(b, speed.derivative, column), times(b, speed.derivative, shifts[i])
            yield Motion(
                body=body, row=speed.row, index=i, group=n, share=part.share, s=s, shift=shift, xi=xi, after=after, moved=moved, DV=DV,
                c=c, derivative=speed.derivative, derivative_change=speed.derivative_change, is_embedded=speed.is_embedded,
            )  # fmt: skip
        before, A_before = after, A_after


def times(b: Builder, factor: Block | None, column: Block) -> Block:
    """A column, or a scalar, times a factor, which is 1 if it is None."""
    return column if factor is None else b.scale(factor, column)


def _columns(b: Builder, motion: JointMotion) -> list[list[Block]]:
    """The columns of each elementary motion: three of a ball."""
    subspace = motion.b if motion.b is not None else motion.own
    columns = subspace if motion.columns is None else motion.columns
    assert columns is not None
    elementary = elementary_motions(motion.tree_joint.joint, motion.tree_joint.reversed)
    places = [each.places if motion.columns is None else (n,) for n, each in enumerate(elementary)]
    return [[b.take(columns, (0, 6), (i, i + 1)) for i in each] for each in places]


def _shifts(k: Kinematics, motion: JointMotion, columns: Mapping[int, Block]) -> Mapping[int, Block]:
    """The columns of a motion by its unknowns. The unknowns of a ball are a rotation vector from the pose before the step; T (3, 3) maps
    their change to a rotation, see runtime/include/cutjoint/core/mechanism/retraction.hpp."""
    b, chart = k.builder, motion.chart
    if chart is None or not chart.ball or chart.scalars not in columns:
        return columns
    elements = b.symbol(f"ball_tangent:{chart.joint}", 9, BindingTime.ITERATION)
    T = b.stack([[b.element(elements, 3 * i + j) for j in range(3)] for i in range(3)])
    ball = b.mul(b.stack([list(columns.values())]), T)
    return {chart.scalars + i: b.take(ball, (0, 6), (i, i + 1)) for i in range(3)}


def joint_forces_of(k: Kinematics, gears: Sequence[GearClosure], gear_multipliers: Sequence[Block]) -> dict[str, Block]:
    """The generalised forces J^T force, summed over all gears, of all speeds of each joint, by its outer body."""
    b = k.builder
    forces: dict[str, Block] = {}
    for gear, force in zip(gears, gear_multipliers, strict=True):
        for body in gear.row:
            motion = k.motions[body]
            share = b.mul(b.transpose(gear.columns(b, body, len(motion.speed_names))), force)
            forces[body] = b.add(forces[body], share) if body in forces else share
    return forces


def augmented_multipliers(k: Kinematics, gear: GearClosure, penalty: Block) -> Block:
    """penalty Phi + lambda."""
    b, name = k.builder, gear.element.name
    with b.section("closure", name, "penalty Phi + lambda", gear.element.span.place):
        return b.name(b.add(b.scale(penalty, gear.residual), gear.multipliers), "push", name, rows=gear.names)


def change(k: Kinematics, gear: GearClosure, x: Mapping[str, Block]) -> Block:
    """The product J x by joint, for columns x (speeds, 1)."""
    b = k.builder
    parts = [(k.motions[body].tree_joint.joint.name, place, factor) for body, (place, factor) in gear.row.items()]
    return b.total([b.mul(factor, b.element(x[joint], place)) for joint, place, factor in parts])


def speed_inputs(k: Kinematics) -> dict[str, Block]:
    """The accelerations, or their substitutes, by joint."""
    b, charts = k.builder, [motion.chart for motion in k.motions.values() if motion.chart is not None]
    return {c.joint: b.symbol(f"vdot:{c.joint}", len(c.speed_names), BindingTime.ITERATION) for c in charts}


def gear_tangent(motions: Motions, gear: GearClosure, force: Block) -> Iterator[tuple[Motion, Motion, Block]]:
    """constraint J^T J, and stiffness times the change of J^T ``force``: row, column, value; motions that share a coordinate count once."""
    b = motions.k.builder
    ends, seconds = (
        [(next(m for m in motions.of_body[body] if m.index == place), factor) for body, (place, factor) in of.items()]
        for of in (gear.row, gear.row_derivative)
    )
    for j, first in ends:
        for k, second in ends:
            yield j, k, b.mul(motions.weights.constraint, b.mul(first, second))
    for j, second in seconds:
        yield j, j, b.mul(motions.weights.stiffness, b.mul(second, force))
