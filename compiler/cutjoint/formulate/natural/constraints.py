"""The constraint equations of natural coordinates: products of points and unit vectors, and a few linear ones.

Each has its residual Phi, the gradient of Phi by the nodes, its rate Phid = Phi_q qd + Phi_t, and the drift (d/dt Phi_q) qd + (d/dt Phi_t),
so that Phidd = Phi_q qdd + drift. A product of two displacements between points is divided by the longer displacement, so that every
residual is in metres or, of two directions, in radians, times the arm, the length scale of a mechanism whose size is far from 1 m.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy

from cutjoint.elements.gear import NAMES, equation
from cutjoint.elements.joint import JointDisplacement
from cutjoint.formulate.inputs import gear_derivatives, guide_rates
from cutjoint.formulate.natural.joint_rows import AngleRow, Arm, JointRow, SumRow, Term, joint_rows
from cutjoint.formulate.natural.layout import Group, Layout, combination
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Use, Uses, total
from cutjoint.kernels.joints import slide_axis
from cutjoint.model.records import GROUND, Gear, Joint, JointCoordinate, Model, Scalar, Vector
from cutjoint.program.blocks import BindingTime, Block, Builder


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """Equations of one body, joint or gear: columns (m, 1), and the gradient (m, size) by node.
    ``by_use`` has the gradient (m, 3) by each body's part with its sign, ``by_displacement`` that by the displacement between a joint's
    points, None where an equation of the joint has none."""

    element: str
    names: tuple[str, ...]
    residual: Block
    rate: Block
    drift: Block
    gradient: Mapping[Node, Block]
    by_use: tuple[tuple[Use, Block], ...] = ()
    by_displacement: Block | None = None

    def without(self, names: Collection[str], b: Builder) -> "Constraint | None":
        """The constraint without the equations of these names; None when none is left."""
        rows = [i for i, name in enumerate(self.names) if name not in names]
        if len(rows) == len(self.names) or not rows:
            return self if rows else None

        def kept(block: Block) -> Block:
            return b.stack([[b.take(block, (i, i + 1), (0, block.shape[1]))] for i in rows])

        return Constraint(
            element=self.element, names=tuple(self.names[i] for i in rows), residual=kept(self.residual), rate=kept(self.rate),
            drift=kept(self.drift), gradient={node: kept(block) for node, block in self.gradient.items()},
            by_use=tuple((use, kept(block)) for use, block in self.by_use),
            by_displacement=None if self.by_displacement is None else kept(self.by_displacement),
        )  # fmt: skip

    @property
    def symbol(self) -> str:
        """The ending of its multipliers' symbols: an element may have several constraints."""
        return f"{self.element}.{self.names[0]}"


