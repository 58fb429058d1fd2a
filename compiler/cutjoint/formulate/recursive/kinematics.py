"""Positions, velocities and motion subspaces of all bodies, from the ground outwards.

The motion of a body is Z = [v0; w], the velocity of its point at the pole and its angular velocity (Cuadrado et al. 2000, eqs. 23, 26,
27).  All vectors are resolved in the same axes: global axes, or the instantaneous axes of the body that carries all others.  The pole
of a branch that stands free is its root body's origin at this instant; that of a branch on the ground is its first joint.  Bodies of one
branch share the pole, so that Z_i = Z_p + b_i zd_i without frame transforms.

`derive_poses` has the poses of all bodies as blocks of the tree's coordinates, and nothing of the recursion's dynamics.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy

from cutjoint.formulate.inputs import derive_scene_inputs, guide_rates, make_charts, make_translator, reference_point, tunable_parameters
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.recursive.embedding.dependent import DependentMotion, dependent_motion
from cutjoint.formulate.translate import Translator
from cutjoint.kernels.joints import QUATERNION, JointKernel, derive_joint, inner_point
from cutjoint.model.records import GROUND, EmbeddedLoop, Model, Parameter, Scalar, Scene, Vector
from cutjoint.program.blocks import BindingTime, Block, Builder, is_zero
from cutjoint.topology.records import Topology, TreeJoint

_Motion = tuple[Block | None, Block, Block | None]
ATTITUDE = frozenset({"roll", "pitch", "yaw"})  #: the angles that a body reports


@dataclass(frozen=True, kw_only=True)
class Frame:
    """The pose and velocity of a body.
    ``R`` (3, 3) from the body's axes; ``r`` (3, 1) its origin from the pole; ``origin`` that point in the design position; ``Z`` (6, 1);
    ``pole`` (3, 1) the pole from the world's origin in global axes, ``root`` the body that names the branch."""

    R: Block
    r: Block
    origin: Vector
    Z: Block
    pole: Block
    root: str


@dataclass(frozen=True, kw_only=True)
class JointMotion:
    """The motion of a joint, Zdd_i = Zdd_p + b zdd + d: ``b`` (6, k), ``d`` (6, 1), ``chart`` of its k unknowns.

    ``centre`` is the pole-to-centre vector of a spherical joint, which is eliminated in global axes about that point.
    ``columns`` (6, n) are those of the elementary motions in the chain's order, where several share a speed; else they are b's.
    ``position``, ``quaternion``, ``rate`` hold the coordinates and speeds, ``acceleration`` the guide's if the joint is guided.
    Of a dependent joint of an embedded loop, ``derivative`` (k, 1) has its speeds by that of the independent coordinate, ``own`` (6, k) the
    motion subspace, and ``follows`` (6, 1) the motion by that coordinate.
    """

    tree_joint: TreeJoint
    b: Block | None
    d: Block
    chart: Chart | None
    centre: Block | None
    columns: Block | None
    position: tuple[Block, ...]
    quaternion: tuple[Block, ...]
    rate: tuple[Block, ...]
    acceleration: tuple[Block, ...]
    derivative: Block | None = None
    own: Block | None = None
    follows: Block | None = None

    @property
    def speed_names(self) -> tuple[str, ...]:
        """The names of the k unknowns among the joint's speeds."""
        return self.chart.speed_names if self.chart is not None else ()


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """A wheel that rotates about its axis of symmetry: the body of the bearing, its ``axis`` (3, 1), the ``inertia`` about it (1, 1)."""

    carrier: str
    axis: Block
    inertia: Block


