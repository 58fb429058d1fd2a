"""Branches that close on themselves are eliminated at once, in joint space.

With S_i the motion subspaces, a_j the acceleration of body j by the known motions, M^c and F^c the sums of M and of Q - M a over a body and
all bodies that it carries, Z_P the carrier's twist, and J = A S the cut joints' Jacobian by the unknowns::

    H_ij = S_i^T M^c_j S_j  (i carries j)       H += J^T a J
    h_j  = S_j^T F^c_j + tau_j                  h -= J^T (lambda + a s'),   s' = s + A (a_f - a_b)
    M_P += M^c - G H^-1 G^T                     Q_P += F^c - G H^-1 h,      G_j = M^c_j S_j
    zdd  = H^-1 (h - G^T Zdd_P)                 lambda <- lambda + a (J zdd + s')

The carrier's own acceleration is in none of the cut joints' equations.  A gear has J = [1, -ratio] and s' = s.  H is composed as by
Walker and Orin (1982).

Branches around a hub share cut joints with it, J zdd + J_K zdd_K + s'.  They are eliminated first, with H = L D L^T, g = L^-1 h,
Y = L^-1 G^T and W = L^-1 J^T a J_K::

    H_K += J_K^T a J_K - W^T D^-1 W             G_K^T -= W^T D^-1 Y
    h_K -= J_K^T (lambda + a s') + W^T D^-1 g
    zdd  = L^-T D^-1 (g - Y Zdd_P - W zdd_K)    lambda <- lambda + a (J zdd + J_K zdd_K + s')
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from cutjoint.formulate.inputs import Numbers
from cutjoint.formulate.recursive.gears import GearClosure
from cutjoint.formulate.recursive.kinematics import JointMotion, Kinematics
from cutjoint.formulate.recursive.loops import ERRORS, Closing, LoopClosure, by_joint, transport
from cutjoint.formulate.recursive.recursion import BodySystem, KnownMotions
from cutjoint.model.records import GROUND
from cutjoint.program.blocks import Block
from cutjoint.topology.records import Branch

_EQUATION = "H = S^T M^c S + J^T a J = L D L^T,  M_P += M^c - G H^-1 G^T,  Q_P += F^c - G H^-1 h"


@dataclass(frozen=True, kw_only=True)
class _Share:
    """A branch's contribution to the equations of its hub: to H_K, h_K and G_K^T, None where the carrier is the ground."""

    mass: Block
    force: Block
    row: Block | None