@dataclass(kw_only=True)
class _Row:
    """One equation under construction: a sum of terms."""

    b: Builder
    motions: NodeMotions
    residual: Block
    rate: Block
    drift: Block
    gradient: dict[Node, Block] = field(default_factory=dict)
    by_use: list[tuple[Use, Block]] = field(default_factory=list)
    by_displacement: Block | None = None
    is_length: bool = False

    def times(self, arm: float) -> "_Row":
        """The row in metres: one between directions times the arm."""
        if arm == 1 or self.is_length:
            return self
        b, number = self.b, self.b.number(arm)
        return _Row(
            b=b, motions=self.motions, residual=b.mul(number, self.residual), rate=b.mul(number, self.rate),
            drift=b.mul(number, self.drift), gradient={node: b.scale(number, row) for node, row in self.gradient.items()},
            by_use=[(use, b.scale(number, row)) for use, row in self.by_use],
        )  # fmt: skip

    def add_gradient(self, uses: Uses, row: Block) -> None:
        """Add a gradient (1, size) by the bodies' uses of nodes."""
        for use in uses:
            signed = row if use.sign > 0 else self.b.neg(row)
            self.by_use.append((use, row))
            for node, coefficient in use.form.items():
                if node.body != GROUND:
                    term = self.motions.times(coefficient, signed)
                    known = self.gradient.get(node)
                    self.gradient[node] = term if known is None else self.b.add(known, term)

    def product(self, weight: Block, u: Uses, w: Uses) -> None:
        """Add weight (u . w), weight a constant."""
        b, p, q = self.b, self.motions.of(total(u)), self.motions.of(total(w))
        self.residual = b.add(self.residual, b.mul(weight, b.dot(p.x, q.x)))
        self.rate = b.add(self.rate, b.mul(weight, b.add(b.dot(p.x, q.v), b.dot(q.x, p.v))))
        self.drift = b.add(self.drift, b.mul(weight, b.mul(b.number(2.0), b.dot(p.v, q.v))))
        if u is w:
            self.add_gradient(u, b.transpose(b.scale(b.mul(b.number(2.0), weight), p.x)))
        else:
            self.add_gradient(u, b.transpose(b.scale(weight, q.x)))
            self.add_gradient(w, b.transpose(b.scale(weight, p.x)))

    def subtract(self, position: Block, rate: Block, acceleration: Block) -> None:
        """Subtract a function of time."""
        b = self.b
        self.residual, self.rate, self.drift = (
            b.sub(term, guided) for term, guided in zip((self.residual, self.rate, self.drift), (position, rate, acceleration), strict=True)
        )

    def angle(self, node: Node, factor: Scalar) -> None:
        """Subtract factor times an angle."""
        b, motion = self.b, self.motions.node(node)
        number = self.motions.translator.scalar(factor)
        self.residual = b.sub(self.residual, b.mul(number, motion.x))
        self.rate = b.sub(self.rate, b.mul(number, motion.v))
        self.add_gradient((Use(-1, node.body, {node: 1}),), number)


def multipliers(b: Builder, constraint: Constraint) -> Block:
    """The constraint's multipliers, (m, 1)."""
    return b.symbol(f"lambda:{constraint.symbol}", len(constraint.names), BindingTime.ITERATION)


