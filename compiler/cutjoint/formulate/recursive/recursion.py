"""The closed-loop recursion for any topology: joints are eliminated from the leaves to the ground.

In body space the virtual power of all bodies is a block system with the body matrices M_i, the couplings C_ij that cut joints bring,
and the forces Q_i::

    sum_i Z*_i^T ( M_i Zdd_i + sum_j C_ij Zdd_j - Q_i ) = 0

Eliminating the unknowns of body i with parent p, Zdd_i = Zdd_p + b zdd_i + d, is one step of a block LDL^T factorisation::

    D = b^T M_i b          y_p = b^T (M_i + C_ip)          y_j = b^T C_ij          e = D^-1 (b^T (Q_i - M_i d) + tau)
    M_p  += M_i + C_ip + C_pi - y_p^T D^-1 y_p             Q_p += Q_i - M_i d - C_pi d - y_p^T e
    C_pj += C_ij - y_p^T D^-1 y_j                          Q_j -= C_ji d + y_j^T e
    C_jk -= y_j^T D^-1 y_k
    zdd_i = e - D^-1 ( y_p Zdd_p + sum_j y_j Zdd_j )       from the ground outwards

(Cuadrado et al. 2000, eqs. 28-42, generalised to couplings between any bodies).  A spherical joint is eliminated about its centre in
global axes, where it passes on a force only.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics, halves
from cutjoint.model.records import GROUND
from cutjoint.program.blocks import Block, Builder


@dataclass(frozen=True, kw_only=True)
class Pivot:
    """The terms of an eliminated joint that the back substitution needs: zdd = L^-T D^-1 (g - sum_j Y_j Zdd_j).
    A spherical joint has its centre's rows of the body's own matrix in ``centre``, and the same formula with ``- centre a_P`` gives the
    absolute angular acceleration."""

    lower: Block
    inverse: Block
    g: Block
    rows: dict[str, Block]
    centre: Block | None = None


@dataclass(kw_only=True)
class BodySystem:
    """The block system in body space while joints are eliminated; all 6x6 and 6x1 blocks at the bodies' poles.

    ``joint_forces`` act on the coordinates of tree joints, by the bodies that these carry; ``cut_joint_wrenches`` are the wrenches on the
    followers of cut joints by forces on their coordinates. ``friction_laws`` are the forces per N of load, by element, which are added when
    the loads are known. ``source`` names the element whose shares are being added. Rotors have the mass of their spin alone, and their
    carriers the rest; ``own`` has M and Q of each of these as it is, the latter beside that in the system.
    """

    builder: Builder
    M: dict[str, Block] = field(default_factory=dict)
    Q: dict[str, Block] = field(default_factory=dict)
    C: dict[tuple[str, str], Block] = field(default_factory=dict)
    joint_forces: dict[str, Block] = field(default_factory=dict)
    cut_joint_wrenches: dict[str, Block] = field(default_factory=dict)
    friction_laws: dict[str, Block] = field(default_factory=dict)
    own: dict[str, tuple[Block, Block]] = field(default_factory=dict)
    source: str = ""
    _shares: Counter[tuple[str, ...]] = field(default_factory=Counter)

    def couple(self, i: str, j: str, block: Block) -> None:
        """C_ij += block, C_ji += block^T; a coupling of a body with itself closes into its M, one with the ground is nothing."""
        b = self.builder
        if GROUND in (i, j):
            return
        self._name_share("dC", block, i, j)
        if i == j:
            self.add_mass(i, b.symmetrise(block))
            return
        key, part = ((i, j), block) if (j, i) not in self.C else ((j, i), b.transpose(block))
        self.C[key] = b.add(self.C[key], part) if key in self.C else part

    def coupling(self, i: str, j: str) -> Block:
        """C_ij."""
        if (i, j) in self.C:
            return self.C[i, j]
        return self.builder.transpose(self.C[j, i]) if (j, i) in self.C else self.builder.zero(6, 6)

    def coupled(self, i: str) -> list[str]:
        """The bodies that body i is coupled to, in the order in which they were."""
        return [b if a == i else a for a, b in self.C if i in (a, b)]

    def uneliminated(self) -> tuple[dict[str, Block], dict[str, Block]]:
        """M and Q of all bodies, those of rotors and their carriers their own."""
        masses = {body: self.own[body][0] if body in self.own else M for body, M in self.M.items()}
        return masses, {body: self.builder.add(Q, self.own[body][1]) if body in self.own else Q for body, Q in self.Q.items()}

    def release(self, i: str) -> None:
        """Forget body i's couplings."""
        self.C = {key: block for key, block in self.C.items() if i not in key}

    def add_mass(self, i: str, block: Block) -> None:
        """M_i += block."""
        if i != GROUND:
            self._name_share("dM", block, i)
            self.M[i] = self.builder.add(self.M[i], block)

    def add_force(self, i: str, block: Block) -> None:
        """Q_i += block."""
        if i != GROUND:
            self._name_share("dQ", block, i)
            self.Q[i] = self.builder.add(self.Q[i], block)

    def _name_share(self, symbol: str, block: Block, *targets: str) -> None:
        """Name what an element adds to M, Q or C of a body, such as dM1_arm_chassis for the arm's first share of the chassis."""
        key = (symbol, self.source, *targets)
        self._shares[key] += 1
        self.builder.name(block, f"{symbol}{self._shares[key]}", self.source, *targets)


