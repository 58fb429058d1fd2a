"""Loop closures in the body system: the penalty of every cut joint and its augmented update (Cuadrado et al. 2000, eqs. 39-42).

With residual Phi, Phi' = A Z and s = gamma + 2 xi w Phi' + w^2 Phi, Z the relative twist::

    M_f += A^T a A    M_b += A^T a A    C_fb -= A^T a A    Q_f -= A^T (lambda + a s)    Q_b += A^T (lambda + a s)
    lambda <- lambda + a (A Zdd + s)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy

from cutjoint.elements.joint import SameDistance
from cutjoint.formulate.inputs import Numbers
from cutjoint.formulate.recursive.kinematics import Kinematics, halves, motion_cross
from cutjoint.formulate.recursive.recursion import BodySystem
from cutjoint.kernels import closures
from cutjoint.kernels.closures import ClosureKernel, derive_closure
from cutjoint.kernels.joints import rod_of
from cutjoint.model.records import GROUND, Gear, Joint
from cutjoint.program.blocks import BindingTime, Block, Builder

ERRORS, CORRECTION = "A Zdd + s  (eq. 42)", "lambda <- lambda + a (A Zdd + s)  (eq. 42)"


@dataclass(frozen=True, kw_only=True)
class Closing:
    """The common part of cut joints and gears: residual, its rate, the stabilisation s, multipliers."""

    names: tuple[str, ...]
    residual: Block
    rate: Block
    s: Block
    multipliers: Block

    @property
    def element(self) -> Joint | Gear:
        """The element that has the equations."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class LoopClosure(Closing):
    """A cut joint's blocks, with the Jacobian A by the follower's twist."""

    joint: Joint
    A: Block

    @property
    def element(self) -> Joint:
        """The cut joint."""
        return self.joint


def derive_loops(k: Kinematics, cuts: tuple[Joint, ...], numbers: Numbers) -> tuple[LoopClosure, ...]:
    """The blocks of every cut joint."""
    loops = []
    for joint in cuts:
        with k.builder.section("closure", joint.name, "Phi, Phi' = A Z, s = gamma + 2 xi w Phi' + w^2 Phi", joint.span.place):
            kernel = derive_closure(joint)
            terms = _distance(k, joint) if joint.element.conditions == (SameDistance(),) else _of_kernel(k, joint, kernel)
            loops.append(_derive(k.builder, joint, kernel, terms, numbers))
    return tuple(loops)


@dataclass(frozen=True, kw_only=True)
class _Terms:
    """Phi, its rate, A, and gamma = Phi'' - A (Zdd_f - Zdd_b)."""

    residual: Block
    rate: Block
    A: Block
    gamma: Block


def _of_kernel(k: Kinematics, joint: Joint, kernel: ClosureKernel) -> _Terms:
    """The terms as SymPy derives them."""
    b, name = k.builder, joint.name
    step = k.pole_step(joint.base, joint.follower)
    base_twist = b.name(k.twist_at(k.frames[joint.base].Z, step), "Z_base", name)
    twist = b.name(b.sub(k.frames[joint.follower].Z, base_twist), "Z", name)
    local = k.translator.with_values(_values(k, joint, kernel, twist, step))
    A = local.matrix(kernel.jacobian)
    gamma = b.sub(local.matrix(kernel.drift), b.mul(A, motion_cross(b, base_twist, twist)))
    return _Terms(residual=local.matrix(kernel.residual), rate=b.mul(A, twist), A=A, gamma=gamma)


def _distance(k: Kinematics, joint: Joint) -> _Terms:
    """The terms of a distance l, over the motion of its two points p and p0, which rods that meet there share.
    With g = p - p0 and n = g/l: Phi' = n . g', A = [n, p x n], gamma = g'.g'/l + n . (w_f x p' - w_b x p0')."""
    b, name = k.builder, joint.name
    assert joint.to is not None
    point, start = k.point(joint.follower, joint.to), k.point(joint.base, joint.at)
    length = k.translator.scalar(sympy.Matrix(rod_of(joint)).norm())
    share = b.call("div", b.number(1.0), length)
    displacement = b.name(k.between(joint.follower, point, joint.base, start), "displacement", name)
    n = b.name(b.scale(share, displacement), "n", name)
    speeds = (k.velocity(joint.follower, point), k.velocity(joint.base, start))
    turned = (b.cross(halves(b, k.frames[body].Z)[1], v) for body, v in zip((joint.follower, joint.base), speeds, strict=True))
    speed, drift = b.name(b.sub(*speeds), "speed", name), b.sub(*turned)
    return _Terms(
        residual=b.mul(b.number(0.5), b.sub(b.dot(n, displacement), length)), rate=b.dot(n, speed),
        A=b.stack([[b.transpose(n), b.transpose(b.cross(point, n))]]),
        gamma=b.add(b.mul(share, b.dot(speed, speed)), b.dot(n, drift)),
    )  # fmt: skip


def _derive(b: Builder, joint: Joint, kernel: ClosureKernel, terms: _Terms, numbers: Numbers) -> LoopClosure:
    name, rows = joint.name, kernel.names
    residual, rate = b.name(terms.residual, "Phi", name, rows=rows), b.name(terms.rate, "Phid", name, rows=rows)
    A = b.name(terms.A, "A", name, rows=rows)
    of_rate, of_residual = stabilisation(b, numbers)
    s = b.name(b.add(terms.gamma, b.add(b.scale(of_rate, rate), b.scale(of_residual, residual))), "s", name, rows=rows)
    multipliers = b.symbol(f"lambda:{joint.name}", len(kernel.names), BindingTime.ITERATION)
    return LoopClosure(joint=joint, names=kernel.names, residual=residual, rate=rate, A=A, s=s, multipliers=multipliers)