class ConstraintMaker:
    """Derives the constraints of all groups, joints and gears."""

    def __init__(self, motions: NodeMotions, model: Model, arm: float) -> None:
        self._b = motions.builder
        self._m = motions
        self._layout = motions.layout
        self._model = model
        self._arm = arm

    def all(self) -> list[Constraint]:
        """The constraints, bodies first."""
        spans = {body.name: body.span for body in self._model.bodies}
        constraints: list[Constraint] = []
        for group in self._layout.groups.values():
            with self._b.section("body", group.name, "Phi = (u . w - const)/length, the shape of a body", spans[group.name].place):
                constraints.extend(self._body(group))
        for joint in self._model.joints:
            with self._b.section("joint", joint.name, "Phi of what nodes alone do not share", joint.span.place):
                if rows := joint_rows(self._layout, joint):
                    found = [self._joint_row(joint, row) for row in rows]
                    constraints.append(self._stacked(joint.name, [row.name for row in rows], found))
        for gear in self._model.gears:
            with self._b.section("joint", gear.name, equation(gear.law is not None), gear.span.place):
                constraints.append(self._stacked(gear.name, NAMES, [self._gear(gear)]))
        return constraints

    def _row(self) -> _Row:
        zero = self._b.zero(1)
        return _Row(b=self._b, motions=self._m, residual=zero, rate=zero, drift=zero)

    def _stacked(self, element: str, names: Sequence[str], rows: Sequence[_Row]) -> Constraint:
        b, rows = self._b, [row.times(self._arm) for row in rows]
        nodes = dict.fromkeys(node for row in rows for node in row.gradient)
        return Constraint(
            element=element, names=tuple(names), residual=b.column([r.residual for r in rows]), rate=b.column([r.rate for r in rows]),
            drift=b.column([r.drift for r in rows]),
            gradient={n: b.stack([[r.gradient.get(n, b.zero(1, n.size))] for r in rows]) for n in nodes},
            by_use=tuple(
                (use, b.stack([[block if row is r else b.zero(1, block.shape[1])] for r in rows]))
                for row in rows for use, block in row.by_use
            ),
            by_displacement=_stacked_displacements(b, [r.by_displacement for r in rows]),
        )  # fmt: skip

    def _body(self, group: Group) -> Iterator[Constraint]:
        """The constraints that keep a group rigid and tie it to shared nodes outside its basis."""
        for u, w in group.pairs:
            name = _displacement_name(u) if u == w else f"{_displacement_name(u)}*{_displacement_name(w)}"
            yield self._stacked(group.name, [name], [self._remaining_row(group.name, u, w)])
        for node in group.surplus:
            yield from self._surplus_node(group, node)

    def _remaining_row(self, group: str, u: Form, w: Form) -> _Row:
        """The product of two displacements keeps its design value."""
        row = self._row()
        p, q = (sympy.Matrix(_design(form)) for form in (u, w))
        weight = self._b.number(row_scale(self._layout, u, w))
        first, row.is_length = (Use(1, group, u),), len(u) == 2 or len(w) == 2
        row.product(weight, first, first if u == w else (Use(1, group, w),))
        constant = self._b.mul(weight, self._m.translator.scalar(p.dot(q)))
        row.subtract(constant, self._b.zero(1), self._b.zero(1))
        return row

    def _surplus_node(self, group: Group, node: Node) -> Iterator[Constraint]:
        """A group's own combination equals a shared node: three equations, or two of a direction if all directions are numeric."""
        shared = (Use(1, node.body, {node: 1}),)
        across = surplus_tangents(self._layout, group, node)
        if across is None:
            node_use = Use(-1, group.name, combination(group, node.kind, node.place))
            yield self._equal(group.name, node.name, (*shared, node_use))
        else:
            forms = [combination(group, NodeKind.VECTOR, t) for t in across]
            rows = [self._perpendicular(shared, (Use(1, group.name, form),)) for form in forms]
            yield self._stacked(group.name, [f"{node.name}.{i}" for i in (1, 2)], rows)

    def _equal(self, element: str, name: str, uses: Uses) -> Constraint:
        """A combination of nodes is zero."""
        b, form = self._b, total(uses)
        motion, arm = self._m.of(form), 1.0 if next(iter(uses[0].form)).kind is NodeKind.POINT else self._arm
        gradient = {n: self._m.times(c, self._m.times(arm, b.identity(3))) for n, c in form.items() if n.body != GROUND}
        return Constraint(
            element=element, names=tuple(f"{name}.{axis}" for axis in "xyz"), residual=self._m.times(arm, motion.x),
            rate=self._m.times(arm, motion.v), drift=b.zero(3), gradient=gradient,
            by_use=tuple((use, self._m.times(arm, b.identity(3))) for use in uses),
        )  # fmt: skip

    def _perpendicular(self, u: Uses, w: Uses) -> _Row:
        row = self._row()
        row.product(self._b.number(1.0), u, w)
        return row

    def _joint_row(self, joint: Joint, row: JointRow) -> _Row:
        match row:
            case SumRow():
                return self._sum(joint, row)
            case AngleRow(guide=None):
                return self._angle_equation(row, self._layout.angles[joint.name, row.coordinate])
            case AngleRow():
                return self._angle_terms(row, *self._guided_motion(row.guide))
        guided = self._row()
        guided.angle(self._layout.angles[joint.name, row.coordinate], sympy.Integer(-1))
        guided.subtract(*self._guided_motion(row.guide))
        return guided

    def _sum(self, joint: Joint, row: SumRow) -> _Row:
        found, b = self._row(), self._b
        for term in row.terms:
            self._add_term(found, self._m.translator.scalar(term.weight), *self._factors(joint, term))
        if row.constant is not None:
            found.subtract(self._m.translator.scalar(row.constant), b.zero(1), b.zero(1))
        if row.pitch is not None:
            (angle,) = joint.element.coordinates
            found.angle(self._layout.angles[joint.name, angle], row.pitch)
        if row.guide is not None:
            found.subtract(*self._guided_motion(row.guide))
        return found

    def _factors(self, joint: Joint, term: Term) -> tuple[Uses, Uses, bool]:
        """The two factors of a term, and whether the first is the displacement between the joint's points.
        A square has one factor twice."""
        if term.left is term.right is JointDisplacement.VECTOR:
            displacement = self._displacement(joint)
            return displacement, displacement, True
        factors = term.left, term.right
        left, right = (self._displacement(joint) if isinstance(f, JointDisplacement) else self._direction(f) for f in factors)
        return left, right, term.left is JointDisplacement.VECTOR

    def _add_term(self, row: _Row, weight: Block, left: Uses, right: Uses, is_displacement: bool) -> None:
        b = self._b
        row.product(weight, left, right)
        row.is_length = row.is_length or is_displacement
        if is_displacement:
            factor = b.mul(b.number(2.0), weight) if left is right else weight
            row.by_displacement = b.transpose(b.scale(factor, self._m.of(total(right)).x))

    def _direction(self, arm: Arm) -> Uses:
        return (self._layout.use(arm.body, self._layout.direction(arm.body, arm.place)),)

    def _displacement(self, joint: Joint) -> Uses:
        """The displacement from a joint's point of the base to that of the follower."""
        end = self._layout.point(joint.follower, joint.to or joint.at)
        start = self._layout.point(joint.base, joint.at)
        return self._layout.use(joint.follower, end), self._layout.use(joint.base, start, -1)

    def _angle_equation(self, angle: AngleRow, node: Node) -> _Row:
        """f . (b_2 cos angle - b_1 sin angle) = 0 for an angle that is a coordinate."""
        b, motion = self._b, self._m.node(node)
        row = self._angle_terms(angle, motion.x, motion.v, b.zero(1))
        pointer, first, second = (self._m.direction(arm.body, arm.place).x for arm in (angle.pointer, angle.first, angle.second))
        products = b.dot(pointer, first), b.dot(pointer, second)
        reach = b.add(b.mul(b.call("cos", motion.x), products[0]), b.mul(b.call("sin", motion.x), products[1]))
        row.add_gradient((Use(-1, node.body, {node: 1}),), reach)
        return row

    def _angle_terms(self, row: AngleRow, angle: Block, rate: Block, acceleration: Block) -> _Row:
        """f . (b_2 cos angle - b_1 sin angle) with its rate and drift, without a gradient by the angle."""
        b, found, pointer = self._b, self._row(), self._direction(row.pointer)
        sin, cos = b.call("sin", angle), b.call("cos", angle)
        for weight, rate_factor, arm in ((cos, b.neg(sin), row.second), (b.neg(sin), b.neg(cos), row.first)):
            base = self._direction(arm)
            u, w = self._m.of(total(pointer)), self._m.of(total(base))
            found.product(weight, pointer, base)
            product = b.dot(u.x, w.x)
            change = b.add(b.dot(u.x, w.v), b.dot(w.x, u.v))
            found.rate = b.add(found.rate, b.mul(b.mul(rate_factor, rate), product))
            twice = b.mul(b.mul(b.number(2.0), b.mul(rate_factor, rate)), change)
            second = b.mul(b.sub(b.mul(rate_factor, acceleration), b.mul(weight, b.mul(rate, rate))), product)
            found.drift = b.add(found.drift, b.add(twice, second))
        return found

    def _gear(self, gear: Gear) -> _Row:
        """The sum of a gear's coordinates with their factors, less the law of the second one."""
        row = self._row()
        self._add_terms(row, gear.terms)
        if gear.law is not None:
            b, inner = self._b, self._row()
            self._add_terms(inner, ((gear.second, 1),))
            law, derivative, second = gear_derivatives(gear, self._m.translator, inner.residual)
            drift = b.add(b.mul(derivative, inner.drift), b.mul(second, b.mul(inner.rate, inner.rate)))
            row.subtract(law, b.mul(derivative, inner.rate), drift)
            for use, gradient in inner.by_use:
                row.add_gradient((use,), b.neg(b.mul(derivative, gradient)))
        return row

    def _add_terms(self, row: _Row, terms: Sequence[tuple[JointCoordinate, Scalar]]) -> None:
        b, joints = self._b, {joint.name: joint for joint in self._model.joints}
        for coordinate, factor in terms:
            joint, key = joints[coordinate.joint], (coordinate.joint, coordinate.name)
            if key in self._layout.angles:
                row.angle(self._layout.angles[key], -factor)
            elif joint.guide is not None:
                guide, weight = joint.guide[joint.element.coordinates.index(coordinate.name)], self._m.translator.scalar(-factor)
                position, rate, acceleration = (b.mul(weight, part) for part in self._guided_motion(guide))
                row.subtract(position, rate, acceleration)
            else:
                row.product(self._m.translator.scalar(factor), *self._slide(joint, coordinate.name))
                row.is_length = True

    def _slide(self, joint: Joint, coordinate: str) -> tuple[Uses, Uses]:
        """The displacement between a joint's points and the direction along which a displacement counts."""
        base, follower = self._layout.slide_ends(joint)
        end, start = self._layout.point(follower, joint.at), self._layout.point(base, joint.at)
        axis = self._layout.direction(base, slide_axis(joint, coordinate))
        return (self._layout.use(follower, end), self._layout.use(base, start, -1)), (self._layout.use(base, axis),)

    def _guided_motion(self, guide: Scalar) -> tuple[Block, Block, Block]:
        """A guide's position, rate and acceleration; the latter are zero while the equilibrium is sought."""
        b, motion = self._b, self._b.symbol("motion", 1, BindingTime.STEP)
        place, rate, acceleration = (self._m.translator.scalar(e) for e in guide_rates(guide, self._model))
        return place, b.mul(motion, rate), b.mul(motion, acceleration)


