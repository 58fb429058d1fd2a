"""Other mechanisms that move as a given one: turned, mirrored, shifted, in other units, with other names and orders, cut elsewhere.

An `Image` is a model and a scene, and how places of its bodies come from those of the original.  A transformation answers None where it
does not know how a feature of the model looks in its image.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import sympy

from cutjoint.compile.derivation import derive
from cutjoint.elements.forces.body_load import BodyLoad
from cutjoint.elements.interaction import Frame, Point
from cutjoint.elements.joint import Direction
from cutjoint.model.elements.build import Elements
from cutjoint.model.elements.mirror import coordinate_signs, mirror_along, mirror_elements
from cutjoint.model.records import AxialForce, Body, Bushing, Force, Joint, JointForce, Model, Numerics, Output, PointSpring, Scene

Array = np.ndarray
#: Forces whose images are known, and their laws' fields.
KNOWN = (PointSpring, AxialForce, JointForce, Bushing, BodyLoad)
GLOBAL = (Direction.X, Direction.Y, Direction.Z)


@dataclass(frozen=True, kw_only=True)
class Image:
    """A place p of a body is at ``length`` (Q p + d) in the image, at ``time`` times the time; ``names`` are those of bodies."""

    model: Model
    scene: Scene
    Q: Array = None  # type: ignore[assignment]
    d: Array = None  # type: ignore[assignment]
    length: float = 1.0
    time: float = 1.0
    names: Mapping[str, str] = None  # type: ignore[assignment]

    def back(self, places: Array) -> Array:
        """Places of the original, by those of the image."""
        shift = np.zeros(3) if self.d is None else self.d
        return (places / self.length - shift) @ (np.eye(3) if self.Q is None else self.Q)


def original(model: Model, scene: Scene) -> Image | None:
    """The model itself with default numerics; None for one that has what no transformation knows."""
    odd = model.states or model.signals or model.controllers or model.functions or model.guards or model.embedded_loops or model.gears
    odd = odd or scene.guides or scene.assemble or scene.near or scene.starts or not model.bodies
    if odd or not all(isinstance(force, KNOWN) for force in model.forces):
        return None
    scene = replace(scene, numerics=Numerics(), plots=(), method="", accuracy=None)
    return Image(model=replace(model, reactions=(), markers=()), scene=scene)


def outputs(model: Model, names: Mapping[str, str] | None = None) -> tuple[Output, ...]:
    """The places of all bodies."""
    bodies = [(names or {}).get(body.name, body.name) for body in model.bodies]
    return tuple(Output(element=body, quantity=x, span=model.span) for body in bodies for x in "xyz")


def _times(s: float, v: Any) -> Any:
    return tuple(sympy.Float(s) * x for x in v)


def _moved(model: Model, point: Callable[[Any], Any], axis: Callable[[Any], Any], tensor: Callable[[Any], Any]) -> Model:
    """A model whose points, directions and inertias have moved."""

    def of_force(force: Force) -> Force:
        images = {}
        for place in force.places:
            value = place.of(force)
            if value is None:
                continue
            of_frame = tuple(map(axis, value)) if isinstance(place, Frame) else ()
            images[place.field] = of_frame or (point if isinstance(place, Point) else axis)(value)
        return replace(force, **images)

    def of_joint(joint: Joint) -> Joint:
        return replace(joint, at=point(joint.at), axes=tuple(map(axis, joint.axes)), to=None if joint.to is None else point(joint.to))

    def of_body(body: Body) -> Body:
        return replace(body, centre_of_mass=point(body.centre_of_mass), inertia=tensor(body.inertia), shapes=(), visuals=())

    return replace(
        model, bodies=tuple(map(of_body, model.bodies)), joints=tuple(map(of_joint, model.joints)),
        forces=tuple(map(of_force, model.forces)), gravity=axis(model.gravity),
    )  # fmt: skip


def _is_global(joint: Joint) -> bool:
    """Whether coordinates of a joint count along global axes, or across an axis, where these decide."""
    turning = (*GLOBAL, Direction.ACROSS_1, Direction.ACROSS_2)
    return joint.element.has_ball or any(m.direction in turning for m in joint.element.scalar_motions)


def _depends_on_axes(image: Image) -> bool:
    """Whether a start, a guide or a force names such a coordinate, or a load has global components."""
    if any(isinstance(force, BodyLoad) and force.axes == "global" for force in image.model.forces):
        return True
    named = {name.partition(".")[0] for name in (*image.scene.positions, *image.scene.rates)}
    named |= {force.joint_of for force in image.model.forces}
    return any(_is_global(joint) and (joint.guide is not None or joint.name in named) for joint in image.model.joints)


def turned(image: Image, seed: int = 0) -> Image | None:
    """By an angle about an axis that are drawn."""
    if _depends_on_axes(image):
        return None
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    Q *= np.sign(np.linalg.det(Q))
    M = sympy.Matrix(3, 3, [sympy.Float(x) for x in Q.ravel()])

    def axis(v: Any) -> Any:
        return tuple(M * sympy.Matrix(v))

    def tensor(v: Any) -> Any:
        xx, yy, zz, xy, xz, yz = v
        moved = M * sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * M.T
        return (moved[0, 0], moved[1, 1], moved[2, 2], moved[0, 1], moved[0, 2], moved[1, 2])

    return replace(image, model=_moved(image.model, axis, axis, tensor), Q=Q)


def mirrored(image: Image) -> Image | None:
    """Along y, by what the compiler does for instances with ``mirror``."""
    if _depends_on_axes(image):
        return None
    m, scene = image.model, image.scene
    signs = {f"{j.name}.{name}": sign for j in m.joints for name, sign in coordinate_signs(mirror_along("y"), j).items()}
    given = {
        field: {name: signs[name.removesuffix("_rate")] * value for name, value in getattr(scene, field).items()}
        for field in ("positions", "rates")
    }  # fmt: skip
    elements = mirror_elements(Elements(m.bodies, m.joints, m.forces, (), ()), "y")
    gx, gy, gz = m.gravity
    model = replace(m, bodies=elements.bodies, joints=elements.joints, forces=elements.forces, gravity=(gx, -gy, gz))
    return replace(image, model=model, scene=replace(scene, **given), Q=np.diag([1.0, -1.0, 1.0]))


def shifted(image: Image) -> Image | None:
    """By a metre or so; laws over places are not known."""
    if any(isinstance(force, BodyLoad) for force in image.model.forces):
        return None
    d = np.array([0.7, -1.3, 0.45])

    def point(v: Any) -> Any:
        return tuple(x + sympy.Float(s) for x, s in zip(v, d, strict=True))

    return replace(image, model=_moved(image.model, point, tuple, tuple), d=d)


def scaled(image: Image, length: float = 1.0, mass: float | None = None, time: float | None = None) -> Image | None:
    """In other units of length, mass and time; without others the mass goes with its cube, the time with its root, and gravity stays."""
    mu, tau = mass if mass is not None else length**3, time if time is not None else length**0.5
    t = sympy.Symbol("t", real=True)

    def factor(unit: str) -> float:
        force = mu * length / tau**2
        sizes = {"m": length, "rad": 1.0, "N": force, "N*m": force * length, "m/s": length / tau, "rad/s": 1 / tau}
        return sizes[unit]

    def law(value: Any, variables: Mapping[str, str], unit: str) -> Any:
        symbols = {sympy.Symbol(name, real=True): unit_of for name, unit_of in variables.items()}
        over = {s: s / sympy.Float(factor(u)) for s, u in symbols.items()} | {t: t / sympy.Float(tau)}
        return sympy.sympify(value).xreplace(over) * sympy.Float(factor(unit))

    def of_force(force: Force) -> Force:
        if isinstance(force, Bushing | BodyLoad):
            field, (along, about) = force.element.laws[0], force.element.forms
            forms = (along,) * 3 + (about,) * 3 if isinstance(force, Bushing) else (about if force.point is None else along,) * 3
            laws = [law(x, f.variables, f.unit) for x, f in zip(getattr(force, field), forms, strict=True)]
            return replace(force, **{field: tuple(laws)})
        return replace(force, law=law(force.law, force.variables.variables, force.variables.unit))

    def of_joint(joint: Joint) -> Joint:
        units = list(joint.element.units.values())
        guide = None if joint.guide is None else tuple(law(g, {}, u) for g, u in zip(joint.guide, units, strict=False))
        armature = joint.armature and joint.armature * sympy.Float(mu * (length**2 if units[0] == "rad" else 1))
        return replace(joint, guide=guide, pitch=joint.pitch and joint.pitch * sympy.Float(length), armature=armature)

    def size(entry: str) -> Any:
        joint, _, coordinate = entry.rpartition(".")
        units = next(j.element.units for j in image.model.joints if j.name == joint)
        return sympy.Float(factor(units.get(coordinate, "rad")))

    moved = _moved(image.model, lambda v: _times(length, v), tuple, lambda v: _times(mu * length**2, v))
    model = replace(
        moved, bodies=tuple(replace(b, mass=b.mass * sympy.Float(mu)) for b in moved.bodies),
        gravity=_times(length / tau**2, moved.gravity), joints=tuple(map(of_joint, moved.joints)),
        forces=tuple(map(of_force, moved.forces)),
    )  # fmt: skip
    s = image.scene
    scene = replace(
        s, end=s.end * tau, output_step=s.output_step * tau, positions={n: v * size(n) for n, v in s.positions.items()},
        rates={n: v * size(n) for n, v in s.rates.items()},
        inputs={n: sympy.sympify(v).xreplace({t: t / sympy.Float(tau)}) for n, v in s.inputs.items()},
    )  # fmt: skip
    return replace(image, model=model, scene=scene, length=length, time=tau)


def permuted(image: Image) -> Image:
    """Elements in the opposite order."""
    m = image.model
    return replace(image, model=replace(m, bodies=m.bodies[::-1], joints=m.joints[::-1], forces=m.forces[::-1]))


def renamed(image: Image) -> Image:
    """Names in the opposite order of the alphabet."""
    elements = sorted(e.name for e in (*image.model.bodies, *image.model.joints, *image.model.forces))
    names = {name: f"n{len(elements) - i:03d}" for i, name in enumerate(elements)}

    def walk(x: Any) -> Any:
        if isinstance(x, str):
            first, dot, rest = x.rpartition(".")
            return names.get(x) or (f"{names[first]}.{rest}" if dot and first in names else x)
        if isinstance(x, tuple) and type(x) is tuple:
            return tuple(map(walk, x))
        if isinstance(x, Mapping):
            return {walk(key): walk(value) for key, value in x.items()}
        if is_dataclass(x) and not isinstance(x, type):
            return replace(x, **{f.name: walk(getattr(x, f.name)) for f in fields(x) if f.name not in ("kind", "span", "coordinate")})
        return x

    m = image.model
    model = replace(m, bodies=walk(m.bodies), joints=walk(m.joints), forces=walk(m.forces))
    scene = replace(image.scene, **{n: walk(getattr(image.scene, n)) for n in ("positions", "rates", "switches")})
    return replace(image, model=model, scene=scene, names=names)


def swapped(image: Image) -> Image | None:
    """Base and follower of joints exchanged whose one coordinate then counts the other way, and of balls."""
    named = {name.rpartition(".")[0] for name in (*image.scene.positions, *image.scene.rates)} | {f.joint_of for f in image.model.forces}
    kinds = ("revolute", "prismatic", "spherical", "fixed", "screw")

    def of(joint: Joint) -> Joint:
        if joint.kind not in kinds or joint.name in named or joint.guide is not None:
            return joint
        return replace(joint, base=joint.follower, follower=joint.base, to=None if joint.to is None else joint.at, at=joint.to or joint.at)

    joints = tuple(map(of, image.model.joints))
    return None if joints == image.model.joints else replace(image, model=replace(image.model, joints=joints))


def recut(image: Image) -> Image | None:
    """One loop cut elsewhere: the first cut joint that the compiler chose is in the tree."""
    topology = derive(image.model, image.scene, ()).topology
    chosen = next((cut.name for cut in topology.cuts if cut.cut is None), None)
    if chosen is None:
        return None
    joints = tuple(replace(joint, cut=False) if joint.name == chosen else joint for joint in image.model.joints)
    return replace(image, model=replace(image.model, joints=joints))


def split(image: Image) -> Image:
    """The last body with mass in two welded halves."""
    m = image.model
    body = [b for b in m.bodies if not b.is_massless][-1]
    half = replace(body, mass=body.mass / 2, inertia=tuple(x / 2 for x in body.inertia))
    halves = [half, replace(half, name=f"{body.name}_half")]
    weld = Joint(
        name="weld_of_halves", kind="fixed", base=body.name, follower=halves[1].name, at=body.centre_of_mass, axes=(), to=None, pitch=None,
        cut=None, guide=None, span=m.span,
    )  # fmt: skip
    bodies = tuple(part for one in m.bodies for part in (halves if one is body else [one]))
    return replace(image, model=replace(m, bodies=bodies, joints=(*m.joints, weld)))


#: Factors of lengths, so many times as long.
SCALES = (1e-5, 1e-4, 1e-2, 1e2, 1e3, 1e4)

#: All transformations by name.
TRANSFORMATIONS: Mapping[str, Callable[[Image], Image | None]] = {
    "turned": turned, "mirrored": mirrored, "shifted": shifted, "permuted": permuted, "renamed": renamed, "swapped": swapped,
    "recut": recut, "split": split, **{f"scaled by {a:g}": partial(scaled, length=a) for a in SCALES},
    "other mass": partial(scaled, mass=1e-6, time=1.0), "other time": partial(scaled, mass=1.0, time=1e3),
}  # fmt: skip
