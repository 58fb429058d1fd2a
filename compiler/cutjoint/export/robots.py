"""A model as files of robots say it: a tree of bodies, joints that close loops, resistances and drives of joints.  URDF is written here.

All frames have the global axes of the design position, in which all coordinates are zero.  A URDF has the tree by ``<joint>``, loops and
relations by ``<loop>`` and ``mimic``, as `importing/urdf.py` reads them.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, ClassVar
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import GROUND, BallSpring, Binding, Body, Force, Gear, Joint, JointFriction, Model

_TREE = {"fixed": "fixed", "revolute": "continuous", "prismatic": "prismatic", "free": "floating", "spherical": "spherical"}
_LOOPS = {"fixed": "fixed", "revolute": "revolute", "prismatic": "prismatic", "spherical": "spherical"}
#: The body on which all others stand.
WORLD = "world"
#: The range of slides, m, and bounds of force (N) and speed (m/s), which readers ask for; nothing heeds them.
_LIMITS = {"lower": "-1000", "upper": "1000", "effort": "1000000", "velocity": "1000"}


def write_urdf(model: Model, parameters: Mapping[str, float] | None = None) -> tuple[str, tuple[str, ...]]:
    """The file's text, and sentences of what it leaves out; ``parameters`` are values in SI units, by default the model's.
    Raises ModelError: bodies that nothing connects to the ground, joints of kinds that URDF does not have, armatures, gears that are
    neither mimic joints nor couplings."""
    writer = _Urdf(model, parameters or {})
    return writer.text(), tuple(writer.left_out())


@dataclass(frozen=True)
class Resistance:
    """Resistance of a coordinate.
    ``stiffness`` (N m/rad or N/m) from ``rest`` (rad or m), ``damping`` (N m s or N s/m), dry ``friction`` (N m or N)."""

    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0


class Tree:
    """A model's bodies, each hung on the first joint, in the file's order, whose other body hangs already; the other joints close loops.

    ``tree`` has these joints with parents and children, ``loops`` the others, ``origins`` (3) by bodies the places of their joints, m.
    """

    title: ClassVar[str]
    #: Kinds of joints of the tree and of loops.
    kinds: ClassVar[tuple[Set[str], Set[str]]]

    def __init__(self, model: Model, parameters: Mapping[str, float]) -> None:
        self.model = model
        self.numbers = {p.symbol: parameters.get(p.name, p.value) for p in model.parameters if p.binding is not Binding.INPUT}
        self.inputs = {p.symbol: p for p in model.parameters if p.binding is Binding.INPUT}
        self.bodies = {body.name: body for body in model.bodies}
        self._build_tree(model.joints)
        if hard := [joint for joint in self.loops if joint.kind not in self.kinds[1] and joint.kind in self.kinds[0]]:
            self._build_tree([*hard, *(joint for joint in model.joints if joint not in hard)])
        if problems := list(self.problems()):
            raise ModelError(problems)

    def _build_tree(self, joints: Sequence[Joint]) -> None:
        self.origins = {GROUND: np.zeros(3)}
        self.tree: list[tuple[Joint, str, str]] = []
        self.loops: list[Joint] = []
        waiting = list(joints)
        while waiting:
            ready = next((j for j in waiting if j.base in self.origins or j.follower in self.origins), None)
            if ready is None:
                name = f"joint '{waiting[0].name}'"
                raise ModelError([Problem(waiting[0].span, name, "is attached to nothing", "connect it to the ground")])
            waiting.remove(ready)
            if ready.base in self.origins and ready.follower in self.origins:
                self.loops.append(ready)
                continue
            parent, child = (ready.base, ready.follower) if ready.base in self.origins else (ready.follower, ready.base)
            self.tree.append((ready, parent, child))
            self.origins[child] = self.vector(ready.at)

    def problems(self) -> Iterator[Problem]:
        """Elements that the format cannot say."""
        for joints, kinds in zip(([j for j, _, _ in self.tree], self.loops), self.kinds, strict=True):
            for j in joints:
                if j.kind not in kinds:
                    message = f"{self.title} has no joint of kind {j.kind} there"
                    yield Problem(j.span, f"joint '{j.name}'", message, f"write it by joints that {self.title} has")
                elif j.guide is not None:
                    yield Problem(j.span, f"joint '{j.name}'", f"{self.title} has no guides", "leave the guide out")
        closing = {joint.name for joint in self.loops}
        for gear in self.model.gears:
            if found := closing.intersection(gear.joints):
                message = f"relates '{min(found)}', which closes a loop"
                yield Problem(gear.span, f"gear '{gear.name}'", message, "write another joint of its loop last")
        for word, elements in (("body", self.model.bodies), ("marker", self.model.markers)):
            for element in elements:
                if element.name == WORLD:
                    yield Problem(element.span, f"{word} '{WORLD}'", f"{self.title} calls the ground so", "rename it")

    def number(self, value: Any) -> float:
        """The value of an expression over parameters."""
        return float(evaluate(sympy.sympify(value), self.numbers))

    def vector(self, values: Sequence[Any]) -> NDArray[np.float64]:
        """The values of expressions."""
        return np.array([self.number(x) for x in values])

    def axis(self, joint: Joint, parent: str) -> NDArray[np.float64]:
        """The direction (3) about or along which a child moves beside its parent."""
        return (1 if parent == joint.base else -1) * self.vector(joint.axes[0])

    def is_number(self, value: Any) -> bool:
        """Return whether an expression depends on parameters alone."""
        return not sympy.sympify(value).free_symbols - self.numbers.keys()

    def linear(self, law: Any, variables: Sequence[Any]) -> list[float] | None:
        """The value of a law where all variables are zero, and its derivatives by each; None if it is not linear in them."""
        if not law.is_polynomial(*variables):
            return None
        derivatives = [law.diff(variable) for variable in variables]
        constant = law.subs(dict.fromkeys(variables, 0))
        return [self.number(x) for x in (constant, *derivatives)] if all(map(self.is_number, (constant, *derivatives))) else None

    def resistance(self, joint: Joint) -> Resistance:
        """The sum of what resists a joint's coordinate."""
        found = [r for force in self.model.force_elements if joint_of(force) == joint.name and (r := self.as_resistance(force))]
        stiffness = sum(r.stiffness for r in found)
        rest = sum(r.stiffness * r.rest for r in found) / stiffness if stiffness else 0.0
        return Resistance(stiffness, rest, sum(r.damping for r in found), sum(r.friction for r in found))

    def is_resistance(self, force: Force) -> bool:
        """Return whether a force is written as the resistance of a joint of the tree; a joint that closes a loop has none."""
        return any(joint.name == joint_of(force) for joint, _, _ in self.tree) and self.as_resistance(force) is not None

    def as_resistance(self, force: Force) -> Resistance | None:
        """A force with the law -k (position - rest) - c rate, or friction of a constant size; None of any other."""
        if isinstance(force, BallSpring):
            found = Resistance(self.number(force.stiffness), 0.0, self.number(force.damping))
            return found if force.axes == GLOBAL_AXES or not found.stiffness else None
        law = getattr(force, "law", None)
        if isinstance(force, JointFriction):
            constant = not force.carried and force.bristle.limit.is_polynomial() and self.is_number(force.bristle.limit * force.preload)
            return Resistance(friction=self.number(force.bristle.limit * force.preload)) if constant else None
        if not force.joint_of or law is None:
            return None
        position, rate = variables_of(law)
        if values := self.linear(sympy.sympify(law), (position, rate)):
            constant, stiffness, damping = values
            if stiffness:
                return Resistance(-stiffness, -constant / stiffness, -damping)
            return Resistance(damping=-damping) if not constant else None
        return None


