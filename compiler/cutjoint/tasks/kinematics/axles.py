"""The axles of a model: wheels in pairs, the chassis that carries both, and the joint that steers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.elements.forces.on_road import OnRoad
from cutjoint.elements.terms import JointKind
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import GROUND, AxialForce, Binding, BodyLoad, Bushing, Force, Joint, Model, PointSpring, Scalar, Span, Vector
from cutjoint.package.errors import RunError

#: The name of a force that carries a wheel, if its kind is neither tyre nor wheel.
TYRE = "tyre"
SIDES = ("left", "right")


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A wheel in the design position: the body that carries it without spinning, ``centre`` and the axis ``outward`` (3,), m, its radius.

    ``side`` is 1 on the left, -1 on the right.
    """

    body: str
    centre: Array
    outward: Array
    radius: float
    side: int


@dataclass(frozen=True, kw_only=True)
class Axle:
    """An axle: its wheels, left and right, the ``part`` of the model that carries them on the ground in place of the chassis.

    ``steering`` is the joint that steers it, if there is one.  ``springs`` are the forces whose lengths change with it.  ``wheelbase`` and
    ``height``, of the centre of all masses above the road, are in m, None of a model with one axle.
    """

    name: str
    wheels: tuple[Wheel, Wheel]
    chassis: str
    part: Model
    steering: Joint | None
    springs: tuple[Force, ...]
    is_front: bool
    wheelbase: float | None
    height: float

    @property
    def steering_unit(self) -> str:
        """The unit of the steering joint's coordinate, "m" or "rad"; "" without one."""
        return "" if self.steering is None else self.steering.element.units[self.steering.element.coordinates[0]]


@dataclass(frozen=True, kw_only=True)
class _WheelCandidate:
    """A wheel as the model names it, with the force that carries it, if any."""

    name: str
    body: str
    centre: Vector
    axis: Vector | None
    radius: Scalar | None
    span: Span


class Values:
    """The numbers of a model at values of all its parameters."""

    def __init__(self, model: Model, parameters: Mapping[str, float]) -> None:
        self.parameters = tuple(replace(p, value=float(parameters.get(p.name, p.value)), binding=Binding.CONST) for p in model.parameters)
        self._symbols = {p.symbol: p.value for p in self.parameters}

    def number(self, expression: Scalar | float) -> float:
        """The value of an expression."""
        return evaluate(expression, self._symbols) if hasattr(expression, "free_symbols") else float(expression)

    def vector(self, vector: Vector) -> Array:
        """The values of three expressions."""
        return np.array([self.number(x) for x in vector])


def find_axle(model: Model, values: Values, name: str | None, *, radius: float | None, steer: str | None) -> Axle:
    """The axle of a name, the only one if none is given.

    A name is that of an axle, or those of two bodies with a comma between. Raises RunError: there is no such axle, or it lacks what its
    kinematics need.
    """
    pairs = _pairs(model, values)
    chosen, pair = _chosen(model, values, pairs, name)
    wheels = tuple(_wheel(model, values, found, side, radius) for found, side in zip(pair, (1, -1), strict=True))
    chassis = _chassis(model, [wheel.body for wheel in wheels])
    wheels = tuple(replace(wheel, body=_carrier(model, values, wheel, chassis)) for wheel in wheels)
    bodies = _suspension_bodies(model, {wheel.body for wheel in wheels}, chassis)
    steering = _steering(model, values, bodies, chassis, steer)
    others = [x for key, other in pairs.items() if key != chosen for x in (_place(values, other),)]
    here = float(np.mean([wheel.centre[0] for wheel in wheels]))
    nearest = min(others, key=lambda x: abs(x - here), default=None)
    tyres = {found.name for found in pair}
    springs = tuple(f for f in model.forces if f.active and f.name not in tyres and _is_spring(f, bodies, chassis))
    return Axle(
        name=chosen, wheels=(wheels[0], wheels[1]), chassis=chassis, part=_part(model, values, bodies, chassis, steering),
        steering=steering, springs=springs, is_front=nearest is None or here > nearest,
        wheelbase=None if nearest is None else abs(here - nearest),
        height=_height(model, values) - float(np.mean([w.centre[2] - w.radius for w in wheels])),
    )  # fmt: skip