@dataclass(kw_only=True)
class Kinematics:
    """All frames and joint motions, and the geometry for forces and closures.
    Vectors are resolved in the axes of the body ``axes``, whose rotation from the global ones is ``axes_rotation`` (3, 3), or in global
    ones. ``rotors`` are wheels whose mass moves with their carriers."""

    builder: Builder
    translator: Translator
    topology: Topology
    axes: str = GROUND
    axes_rotation: Block | None = None
    frames: dict[str, Frame] = field(default_factory=dict)
    motions: dict[str, JointMotion] = field(default_factory=dict)
    rotors: dict[str, Rotor] = field(default_factory=dict)

    @property
    def guided_rates(self) -> list[Block]:
        """The speeds of guided tree joints."""
        return [rate for motion in self.motions.values() if motion.tree_joint.joint.guide is not None for rate in motion.rate]

    def carriers(self, body: str, end: str = GROUND) -> list[str]:
        """The body and those that carry it, up to but without ``end`` or the ground."""
        found = []
        while body not in (GROUND, end):
            found.append(body)
            body = self.motions[body].tree_joint.parent
        return found

    def vector(self, vector: Vector) -> Block:
        """A design vector as a column."""
        return self.builder.column([self.translator.scalar(x) for x in vector])

    def in_global(self, vectors: Block) -> Block:
        """Columns (3, n) of vectors in global axes."""
        return vectors if self.axes_rotation is None else self.builder.mul(self.axes_rotation, vectors)

    def from_global(self, vectors: Block) -> Block:
        """Columns (3, n) of vectors that are given in global axes."""
        return vectors if self.axes_rotation is None else self.builder.mul(self.builder.transpose(self.axes_rotation), vectors)

    def direction(self, body: str, direction: Vector) -> Block:
        """A body-fixed direction."""
        return self.builder.mul(self.frames[body].R, self.vector(direction))

    def point(self, body: str, point: Vector) -> Block:
        """A body-fixed point from its branch's pole."""
        frame = self.frames[body]
        arm = tuple(p - o for p, o in zip(point, frame.origin, strict=True))
        return self.builder.add(frame.r, self.direction(body, arm))

    def absolute(self, body: str, point: Block) -> Block:
        """A point given from the pole, from the world's origin in global axes."""
        return self.builder.add(self.in_global(point), self.frames[body].pole)

    def velocity(self, body: str, point: Block) -> Block:
        """The velocity of the body's point that stands at ``point`` from the pole: v0 + w x p."""
        b, (v0, w) = self.builder, halves(self.builder, self.frames[body].Z)
        return b.add(v0, b.cross(w, point))

    def between(self, body: str, point: Block, other: str, other_point: Block) -> Block:
        """The displacement from ``other_point`` of ``other`` to ``point`` of ``body``."""
        b = self.builder
        return b.add(b.sub(point, other_point), self.pole_step(other, body))

    def pole_step(self, start: str, end: str) -> Block:
        """The displacement from the pole of ``start`` to that of ``end``; zero when they share it."""
        first, second = self.frames[start], self.frames[end]
        return self.builder.zero(3) if first.root == second.root else self.from_global(self.builder.sub(second.pole, first.pole))

    def twist_at(self, twist: Block, step: Block) -> Block:
        """A twist with its linear part at a pole displaced by ``step``: [v0 + w x s; w]."""
        b = self.builder
        if is_zero(step):
            return twist
        v0, w = halves(b, twist)
        return b.stack([[b.add(v0, b.cross(w, step))], [w]])

    def armature(self, body: str) -> Block | None:
        """The inertia of a joint's only coordinate in addition to that of the bodies, None if there is none."""
        armature = self.motions[body].tree_joint.joint.armature
        return self.translator.scalar(armature) if armature != 0 else None

    def for_subspace(self, body: str, column: Block) -> Block:
        """A column of a joint's speeds, or of forces on them, as one that multiplies its motion subspace."""
        return self.twists_from_global(column) if self._is_free_root(body) else column

    def of_subspace(self, body: str, column: Block) -> Block:
        """A column of a joint's speeds from one that multiplies its motion subspace."""
        if not self._is_free_root(body):
            return column
        return self.builder.stack([[self.in_global(half)] for half in halves(self.builder, column)])

    def twists_from_global(self, twists: Block) -> Block:
        """Columns (6, n) of twists that are given in global axes."""
        b, n = self.builder, twists.shape[1]
        if self.axes_rotation is None:
            return twists
        return b.stack([[self.from_global(b.take(twists, rows, (0, n)))] for rows in ((0, 3), (3, 6))])

    def _is_free_root(self, body: str) -> bool:
        return body == self.axes and next(t for t in self.topology.tree if t.child == body).joint.element.is_free


def halves(builder: Builder, column: Block) -> tuple[Block, Block]:
    """The linear and the angular part of a 6-column."""
    return builder.take(column, (0, 3)), builder.take(column, (3, 6))