def joint_of(force: Force) -> str:
    """The joint on whose coordinate or turns a force acts, "" for none."""
    return force.of if isinstance(force, BallSpring) else force.joint_of


def variables_of(law: Any) -> tuple[Any, Any]:
    """The symbols of position and rate in a law."""
    symbols = {symbol.name: symbol for symbol in sympy.sympify(law).free_symbols}
    position, rate = (symbols.get(name, sympy.Symbol(name, real=True)) for name in ("position", "rate"))
    return position, rate


class _Urdf(Tree):
    title = "URDF"
    kinds = _TREE.keys(), _LOOPS.keys()

    def __init__(self, model: Model, parameters: Mapping[str, float]) -> None:
        super().__init__(model, parameters)
        self._unwritten: list[str] = []

    def problems(self) -> Iterator[Problem]:
        """Elements that URDF cannot say."""
        yield from super().problems()
        for j in self.model.joints:
            if j.armature != 0:
                yield Problem(j.span, f"joint '{j.name}'", "URDF has no armature", "leave it out, or export to mjcf")
        for gear in self.model.gears:
            if gear.law is not None or (gear.others and not self._coupling(gear)):
                hint = "relate two joints, or turns of two bodies, by a ratio"
                yield Problem(gear.span, f"gear '{gear.name}'", "URDF has no such relation", hint)

    def text(self) -> str:
        """The whole file."""
        root = Element("robot", name=self.model.name)
        SubElement(root, "link", name=WORLD)
        for _, _, child in self.tree:
            self._link(root, self.bodies[child])
        for joint, parent, child in self.tree:
            self._joint(root, joint, parent, child)
        for marker in self.model.markers:
            link = SubElement(root, "link", name=marker.name)
            place = SubElement(root, "joint", name=f"{marker.name}_place", type="fixed")
            self._ends(place, marker.body, link.get("name", ""), self.vector(marker.point) - self.origins[marker.body])
        for loop in self.loops:
            self._loop(root, loop)
        for gear in self.model.gears:
            if not self._mimics(gear) and (coupling := self._coupling(gear)):
                first, second, ratio = coupling
                element = SubElement(root, "coupling", name=gear.name)
                SubElement(element, "predecessor", link=first)
                SubElement(element, "successor", link=second)
                SubElement(element, "ratio", value=repr(ratio))
        for force in self.model.force_elements:
            self._drive(root, force)
        indent(root)
        return tostring(root, encoding="unicode") + "\n"

    def left_out(self) -> Iterator[str]:
        """Sentences of what has no place in a URDF file, after `text`."""
        if self._unwritten:
            yield f"left out, since URDF has only dampers, dry friction and drives of joints: {', '.join(self._unwritten)}"
        if any(self.number(x) != y for x, y in zip(self.model.gravity, (0, 0, -9.81), strict=True)):
            yield "left out: gravity, which readers of URDF take as 9.81 m/s2 down"
        if any(scene.positions or scene.rates for scene in self.model.scenes.values()):
            yield "left out: where scenes start"

    def _link(self, root: Element, body: Body) -> None:
        link = SubElement(root, "link", name=body.name)
        mass, inertia = self.number(body.mass), self.vector(body.inertia)
        if mass or inertia.any():
            inertial = SubElement(link, "inertial")
            SubElement(inertial, "origin", xyz=text_of((self.vector(body.centre_of_mass) - self.origins[body.name]) * (mass != 0)))
            SubElement(inertial, "mass", value=repr(mass))
            values = {f"i{ij}": repr(float(x)) for ij, x in zip(("xx", "yy", "zz", "xy", "xz", "yz"), inertia, strict=True)}
            SubElement(inertial, "inertia", values)
        for visual in body.visuals:
            self._visual(link, visual, body)

    def _visual(self, link: Element, visual: Any, body: Body) -> None:
        element = SubElement(link, "visual")
        if visual.mesh:
            axes = np.array([self.vector(axis) for axis in visual.axes]).T
            pitch = np.arctan2(-axes[2, 0], np.hypot(axes[0, 0], axes[1, 0]))
            roll, yaw = np.arctan2(axes[2, 1], axes[2, 2]), np.arctan2(axes[1, 0], axes[0, 0])
            SubElement(element, "origin", xyz=text_of(self.vector(visual.at) - self.origins[body.name]), rpy=text_of([roll, pitch, yaw]))
            mesh = SubElement(SubElement(element, "geometry"), "mesh", filename=visual.mesh)
            mesh.set("scale", text_of([visual.scale] * 3))
        if visual.colour:
            parts = [int(visual.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
            SubElement(SubElement(element, "material", name=f"{body.name}_colour"), "color", rgba=text_of([*parts, 1.0]))

    def _ends(self, joint: Element, parent: str, child: str, place: NDArray[np.float64]) -> None:
        SubElement(joint, "parent", link=WORLD if parent == GROUND else parent)
        SubElement(joint, "child", link=child)
        SubElement(joint, "origin", xyz=text_of(place))

    def _joint(self, root: Element, joint: Joint, parent: str, child: str) -> None:
        element = SubElement(root, "joint", name=joint.name, type=_TREE[joint.kind])
        self._ends(element, parent, child, self.origins[child] - self.origins[parent])
        if joint.kind in ("revolute", "prismatic"):
            SubElement(element, "axis", xyz=text_of(self.axis(joint, parent)))
        if joint.kind == "prismatic":
            SubElement(element, "limit", _LIMITS)
        found = self.resistance(joint)
        if found.damping or found.friction:
            SubElement(element, "dynamics", damping=repr(found.damping), friction=repr(found.friction))
        for gear in self.model.gears:
            if gear.first.joint == joint.name and self._mimics(gear):
                SubElement(element, "mimic", joint=gear.second.joint, multiplier=repr(self.number(gear.ratio)), offset="0")
            elif gear.first.joint == joint.name:
                element.set("independent", "false")

    def _mimics(self, gear: Gear) -> bool:
        """Return whether a gear is a mimic joint: where its name says so, or no coupling would do."""
        return not gear.others and (gear.name == f"{gear.first.joint}_mimic" or not self._coupling(gear))

    def _coupling(self, gear: Gear) -> tuple[str, str, float] | tuple[()]:
        """The links and the ratio of a coupling; empty if no two links give the gear's equation.
        The equation is ratio times the joints before one link, less those before the other one, without their common part."""
        terms = {end.joint: self.number(factor) for end, factor in gear.terms}
        ends = [child for joint, _, child in self.tree if joint.name in terms]
        for second in ends:
            for first in ends:
                ways = [self._moving_joints(first), self._moving_joints(second)]
                mine, others = ([j for j in way if j not in ways[1 - i]] for i, way in enumerate(ways))
                if mine and others and {*mine, *others} == terms.keys() and terms[others[0]] == 1:
                    ratio = -terms[mine[0]]
                    if all(terms[j] == -ratio for j in mine) and all(terms[j] == 1 for j in others):
                        return first, second, ratio
        return ()

    def _moving_joints(self, link: str) -> list[str]:
        carried, way = {child: (joint, parent) for joint, parent, child in self.tree}, []
        while link in carried:
            joint, link = carried[link]
            way += [joint.name] if joint.kind != "fixed" else []
        return way

    def _loop(self, root: Element, joint: Joint) -> None:
        element, place = SubElement(root, "loop", name=joint.name, type=_LOOPS[joint.kind]), self.vector(joint.at)
        for tag, body in (("predecessor", joint.base), ("successor", joint.follower)):
            end = SubElement(element, tag, link=WORLD if body == GROUND else body)
            SubElement(end, "origin", xyz=text_of(place - self.origins[body]))
        if joint.axes:
            SubElement(element, "axis", xyz=text_of(self.vector(joint.axes[0])))

    def as_resistance(self, force: Force) -> Resistance | None:
        """A damper or dry friction."""
        found = super().as_resistance(force)
        return None if found is None or found.stiffness else found

    def _drive(self, root: Element, force: Force) -> None:
        """A drive of a force that is an input, else a note of one that is no resistance of a joint."""
        if force.joint_of and getattr(force, "law", None) in self.inputs:
            SubElement(SubElement(root, "transmission", name=force.name), "joint", name=force.joint_of)
        elif not self.is_resistance(force):
            self._unwritten.append(force.name)


def text_of(values: Any) -> str:
    """Numbers in a row, without the rounding of differences of coordinates."""
    return " ".join(repr(float(f"{x:.14g}") + 0.0) for x in values)
