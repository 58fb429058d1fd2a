"""Load-dependent friction in joints: loads of a given motion, and loads solved for together with the accelerations.

A load is a preload and the lengths of vectors, which are linear in accelerations and multipliers, and so in all loads::

    N_j = p_j + sum of |r_j|        r_j = r_j0 + sum over k of B_jk N_k

r_j0 is that of the motion without friction, B_jk that of unit load k alone.  With C_jk = sum of |B_jk|, I - C has positive pivots where the
largest eigenvalue of C is below 1.  Then there is one solution, as the right side contracts, and Newton's iteration finds it.  Elsewhere
there may be none or several (Painleve, Comptes Rendus 121 (1895) 112-115): the loads have no value then.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy

from cutjoint.elements.joint import Translation
from cutjoint.formulate.events import FRICTION
from cutjoint.formulate.inputs import Numbers
from cutjoint.formulate.recursive.forces import WrenchMechanics
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.formulate.recursive.loops import LoopClosure
from cutjoint.formulate.recursive.outputs import Reactions, accelerations_of
from cutjoint.formulate.recursive.quantities import Forces
from cutjoint.formulate.recursive.recursion import BodySystem
from cutjoint.formulate.recursive.solution import ClosingElements, Solution, refine, respond, without_speed
from cutjoint.kernels.joints import direction_of, rotation_axis
from cutjoint.model.records import Joint, JointFriction, Model
from cutjoint.program.blocks import Block, Builder, is_zero
from cutjoint.program.indicators import EventIndicator
from cutjoint.topology.records import Topology

#: Newton's iterations for the loads.
_ITERATIONS = 7
#: The square of the force (N) by which the length of a vector is rounded where it is zero.
_ROUNDING = 1e-24
#: The share of a load within which Newton's iteration must find it.
_FOUND = 1e-8
#: The load (N) below which that share is one of it.
_NEAR = 1e-3
#: Powers of I + C by which the largest eigenvalue of C is estimated.
_POWERS = 24
#: The share of its limit within which friction says nothing about the load that it would have at the limit.
_AT_REST = 1e-6


@dataclass(frozen=True, kw_only=True)
class LoadFriction:
    """A force by the load of a joint: its ``law`` by N of load."""

    force: JointFriction
    joint: Joint
    law: Block

    def apply(self, system: BodySystem, k: Kinematics, load: Block) -> Block:
        """Add the friction force of a load to a system, and return it."""
        b, system.source = k.builder, self.force.name
        force = b.mul(load, self.law)
        WrenchMechanics(b=b, translator=k.translator, system=system, k=k, force=self.force).apply_joint_force(force)
        return force

    def vectors(self, k: Kinematics, reactions: Reactions) -> list[Block]:
        """The vectors, each (3, 1), whose lengths make the load; components along the joint's own motions are excluded."""
        b, force, joint = k.builder, self.force, self.joint
        reaction, moment = reactions.on_follower[joint.name]
        slides, turns = _directions(k, joint)
        axis = {**slides, **turns}[force.coordinate]
        found = [_across(b, reaction, [*slides.values(), axis])]
        if force.thrust_radius is not None and force.bearing_radius is not None:
            share = k.translator.scalar(force.thrust_radius / force.bearing_radius)
            found.append(b.scale(b.mul(share, b.dot(axis, reaction)), axis))
        if force.arm is not None:
            found.append(b.scale(k.translator.scalar(1 / force.arm), _across(b, moment, list(turns.values()))))
        return found


def _directions(k: Kinematics, joint: Joint) -> tuple[dict[str, Block], dict[str, Block]]:
    """The unit directions of a joint's displacements and rotations, by coordinate."""
    tree = next((m for m in k.motions.values() if m.tree_joint.joint.name == joint.name), None)
    between = dict(zip((sympy.Symbol(f"q_{c}", real=True) for c in joint.element.coordinates), tree.position, strict=False)) if tree else {}
    slides, turns = {}, {}
    for motion in joint.element.scalar_motions:
        if isinstance(motion, Translation):
            slides[motion.coordinate] = k.direction(joint.base, direction_of(joint, motion.direction))
        else:
            body, axis = rotation_axis(joint, tree is not None and tree.tree_joint.reversed, motion.coordinate)
            at = k.translator.with_values(between)
            turns[motion.coordinate] = k.builder.mul(k.frames[body].R, k.builder.column([at.scalar(x) for x in axis]))
    return slides, turns