def motion_cross(builder: Builder, twist: Block, motion: Block) -> Block:
    """The rate of a motion vector carried by a twist: [w x m_v + v x m_w; w x m_w] (Featherstone 2008, eq. 2.31)."""
    b = builder
    (v, w), (mv, mw) = halves(b, twist), halves(b, motion)
    return b.stack([[b.add(b.cross(w, mv), b.cross(v, mw))], [b.cross(w, mw)]])


def derive_kinematics(
    builder: Builder, translator: Translator, topology: Topology, charts: Mapping[str, Chart], *, axes: str = GROUND
) -> Kinematics:  # fmt: skip
    """The frames and motions of all bodies, resolved in global axes, or in those of the body that carries all others."""
    b = builder
    k = Kinematics(builder=b, translator=translator, topology=topology, axes=axes)
    zero, still = b.zero(3), b.zero(6)
    origin = (sympy.Integer(0),) * 3
    if axes != GROUND:
        k.axes_rotation = _axes_rotation(k, next(t for t in topology.tree if t.child == axes), charts)
    k.frames[GROUND] = Frame(R=k.from_global(b.identity(3)), r=zero, origin=origin, Z=still, pole=zero, root=GROUND)
    for t in topology.tree:
        equation = "R_i = R_p R(q), Z_i = Z_p + b_i zd_i, Zdd_i = Zdd_p + b_i zdd_i + d_i  (eqs. 23, 26, 27)"
        with b.section("kinematics", t.joint.name, equation, t.joint.span.place):
            _add_joint(k, t, topology.model, charts.get(t.joint.name))
    return k


def _add_joint(k: Kinematics, t: TreeJoint, model: Model, chart: Chart | None) -> None:
    b = k.builder
    kernel = derive_joint(t.joint, t.reversed)
    following = _following(k, t, model)
    position, quaternion, rate, acceleration = following.motion if following else _coordinates(k, t, kernel, model, chart)
    local = k.translator.with_values(dict(zip((*kernel.q, *QUATERNION), (*position, *quaternion), strict=False)))
    local = local.with_values(dict(zip(kernel.u, rate, strict=True)))
    local_rotation = local.matrix(kernel.rotation)
    if t.child == k.axes:
        local_rotation = b.identity(3)  # its own axes
    b.name(local_rotation, "R", t.joint.name)
    shift = local.matrix(kernel.displacement)
    if t.parent == GROUND:
        frame, motion = _add_root(k, t, kernel, local, local_rotation, shift, rate)
    else:
        frame, motion = _add_branch(k, t, kernel, local, local_rotation, shift, rate)
    for block, symbol in ((frame.R, "R"), (frame.r, "r"), (frame.Z, "Z"), (motion[0], "b"), (motion[1], "d")):
        if block is not None:
            b.name(block, symbol, t.child, columns=chart.speed_names if chart is not None and symbol == "b" else ())
    subspace, drift, centre = motion
    own = subspace if following else None
    follows = b.name(b.mul(own, following.derivative), "follows", t.child) if following and own is not None else None
    if acceleration and subspace is not None:
        drift, subspace = b.add(drift, b.mul(subspace, b.column(acceleration))), None
    k.frames[t.child] = frame
    k.motions[t.child] = JointMotion(
        tree_joint=t, b=subspace if chart else None, d=drift, chart=chart, centre=centre if chart else None,
        columns=_columns(k, t, kernel, local) if t.joint.element.shares_coordinates and (chart or following) else None,
        position=position, quaternion=quaternion, rate=rate, acceleration=acceleration,
        derivative=following.derivative if following else None, own=own, follows=follows,
    )  # fmt: skip


def _axes_rotation(k: Kinematics, t: TreeJoint, charts: Mapping[str, Chart]) -> Block:
    """The rotation of a body next to the ground from its own axes to global ones."""
    kernel = derive_joint(t.joint, t.reversed)
    with k.builder.section("kinematics", t.joint.name, "R, from the axes in which all vectors are resolved", t.joint.span.place):
        position, quaternion, _, _ = _coordinates(k, t, kernel, k.topology.model, charts[t.joint.name])
        values = dict(zip((*kernel.q, *QUATERNION), (*position, *quaternion), strict=False))
        rotation = k.translator.with_values(values).matrix(kernel.rotation)
        return k.builder.name(rotation, "R", "global")


