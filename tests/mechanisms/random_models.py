"""Seeded random models: trees, closed loops, forces, guides, and states to try them at.

A model is a function of its seed.  Every joint point is common to both bodies in the design position, every inertia is that of a possible
body, and a massless body is placed only where a loop or a carried body gives its joint an inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy

from cutjoint.elements.joint import Fault
from cutjoint.elements.joints import JOINTS
from cutjoint.model.elements.geometry import GLOBAL_AXES, rotated_axes
from cutjoint.model.records import (
    COORDINATES,
    GROUND,
    AxialForce,
    BallSpring,
    Binding,
    Body,
    BodyLoad,
    Bushing,
    Contact,
    Force,
    Gear,
    Joint,
    JointCoordinate,
    JointForce,
    JointKind,
    Marker,
    Model,
    Numerics,
    Parameter,
    PointSpring,
    Reaction,
    Road,
    Scene,
    Span,
)

K = JointKind
#: All kinds, in an order in which those without a name of their own come last; named ones whose motions have a coordinate each, of which
#: random models are made; and all kinds, these first.  So a seed's models stay.
KINDS = (*JointKind, *(kind for kind in JOINTS if kind not in set(JointKind)))
PLAIN_KINDS = tuple(kind for kind in JointKind if not JOINTS[kind].shares_coordinates)
TREE_KINDS = (*PLAIN_KINDS, *(kind for kind in KINDS if kind not in PLAIN_KINDS))
PLAIN_CUTS = tuple(kind for kind in PLAIN_KINDS if JOINTS[kind].closes)
CUT_KINDS = tuple(kind for kind in TREE_KINDS if JOINTS[kind].closes)
GUIDABLE = tuple(kind for kind in JOINTS if JOINTS[kind].can_be_guided)
#: Guided kinds whose angles natural coordinates have.
MEASURED = tuple(kind for kind in GUIDABLE if JOINTS[kind].is_measured)

NOWHERE = Span(file="random", line=1, column=1)
TIME = sympy.Symbol("t", real=True)


def variable(name: str) -> Any:
    """The symbol of a law's variable."""
    return sympy.Symbol(name, real=True)


def parameter(name: str, value: float, binding: Binding) -> Parameter:
    """A parameter without a unit."""
    return Parameter(name=name, symbol=sympy.Symbol(f"p_{name}", real=True), value=value, unit="1", binding=binding, span=NOWHERE)


SIZE = parameter("size", 1.15, Binding.PARAM)
STRENGTH = parameter("strength", 0.85, Binding.CONST)
DRIVE = parameter("drive", 0.1, Binding.INPUT)


def scene(inputs: dict[str, Any] | None = None, switches: dict[str, bool] | None = None) -> Scene:
    """A scene with nothing but inputs and switches of forces."""
    return Scene(
        name="try", end=1.0, output_step=0.1, pose="design", positions={}, rates={}, inputs=inputs or {}, switches=switches or {},
        road=Road(), numerics=Numerics(), outputs=(), span=NOWHERE,
    )  # fmt: skip


def stop(x: Any, rate: Any, stiffness: Any) -> Any:
    """A soft stop at -0.11 and 0.12 that pushes back and never holds on."""
    below, above = (stiffness * (sympy.Float(limit) - x) - rate for limit in (-0.11, 0.12))
    return sympy.Piecewise(
        (below, sympy.And(x < sympy.Float(-0.11), below > 0)), (above, sympy.And(x > sympy.Float(0.12), above < 0)), (0, True)
    )  # fmt: skip