# Wheels


def _pairs(model: Model, values: Values) -> dict[str, tuple[_WheelCandidate, _WheelCandidate]]:
    """The axles by their names, from the front backwards: each left wheel and the right one that is nearest along x."""
    wheels = [wheel for wheel in map(_wheel_of, model.forces) if wheel is not None]
    y = {wheel.name: values.number(wheel.centre[1]) for wheel in wheels}
    right = [wheel for wheel in wheels if y[wheel.name] < 0]
    pairs = []
    for wheel in (wheel for wheel in wheels if y[wheel.name] > 0 and right):
        x = values.number(wheel.centre[0])
        other = min(right, key=lambda w: abs(values.number(w.centre[0]) - x))
        right.remove(other)
        pairs.append((wheel, other))
    pairs.sort(key=lambda pair: -_place(values, pair))
    return dict(zip(_names(pairs), pairs, strict=True))


def _wheel_of(force: Force) -> _WheelCandidate | None:
    """The wheel that a force carries, if it is a tyre or a wheel by its kind, or a tyre by its name."""
    if isinstance(force, OnRoad):
        return _WheelCandidate(name=force.name, body=force.body, centre=force.centre, axis=force.axis, radius=force.radius, span=force.span)
    if TYRE not in force.name.rpartition(".")[2].split("_"):
        return None
    if isinstance(force, AxialForce):
        return _WheelCandidate(name=force.name, body=force.follower, centre=force.point, axis=None, radius=None, span=force.span)
    if isinstance(force, PointSpring):
        return _WheelCandidate(name=force.name, body=force.follower, centre=force.end, axis=None, radius=None, span=force.span)
    if isinstance(force, BodyLoad) and force.point is not None:
        return _WheelCandidate(name=force.name, body=force.body, centre=force.point, axis=None, radius=None, span=force.span)
    return None


def _names(pairs: Sequence[tuple[_WheelCandidate, _WheelCandidate]]) -> list[str]:
    """The words that the names of an axle's two wheels share, or its place where they share none or another axle has the same."""
    words = [_shared(*(wheel.name.split(".") for wheel in pair)) for pair in pairs]
    if all(words) and len(set(words)) == len(words):
        return words
    return ["front", *(f"middle_{i}" for i in range(1, len(pairs) - 1)), "rear"][: len(pairs)]


def _shared(left: Sequence[str], right: Sequence[str]) -> str:
    """The words that two paths share down to the last instance in which they differ, else in their whole."""
    last = max((i for i, (a, b) in enumerate(zip(left, right, strict=False), 1) if a != b), default=0)
    for depth in (last, None):
        own, other = ("_".join(path[:depth]).split("_") for path in (left, right))
        if words := [word for word in own if word in other and word not in ("", TYRE)]:
            return "_".join(words)
    return ""


def _place(values: Values, pair: Iterable[_WheelCandidate]) -> float:
    """The mean x of an axle's wheels, m."""
    return float(np.mean([values.number(wheel.centre[0]) for wheel in pair]))


def _chosen(
    model: Model, values: Values, pairs: Mapping[str, tuple[_WheelCandidate, _WheelCandidate]], name: str | None
) -> tuple[str, tuple[_WheelCandidate, _WheelCandidate]]:  # fmt: skip
    if name is None and len(pairs) == 1:
        return next(iter(pairs.items()))
    if name is not None and name in pairs:
        return name, pairs[name]
    if name is not None and "," in name:
        return name, _of_bodies(model, values, pairs, name.split(","))
    if not pairs:
        raise RunError(
            f"{model.span}: no axle: no pair of forces of kind tyre or wheel, or called tyre, stands left and right of y = 0; "
            "name the two bodies that carry its wheels, as in --axle LEFT,RIGHT; a single corner needs its mirror image, by mirror: y"
        )
    wanted = "" if name is None else f"no axle '{name}'; "
    raise RunError(f"{model.span}: {wanted}--axle is one of {', '.join(pairs)}, or two bodies that carry wheels, as in LEFT,RIGHT")


