"""Elimination of embedded loops: all bodies of a loop move with one coordinate q.

With the carrier's acceleration Zdd_P, a_i that of body i relative to it by the known motions, and B_i the motion of body i by q'::

    Zdd_i = Zdd_P + a_i + B_i qdd
    H = sum of B_i^T M_i B_i        G = sum of M_i B_i        F_i = Q_i - M_i a_i        h = sum of B_i^T F_i + derivative . tau
    M_P += sum of M_i - G H^-1 G^T      Q_P += sum of F_i - G H^-1 h
    qdd = H^-1 (h - G^T Zdd_P)

The cut joints of embedded loops have no equations here.  Their multipliers follow from the force balance in the motion subspaces S_j of the
tree joints, with the wrenches W_j that these would transmit without them and J = A S::

    J^T lambda = tau_j - S_j^T W_j
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

from cutjoint.formulate.recursive.embedding.dependent import fitted, independent_motion
from cutjoint.formulate.recursive.kinematics import Kinematics, drive_of
from cutjoint.formulate.recursive.loops import LoopClosure, by_joint, transport
from cutjoint.formulate.recursive.recursion import BodySystem, KnownMotions
from cutjoint.model.records import GROUND, EmbeddedLoop
from cutjoint.program.blocks import Block, is_zero

_EQUATION = "H = sum B^T M B,  M_P += sum M - G H^-1 G^T,  Q_P += sum F - G H^-1 h"
LEAST_HALF_RANGE = 1e-9  #: a guide that moves by less, m or rad, counts as fixed
#: The share of the mean square of the rows by which equations that follow from others get a pivot; corrections take it away from the
#: others.
_SHARE, _CORRECTIONS = 1e-9, 2


@dataclass(kw_only=True)
class EmbeddedLoopSystem:
    """The equation of motion of an embedded loop in its independent coordinate."""

    embedded_loop: EmbeddedLoop
    system: BodySystem
    k: Kinematics
    _columns: dict[str, Block] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.known = KnownMotions(k=self.k, carrier=self.embedded_loop.carrier)

    @property
    def independent(self) -> str:
        """The outer body of the independent joint."""
        return next(body for body, m in self.k.motions.items() if m.tree_joint.joint.name == self.embedded_loop.independent)

    def column(self, body: str) -> Block:
        """B of a body, (6, 1)."""
        if body in (GROUND, self.embedded_loop.carrier):
            return self.k.builder.zero(6)
        if body not in self._columns:
            motion = self.k.motions[body]
            own = motion.b if motion.b is not None else motion.follows
            inner = self.column(motion.tree_joint.parent)
            whole = inner if own is None else self.k.builder.add(inner, own)
            self._columns[body] = self.k.builder.name(whole, "B", body)
        return self._columns[body]

    def eliminate(self) -> None:
        """Add the reduced equations of the bodies to the carrier's."""
        b, system, carrier = self.k.builder, self.system, self.embedded_loop.carrier
        system.source = self.independent
        with b.section("condensation", self.embedded_loop.independent, _EQUATION, self.embedded_loop.span.place):
            zero = b.zero(1)
            heavy = [body for body in self.embedded_loop.bodies if not (is_zero(system.M[body]) and is_zero(system.Q[body]))]
            forces, moments = {}, {}
            for body in heavy:
                forces[body] = b.name(b.sub(system.Q[body], b.mul(system.M[body], self.known(body))), "F", body)
                moments[body] = b.name(b.mul(system.M[body], self.column(body)), "G", body)
            H = b.total([zero, *(b.dot(self.column(body), moments[body]) for body in heavy)])
            h = b.total([zero, *(b.dot(self.column(body), forces[body]) for body in heavy), *self._joint_forces()])
            self._inverse = b.name(b.call("div", b.number(1.0), b.name(H, "H", self.independent)), "Dinv", self.independent)
            self._h = b.name(h, "h", self.independent)
            if carrier != GROUND:
                self._G = b.name(b.total([b.zero(6), *moments.values()]), "G", "assembly", self.independent)
                for body in heavy:
                    system.add_mass(carrier, system.M[body])
                    system.add_force(carrier, forces[body])
                system.add_mass(carrier, b.neg(b.gram(b.transpose(self._G), self._inverse)))
                system.add_force(carrier, b.neg(b.scale(b.mul(self._inverse, self._h), self._G)))
        for body in self.embedded_loop.bodies:
            system.release(body)

    def _joint_forces(self) -> list[Block]:
        b, found = self.k.builder, []
        for body in self.embedded_loop.bodies:
            if body in self.system.joint_forces:
                derivative, force = self.k.motions[body].derivative, self.system.joint_forces[body]
                found.append(force if derivative is None else b.dot(derivative, force))
        return found

    def solve(self, Zdd: dict[str, Block]) -> dict[str, Block]:
        """The acceleration of the independent coordinate, by the outer body of its joint; those of the bodies are added to ``Zdd``."""
        b, carrier, independent = self.k.builder, self.embedded_loop.carrier, self.embedded_loop.independent
        equation = "qdd = H^-1 (h - G^T Zdd_P),  Zdd = Zdd_P + a + B qdd"
        with b.section("accelerations", independent, equation, self.embedded_loop.span.place):
            right = self._h if carrier == GROUND else b.sub(self._h, b.dot(self._G, Zdd[carrier]))
            unknown = b.name(b.mul(self._inverse, right), "vdot", independent)
            for body in self.embedded_loop.bodies:
                moved = b.add(self.known(body), b.scale(unknown, self.column(body)))
                Zdd[body] = b.name(b.add(Zdd[carrier], moved), "Zdd", body)
        return {self.independent: unknown}