@dataclass(kw_only=True)
class Workshop:
    """Collects the parts of a model; without ``terrain`` no force element stands on the ground."""

    rng: np.random.Generator
    gravity: bool = True
    terrain: bool = True
    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    forces: list[Force] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)
    reactions: list[Reaction] = field(default_factory=list)

    def chance(self, probability: float) -> bool:
        """True with a probability."""
        return bool(self.rng.random() < probability)

    def pick(self, options: Any) -> Any:
        """One of a sequence."""
        return options[int(self.rng.integers(len(options)))]

    # Geometry

    def numbers(self, scale: float = 1.0) -> tuple[Any, Any, Any]:
        """A vector of numbers."""
        return tuple(sympy.Float(x) for x in scale * self.rng.uniform(-1, 1, 3))

    def point(self) -> tuple[Any, Any, Any]:
        """A point; now and then one of its components is an expression over a parameter, or zero."""
        x, y, z = self.numbers()
        if self.chance(0.2):
            return SIZE.symbol * x, y, z
        return (x, sympy.Integer(0), z) if self.chance(0.2) else (x, y, z)

    def axis(self) -> tuple[Any, Any, Any]:
        """A unit vector; now and then along an axis of the design frame."""
        if self.chance(0.3):
            k, sign = int(self.rng.integers(3)), self.pick((1, -1))
            return tuple(sympy.Integer(sign * (i == k)) for i in range(3))
        return _unit(self.rng.standard_normal(3))

    def axes(self, kind: str) -> tuple[tuple[Any, ...], ...]:
        """The directions of a joint."""
        checks = {field.name: field.check for field in JOINTS[kind].fields}
        if "axis" not in checks:
            return ()
        first, second = self.axis(), checks.get("axis_2")
        if second is None or second.fault is not Fault.NOT_PERPENDICULAR:
            return (first,)
        return first, _unit(np.cross(np.array(first, dtype=float), self.rng.standard_normal(3)))

    # Parts

    def body(self, massless: bool = False) -> str:
        """A body; a massless one has no inertia."""
        name = f"body_{len(self.bodies)}"
        cloud = self.rng.uniform(-0.5, 0.5, (4, 3))
        weights = self.rng.uniform(0.2, 1.0, 4)
        centre = weights @ cloud / weights.sum()
        J = sum(w * ((r @ r) * np.eye(3) - np.outer(r, r)) for w, r in zip(weights, cloud - centre, strict=True))
        mass: Any = sympy.Float(weights.sum())
        if self.chance(0.2):
            mass = mass * SIZE.symbol
        inertia = tuple(sympy.Float(J[ij]) for ij in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        none = sympy.Integer(0)
        self.bodies.append(
            Body(
                name=name, mass=none if massless else mass, centre_of_mass=self.point(),
                inertia=(none,) * 6 if massless else inertia, span=NOWHERE,
            )
        )  # fmt: skip
        return name

    def joint(
        self, kind: str, inner: str, outer: str, *, is_reversed: bool = False, cut: bool | None = False, guide: Any = None
    ) -> str:
        """A joint; ``is_reversed`` makes the outer body its base."""
        name = f"{'cut' if cut else 'joint'}_{len(self.joints)}"
        base, follower = (outer, inner) if is_reversed else (inner, outer)
        at, to = self.point(), None
        if any(field.name == "to" for field in JOINTS[kind].fields):
            at = self.numbers()
            to = tuple(a + s for a, s in zip(at, self.numbers(0.8), strict=True))
        pitch = sympy.Float(self.rng.uniform(0.1, 0.3)) if JOINTS[kind].is_screw else None
        self.joints.append(
            Joint(
                name=name, kind=kind, base=base, follower=follower, at=at, axes=self.axes(kind), to=to, pitch=pitch, cut=cut,
                guide=guide, span=NOWHERE,
            )
        )  # fmt: skip
        return name

    def grow(self, inner: str, kind: str | None = None, **how: Any) -> str:
        """A new body on a joint, by default one of any kind that is seen from either end."""
        body = self.body(how.pop("massless", False))
        how.setdefault("is_reversed", self.chance(0.5))
        self.joint(kind or self.pick(PLAIN_KINDS), inner, body, **how)
        return body

    def close(self, kind: str, one: str, other: str, *, cut: bool | None = True) -> str:
        """A joint that closes a loop, either body its base."""
        return self.joint(kind, one, other, is_reversed=self.chance(0.5), cut=cut)

    def guided(self, inner: str, kind: str | None = None) -> str:
        """A new body on a guided joint."""
        kind = kind or self.pick([k for k in GUIDABLE if k in PLAIN_KINDS])
        rates = [sympy.Float(x) for x in self.rng.uniform(0.5, 1.5, len(COORDINATES[kind]))]
        return self.grow(inner, kind, guide=tuple(sympy.Float(0.3) * sympy.sin(x * TIME) + DRIVE.symbol for x in rates))

    # Massless links

    def link(self, one: str, other: str) -> None:
        """A massless link between two bodies, as of the wheel suspension: its own motions are those that its closure holds."""
        if self.chance(0.5):
            link = self.grow(one, K.UNIVERSAL, massless=True)
            self.close(K.SPHERICAL, other, link)
        else:
            link = self.grow(one, K.SPHERICAL, massless=True)
            self.close(K.REVOLUTE, other, link)

    def carrier(self, inner: str) -> str:
        """A massless body between two skew hinges that carries a body."""
        between = self.grow(inner, K.REVOLUTE, massless=True)
        return self.grow(between, self.pick((K.REVOLUTE, K.PRISMATIC)))

    # Forces

    def places(self) -> list[str]:
        """All bodies, and the ground unless the mechanism floats."""
        return [*([GROUND] if self.terrain else []), *(b.name for b in self.bodies)]

    def two(self) -> tuple[str, str]:
        """Two different bodies or the ground."""
        one, other = self.rng.permutation(self.places())[:2]
        return str(one), str(other)

    def point_spring(self) -> None:
        """A spring and damper of two pieces, with a part that depends on time."""
        length, rate = variable("length"), variable("rate")
        base, follower = self.two()
        k, free = sympy.Float(self.rng.uniform(20, 60)), sympy.Float(self.rng.uniform(0.3, 1))
        damper = sympy.Piecewise((3 * rate - rate**3, rate < sympy.Float(0.123)), (2 * rate + rate**2, True))
        law = STRENGTH.symbol * k * (length - free) + damper + 5 * sympy.cos(3 * TIME)
        self.forces.append(
            PointSpring(
                name=self._force(), base=base, follower=follower, start=self.point(), end=self.point(), law=law, active=True,
                span=NOWHERE,
            )
        )  # fmt: skip

    def axial_force(self) -> None:
        """A push along an axis of its base, with a bumper."""
        travel, rate = variable("travel"), variable("rate")
        base, follower = self.two()
        law = 10 - 20 * travel - SIZE.symbol * rate + sympy.Piecewise((-40 * travel, travel < sympy.Float(0.021)), (0, True))
        self.forces.append(
            AxialForce(
                name=self._force(), base=base, follower=follower, origin=self.point(), point=self.point(), axis=self.axis(),
                law=law, active=True, span=NOWHERE,
            )
        )  # fmt: skip

    def bushing(self) -> None:
        """Six laws in a skew frame: linear, cubic, a stop, and one that depends on time."""
        position, rate = variable("position"), variable("rate")
        base, follower = self.two()
        linear = -30 * position - STRENGTH.symbol * rate
        laws = (linear, linear - 9 * position**3, stop(position, rate, 25), 2 * linear, linear * SIZE.symbol, linear + sympy.sin(TIME))
        first, second = np.linalg.qr(self.rng.standard_normal((3, 2)))[0].T
        axes = (_unit(first), _unit(second), _unit(np.cross(first, second)))
        self.forces.append(
            Bushing(
                name=self._force(), base=base, follower=follower, point=self.point(), axes=axes, laws=laws, active=True, span=NOWHERE
            )
        )  # fmt: skip

    def load(self) -> None:
        """A force that depends on its point's place and velocity, or a torque on time and on the angular velocity."""
        x, y, z, vx, vy, vz = (variable(n) for n in ("x", "y", "z", "vx", "vy", "vz"))
        torque = self.chance(0.4)
        components: tuple[Any, ...] = (3 * x - y * vy, SIZE.symbol * sympy.sin(z) - 2 * vx, 4 * DRIVE.symbol - vz * abs(vz))
        if torque:
            wx, wy, wz = (variable(n) for n in ("wx", "wy", "wz"))
            components = (sympy.Float(1.5) - wx, 2 * sympy.sin(TIME) - wy * abs(wy), DRIVE.symbol + wx * wz)
        self.forces.append(
            BodyLoad(
                name=self._force(), body=self.pick(self.bodies).name, point=None if torque else self.point(),
                axes=self.pick(("global", "body")), components=components, moving_only=self.chance(0.3), active=True, span=NOWHERE,
            )
        )  # fmt: skip

    def joint_force(self) -> None:
        """A spring and damper on a coordinate, or a stop, where the tree has a joint with one; what is free has the ground's."""
        held = [j for j in self.joints if j.cut is False and j.kind is not K.FREE and j.guide is None]
        found = [j for j in held if COORDINATES[j.kind]]
        if found:
            position, rate = variable("position"), variable("rate")
            law = -4 * position - sympy.Float(0.5) * rate + sympy.tanh(position) * STRENGTH.symbol
            if self.chance(0.5):
                law = stop(position, rate, 30 * STRENGTH.symbol)
            joint = self.pick(found)
            name, coordinate = self._force(), self.pick(COORDINATES[joint.kind])
            unit = joint.element.units[coordinate]
            self.forces.append(
                JointForce(name=name, joint=joint.name, coordinate=coordinate, unit=unit, law=law, active=True, span=NOWHERE)
            )

    def _force(self) -> str:
        return f"force_{len(self.forces)}"

    def load_all(self) -> None:
        """One or two forces of every kind, none from outside on what floats, and one that the model switches off."""
        for add in (self.point_spring, self.axial_force, self.bushing, self.joint_force, *([self.load] if self.terrain else [])):
            for _ in range(int(self.rng.integers(1, 3))):
                add()
        off = PointSpring(
            name="off", base=GROUND, follower=self.bodies[0].name, start=self.point(), end=self.point(),
            law=sympy.Float(1e6), active=False, span=NOWHERE,
        )  # fmt: skip
        self.forces.append(off)

    def sense(self) -> None:
        """A marker on every body and two reactions of every cut joint, in either body's axes."""
        for body in self.bodies:
            self.markers.append(Marker(name=f"marker_on_{body.name}", body=body.name, point=self.point(), span=NOWHERE))
        for cut in (j for j in self.joints if j.cut):
            for body in (cut.base, cut.follower):
                name = f"reaction_of_{cut.name}_along_{body}"
                self.reactions.append(Reaction(name=name, joint=cut.name, body=body, direction=self.axis(), span=NOWHERE))

    def model(self) -> Model:
        """The model that has been built."""
        gravity = self.numbers(10.0) if self.gravity else (sympy.Integer(0),) * 3
        return Model(
            name="random", gravity=gravity, parameters=(SIZE, STRENGTH, DRIVE), bodies=tuple(self.bodies),
            joints=tuple(self.joints), forces=tuple(self.forces), reactions=tuple(self.reactions), markers=tuple(self.markers),
            scenes={}, span=NOWHERE, text="",
        )  # fmt: skip


def _unit(x: np.ndarray) -> tuple[Any, Any, Any]:
    return tuple(sympy.Float(c) for c in x / np.linalg.norm(x))


def workshop(seed: int, salt: str, gravity: bool = True, terrain: bool = True) -> Workshop:
    """An empty workshop; ``salt`` tells apart the generators that share a seed."""
    return Workshop(rng=np.random.default_rng([seed, *salt.encode()]), gravity=gravity, terrain=terrain)


# Models

HEAVY = (K.REVOLUTE, K.PRISMATIC, K.CYLINDRICAL, K.SPHERICAL, K.FREE)


def tree_with(kind: str, is_reversed: bool, seed: int) -> Model:
    """A tree with joints of one kind: at the ground, on a free body, and with a body behind it."""
    w = workshop(seed, f"tree {kind} {is_reversed}")
    at_ground = w.grow(GROUND, kind, is_reversed=is_reversed)
    floating = w.grow(GROUND, K.FREE if seed % 2 else None)
    branch = w.grow(floating, kind, is_reversed=is_reversed)
    w.grow(w.grow(branch))
    w.grow(at_ground, kind, is_reversed=is_reversed)
    w.load_all()
    return w.model()


def random_tree(seed: int, gravity: bool = True, guides: bool = True) -> Model:
    """A tree of four to nine bodies on joints of any kind, with a guided joint or a massless body in every third model each."""
    w = workshop(seed, "random tree", gravity)
    for n in range(int(w.rng.integers(4, 10))):
        w.grow(GROUND if n == 0 else w.pick(w.places()))
    if seed % 3 == 0 and guides:
        w.grow(w.guided(w.pick(w.places())))
    if seed % 3 == 1:
        w.carrier(w.pick(w.places()))
    w.load_all()
    return w.model()


#: The ways in which a cut joint may close its loop.
CLOSINGS = ("branch", "roots", "floating", "parent", "twice", "guided")


def loop_with(kind: str, closing: str, seed: int) -> Model:
    """A loop closed by a cut joint of a kind: within a branch, between branches with different roots, to the ground, between a body
    and its parent, twice between the same bodies, or between guided bodies; an odd seed swaps the cut joint's bodies."""
    w = workshop(seed, f"loop {kind} {closing}")
    first = w.grow(GROUND, K.FREE if closing == "floating" else w.pick(HEAVY))
    second = w.grow(first)
    third = w.grow(second)
    if closing == "branch":
        one, other = third, w.grow(w.grow(first))
    elif closing in ("roots", "floating"):
        one, other = third, w.grow(w.grow(GROUND, K.FREE if closing == "floating" else w.pick(HEAVY)))
    elif closing == "ground":
        one, other = third, GROUND
    elif closing == "twice":
        one, other = third, first
        w.close(w.pick(PLAIN_CUTS), other, one)
    elif closing == "parent":
        one, other = third, second
    else:
        one, other = w.grow(w.guided(second)), w.guided(GROUND)
    w.joint(kind, one, other, is_reversed=seed % 2 == 1, cut=True)
    w.load_all()
    w.sense()
    return w.model()


def floating_loops(seed: int, roots: int = 2) -> Model:
    """Free bodies that carry others, with loops in and between them; neither gravity nor a force from outside."""
    w = workshop(seed, "floating loops", gravity=False, terrain=False)
    for _ in range(roots):
        w.grow(GROUND, K.FREE, is_reversed=False)
    for _ in range(int(w.rng.integers(3, 6))):
        w.grow(w.pick(w.places()))
    for _ in range(int(w.rng.integers(1, 4))):
        w.close(w.pick(PLAIN_CUTS), *w.two())
    w.load_all()
    return w.model()


def random_loops(seed: int, gravity: bool = True, forces: bool = True) -> Model:
    """Nested and coupled loops: a tree of five to eight bodies, two to four cut joints of any kind, massless links."""
    w = workshop(seed, "random loops", gravity)
    w.grow(GROUND, w.pick(HEAVY))
    for _ in range(int(w.rng.integers(4, 8))):
        w.grow(w.pick(w.places()))
    if seed % 2 == 0:
        w.guided(w.pick(w.places()))
    for _ in range(int(w.rng.integers(2, 5))):
        w.close(w.pick(PLAIN_CUTS), *w.two())
    heavy = [b.name for b in w.bodies]
    if seed % 3 != 2:
        w.link(*w.rng.permutation(heavy)[:2])
    if seed % 3 == 1:
        w.link(w.pick(heavy), GROUND)
    if forces:
        w.load_all()
    w.sense()
    return w.model()


def around_hub(seed: int) -> Model:
    """Two or three parts of nine unknowns that cut joints connect through one body: on the ground, on a free body or on one that a joint
    holds.  Parts have loops of their own too, and ends on a guided body of the hub."""
    w = workshop(seed, "around a hub")
    carrier = (GROUND, w.grow(GROUND, K.FREE, is_reversed=False), w.grow(GROUND, K.UNIVERSAL))[seed % 3]
    hub = w.grow(carrier, w.pick((K.REVOLUTE, K.PRISMATIC, K.CYLINDRICAL, K.SPHERICAL)))
    end = w.guided(hub) if seed % 2 else hub
    for n in range(2 + seed % 2):
        first = w.grow(carrier, K.SPHERICAL)
        last = w.grow(w.grow(first, K.SPHERICAL), K.SPHERICAL)
        w.close(w.pick(PLAIN_CUTS), last, hub if n else end)
        if w.chance(0.5):
            w.close(w.pick(PLAIN_CUTS), last, w.pick((carrier, first)))
    w.load_all()
    w.sense()
    return w.model()


def chosen_loops(seed: int) -> Model:
    """Loops whose cut joints the compiler chooses; no joint says whether it may be cut, but for the massless links' own."""
    w = workshop(seed, "chosen loops")
    w.grow(GROUND, w.pick(HEAVY), cut=None)
    for _ in range(int(w.rng.integers(3, 7))):
        w.grow(w.pick(w.places()), w.pick(PLAIN_CUTS), cut=None)
    for _ in range(int(w.rng.integers(1, 4))):
        w.close(w.pick(PLAIN_CUTS), *w.two(), cut=None)
    w.load_all()
    return w.model()


def with_gears(model: Model, seed: int, kinds: Sequence[str] = TREE_KINDS, bent: bool = False) -> Model:
    """The model with up to three gears between joints of its tree, of these kinds; none follows from the others or from the guides.  Those
    that are ``bent`` have laws in place of ratios."""
    rng = np.random.default_rng([seed, *b"gears"])
    ends = [(j, name) for j in model.joints if not j.cut and j.kind in kinds for name in COORDINATES[j.kind]]
    group = {j.name: "guided" if j.guide is not None else j.name for j, _ in ends}
    gears: list[Gear] = []
    for _ in range(20):
        pair = [ends[int(i)] for i in rng.choice(len(ends), 2, replace=False)]
        one, other = (group[joint.name] for joint, _ in pair)
        if one != other and len(gears) <= seed % 3:
            group = {name: one if g == other else g for name, g in group.items()}
            gears.append(_gear(f"gear_{len(gears)}", pair, float(rng.uniform(0.3, 3) * rng.choice((1, -1)))))
    x = variable("position")
    laws = [gear.ratio * (x + sympy.sin(x) / 2 + x**2 / 5) for gear in gears]
    return replace(model, gears=tuple(replace(g, ratio=None, law=law) if bent else g for g, law in zip(gears, laws, strict=True)))


def with_contacts(model: Model, seed: int) -> Model:
    """The model with a ball on a plane and on a cylinder from either side, between any of its bodies and the ground: pressed in and not."""
    rng = np.random.default_rng([seed, *b"contacts"])
    names = [GROUND, *(body.name for body in model.bodies)]
    depth, rate, vx, vy, turn = (variable(n) for n in ("deflection", "deflection_rate", "vx", "vy", "turn"))
    force = (STRENGTH.symbol * depth - vx, 3 * depth * vy - turn, 20 * depth**2 * (1 + rate / 2) + sympy.sin(TIME))
    contacts = []
    for i, (cylinder, inside) in enumerate([(None, False), (1.0, False), (4.0, True)]):
        base, follower = rng.choice(names, 2, replace=False)
        first, second = np.linalg.qr(rng.standard_normal((3, 2)))[0].T
        normal = _unit(first) if cylinder is None else None
        start, centre = (tuple(map(sympy.Float, rng.uniform(-1, 1, 3))) for _ in range(2))
        contacts.append(Contact(
            name=f"contact_{i}", base=str(base), follower=str(follower), start=start, centre=centre, along=_unit(second), normal=normal,
            ball=2 * SIZE.symbol, cylinder=cylinder and sympy.Float(cylinder), inside=inside, force=force, active=True, span=NOWHERE,
        ))  # fmt: skip
    return replace(model, forces=(*model.forces, *contacts))


def with_ball_springs(model: Model, seed: int) -> Model:
    """The model with springs and dampers on the turns between any of its bodies and the ground, one at rest where the design is turned
    out of it, and a damper alone."""
    rng = np.random.default_rng([seed, *b"ball springs"])
    names = [GROUND, *(body.name for body in model.bodies)]
    springs = []
    for i, (stiffness, damping) in enumerate([(20 * STRENGTH.symbol, 0), (sympy.Integer(7), sympy.Float(0.4)), (0, SIZE.symbol)]):
        base, follower = rng.choice(names, 2, replace=False)
        rest = rotated_axes(tuple(map(sympy.Float, rng.uniform(-1, 1, 3)))) if i == 1 else GLOBAL_AXES
        springs.append(BallSpring(
            name=f"ball_{i}_spring", of=f"ball_{i}", base=str(base), follower=str(follower), axes=rest, stiffness=sympy.sympify(stiffness),
            damping=sympy.sympify(damping), active=True, span=NOWHERE,
        ))  # fmt: skip
    return replace(model, forces=(*model.forces, *springs))


def _gear(name: str, ends: Sequence[tuple[Joint, str]], ratio: float) -> Gear:
    first, second = (JointCoordinate(joint=joint.name, name=end, unit=joint.element.units[end]) for joint, end in ends)
    return Gear(name=name, first=first, second=second, ratio=ratio * SIZE.symbol, span=NOWHERE)


def state(layouts: Any, nq: int, nv: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random coordinates off the design position, away from gimbal lock, and random speeds."""
    q = np.clip(0.5 * rng.standard_normal(nq), -1.1, 1.1)
    for x in layouts.values():
        if x.ball:
            e = rng.standard_normal(4)
            q[x.q_slice.stop - 4 : x.q_slice.stop] = e / np.linalg.norm(e)
    return q, rng.standard_normal(nv)