def _of_bodies(
    model: Model, values: Values, pairs: Mapping[str, tuple[_WheelCandidate, _WheelCandidate]], names: Sequence[str]
) -> tuple[_WheelCandidate, _WheelCandidate]:  # fmt: skip
    """The wheels of two bodies: those of their tyres, else around their centres of mass."""
    bodies = {body.name: body for body in model.bodies}
    known = {wheel.body: wheel for wheel in chain.from_iterable(pairs.values())}
    if len(set(names)) != 2 or len(names) != 2:
        raise RunError(f"--axle {','.join(names)}: give two bodies, the left one and the right one; a single corner needs its mirror image")
    for name in names:
        if name not in bodies:
            raise RunError(f"{model.span}: --axle: no body '{name}'; the bodies are {', '.join(bodies)}")
    found = [
        known.get(name)
        or _WheelCandidate(name=name, body=name, centre=bodies[name].centre_of_mass, axis=None, radius=None, span=bodies[name].span)
        for name in names
    ]
    y = [values.number(wheel.centre[1]) for wheel in found]
    if not y[0] > y[1]:
        raise RunError(f"--axle {','.join(names)}: the wheel of '{names[0]}' is not left of that of '{names[1]}'; exchange them")
    return found[0], found[1]


def _wheel(model: Model, values: Values, found: _WheelCandidate, side: int, radius: float | None) -> Wheel:
    """The numbers of a wheel; without a given radius it stands on the road at z = 0, but is no larger than its tyre."""
    centre = values.vector(found.centre)
    outward = side * (np.array([0.0, 1.0, 0.0]) if found.axis is None else values.vector(found.axis))
    if radius is None:
        sizes = [float(centre[2]), *([] if found.radius is None else [values.number(found.radius)])]
        radius = min((size for size in sizes if size > 0), default=0.0)
    if not radius > 0:
        raise RunError(f"{found.span}: '{found.name}': its wheel's centre is not above the road at z = 0; give its --radius")
    return Wheel(body=found.body, centre=centre, outward=outward / np.linalg.norm(outward), radius=radius, side=side)


def _height(model: Model, values: Values) -> float:
    """The height of the centre of mass, m; 0 if the model has no mass."""
    masses = np.array([values.number(body.mass) for body in model.bodies])
    heights = np.array([values.number(body.centre_of_mass[2]) for body in model.bodies])
    return float(masses @ heights / masses.sum()) if masses.sum() else 0.0


# The part of the model that an axle is


def _connected_bodies(model: Model, start: Iterable[str], without: str) -> set[str]:
    """The bodies that joints and bushings connect with a start body on paths that avoid another body."""
    ways: dict[str, set[str]] = {}
    ends = [(joint.base, joint.follower) for joint in model.joints]
    ends += [(force.base, force.follower) for force in model.forces if isinstance(force, Bushing)]
    for base, follower in ends:
        ways.setdefault(base, set()).add(follower)
        ways.setdefault(follower, set()).add(base)
    found, new = set(start), list(start)
    while new:
        more = ways.get(new.pop(), set()) - found - {without}
        found |= more
        new += more
    return found


def _chassis(model: Model, carriers: Sequence[str]) -> str:
    """The body nearest to the wheels that lies on all paths from the ground to them; the ground if there is none."""
    on_the_way = []
    for body in model.bodies:
        standing = _connected_bodies(model, {GROUND}, body.name)
        if body.name not in carriers and not standing & set(carriers):
            on_the_way.append((len(standing), body.name))
    return max(on_the_way, default=(0, GROUND))[1]