def _across(b: Builder, vector: Block, directions: Sequence[Block]) -> Block:
    """The part of a vector across perpendicular unit directions."""
    for e in dict.fromkeys(directions):
        vector = b.sub(vector, b.scale(b.dot(e, vector), e))
    return vector


def load_frictions(model: Model, system: BodySystem) -> tuple[LoadFriction, ...]:
    """The friction forces of a system whose loads are not known yet."""
    joints = {joint.name: joint for joint in model.joints}
    return tuple(
        LoadFriction(force=f, joint=joints[f.joint], law=system.friction_laws[f.name])
        for f in model.forces if isinstance(f, JointFriction) and f.name in system.friction_laws
    )  # fmt: skip


def _length(b: Builder, vector: Block) -> Block:
    return b.call("sqrt", b.add(b.dot(vector, vector), b.number(_ROUNDING)))


def add_friction(frictions: Sequence[LoadFriction], system: BodySystem, k: Kinematics, forces: Forces, reactions: Reactions) -> Reactions:
    """Add friction to the forces of a motion whose accelerations and multipliers are given; returns the reactions with it.

    Friction in cut joints first: it follows from the multipliers, and loads the joints of the tree.
    """
    cut = {loop.joint.name for loop in reactions.loops}
    b = k.builder
    for of_tree in (False, True):
        for each in (each for each in frictions if (each.joint.name not in cut) is of_tree):
            with b.section("friction", each.force.name, "N = p + sum of |r|", each.force.span.place):
                lengths = [_length(b, vector) for vector in each.vectors(k, reactions)]
                load = b.total([k.translator.scalar(each.force.preload), *lengths])
                forces.add(b, each.force.name, {"force": each.apply(system, k, load), "load": load})
        reactions = replace(reactions, Q=dict(system.Q), acting=dict(system.cut_joint_wrenches))
    return reactions


@dataclass(frozen=True, kw_only=True)
class FrictionMotion:
    """Bodies and cut joints whose accelerations follow from all forces, friction included."""

    topology: Topology
    masses: Mapping[str, Block]
    k: Kinematics
    closing: ClosingElements
    numbers: Numbers
    times: int

    def solve(self, frictions: Sequence[LoadFriction], free: Solution, system: BodySystem) -> Solution:
        """The solution with friction, from that without; ``system`` has the forces without it."""
        b = self.k.builder
        equations, solutions = self._equations(frictions, free, system)
        vdot, errors = dict(free.vdot), dict(free.errors)
        places = {name: span.place for name, span in self.topology.model.constraint_spans.items()}
        for load, unit in zip(equations.solve(), solutions, strict=True):
            for sums, shares in ((vdot, unit.vdot), (errors, unit.errors)):
                for name, share in shares.items():
                    with b.section("friction", name, "zdd <- zdd + N dzdd", places[name]):
                        sums[name] = b.add(sums[name], b.scale(load, share))
        return Solution(vdot=vdot, errors=errors)

    def load_indicators(self, frictions: Sequence[LoadFriction], free: Solution, system: BodySystem) -> list[EventIndicator]:
        """Indicators of the vectors r of loads, whose lengths are not smooth where r is zero: their components x as x^3/|r|^2.

        So one that is zero but for rounding has no sign, as of a plane mechanism the one across its plane.
        """
        b, found = self.k.builder, []
        equations, _ = self._equations(frictions, free, system)
        loads = equations.solve()
        for j, each in enumerate(frictions):
            with b.section("friction", each.force.name, "x^3/|r|^2 of r = (x, y, z)", each.force.span.place):
                for r in (equations.vector(j, n, loads) for n in range(len(equations.at_zero[j]))):
                    square = b.add(b.dot(r, r), b.number(_ROUNDING))
                    for x in (b.element(r, i) for i in range(3)):
                        if not is_zero(x):
                            value = b.mul(x, b.call("div", b.mul(x, x), square))
                            found.append(EventIndicator(value=value, section=value.section, is_continuous=True))
        return found

    def _equations(self, frictions: Sequence[LoadFriction], free: Solution, system: BodySystem) -> "tuple[_Loads, list[Solution]]":
        """The equations of the loads, and the response to each of these."""
        b, k = self.k.builder, self.k
        without = self._reactions(k, free, system)
        at_zero = [each.vectors(k, without) for each in frictions]
        solutions, by_unit = [], []
        for number, each in enumerate(frictions, start=1):
            with b.marked(f"u{number}", f"friction '{each.force.name}' by N of load"):
                unit, applied = self._unit(each)
                solutions.append(unit)
                alone = self._reactions(without_speed(k), unit, applied)
                by_unit.append([other.vectors(k, alone) for other in frictions])
        return _Loads(k=k, frictions=frictions, at_zero=at_zero, by_unit=by_unit), solutions

    def _unit(self, each: LoadFriction) -> tuple[Solution, BodySystem]:
        """The response to friction by a load of 1 N alone, and the forces that make it."""
        b, k = self.k.builder, self.k
        no_violations = {x.element.name: b.zero(len(x.names)) for x in self.closing.all()}
        applied = BodySystem(builder=b, Q={body: b.zero(6) for body in self.masses})
        with b.section("friction", each.force.name, "Q by N of load", each.force.span.place):
            each.apply(applied, k, b.number(1.0))

        def apply(system: BodySystem) -> None:
            system.Q, system.joint_forces = dict(applied.Q), dict(applied.joint_forces)

        arguments = self.topology, self.masses, k, self.closing, self.numbers
        first = respond(*arguments, no_violations, mark="", origin=f"friction '{each.force.name}' by N of load", apply=apply)
        return refine(*arguments, first, self.times), applied

    def _reactions(self, k: Kinematics, solution: Solution, system: BodySystem) -> Reactions:
        """The reactions of a solution, with corrected multipliers."""
        b, own = k.builder, {x.element.name for x in self.closing.all() if k is self.k}
        loops: list[LoopClosure] = []
        for loop in self.closing.loops:
            augmented = b.scale(self.numbers.penalties[loop.joint.name], solution.errors[loop.joint.name])
            loops.append(replace(loop, multipliers=b.add(loop.multipliers, augmented) if loop.joint.name in own else augmented))
        Zdd = accelerations_of(k, solution.vdot.__getitem__)
        return Reactions(kinematics=k, loops=tuple(loops), M=self.masses, Q=system.Q, Zdd=Zdd, acting=system.cut_joint_wrenches)