def _following(k: Kinematics, t: TreeJoint, model: Model) -> DependentMotion | None:
    """The motion of a dependent joint of an embedded loop."""
    embedded_loop = model.dependent_joints.get(t.joint.name)
    if embedded_loop is None:
        return None
    driven = embedded_loop.functions.drive_range
    drive = drive_of(k, embedded_loop) if driven is not None and driven.half > 0 else None
    with k.builder.section("functions", t.joint.name, "s = sum of c f(q), s' = s_q q', s'' = s_q q'' + s_qq q'^2", t.joint.span.place):
        return dependent_motion(k.builder, t.joint, embedded_loop, drive)


def drive_of(k: Kinematics, embedded_loop: EmbeddedLoop) -> tuple[Block, Block, Block]:
    """The guided coordinate of an embedded loop with its rate and acceleration."""
    joint = next(joint for joint in k.topology.model.joints if joint.name == embedded_loop.drive)
    assert joint.guide is not None
    return _guided(k, joint.guide[0], k.topology.model)


def _coordinates(
    k: Kinematics, t: TreeJoint, kernel: JointKernel, model: Model, chart: Chart | None
) -> tuple[tuple[Block, ...], tuple[Block, ...], tuple[Block, ...], tuple[Block, ...]]:
    """Scalar coordinates, quaternion, speeds, and (of a guided joint) accelerations."""
    b, name = k.builder, t.joint.name
    if t.joint.guide is not None:
        columns = [_guided(k, guide, model) for guide in t.joint.guide]
        for coordinate, column in zip(kernel.q, columns, strict=True):
            which = () if len(columns) == 1 else (str(coordinate).removeprefix("q_"),)
            for block, symbol in zip(column, ("q", "v", "vdot"), strict=True):
                b.name(block, symbol, name, which=which)
        places, rates, accelerations = zip(*columns, strict=True)
        return places, (), rates, accelerations
    if chart is None:
        return (), (), (), ()
    q = b.symbol(f"q:{chart.joint}", chart.scalars + 4 * chart.ball, BindingTime.ITERATION)
    v = b.symbol(f"v:{chart.joint}", len(chart.speed_names), BindingTime.ITERATION)
    position = tuple(b.element(q, i) for i in range(q.shape[0]))
    rate = tuple(b.element(v, i) for i in range(v.shape[0]))
    return position[: chart.scalars], position[chart.scalars :], rate, ()


def _guided(k: Kinematics, guide: Scalar, model: Model) -> tuple[Block, Block, Block]:
    """A guided coordinate with its rate and acceleration, which are zero while the equilibrium is sought."""
    b = k.builder
    motion = b.symbol("motion", 1, BindingTime.STEP)
    place, rate, acceleration = (k.translator.scalar(e) for e in guide_rates(guide, model))
    return place, b.mul(motion, rate), b.mul(motion, acceleration)


def _add_root(
    k: Kinematics, t: TreeJoint, kernel: JointKernel, local: Translator, local_rotation: Block, shift: Block, rate: tuple[Block, ...]
) -> tuple[Frame, _Motion]:
    """A body next to the ground.  The pole moves with a free body, so that its b is the unit matrix and d = [-w x v; 0]."""
    b = k.builder
    inner = k.vector(inner_point(t.joint, t.reversed))
    origin = reference_point(t.joint, t.reversed)
    if t.joint.element.is_free:
        Z = k.for_subspace(t.child, b.column(rate))
        v, w = halves(b, Z)
        frame = Frame(R=local_rotation, r=b.zero(3), origin=origin, Z=Z, pole=b.add(inner, shift), root=t.child)
        return frame, (b.identity(6), b.stack([[b.cross(v, w)], [b.zero(3)]]), None)
    subspace = k.twists_from_global(local.matrix(kernel.subspace)) if kernel.u else None
    Z = b.mul(subspace, b.column(rate)) if subspace is not None else b.zero(6)
    frame = Frame(R=local_rotation, r=k.from_global(shift), origin=origin, Z=Z, pole=inner, root=t.child)
    centre = b.zero(3) if t.joint.element.is_ball else None
    return frame, (subspace, k.twists_from_global(local.matrix(kernel.drift)), centre)