def range_margins(k: Kinematics) -> dict[str, Block]:
    """A margin of each embedded loop: negative outside the ranges of its functions, 1 in their middle."""
    b, margins = k.builder, {}
    for embedded_loop in k.topology.model.embedded_loops:
        sides, functions = [], embedded_loop.functions
        if not functions.is_periodic:
            sides.append((independent_motion(b, embedded_loop)[0], functions.range))
        if functions.drive_range is not None:
            sides.append((drive_of(k, embedded_loop)[0], functions.drive_range))
        equation = "functions of its loops hold while the margin is not negative"
        with b.section("guard", embedded_loop.independent, equation, embedded_loop.span.place):
            found = []
            for place, side in sides:
                x = b.mul(b.number(1 / max(side.half, LEAST_HALF_RANGE)), b.sub(place, b.number(side.middle)))
                found.append(b.sub(b.number(1.0), b.mul(x, x)))
            if functions.open:
                column = fitted(b, embedded_loop)
                found.append(b.element(column, column.shape[0] - 1))
            if found:
                smallest = reduce(lambda one, other: b.call("where", b.call("lt", one, other), one, other), found)
                margins[embedded_loop.independent] = b.name(smallest, "margin", embedded_loop.independent)
    return margins


def embedded_reactions(
    k: Kinematics, held: Sequence[LoopClosure], carried: Mapping[str, Block], joint_forces: Mapping[str, Block]
) -> tuple[LoopClosure, ...]:  # fmt: skip
    """The closures of embedded loops with their multipliers; ``carried`` are the wrenches of the tree's joints without these."""
    found: dict[str, LoopClosure] = {}
    for embedded_loop in k.topology.model.embedded_loops:
        loops = [loop for loop in held if loop.joint.name in embedded_loop.cuts]
        first = 0
        multipliers = _multipliers(k, embedded_loop, loops, carried, joint_forces)
        for loop in loops:
            found[loop.joint.name] = replace(loop, multipliers=k.builder.take(multipliers, (first, first + len(loop.names))))
            first += len(loop.names)
    return tuple(found[loop.joint.name] for loop in held)


def _multipliers(
    k: Kinematics, embedded_loop: EmbeddedLoop, loops: Sequence[LoopClosure], carried: Mapping[str, Block],
    joint_forces: Mapping[str, Block],
) -> Block:  # fmt: skip
    """The shortest lambda with J^T lambda = tau - S^T W."""
    b = k.builder
    with b.section("multipliers", embedded_loop.independent, "J^T lambda = tau - S^T W", embedded_loop.span.place):
        rows, left, ends, steps = [], [], {}, {}
        for loop in loops:
            base, follower = loop.joint.base, loop.joint.follower
            ends[loop.joint.name] = k.carriers(base), k.carriers(follower)
            steps[loop.joint.name] = transport(b, k.pole_step(base, follower))
        for body in embedded_loop.bodies:
            motion = k.motions[body]
            S = motion.b if motion.b is not None else motion.own
            if S is None:
                continue
            columns = (by_joint(b, loop, steps[loop.joint.name], ends[loop.joint.name], body, S) for loop in loops)
            rows.append([b.transpose(column) for column in columns])
            carried_force = b.mul(b.transpose(S), carried[body])
            left.append([b.sub(joint_forces[body], carried_force) if body in joint_forces else b.neg(carried_force)])
        transposed, right = b.stack(rows), b.stack(left)
        size = transposed.shape[1]
        ones = b.const([[1.0]] * transposed.shape[0])
        gram = b.gram(transposed, ones)
        trace = b.total([b.element(gram, i, i) for i in range(size)])
        lower, inverse = b.ldl(b.add(gram, b.scale(b.mul(b.number(_SHARE / size), trace), b.identity(size))))
        projected = b.mul(b.transpose(transposed), right)
        for block, symbol in ((transposed, "J"), (lower, "L"), (inverse, "Dinv"), (projected, "right")):
            b.name(block, symbol, embedded_loop.independent)

        def solved(values: Block) -> Block:
            return b.backward(lower, b.weigh(inverse, b.forward(lower, values)))

        found = solved(projected)
        for _ in range(_CORRECTIONS):
            found = b.add(found, solved(b.sub(projected, b.mul(gram, found))))
        return b.name(found, "multipliers", embedded_loop.independent)