@dataclass(frozen=True, kw_only=True)
class _Loads:
    """The equations of loads: ``at_zero`` has the vectors of each, ``by_unit`` their changes by each load, load by load."""

    k: Kinematics
    frictions: Sequence[LoadFriction]
    at_zero: Sequence[Sequence[Block]]
    by_unit: Sequence[Sequence[Sequence[Block]]]

    @property
    def _numbers(self) -> range:
        return range(len(self.frictions))

    def solve(self) -> list[Block]:
        """The loads, which have no value where they might not be the only ones."""
        b = self.k.builder
        loads = [right for right, _ in self._right_sides([b.zero(1) for _ in self._numbers])]  # without friction
        ones = self._contraction()
        for _ in range(_ITERATIONS):
            loads = self._iterate(loads)
        found = []
        for each, load, (right, _), one in zip(self.frictions, loads, self._right_sides(loads), ones, strict=True):
            with b.section(FRICTION, each.force.name, "N, once it is found", each.force.span.place):
                load = b.mul(load, one)
                near, difference = b.mul(b.number(_FOUND), b.add(right, b.number(_NEAR))), b.sub(load, right)
                is_found = _positive(b, b.sub(b.mul(near, near), b.mul(difference, difference)))
                found.append(b.name(b.mul(load, is_found), "load", each.force.name))
        return found

    def _right_sides(self, loads: Sequence[Block]) -> list[tuple[Block, list[Block]]]:
        """p + sum of |r| at some loads, with its derivatives by all of them."""
        b, found = self.k.builder, []
        for each, vectors, j in zip(self.frictions, self.at_zero, self._numbers, strict=True):
            with b.section("friction", each.force.name, "p + sum of |r|", each.force.span.place):
                lengths, derivatives = [self.k.translator.scalar(each.force.preload)], [b.zero(1) for _ in self._numbers]
                for n in range(len(vectors)):
                    changes = [self.by_unit[i][j][n] for i in self._numbers]
                    r = self.vector(j, n, loads)
                    length = _length(b, r)
                    unit = b.scale(b.call("div", b.number(1.0), length), r)
                    lengths.append(length)
                    derivatives = [b.add(derivative, b.dot(unit, change)) for derivative, change in zip(derivatives, changes, strict=True)]
                found.append((b.total(lengths), derivatives))
        return found

    def vector(self, j: int, n: int, loads: Sequence[Block]) -> Block:
        """r of a load at some loads."""
        b = self.k.builder
        shares = (b.scale(load, self.by_unit[i][j][n]) for i, load in enumerate(loads) if not is_zero(load))
        return b.total([self.at_zero[j][n], *shares])

    def _iterate(self, loads: Sequence[Block]) -> list[Block]:
        """One of Newton's iterations."""
        b, sides = self.k.builder, self._right_sides(loads)
        with b.section("friction", self.frictions[0].force.name, "N <- N + (1 - dr/dN)^-1 (p + sum of |r| - N)", self._place):
            matrix = [[b.sub(b.number(float(i == j)), d) for i, d in enumerate(derivatives)] for j, (_, derivatives) in enumerate(sides)]
            right = [b.sub(side, load) for (side, _), load in zip(sides, loads, strict=True)]
            _, upper, right = _eliminate(b, matrix, right)
            steps: dict[int, Block] = {}
            for j in reversed(self._numbers):
                rest = b.total([right[j], *(b.neg(b.mul(upper[j][i], step)) for i, step in steps.items())])
                steps[j] = b.call("div", rest, upper[j][j])
            return [b.add(load, steps[j]) for j, load in enumerate(loads)]

    def _contraction(self) -> list[Block]:
        """1 for each load where the pivots of I - C are positive, else no value."""
        b = self.k.builder
        with b.section("friction", self.frictions[0].force.name, "I - C", self._place):
            sizes = [[[_length(b, v) for v in self.by_unit[i][j] if not is_zero(v)] for i in self._numbers] for j in self._numbers]
            C = [[b.total([b.zero(1), *each]) for each in row] for row in sizes]
            matrix = [[b.sub(b.number(float(i == j)), value) for i, value in enumerate(row)] for j, row in enumerate(C)]
        pivots, _, _ = _eliminate(b, matrix, [b.zero(1) for _ in self._numbers])
        ones = []
        remedy = b.call("div", b.number(1.0), _largest_eigenvalue(b, [self._at_limits(row) for row in C]))
        for each, pivot in zip(self.frictions, pivots, strict=True):
            with b.section(FRICTION, each.force.name, "1 where the pivot of I - C is positive", each.force.span.place):
                ones.append(_positive(b, pivot, remedy))
        return ones

    def _at_limits(self, row: Sequence[Block]) -> list[Block]:
        """A row of C as it would be if all friction, but that which is at rest, were at its limit."""
        b, limits = self.k.builder, (self.k.translator.scalar(each.force.bristle.limit) for each in self.frictions)
        sizes = (b.call("abs", each.law) for each in self.frictions)
        return [
            b.mul(value, b.call("div", limit, b.add(size, b.mul(b.number(_AT_REST), limit))))
            for value, limit, size in zip(row, limits, sizes, strict=True)
        ]

    @property
    def _place(self) -> str:
        return self.frictions[0].force.span.place