def add_to(b: Builder, sums: dict[str, Block], name: str, block: Block) -> None:
    """sums[name] += block."""
    sums[name] = b.add(sums[name], block) if name in sums else block


@dataclass(kw_only=True)
class KnownMotions:
    """The accelerations a of bodies relative to a carrier by the known motions: sums of d."""

    k: Kinematics
    carrier: str
    _found: dict[str, Block] = field(default_factory=dict)

    def __call__(self, body: str) -> Block:
        """a of a body, (6, 1)."""
        b = self.k.builder
        if body in (GROUND, self.carrier):
            return b.zero(6)
        if body not in self._found:
            motion = self.k.motions[body]
            self._found[body] = b.name(b.add(self(motion.tree_joint.parent), motion.d), "a", body)
        return self._found[body]


class Branched(Protocol):
    """Joints that are eliminated together."""

    def eliminate(self) -> None:
        """Add the reduced equations of the eliminated joints to the carrier's."""
        ...

    def solve(self, Zdd: dict[str, Block]) -> dict[str, Block]:
        """The unknowns by body, from the carrier's acceleration; of bodies that carry others their own join ``Zdd``."""
        ...


def condense(system: BodySystem, kinematics: Kinematics, branches: Mapping[str, Branched]) -> dict[str, Pivot]:
    """Eliminate all joints, leaves first; the pivots are in the order of elimination.  ``branches`` by their bodies go at once."""
    pivots: dict[str, Pivot] = {}
    b, last = system.builder, _first_bodies(kinematics, branches)
    for body, motion in reversed(kinematics.motions.items()):
        if body in branches:
            if body in last:
                branches[body].eliminate()
            continue
        joint = motion.tree_joint.joint
        system.source = body
        equation = "D = b^T M b, M_p += M + C + C^T - y_p^T D^-1 y_p, Q_p += Q - M d - y_p^T e  (eqs. 28-42)"
        with b.section("condensation", joint.name, equation, joint.span.place):
            b.name(system.M[body], "M", body)
            b.name(system.Q[body], "Q", body)
            if motion.b is None:
                _carry(system, body, motion)
            elif motion.centre is not None:
                pivots[body] = _eliminate_ball(system, body, motion, motion.centre)
            elif body in kinematics.rotors:
                pivots[body] = _eliminate_rotor(kinematics, system, body, motion.b)
            else:
                pivots[body] = _eliminate(kinematics, system, body, motion, motion.b)
            _name_pivot(b, pivots.get(body), body, motion)
        system.release(body)
    return pivots


def _first_bodies(kinematics: Kinematics, branches: Mapping[str, Branched]) -> set[str]:
    """The first body of each branch in the order of the tree: all that its bodies carry stands behind it."""
    first: dict[int, str] = {}
    for body in kinematics.motions:
        if body in branches:
            first.setdefault(id(branches[body]), body)
    return set(first.values())


def _name_pivot(builder: Builder, pivot: Pivot | None, body: str, motion: JointMotion) -> None:
    if pivot is not None:
        rows = motion.speed_names
        builder.name(pivot.lower, "L", body, rows=rows, columns=rows)
        builder.name(pivot.inverse, "Dinv", body, rows=rows)
        builder.name(pivot.g, "g", body, rows=rows)
        for other, row in pivot.rows.items():
            builder.name(row, "Y", body, other, rows=rows)


