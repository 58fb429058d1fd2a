"""A model as an MJCF file, MuJoCo's own: bodies in each other, loops by ``<connect>`` and ``<weld>``, as `importing/mjcf.py` reads them.

MuJoCo closes loops and relations by springs, which are as stiff as its defaults have them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.export.robots import WORLD, Tree, text_of, variables_of
from cutjoint.model.errors import Problem
from cutjoint.model.expressions.choices import Case, Choice
from cutjoint.model.records import GROUND, Body, Force, Gear, Joint, Model, Scene

_TREE = {"fixed": "", "revolute": "hinge", "prismatic": "slide", "free": "free", "spherical": "ball"}
_SCALAR = ("revolute", "prismatic")
#: Kinds of joints that equality constraints can stand for.
CLOSINGS = frozenset({"fixed", "revolute", "spherical"})
#: The least principal moment by the largest, and by the mass of a point (m2): MuJoCo asks for some in bodies that move.
_LEAST, _POINT = 1e-12, 5e-13
_SMALLEST = 2e-15
#: Shares of several joints that differ by less are one.
_ROUNDING = 1e-12
#: The number of coefficients of a relation.
_POWERS = 5

Array = NDArray[np.float64]


def write_mjcf(model: Model, parameters: Mapping[str, float] | None = None) -> tuple[str, tuple[str, ...]]:
    """The file's text, and sentences of what it leaves out; ``parameters`` are values in SI units, by default the model's.
    Raises ModelError: bodies that nothing connects to the ground, bodies without mass that move, joints of kinds that MuJoCo does not have,
    gears that are no polynomial of the fourth degree."""
    writer = _Mjcf(model, parameters or {})
    return writer.text(), tuple(writer.left_out())


def closures(kind: str, name: str, bodies: tuple[str, str], anchors: tuple[Array, Array], axis: Array) -> Iterator[Element]:
    """The constraints of a joint that closes a loop: of a ball in a point, of a hinge in two, or of a weld.

    ``anchors`` are its place (3) in the frames of both bodies, whose axes are parallel; ``axis`` (3) is that of a hinge.  Points of a hinge
    are as far apart as the farther anchor is from its frame, m.
    """
    ends = {"body1": bodies[0], "body2": bodies[1]}
    if kind == "fixed":
        yield Element("weld", {"name": name, **ends, "anchor": text_of(anchors[1])})
        return
    yield Element("connect", {"name": name, **ends, "anchor": text_of(anchors[0])})
    if kind == "revolute":
        reach = max(float(np.linalg.norm(anchor)) for anchor in anchors) or 1.0
        yield Element("connect", {"name": f"{name}.axis", **ends, "anchor": text_of(anchors[0] + reach * axis)})


def couple(name: str, first: str, second: str, coefficients: Sequence[float]) -> Element:
    """The movement of the first joint is a polynomial of that of the second one, from the constant up."""
    values = [*coefficients, *[0.0] * (_POWERS - len(coefficients))]
    return Element("joint", {"name": name, "joint1": first, "joint2": second, "polycoef": " ".join(f"{x:.15g}" for x in values)})


class _Mjcf(Tree):
    """``_merged`` has bodies without mass between two joints: these are joints of one body in MuJoCo."""

    title = "MuJoCo"
    kinds = _TREE.keys(), CLOSINGS

    def __init__(self, model: Model, parameters: Mapping[str, float]) -> None:
        self._merged: dict[str, Joint] = {}
        super().__init__(model, parameters)
        self._unwritten = list[str]()
        self._pulled = dict[str, Element | None]()
        self._order = list[Joint]()

    def problems(self) -> Iterator[Problem]:
        """Elements that MuJoCo cannot say."""
        yield from super().problems()
        self._merged = dict(self._between())
        moving = {GROUND: False}
        for joint, parent, child in self.tree:
            moving[child] = moving[parent] or joint.kind != "fixed"
            body = self.bodies[child]
            if joint.kind == "free" and parent != GROUND:
                yield Problem(joint.span, f"joint '{joint.name}'", "a free joint of MuJoCo is one of the ground", "begin it there")
            if self._light(body) and child not in self._merged and (np.any(self.vector(body.inertia)) or joint.kind != "fixed"):
                message = "MuJoCo has no bodies without mass that move or have inertia"
                yield Problem(body.span, f"body '{child}'", message, f"give it some by --link-mass '{child}=KG'")
        for gear in self.model.gears:
            if gear.law is not None and self._polynomial(gear) is None:
                message = "is no polynomial of the fourth degree"
                yield Problem(gear.span, f"gear '{gear.name}'", message, "MuJoCo has no other laws; write such a one")

    def _light(self, body: Body) -> bool:
        return self.number(body.mass) == 0

    def _between(self) -> Iterator[tuple[str, Joint]]:
        """Bodies with neither mass nor anything on them but the joint before and one behind, each with the joint before."""
        held = {end for loop in self.loops for end in (loop.base, loop.follower)} | {marker.body for marker in self.model.markers}
        for joint, _, child in self.tree:
            behind = [j for j, parent, _ in self.tree if parent == child]
            body = self.bodies[child]
            plain = self._light(body) and not self.vector(body.inertia).any() and not body.visuals and child not in held
            if plain and len(behind) == 1 and {joint.kind, behind[0].kind} <= {*_SCALAR, "spherical"} and joint.kind in _SCALAR:
                yield child, joint

    def text(self) -> str:
        """The whole file."""
        root = Element("mujoco", model=self.model.name)
        SubElement(root, "compiler", angle="radian")
        SubElement(root, "option", gravity=text_of(self.vector(self.model.gravity)))
        meshes = [visual for body in self.model.bodies for visual in body.visuals if visual.mesh]
        if meshes:
            assets = SubElement(root, "asset")
            for number, visual in enumerate(meshes, 1):
                SubElement(assets, "mesh", name=f"mesh_{number}", file=visual.mesh, scale=text_of([visual.scale] * 3))
        self._meshes = {id(visual): f"mesh_{number}" for number, visual in enumerate(meshes, 1)}
        self._add_children(SubElement(root, "worldbody"), GROUND, np.zeros(3), [])
        pulls = list(self._tendon_actuators())
        self._add_equalities(root, [tendon for _, tendon, _ in pulls])
        self._pulled = {force: actuator if force == forces[0] else None for actuator, _, forces in pulls for force in forces}
        actuators = [element for force in self.model.force_elements if (element := self._drive(force)) is not None]
        for title, elements in (("actuator", actuators), ("keyframe", list(self._starts()))):
            if elements:
                SubElement(root, title).extend(elements)
        indent(root)
        return tostring(root, encoding="unicode") + "\n"

    def left_out(self) -> Iterator[str]:
        """Sentences of what has no place in the file, after `text`."""
        if self._unwritten:
            yield f"left out, since MJCF has linear springs, dampers, dry friction and drives of joints here: {', '.join(self._unwritten)}"
        if self._is_coupled() and any(scene.positions for scene in self.model.scenes.values()):
            yield "left out: where scenes start, since coordinates depend on each other"
        scalar = {f"{joint.name}.{name}" for joint, _, _ in self.tree if joint.kind in _SCALAR for name in joint.element.coordinates}
        if any(scene.positions.keys() - scalar for scene in self.model.scenes.values()):
            yield "left out: where free bodies and balls start"
        if any(scene.rates for scene in self.model.scenes.values()):
            yield "left out: speeds at which scenes start"

    # bodies and joints

    def _add_children(self, element: Element, parent: str, origin: Array, before: list[tuple[Joint, str]]) -> None:
        """The markers of a body and the bodies that the tree hangs on it; ``before`` are joints of bodies that are none in MuJoCo."""
        for marker in self.model.markers:
            if marker.body == parent:
                SubElement(element, "site", name=marker.name, pos=text_of(self.vector(marker.point) - origin))
        for joint, carrier, child in self.tree:
            if carrier != parent:
                continue
            joints = [*before, (joint, carrier)]
            if child in self._merged:
                self._add_children(element, child, origin, joints)
                continue
            place, body = self.origins[child], self.bodies[child]
            inside = SubElement(element, "body", name=child, pos=text_of(place - origin))
            for one, base in joints:
                self._joint(inside, one, base, self.vector(one.at) - place)
            self._inertial(inside, body, place, moves=any(one.kind != "fixed" for one, _ in joints))
            self._draw(inside, body, place)
            self._add_children(inside, child, place, [])

    def _joint(self, body: Element, joint: Joint, parent: str, place: Array) -> None:
        if joint.kind == "fixed":
            return
        self._order.append(joint)
        element = SubElement(body, "joint", name=joint.name, type=_TREE[joint.kind])
        if joint.kind in _SCALAR:
            element.set("axis", text_of(self.axis(joint, parent)))
        if place.any():
            element.set("pos", text_of(place))
        found = self.resistance(joint)
        values = {"stiffness": found.stiffness, "springref": found.rest, "damping": found.damping, "frictionloss": found.friction,
                  "armature": self.number(joint.armature)}  # fmt: skip
        for name, value in values.items():
            if value:
                element.set(name, repr(value))

    def _inertial(self, element: Element, body: Body, origin: Array, moves: bool) -> None:
        mass = self.number(body.mass)
        if not mass:
            return
        xx, yy, zz, xy, xz, yz = self.vector(body.inertia)
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        moments, axes = (np.diag(matrix), np.eye(3)) if not np.any([xy, xz, yz]) else np.linalg.eigh(matrix)
        least = max(_LEAST * moments.max() if moments.any() else _POINT * mass, _SMALLEST) if moves else 0.0
        place = text_of(self.vector(body.centre_of_mass) - origin)
        inertial = SubElement(element, "inertial", pos=place, mass=repr(mass), diaginertia=text_of(np.maximum(moments, least)))
        if np.any(axes != np.eye(3)):
            inertial.set("xyaxes", _axes(axes * np.sign(np.linalg.det(axes))))

    def _draw(self, element: Element, body: Body, origin: Array) -> None:
        for visual in body.visuals:
            if not visual.mesh:
                continue
            axes = np.array([self.vector(axis) for axis in visual.axes]).T
            geom = SubElement(element, "geom", type="mesh", mesh=self._meshes[id(visual)], pos=text_of(self.vector(visual.at) - origin))
            geom.attrib.update(xyaxes=_axes(axes), mass="0", contype="0", conaffinity="0")
            if visual.colour:
                geom.set("rgba", text_of([*(int(visual.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)), 1.0]))

    # relations

    def _add_equalities(self, root: Element, tendons: list[Element]) -> None:
        equalities = list[Element]()
        for loop in self.loops:
            equalities += self._closures(loop)
        for gear in self.model.gears:
            if not gear.others:
                coefficients = [0.0, self.number(gear.ratio)] if gear.law is None else self._polynomial(gear) or []
                equalities.append(couple(gear.name, gear.first.joint, gear.second.joint, coefficients))
                continue
            tendon = Element("fixed", name=f"{gear.name}.sum")
            for end, factor in gear.terms:
                SubElement(tendon, "joint", joint=end.joint, coef=repr(self.number(factor)))
            tendons.append(tendon)
            equalities.append(Element("tendon", name=gear.name, tendon1=f"{gear.name}.sum"))
        for title, elements in (("tendon", tendons), ("equality", equalities)):
            if elements:
                SubElement(root, title).extend(elements)

    def _closures(self, loop: Joint) -> Iterable[Element]:
        place, ends = self.vector(loop.at), (loop.base, loop.follower)
        anchors = place - self.origins[ends[0]], place - self.origins[ends[1]]
        axis = self.vector(loop.axes[0]) if loop.axes else np.zeros(3)
        names = body_name(ends[0]), body_name(ends[1])
        return closures(loop.kind, loop.name, names, anchors, axis)

    def _polynomial(self, gear: Gear) -> list[float] | None:
        """The coefficients of a gear's law from the constant up, None where it is no polynomial that MuJoCo has."""
        position, _ = variables_of(gear.law)
        law = sympy.sympify(gear.law)
        if not law.is_polynomial(position) or not self.is_number(law.subs(position, 0)):
            return None
        coefficients = sympy.Poly(law, position).all_coeffs()[::-1]
        return [self.number(c) for c in coefficients] if len(coefficients) <= _POWERS and all(map(self.is_number, coefficients)) else None

    # drives and starts

    def _drive(self, force: Force) -> Element | None:
        """The actuator of a force that an input drives; of several, of the first. None, with a note, if an unsupported force resists
        nothing."""
        if force.name in self._pulled:
            return self._pulled[force.name]
        found = self._actuator(force)
        if found is None and not self.is_resistance(force):
            self._unwritten.append(force.name)
        return found

    def _actuator(self, force: Force) -> Element | None:
        law = sympy.sympify(getattr(force, "law", None) or 0)
        position, rate = variables_of(law)
        return self._servo(law, {"joint": force.joint_of}, {position: 1.0}, {rate: 1.0}) if force.joint_of else None

    def _tendon_actuators(self) -> Iterator[tuple[Element, Element, list[str]]]:
        """Actuators of signals that pull several joints, each by its share; with the tendon and the names of the forces."""
        scalar = {joint.name: joint for joint, _, _ in self.tree if joint.kind in _SCALAR}
        for signal in self.model.signals:
            forces = [force for force in self.model.force_elements if force.joint_of in scalar]
            laws = {force: sympy.sympify(getattr(force, "law", None) or 0) for force in forces}
            shares = {force.name: (force.joint_of, law / signal.symbol) for force, law in laws.items() if signal.symbol in law.free_symbols}
            if not shares or not all(self.is_number(share) for _, share in shares.values()):
                continue
            joints = {joint: self.number(share) for joint, share in shares.values()}
            names = {joint: f"@{joint}.{scalar[joint].element.coordinates[0]}" for joint in joints}
            ways = [{sympy.Symbol(f"{names[joint]}{end}", real=True): share for joint, share in joints.items()} for end in ("", "_rate")]
            if len(joints) == len(shares) and (actuator := self._servo(signal.value, {"tendon": signal.name}, *ways)) is not None:
                tendon = Element("fixed", name=signal.name)
                tendon.extend(Element("joint", joint=joint, coef=repr(share)) for joint, share in joints.items())
                yield actuator, tendon, list(shares)

    def _servo(self, law: Any, target: Mapping[str, str], places: Mapping[Any, float], rates: Mapping[Any, float]) -> Element | None:
        """The law is factor * clamp(gain * clamp(input) + bias + derivatives by position and rate), without what is 0, 1 or no bound there.

        Position and rate are sums of symbols times their factors.  None of a law that is not like this, or has another number of inputs.
        """
        inputs = [symbol for symbol in law.free_symbols if symbol in self.inputs]
        if len(inputs) != 1:
            return None
        attributes = {"name": self.inputs[inputs[0]].name, **target}
        factor, inner = law.as_coeff_Mul()
        gear = 1.0
        if (clamp := self._clamp(inner)) and inputs[0] in clamp[2].free_symbols and clamp[2] != inputs[0]:
            gear, law = float(factor), clamp[2]
            attributes |= {"forcelimited": "true", "forcerange": text_of(clamp[:2])}
        control = inputs[0]
        for part in law.atoms(Choice):
            if (clamp := self._clamp(part)) and clamp[2] == control:
                attributes |= {"ctrllimited": "true", "ctrlrange": text_of(clamp[:2])}
                control = sympy.Dummy(real=True)
                law = law.xreplace({part: control})
        values = self.linear(law, (control, *places, *rates))
        if values is None:
            return None
        constant, gain = values[:2]
        position, rate = (_common(values[2:][: len(places)], places.values()), _common(values[2:][len(places) :], rates.values()))
        if position is None or rate is None:
            return None
        if self.inputs[inputs[0]].unit and gear == 1 and not any((constant, position, rate)):
            return Element("motor", {**attributes, "gear": repr(gain)})
        attributes |= {"gear": repr(gear), "gaintype": "fixed", "gainprm": repr(gain)}
        scaled = " ".join(map(repr, (constant, position / gear, rate / gear)))
        return Element("general", {**attributes, "biastype": "affine", "biasprm": scaled})

    def _clamp(self, law: Any) -> tuple[float, float, Any] | None:
        """The bounds of max(low, min(high, inner)), and the inner law; None of any other."""
        if not (isinstance(law, Choice) and len(law.args) == 2 and isinstance(law.args[1].args[0], Choice)):
            return None
        low, inside = law.args[0].args[0], law.args[1].args[0]
        if len(inside.args) != 2 or not (self.is_number(low) and self.is_number(high := inside.args[0].args[0])):
            return None
        inner = inside.args[1].args[0]
        smaller = Choice(Case(high, sympy.Le(high, inner)), Case(inner, sympy.true))
        if law != Choice(Case(low, sympy.Ge(low, smaller)), Case(smaller, sympy.true)):
            return None
        return self.number(low), self.number(high), inner

    def _is_coupled(self) -> bool:
        return bool(self.loops or self.model.gears)

    def _starts(self) -> Iterator[Element]:
        """A key of each scene that begins elsewhere."""
        for name, scene in self.model.scenes.items():
            if scene.positions and not self._is_coupled():
                values = [value for joint in self._order for value in self._coordinates(joint, scene)]
                yield Element("key", name=name, qpos=text_of(values))

    def _coordinates(self, joint: Joint, scene: Scene) -> list[float]:
        still = {"free": [*self.vector(joint.at), 1.0, 0.0, 0.0, 0.0], "spherical": [1.0, 0.0, 0.0, 0.0]}
        return still.get(joint.kind) or [self.number(scene.positions.get(f"{joint.name}.{joint.element.coordinates[0]}", 0))]


def _common(derivatives: Sequence[float], factors: Iterable[float]) -> float | None:
    """The number by which all derivatives are their factors, None where there is none."""
    shares = [derivative / factor for derivative, factor in zip(derivatives, factors, strict=True)]
    return shares[0] if np.ptp(shares) <= _ROUNDING * np.abs(shares).max() else None


def body_name(name: str) -> str:
    """A body's name in MuJoCo."""
    return WORLD if name == GROUND else name


def _axes(rotation: Array) -> str:
    """The first two columns of a rotation (3 by 3)."""
    return " ".join(repr(float(part) + 0.0) for part in rotation.T[:2].ravel())