def _stacked_displacements(b: Builder, displacements: Sequence[Block | None]) -> Block | None:
    """The gradients by a displacement of all rows; None if no row has one."""
    if all(displacement is None for displacement in displacements):
        return None
    return b.stack([[b.zero(1, 3) if displacement is None else displacement] for displacement in displacements])


def surplus_tangents(layout: Layout, group: Group, node: Node) -> tuple[Vector, Vector] | None:
    """The directions of a group perpendicular to a shared one that it constrains; None where it constrains all three components."""
    if node.kind is not NodeKind.VECTOR or len(group.basis) < 4 or any(sympy.sympify(x).free_symbols for x in node.place):
        return None
    return tangents_of(tuple(layout.value(x) for x in node.place))


def row_scale(layout: Layout, u: Form, w: Form) -> float:
    """The factor of a product of two displacements: one over the longer of two displacements between points, half of it for a length."""
    lengths = [float(np.linalg.norm([layout.value(x) for x in _design(form)])) for form in (u, w) if len(form) == 2]
    return (0.5 if u == w else 1.0) / (max(lengths) if len(lengths) == 2 else 1.0)


def tangents_of(direction: Sequence[float]) -> tuple[Vector, Vector]:
    """Two unit vectors across a direction."""
    d = np.asarray(direction, dtype=float)
    least = np.eye(3)[int(np.argmin(np.abs(d)))]
    first = np.cross(d, least)
    first /= np.linalg.norm(first)
    second = np.cross(d / np.linalg.norm(d), first)
    x, y = (tuple(sympy.Float(float(c)) for c in v) for v in (first, second))
    return x, y


def _design(form: Form) -> list[Scalar]:
    """A form's value in the design position."""
    return [sum((c * node.place[i] for node, c in form.items()), sympy.Integer(0)) for i in range(3)]


def _displacement_name(form: Form) -> str:
    return next(iter(form)).name