@dataclass(kw_only=True)
class BranchSystem:
    """The equations of a branch in its joints' unknowns, leaves first; those around a ``hub`` pass on to it too."""

    branch: Branch
    system: BodySystem
    k: Kinematics
    numbers: Numbers
    loops: Sequence[LoopClosure]
    gears: Sequence[GearClosure] = ()
    hub: "BranchSystem | None" = None
    _mass: dict[str, Block] = field(default_factory=dict)
    _force: dict[str, Block] = field(default_factory=dict)
    _rows: dict[str, Block] = field(default_factory=dict)
    _by_hub: dict[str, Block] = field(default_factory=dict)
    _drift: dict[str, Block] = field(default_factory=dict)
    _shares: list[_Share] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._known = KnownMotions(k=self.k, carrier=self.branch.carrier)
        self.branch = replace(self.branch, bodies=tuple(body for body in self.branch.bodies if body not in self.k.rotors))
        self.unknowns = [b for b in reversed(self.branch.bodies) if self.k.motions[b].b is not None]
        self.subspaces = {b: self._subspace(self.k.motions[b]) for b in self.unknowns}

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the unknowns: by joint, without a common instance prefix, and with a coordinate name if a joint has several."""
        motions = [self.k.motions[body] for body in self.unknowns]
        names = [m.tree_joint.joint.name for m in motions]
        instances = {name.rpartition(".")[0] for name in names}
        joints = [name.rpartition(".")[2] for name in names] if len(instances) == 1 else names
        return tuple(
            joint if len(m.speed_names) == 1 else f"{joint}_{name}"
            for joint, m in zip(joints, motions, strict=True) for name in m.speed_names
        )  # fmt: skip

    @property
    def name(self) -> str:
        """The name of its matrices: its first body."""
        return self.branch.bodies[0]

    def _subspace(self, motion: JointMotion) -> Block:
        """S; a ball rotates about its centre in global axes."""
        b = self.k.builder
        if motion.centre is None:
            assert motion.b is not None
            return motion.b
        return b.stack([[b.skew(motion.centre)], [b.identity(3)]])

    def _carriers(self, body: str) -> list[str]:
        """The body and those that carry it, up to the branch's own carrier."""
        return self.k.carriers(body, self.branch.carrier)

    def eliminate(self) -> None:
        """Compose and factorise H, and add the reduced equations to the carrier's."""
        b = self.k.builder
        self._gather()
        for loop in self.loops:
            self._close(loop)
        for gear in self.gears:
            self._couple(gear)
        first = self.k.motions[self.branch.bodies[0]].tree_joint.joint
        with b.section("condensation", first.name, _EQUATION, first.span.place):
            H = b.name(self._matrix(), "H", self.name, rows=self.rows, columns=self.rows)
            h = b.name(self._right_side(), "h", self.name, rows=self.rows)
            self._lower, self._inverse = b.ldl(H)
            b.name(self._lower, "L", self.name, rows=self.rows, columns=self.rows)
            b.name(self._inverse, "Dinv", self.name, rows=self.rows)
            self._g = b.name(b.forward(self._lower, h), "g", self.name, rows=self.rows)
            if self.branch.carrier != GROUND:
                self._pass_on()
            if self.hub is not None:
                self._pass_on_to(self.hub)

    def _gather(self) -> None:
        """M^c, F^c and G, from the leaves on."""
        b = self.k.builder
        for body in reversed(self.branch.bodies):
            motion = self.k.motions[body]
            joint = motion.tree_joint.joint
            with b.section("condensation", joint.name, "M^c = M + sum M^c, F^c = Q - M a + sum F^c, G = M^c S", joint.span.place):
                applied = b.sub(self.system.Q[body], b.mul(self.system.M[body], self._known(body)))
                carried = [c for c in self.branch.bodies if self.k.motions[c].tree_joint.parent == body]
                self._mass[body] = b.name(b.total([self.system.M[body], *(self._mass[c] for c in carried)]), "Mc", body)
                self._force[body] = b.name(b.total([applied, *(self._force[c] for c in carried)]), "Fc", body)
                if body in self.subspaces:
                    self._rows[body] = b.name(b.mul(self._mass[body], self.subspaces[body]), "G", body, columns=motion.speed_names)

    def _close(self, loop: LoopClosure) -> None:
        """J and s' of a cut joint."""
        b, joint = self.k.builder, loop.joint
        step = transport(b, self.k.pole_step(joint.base, joint.follower))
        with b.section("closure", joint.name, "J = A S, s' = s + A (a_f - a_b)", joint.span.place):
            ends = self._carriers(joint.base), self._carriers(joint.follower)
            parts = [by_joint(b, loop, step, ends, body, self.subspaces[body]) for body in self.unknowns]
            self._rows[joint.name] = b.name(b.stack([parts]), "J", joint.name, rows=loop.names, columns=self.rows)
            if self.hub is not None and {joint.base, joint.follower} & set(self.hub.branch.bodies):
                parts = [by_joint(b, loop, step, ends, body, self.hub.subspaces[body]) for body in self.hub.unknowns]
                self._by_hub[joint.name] = b.name(b.stack([parts]), "J_hub", joint.name, rows=loop.names, columns=self.hub.rows)
            apart = b.sub(self._known(joint.follower), b.mul(step, self._known(joint.base)))
            self._drift[joint.name] = b.name(b.add(loop.s, b.mul(loop.A, apart)), "drift", joint.name, rows=loop.names)

    def _couple(self, gear: GearClosure) -> None:
        """J and s' of a gear."""
        b, name = self.k.builder, gear.element.name
        parts = [gear.columns(b, body, self.subspaces[body].shape[1]) for body in self.unknowns]
        self._rows[name] = b.name(b.stack([parts]), "J", name, rows=gear.names, columns=self.rows)
        self._drift[name] = gear.s

    @property
    def _closing(self) -> Iterator[Closing]:
        yield from self.loops
        yield from self.gears

    def _matrix(self) -> Block:
        b = self.k.builder
        grid = [[self._tree_part(i, j) for j in self.unknowns] for i in self.unknowns]
        H = b.mirror(b.stack(grid))
        for loop in self._closing:
            H = b.add(H, b.gram(self._rows[loop.element.name], self._weights(loop)))
        return b.total([H, *(share.mass for share in self._shares)])

    def _tree_part(self, i: str, j: str) -> Block:
        b = self.k.builder
        if i in self._carriers(j):
            part, armature = b.mul(b.transpose(self.subspaces[i]), self._rows[j]), self.k.armature(i)
            return b.add(part, armature) if i == j and armature is not None else part
        if j in self._carriers(i):
            return b.transpose(self._tree_part(j, i))
        return b.zero(self.subspaces[i].shape[1], self.subspaces[j].shape[1])

    def _weights(self, loop: Closing) -> Block:
        return self.k.builder.stack([[self.numbers.penalties[loop.element.name]]] * len(loop.names))

    def _right_side(self) -> Block:
        b = self.k.builder
        parts = []
        for body in self.unknowns:
            force = b.mul(b.transpose(self.subspaces[body]), self._force[body])
            if body in self.system.joint_forces:
                force = b.add(force, self.system.joint_forces[body])
            parts.append(force)
        h = b.stack([[part] for part in parts])
        for loop in self._closing:
            name = loop.element.name
            augmented = b.name(self._augmented(loop), "push", name, rows=loop.names)
            h = b.sub(h, b.mul(b.transpose(self._rows[name]), augmented))
        return b.total([h, *(share.force for share in self._shares)])

    def _augmented(self, loop: Closing) -> Block:
        """Lambda + a s'."""
        b, name = self.k.builder, loop.element.name
        return b.add(loop.multipliers, b.scale(self.numbers.penalties[name], self._drift[name]))

    def _pass_on(self) -> None:
        """M_P += M^c - Y^T D^-1 Y, Q_P += F^c - Y^T e."""
        b, carrier = self.k.builder, self.branch.carrier
        roots = [body for body in self.branch.bodies if self.k.motions[body].tree_joint.parent not in self.branch.bodies]
        passed = b.stack([[b.transpose(self._rows[body])] for body in self.unknowns])
        passed = b.total([passed, *(share.row for share in self._shares if share.row is not None)])
        self._Y = b.name(b.forward(self._lower, passed), "Y", self.name, rows=self.rows)
        self.system.source = self.branch.bodies[0]
        for body in roots:
            self.system.add_mass(carrier, self._mass[body])
            self.system.add_force(carrier, self._force[body])
        self.system.add_mass(carrier, b.neg(b.gram(self._Y, self._inverse)))
        self.system.add_force(carrier, b.neg(b.mul(b.transpose(self._Y), b.weigh(self._inverse, self._g))))

    def _pass_on_to(self, hub: "BranchSystem") -> None:
        """H_K += J_K^T a J_K - W^T D^-1 W, h_K -= J_K^T (lambda + a s') + W^T D^-1 g, G_K^T -= W^T D^-1 Y."""
        b, size = self.k.builder, len(hub.rows)
        coupled, mass, force = b.zero(len(self.rows), size), b.zero(size, size), b.zero(size)
        for loop in self.loops:
            if (J := self._by_hub.get(loop.joint.name)) is not None:
                weights = self._weights(loop)
                coupled = b.add(coupled, b.mul(b.transpose(self._rows[loop.joint.name]), b.weigh(weights, J)))
                mass = b.add(mass, b.gram(J, weights))
                force = b.sub(force, b.mul(b.transpose(J), self._augmented(loop)))
        self._W = b.name(b.forward(self._lower, coupled), "W", self.name, rows=self.rows, columns=hub.rows)
        across = b.transpose(b.weigh(self._inverse, self._W))
        hub.take_over(_Share(
            mass=b.sub(mass, b.gram(self._W, self._inverse)), force=b.sub(force, b.mul(across, self._g)),
            row=b.neg(b.mul(across, self._Y)) if self.branch.carrier != GROUND else None,
        ))  # fmt: skip

    def take_over(self, share: _Share) -> None:
        """Add the contribution of a branch around this hub to the equations."""
        self._shares.append(share)

    def solve(self, Zdd: dict[str, Block]) -> dict[str, Block]:
        """The unknowns of its joints by body."""
        b, right = self.k.builder, self._g
        first = self.k.motions[self.branch.bodies[0]].tree_joint.joint
        with b.section("accelerations", first.name, "zdd = H^-1 (h - G^T Zdd_P)", first.span.place):
            if self.branch.carrier != GROUND:
                right = b.sub(right, b.mul(self._Y, Zdd[self.branch.carrier]))
            if self.hub is not None:
                right = b.sub(right, b.mul(self._W, self.hub.solution))
            self.solution: Block = b.name(b.backward(self._lower, b.weigh(self._inverse, right)), "zdd", self.name, rows=self.rows)
            for rotor in self.k.rotors.values():
                if (body := rotor.carrier) in self.branch.bodies and body not in Zdd:
                    parts = dict(self._parts(self.solution))
                    moved = [b.mul(self.subspaces[each], parts[each]) for each in self._carriers(body) if each in parts]
                    Zdd[body] = b.name(b.total([Zdd[self.branch.carrier], self._known(body), *moved]), "Zdd", body)
            return self._parted(self.solution)

    def _parts(self, unknown: Block) -> Iterator[tuple[str, Block]]:
        start = 0
        for body in self.unknowns:
            end = start + self.subspaces[body].shape[1]
            yield body, self.k.builder.take(unknown, (start, end))
            start = end

    def _parted(self, unknown: Block) -> dict[str, Block]:
        """Each joint's own; those of balls in the axes of the body that carries them."""
        b, found = self.k.builder, {}
        for body, part in self._parts(unknown):
            motion = self.k.motions[body]
            if motion.centre is not None:
                part = b.mul(b.transpose(self.k.frames[motion.tree_joint.parent].R), part)
            found[body] = b.name(part, "vdot", motion.tree_joint.joint.name, rows=motion.speed_names)
        return found

    def errors(self) -> dict[str, Block]:
        """J zdd + s' by cut joint and gear, which is A Zdd + s."""
        return {loop.element.name: self._error(loop) for loop in self._closing}

    def _error(self, loop: Closing) -> Block:
        b, name = self.k.builder, loop.element.name
        with b.section("multipliers", name, ERRORS, loop.element.span.place):
            moved = b.mul(self._rows[name], self.solution)
            if self.hub is not None and name in self._by_hub:
                moved = b.add(moved, b.mul(self._by_hub[name], self.hub.solution))
            return b.add(moved, self._drift[name])


@dataclass(frozen=True, kw_only=True)
class HubSystem:
    """A hub and the branches around it, which it waits for."""

    hub: BranchSystem
    around: Sequence[BranchSystem]

    def eliminate(self) -> None:
        """Eliminate the branches, then the hub."""
        for branch in (*self.around, self.hub):
            branch.eliminate()

    def solve(self, Zdd: dict[str, Block]) -> dict[str, Block]:
        """The unknowns of all joints by body, those of the hub first."""
        return {body: block for branch in (self.hub, *self.around) for body, block in branch.solve(Zdd).items()}