def _carry(system: BodySystem, body: str, motion: JointMotion) -> None:
    """A body whose motion relative to its parent is known: everything passes on."""
    b, parent, d = system.builder, motion.tree_joint.parent, motion.d
    system.add_force(parent, b.sub(system.Q[body], b.mul(system.M[body], d)))
    for other in system.coupled(body):
        system.add_force(other, b.neg(b.mul(system.coupling(other, body), d)))
    system.add_mass(parent, system.M[body])
    for other in system.coupled(body):
        system.couple(parent, other, system.coupling(body, other))


def _eliminate(k: Kinematics, system: BodySystem, body: str, motion: JointMotion, subspace: Block) -> Pivot:
    b, parent, d = system.builder, motion.tree_joint.parent, motion.d
    M, others = system.M[body], system.coupled(body)
    bT = b.transpose(subspace)
    force = b.sub(system.Q[body], b.mul(M, d))
    D = b.sandwich(bT, M)
    if (armature := k.armature(body)) is not None:
        D = b.add(D, armature)
    lower, inverse = b.ldl(D)
    generalised = b.mul(bT, force)
    if body in system.joint_forces:
        generalised = b.add(generalised, k.for_subspace(body, system.joint_forces[body]))
    g = b.forward(lower, generalised)
    rows = {j: b.mul(bT, system.coupling(body, j)) for j in others}
    if parent != GROUND:
        coupling = b.mul(bT, M)
        rows[parent] = b.add(coupling, rows[parent]) if parent in rows else coupling
    Y = {j: b.forward(lower, row) for j, row in rows.items()}
    _update_forces(system, body, motion, force, Y, b.weigh(inverse, g))
    system.add_mass(parent, M)
    for j in others:
        system.couple(parent, j, system.coupling(body, j))
    _update_masses(system, Y, inverse)
    return Pivot(lower=lower, inverse=inverse, g=g, rows=Y)


def _eliminate_rotor(k: Kinematics, system: BodySystem, body: str, subspace: Block) -> Pivot:
    """A wheel whose mass moves with its carrier, but for I zdd = tau - I a . w_P' about its axis a: D = I, y_p = [0 I a^T]."""
    b, rotor = system.builder, k.rotors[body]
    force, inverse = system.Q[body], b.call("div", b.number(1.0), rotor.inertia)
    torque = b.mul(b.transpose(subspace), force)
    if body in system.joint_forces:
        torque = b.add(torque, system.joint_forces[body])
    system.add_force(rotor.carrier, b.sub(force, b.stack([[b.zero(3)], [b.scale(torque, rotor.axis)]])))
    row = b.transpose(b.stack([[b.zero(3)], [b.scale(rotor.inertia, rotor.axis)]]))
    return Pivot(lower=b.identity(1), inverse=inverse, g=torque, rows={rotor.carrier: row})


def _update_forces(system: BodySystem, body: str, motion: JointMotion, force: Block, Y: dict[str, Block], e: Block) -> None:
    """Q_p += Q - M d - C_pi d - y_p^T e, Q_j -= C_ji d + y_j^T e."""
    b, parent = system.builder, motion.tree_joint.parent
    system.add_force(parent, force)
    for j in system.coupled(body):
        system.add_force(j, b.neg(b.mul(system.coupling(j, body), motion.d)))
    for j, row in Y.items():
        system.add_force(j, b.neg(b.mul(b.transpose(row), e)))


def _update_masses(system: BodySystem, Y: dict[str, Block], inverse: Block) -> None:
    """M_j -= y_j^T D^-1 y_j, C_jk -= y_j^T D^-1 y_k."""
    b, bodies = system.builder, list(Y)
    for n, j in enumerate(bodies):
        system.add_mass(j, b.neg(b.gram(Y[j], inverse)))
        for k in bodies[n + 1 :]:
            system.couple(j, k, b.neg(b.mul(b.transpose(Y[j]), b.weigh(inverse, Y[k]))))