def _carrier(model: Model, values: Values, wheel: Wheel, chassis: str) -> str:
    """The carrier of a wheel that rotates about its axis; the wheel's own body if it has no such hinge."""
    joints = [joint for joint in model.joints if wheel.body in (joint.base, joint.follower)]
    if len(joints) != 1 or joints[0].kind != "revolute":
        return wheel.body
    other = joints[0].base if joints[0].follower == wheel.body else joints[0].follower
    turns = np.linalg.norm(np.cross(values.vector(joints[0].axes[0]), wheel.outward)) < 1e-9
    return other if turns and other != chassis else wheel.body


def _suspension_bodies(model: Model, carriers: set[str], chassis: str) -> set[str]:
    """The bodies that joints, bushings and gears connect with the wheels' bodies on paths that avoid the chassis and the ground."""
    joints = {joint.name: joint for joint in model.joints}
    bodies: set[str] = set()
    start = carriers
    while start - bodies:
        bodies |= _connected_bodies(model, start | bodies, chassis)
        geared = [g for g in model.gears if any(_belongs_to(joints[name], bodies, chassis) for name in g.joints)]
        start = {body for g in geared for name in g.joints for body in (joints[name].base, joints[name].follower)} - {chassis, GROUND}
    return bodies - {GROUND}


def _belongs_to(between: Joint | PointSpring | AxialForce, bodies: set[str], chassis: str) -> bool:
    """Return whether a joint or a force connects bodies of the axle with each other or with the chassis."""
    ends = {between.base, between.follower}
    return bool(ends & bodies) and ends <= bodies | {chassis}


def _steering(model: Model, values: Values, bodies: set[str], chassis: str, steer: str | None) -> Joint | None:
    """The joint that steers: the named one, else the axle's only joint with a guide, else its only rack (a slider along y)."""
    joints = [joint for joint in model.joints if {joint.base, joint.follower} & bodies]
    single = [joint for joint in joints if len(joint.element.coordinates) == 1 and not joint.element.has_ball]
    if steer is not None:
        for joint in single:
            if joint.name == steer:
                return joint
        raise RunError(
            f"{model.span}: --steer {steer}: the axle has no such joint with one coordinate; "
            f"it has {', '.join(j.name for j in single) or 'none'}"
        )
    guided = [joint for joint in single if joint.guide is not None]
    if len(guided) > 1:
        raise RunError(f"{model.span}: several joints of the axle are guided; --steer is one of {', '.join(j.name for j in guided)}")
    racks = [j for j in single if _is_rack(j, values, chassis)]
    return guided[0] if guided else racks[0] if len(racks) == 1 else None


def _is_rack(joint: Joint, values: Values, chassis: str) -> bool:
    if joint.element.kind is not JointKind.PRISMATIC or chassis not in (joint.base, joint.follower):
        return False
    axis = values.vector(joint.axes[0])
    return bool(abs(axis[1]) > 0.99 * np.linalg.norm(axis))


def _part(model: Model, values: Values, bodies: set[str], chassis: str, steering: Joint | None) -> Model:
    """The model of an axle: its bodies and joints alone, on the ground where the chassis was; the steering joint is free."""
    joints = []
    for joint in (j for j in model.joints if _belongs_to(j, bodies, chassis)):
        base, follower = (GROUND if body == chassis else body for body in (joint.base, joint.follower))
        moved = replace(joint, base=base, follower=follower)
        joints.append(replace(moved, guide=None, cut=False) if joint == steering else moved)
    kept = {joint.name for joint in joints}
    return replace(
        model, parameters=values.parameters, bodies=tuple(b for b in model.bodies if b.name in bodies), joints=tuple(joints), forces=(),
        reactions=(), markers=(), gears=tuple(g for g in model.gears if kept >= set(g.joints)), states=(), signals=(), scenes={}, guards=(),
        embedded_loops=(),
    )  # fmt: skip


def _is_spring(force: Force, bodies: set[str], chassis: str) -> bool:
    """Return whether a force acts between bodies of the axle and the chassis, along a length or a joint's coordinate."""
    return isinstance(force, PointSpring | AxialForce) and _belongs_to(force, bodies, chassis)