def _add_branch(
    k: Kinematics, t: TreeJoint, kernel: JointKernel, local: Translator, local_rotation: Block, shift: Block, rate: tuple[Block, ...]
) -> tuple[Frame, _Motion]:
    """A body that another carries."""
    b, parent = k.builder, k.frames[t.parent]
    at = b.name(k.point(t.parent, inner_point(t.joint, t.reversed)), "p", t.joint.name)
    origin = reference_point(t.joint, t.reversed)
    R = b.mul(parent.R, local_rotation)
    r = b.add(at, b.mul(parent.R, shift))
    if not kernel.u:
        return Frame(R=R, r=r, origin=origin, Z=parent.Z, pole=parent.pole, root=parent.root), (None, b.zero(6), None)
    subspace = _to_pole(k, parent.R, at, local.matrix(kernel.subspace))
    added = _to_pole(k, parent.R, at, b.mul(local.matrix(kernel.subspace), b.column(rate)))
    b.name(added, "bv", t.joint.name)
    drift = b.add(motion_cross(b, parent.Z, added), _to_pole(k, parent.R, at, local.matrix(kernel.drift)))
    frame = Frame(R=R, r=r, origin=origin, Z=b.add(parent.Z, added), pole=parent.pole, root=parent.root)
    return frame, (subspace, drift, at if t.joint.element.is_ball else None)


def _columns(k: Kinematics, t: TreeJoint, kernel: JointKernel, local: Translator) -> Block:
    """The columns of the elementary motions in global axes at the pole."""
    columns = local.matrix(kernel.columns)
    if t.parent == GROUND:
        return columns
    return _to_pole(k, k.frames[t.parent].R, k.point(t.parent, inner_point(t.joint, t.reversed)), columns)


def _to_pole(k: Kinematics, R: Block, at: Block, motion: Block) -> Block:
    """Motion columns given in a body's axes at ``at``, in global axes at the pole: [R v + p x R w; R w]."""
    b, n = k.builder, motion.shape[1]
    if is_zero(motion):
        return motion
    v, w = b.mul(R, b.take(motion, (0, 3), (0, n))), b.mul(R, b.take(motion, (3, 6), (0, n)))
    return b.stack([[b.add(v, b.mul(b.skew(at), w))], [w]])


def attitude(b: Builder, R: Block, angle: str) -> Block:
    """Yaw, pitch or roll (about z, y, x, in this order) of a rotation R (3, 3); atan2 keeps the pitch accurate near 90 degrees."""
    if angle == "pitch":
        across = b.take(R, (2, 3), (1, 3))
        return b.call("atan2", b.neg(b.element(R, 2, 0)), b.call("sqrt", b.mul(across, b.transpose(across))))
    rows = {"yaw": ((1, 0), (0, 0)), "roll": ((2, 1), (2, 2))}[angle]
    return b.call("atan2", *(b.element(R, i, j) for i, j in rows))


@dataclass(frozen=True, kw_only=True)
class PoseEquations:
    """A point p of a body in the design position is at ``rotations`` (3, 3) p + ``shifts`` (3, 1), from the world's origin.

    Dependent joints of embedded loops have ``followers``: coordinates (n, 1), with the quaternion of a ball, and speeds (k, 1).
    Symbols are ``q:joint``, of speeds ``v:joint`` too, by ``charts``, ``t``, ``parameters`` and ``inputs``, the scene's values by ``laws``
    over LAW_TIME.
    """

    topology: Topology
    charts: tuple[Chart, ...]
    parameters: tuple[Parameter, ...]
    laws: tuple[Block, ...]
    rotations: Mapping[str, Block]
    shifts: Mapping[str, Block]
    followers: Mapping[str, tuple[Block, Block]]


def derive_poses(topology: Topology, scene: Scene) -> PoseEquations:
    """The poses of the bodies of a model in a scene."""
    model, b = topology.model, Builder()
    charts = make_charts(topology)
    k = derive_kinematics(b, make_translator(b, model), topology, {c.joint: c for c in charts})
    origin = (sympy.Integer(0),) * 3
    laws = derive_scene_inputs(b, model, scene, (), events=False)
    return PoseEquations(
        topology=topology, charts=charts, parameters=tunable_parameters(model),
        laws=tuple(law for f in laws.functions for law in f.results.values()),
        rotations={name: k.frames[name].R for name in topology.order},
        shifts={name: k.absolute(name, k.point(name, origin)) for name in topology.order},
        followers={
            m.tree_joint.joint.name: (b.column([*m.position, *m.quaternion]), b.column(m.rate))
            for m in k.motions.values() if m.derivative is not None
        },
    )  # fmt: skip