def _largest_eigenvalue(b: Builder, C: Sequence[Sequence[Block]]) -> Block:
    """An upper bound of the largest eigenvalue of a nonnegative matrix: (x + C x)_j/x_j - 1 of some j, for any positive x.
    Collatz, Mathematische Zeitschrift 48 (1942) 221-226. Only domains have it, which are evaluated where a step has failed."""
    if len(C) == 1:
        return C[0][0]
    x = [b.number(1.0) for _ in C]
    for _ in range(_POWERS):
        before, x = x, [b.total([value, *(b.mul(c, y) for c, y in zip(row, x, strict=True))]) for row, value in zip(C, x, strict=True)]
    largest, *others = (b.call("div", after, value) for after, value in zip(x, before, strict=True))
    for other in others:
        largest = b.call("where", b.call("lt", largest, other), other, largest)
    return b.sub(largest, b.number(1.0))


def _positive(b: Builder, value: Block, remedy: Block | None = None) -> Block:
    """1 if a value is positive, else no number: a domain of the motion, with its ``remedy``."""
    if value.op == "const":
        return b.number(1.0)
    root = b.restrict(b.call("sqrt", value), remedy)
    return b.call("div", b.mul(root, root), value)


def _eliminate(b: Builder, matrix: list[list[Block]], right: list[Block]) -> tuple[list[Block], list[list[Block]], list[Block]]:
    """Pivots, the upper triangle and the right side of a system of equations after elimination in the order given."""
    size, pivots = range(len(matrix)), []
    for j in size:
        pivots.append(matrix[j][j])
        for i in size[j + 1 :]:
            if not is_zero(matrix[i][j]):
                share = b.call("div", matrix[i][j], matrix[j][j])
                matrix[i] = [b.sub(x, b.mul(share, y)) for x, y in zip(matrix[i], matrix[j], strict=True)]
                right[i] = b.sub(right[i], b.mul(share, right[j]))
    return pivots, matrix, right