def stabilisation(b: Builder, numbers: Numbers) -> tuple[Block, Block]:
    """The factors 2 xi w of the residual's rate and w^2 of the residual, the same for all cut joints and gears."""
    with b.section("stabilisation", "", "2 xi w, w^2", ""):
        of_rate = b.mul(b.number(2.0), b.mul(numbers.damping_ratio, numbers.frequency))
        of_residual = b.mul(numbers.frequency, numbers.frequency)
    return b.label(of_rate, "rate_stabilisation"), b.label(of_residual, "residual_stabilisation")


def _values(k: Kinematics, joint: Joint, kernel: ClosureKernel, twist: Block, step: Block) -> dict[sympy.Symbol, Block]:
    """The blocks of the kernel's symbols; both points from the follower's pole."""
    b = k.builder
    columns = [
        ("p", closures.P, k.point(joint.follower, joint.at)),
        ("p0", closures.P0, b.sub(k.point(joint.base, joint.at), step)),
        ("V", closures.V, b.take(twist, (0, 3))),
        ("W", closures.W, b.take(twist, (3, 6))),
        *((f"b{i}", closures.B[i], k.direction(joint.base, d)) for i, d in enumerate(kernel.base_directions)),
        *((f"f{i}", closures.F[i], k.direction(joint.follower, d)) for i, d in enumerate(kernel.follower_directions)),
    ]
    return {symbol[i]: b.element(b.letter(block, letter), i) for letter, symbol, block in columns for i in range(3)}


def add_loops(system: BodySystem, k: Kinematics, loops: tuple[LoopClosure, ...], numbers: Numbers) -> None:
    """Penalty masses, couplings and forces of every cut joint."""
    b = k.builder
    for loop in loops:
        joint = loop.joint
        system.source = joint.name
        with b.section("closure", joint.name, "M += A^T a A, C -= A^T a A, Q -= A^T (lambda + a s)  (eqs. 39-42)", joint.span.place):
            penalty = numbers.penalties[joint.name]
            weights = b.stack([[penalty]] * len(loop.names))
            K = b.name(b.gram(loop.A, weights), "K", joint.name)
            force = b.name(b.add(loop.multipliers, b.scale(penalty, loop.s)), "push", joint.name, rows=loop.names)
            wrench = b.mul(b.transpose(loop.A), force)
            step = transport(b, k.pole_step(joint.base, joint.follower))
            back = b.transpose(step)
            system.add_mass(joint.follower, K)
            system.add_mass(joint.base, b.sandwich(back, K))
            system.couple(joint.follower, joint.base, b.neg(b.mul(K, step)))
            system.add_force(joint.follower, b.neg(wrench))
            system.add_force(joint.base, b.mul(back, wrench))


def constraint_wrenches(k: Kinematics, loop: LoopClosure, augmented: Block) -> dict[str, Block]:
    """The wrench -A^T augmented on the follower and its reaction on the base, each at the body's pole."""
    b, joint = k.builder, loop.joint
    wrench = b.mul(b.transpose(loop.A), augmented)
    back = b.transpose(transport(b, k.pole_step(joint.base, joint.follower)))
    return {joint.follower: b.neg(wrench), joint.base: b.mul(back, wrench)}


def by_joint(b: Builder, loop: LoopClosure, step: Block, ends: tuple[Sequence[str], Sequence[str]], body: str, S: Block) -> Block:
    """The rates of a cut joint's equations by the speeds of the joint that carries a body, (m, k). ``ends`` are the bodies that carry the
    base and the follower, these included, ``step`` the transport from the base's pole to the follower's."""
    base, follower = ends
    if (body in base) == (body in follower):
        return b.zero(len(loop.names), S.shape[1])
    return b.mul(loop.A, S) if body in follower else b.neg(b.mul(loop.A, b.mul(step, S)))


def transport(b: Builder, step: Block) -> Block:
    """[1, -s~; 0, 1]: transforms a twist to a pole displaced by s."""
    return b.stack([[b.identity(3), b.neg(b.skew(step))], [b.zero(3, 3), b.identity(3)]])


def loop_errors(k: Kinematics, loops: tuple[LoopClosure, ...], Zdd: Mapping[str, Block]) -> dict[str, Block]:
    """A Zdd + s of every cut joint, by name."""
    b, errors = k.builder, {}
    for loop in loops:
        joint = loop.joint
        with b.section("multipliers", joint.name, ERRORS, joint.span.place):
            step = k.pole_step(joint.base, joint.follower)
            base = k.twist_at(Zdd[joint.base], step) if joint.base != GROUND else b.zero(6)
            relative = b.sub(Zdd[joint.follower], base)
            errors[joint.name] = b.add(b.mul(loop.A, relative), loop.s)
    return errors


def corrections(b: Builder, closing: Sequence[Closing], numbers: Numbers, errors: Mapping[str, Block]) -> dict[str, Block]:
    """a (A Zdd + s) of every cut joint and gear, by name."""
    found = {}
    for loop in closing:
        name = loop.element.name
        with b.section("multipliers", name, CORRECTION, loop.element.span.place):
            found[name] = b.name(b.scale(numbers.penalties[name], errors[name]), "correction", name, rows=loop.names)
    return found