def _eliminate_ball(system: BodySystem, body: str, motion: JointMotion, centre: Block) -> Pivot:
    """A spherical joint about its centre P, unknown the relative angular acceleration in global axes.
    At P the subspace is [0; 1], so that D is the inertia about P, and the body passes on a force through P."""
    b, parent, d = system.builder, motion.tree_joint.parent, motion.d
    M, others, arm = system.M[body], system.coupled(body), b.skew(centre)
    A, B, J = (b.take(M, rows, columns) for rows, columns in (((0, 3), (0, 3)), ((0, 3), (3, 6)), ((3, 6), (3, 6))))
    B_at = b.add(B, b.mul(A, arm))
    J_at = b.mirror(b.add(J, b.sub(b.mul(b.transpose(B), arm), b.mul(arm, B_at))))
    lower, inverse = b.ldl(J_at)
    U = b.forward(lower, b.transpose(B_at))
    force = b.sub(system.Q[body], b.mul(M, d))
    linear, moment = halves(b, force)
    g = b.forward(lower, b.sub(moment, b.cross(centre, linear)))
    Y = {j: b.forward(lower, _moment_rows(b, system.coupling(body, j), arm)) for j in others}
    e = b.weigh(inverse, g)
    passed = b.sub(linear, b.mul(b.transpose(U), e))
    _update_forces(system, body, motion, b.stack([[passed], [b.cross(centre, passed)]]), Y, e)
    system.add_mass(parent, _mass_at(b, b.sub(A, b.gram(U, inverse)), arm))
    for j in others:
        rows = b.sub(b.take(system.coupling(body, j), (0, 3), (0, 6)), b.mul(b.transpose(U), b.weigh(inverse, Y[j])))
        system.couple(parent, j, b.stack([[rows], [b.mul(arm, rows)]]))
    _update_masses(system, Y, inverse)
    return Pivot(lower=lower, inverse=inverse, g=g, rows=Y, centre=U)


def _moment_rows(builder: Builder, coupling: Block, arm: Block) -> Block:
    """The rows of a coupling that take moments about the joint's centre."""
    force, moment = builder.take(coupling, (0, 3), (0, 6)), builder.take(coupling, (3, 6), (0, 6))
    return builder.sub(moment, builder.mul(arm, force))


def _mass_at(builder: Builder, a: Block, arm: Block) -> Block:
    """The 6x6 of a 3x3 mass at the point of ``arm`` = p~: [a, -a p~; p~ a, -p~ a p~]."""
    b = builder
    corner = b.neg(b.mul(a, arm))
    return b.mirror(b.stack([[a, corner], [b.transpose(corner), b.sandwich(arm, a)]]))


def expand(
    kinematics: Kinematics, pivots: dict[str, Pivot], builder: Builder, branches: Mapping[str, Branched]
) -> tuple[dict[str, Block], dict[str, Block]]:
    """The back substitution, from the ground outwards: Zdd of every body outside branches, and zdd of every joint with unknowns."""
    b = builder
    Zdd: dict[str, Block] = {GROUND: b.zero(6)}
    zdd: dict[str, Block] = {}
    first = _first_bodies(kinematics, branches)
    for body, motion in kinematics.motions.items():
        if body in branches:
            if body in first:
                zdd |= branches[body].solve(Zdd)
            continue
        joint = motion.tree_joint.joint
        equation = "zdd = D^-1 ( g - y_p Zdd_p - sum_j y_j Zdd_j ),  Zdd = Zdd_p + b zdd + d  (eqs. 27, 33)"
        with b.section("accelerations", joint.name, equation, joint.span.place):
            above = b.add(Zdd[motion.tree_joint.parent], motion.d)
            if body in pivots:
                above, zdd[body] = _solve(kinematics, motion, pivots[body], Zdd)
                b.name(zdd[body], "vdot", joint.name, rows=motion.speed_names)
            Zdd[body] = b.name(above, "Zdd", body)
    return Zdd, zdd


def _solve(k: Kinematics, motion: JointMotion, pivot: Pivot, Zdd: dict[str, Block]) -> tuple[Block, Block]:
    """Zdd of the body, and the accelerations of the joint's own speeds."""
    b, parent = k.builder, motion.tree_joint.parent
    inner = Zdd[parent]
    right = pivot.g
    for j, row in pivot.rows.items():
        right = b.sub(right, b.mul(row, Zdd[j]))
    if pivot.centre is None or motion.centre is None:
        assert motion.b is not None
        unknown = b.backward(pivot.lower, b.weigh(pivot.inverse, right))
        return b.add(b.add(inner, motion.d), b.mul(motion.b, unknown)), k.of_subspace(motion.tree_joint.child, unknown)
    v, w = halves(b, inner)
    right = b.sub(right, b.mul(pivot.centre, b.add(v, b.cross(w, motion.centre))))
    total = b.backward(pivot.lower, b.weigh(pivot.inverse, right))
    relative = b.sub(total, w)
    step = b.stack([[b.add(v, b.cross(motion.centre, relative))], [total]])
    return b.add(step, motion.d), b.mul(b.transpose(k.frames[parent].R), relative)
