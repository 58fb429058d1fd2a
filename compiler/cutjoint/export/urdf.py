"""A model as a URDF file: the tree by ``<joint>``, loops and relations by ``<loop>`` and ``mimic``, as `importing/urdf.py` reads them.

All frames have the global axes of the design position, in which all coordinates are zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.evaluate import evaluate
from cutjoint.model.records import GROUND, Binding, Body, Force, Gear, Joint, Model, Span

_TREE = {"fixed": "fixed", "revolute": "continuous", "prismatic": "prismatic", "free": "floating", "spherical": "spherical"}
_LOOPS = {"fixed": "fixed", "revolute": "revolute", "prismatic": "prismatic", "spherical": "spherical"}
_WORLD = "world"
#: The range of slides, m, and bounds of force (N) and speed (m/s), which readers ask for; nothing heeds them.
_LIMITS = {"lower": "-1000", "upper": "1000", "effort": "1000000", "velocity": "1000"}


def write_urdf(model: Model, parameters: Mapping[str, float] | None = None) -> tuple[str, tuple[str, ...]]:
    """The file's text, and sentences of what it leaves out; ``parameters`` are values in SI units, by default the model's.

    Raises:
        ModelError: bodies that nothing connects to the ground, joints of kinds that URDF does not have, armatures, gears that are neither
            mimic joints nor couplings.
    """
    writer = _Writer(model, parameters or {})
    return writer.text(), tuple(writer.left_out())


class _Writer:
    def __init__(self, model: Model, parameters: Mapping[str, float]) -> None:
        self._model = model
        self._numbers = {p.symbol: parameters.get(p.name, p.value) for p in model.parameters}
        self._bodies = {body.name: body for body in model.bodies}
        self._origins = {GROUND: np.zeros(3)}
        self._tree: list[tuple[Joint, str, str]] = []
        self._loops: list[Joint] = []
        self._span_tree()
        self._unwritten: list[str] = []
        self._require()

    def _span_tree(self) -> None:
        """Hang each body on the first joint, in the file's order, whose other body hangs already; the other joints close loops."""
        waiting = list(self._model.joints)
        while waiting:
            ready = next((j for j in waiting if j.base in self._origins or j.follower in self._origins), None)
            if ready is None:
                raise ModelError([_problem(waiting[0].span, f"joint '{waiting[0].name}'", "hangs on nothing", "connect it to the ground")])
            waiting.remove(ready)
            if ready.base in self._origins and ready.follower in self._origins:
                self._loops.append(ready)
                continue
            parent, child = (ready.base, ready.follower) if ready.base in self._origins else (ready.follower, ready.base)
            self._tree.append((ready, parent, child))
            self._origins[child] = self._vector(ready.at)

    def _require(self) -> None:
        """Raise ModelError for what URDF cannot say."""
        problems = [
            _problem(j.span, f"joint '{j.name}'", f"URDF has no joint of kind {j.kind} there", "write it by joints that URDF has")
            for joints, kinds in (((j for j, _, _ in self._tree), _TREE), (self._loops, _LOOPS)) for j in joints if j.kind not in kinds
        ]  # fmt: skip
        problems += [
            _problem(j.span, f"joint '{j.name}'", "URDF has no armature and no guides", "leave it out, or export to mujoco")
            for j in self._model.joints if j.armature != 0 or j.guide is not None
        ]  # fmt: skip
        problems += [
            _problem(gear.span, f"gear '{gear.name}'", "URDF has no such relation", "relate two joints, or turns of two bodies, by a ratio")
            for gear in self._model.gears if gear.law is not None or (gear.others and not self._coupling(gear))
        ]  # fmt: skip
        if problems:
            raise ModelError(problems)

    def text(self) -> str:
        """The whole file."""
        root = Element("robot", name=self._model.name)
        SubElement(root, "link", name=_WORLD)
        for _, _, child in self._tree:
            self._link(root, self._bodies[child])
        for joint, parent, child in self._tree:
            self._joint(root, joint, parent, child)
        for marker in self._model.markers:
            link = SubElement(root, "link", name=marker.name)
            place = SubElement(root, "joint", name=f"{marker.name}_place", type="fixed")
            self._ends(place, marker.body, link.get("name", ""), self._vector(marker.point) - self._origins[marker.body])
        for loop in self._loops:
            self._loop(root, loop)
        for gear in self._model.gears:
            if not self._mimics(gear) and (coupling := self._coupling(gear)):
                first, second, ratio = coupling
                element = SubElement(root, "coupling", name=gear.name)
                SubElement(element, "predecessor", link=first)
                SubElement(element, "successor", link=second)
                SubElement(element, "ratio", value=repr(ratio))
        for force in self._model.force_elements:
            self._drive(root, force)
        indent(root)
        return tostring(root, encoding="unicode") + "\n"

    def left_out(self) -> Iterator[str]:
        """Sentences of what has no place in a URDF file, after `text`."""
        if self._unwritten:
            yield f"left out, since URDF has only dampers, dry friction and drives of joints: {', '.join(self._unwritten)}"
        if any(self._number(x) != y for x, y in zip(self._model.gravity, (0, 0, -9.81), strict=True)):
            yield "left out: gravity, which readers of URDF take as 9.81 m/s2 down"
        if any(scene.positions or scene.rates for scene in self._model.scenes.values()):
            yield "left out: where scenes start"

    def _number(self, value: Any) -> float:
        return float(evaluate(sympy.sympify(value), self._numbers))

    def _vector(self, values: Sequence[Any]) -> NDArray[np.float64]:
        return np.array([self._number(x) for x in values])

    def _link(self, root: Element, body: Body) -> None:
        link = SubElement(root, "link", name=body.name)
        mass, inertia = self._number(body.mass), self._vector(body.inertia)
        if mass or inertia.any():
            inertial = SubElement(link, "inertial")
            SubElement(inertial, "origin", xyz=_text((self._vector(body.centre_of_mass) - self._origins[body.name]) * (mass != 0)))
            SubElement(inertial, "mass", value=repr(mass))
            values = {f"i{ij}": repr(float(x)) for ij, x in zip(("xx", "yy", "zz", "xy", "xz", "yz"), inertia, strict=True)}
            SubElement(inertial, "inertia", values)
        for visual in body.visuals:
            self._visual(link, visual, body)

    def _visual(self, link: Element, visual: Any, body: Body) -> None:
        element = SubElement(link, "visual")
        if visual.mesh:
            axes = np.array([self._vector(axis) for axis in visual.axes]).T
            pitch = np.arctan2(-axes[2, 0], np.hypot(axes[0, 0], axes[1, 0]))
            roll, yaw = np.arctan2(axes[2, 1], axes[2, 2]), np.arctan2(axes[1, 0], axes[0, 0])
            SubElement(element, "origin", xyz=_text(self._vector(visual.at) - self._origins[body.name]), rpy=_text([roll, pitch, yaw]))
            mesh = SubElement(SubElement(element, "geometry"), "mesh", filename=visual.mesh)
            mesh.set("scale", _text([visual.scale] * 3))
        if visual.colour:
            parts = [int(visual.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
            SubElement(SubElement(element, "material", name=f"{body.name}_colour"), "color", rgba=_text([*parts, 1.0]))

    def _ends(self, joint: Element, parent: str, child: str, place: NDArray[np.float64]) -> None:
        SubElement(joint, "parent", link=_WORLD if parent == GROUND else parent)
        SubElement(joint, "child", link=child)
        SubElement(joint, "origin", xyz=_text(place))

    def _joint(self, root: Element, joint: Joint, parent: str, child: str) -> None:
        element = SubElement(root, "joint", name=joint.name, type=_TREE[joint.kind])
        self._ends(element, parent, child, self._origins[child] - self._origins[parent])
        if joint.kind in ("revolute", "prismatic"):
            sign = 1 if parent == joint.base else -1
            SubElement(element, "axis", xyz=_text(sign * self._vector(joint.axes[0])))
        if joint.kind == "prismatic":
            SubElement(element, "limit", _LIMITS)
        damping, friction = self._resistance(joint)
        if damping or friction:
            SubElement(element, "dynamics", damping=repr(damping), friction=repr(friction))
        for gear in self._model.gears:
            if gear.first.joint == joint.name and self._mimics(gear):
                SubElement(element, "mimic", joint=gear.second.joint, multiplier=repr(self._number(gear.ratio)), offset="0")
            elif gear.first.joint == joint.name:
                element.set("independent", "false")

    def _mimics(self, gear: Gear) -> bool:
        """Return whether a gear is a mimic joint: where its name says so, or no coupling would do."""
        return not gear.others and (gear.name == f"{gear.first.joint}_mimic" or not self._coupling(gear))

    def _coupling(self, gear: Gear) -> tuple[str, str, float] | tuple[()]:
        """The links and the ratio of a coupling: ratio times the joints before one link, less those before the other one, beyond their
        common way; empty where no two links give the gear's equation."""
        terms = {end.joint: self._number(factor) for end, factor in gear.terms}
        ends = [child for joint, _, child in self._tree if joint.name in terms]
        for second in ends:
            for first in ends:
                ways = [self._way(first), self._way(second)]
                mine, others = ([j for j in way if j not in ways[1 - i]] for i, way in enumerate(ways))
                if mine and others and {*mine, *others} == terms.keys() and terms[others[0]] == 1:
                    ratio = -terms[mine[0]]
                    if all(terms[j] == -ratio for j in mine) and all(terms[j] == 1 for j in others):
                        return first, second, ratio
        return ()

    def _way(self, link: str) -> list[str]:
        """The moving joints between the ground and a body."""
        carried, way = {child: (joint, parent) for joint, parent, child in self._tree}, []
        while link in carried:
            joint, link = carried[link]
            way += [joint.name] if joint.kind != "fixed" else []
        return way

    def _resistance(self, joint: Joint) -> tuple[float, float]:
        """Damping (N m s or N s/m) and dry friction (N m or N) of a joint's forces."""
        damping = friction = 0.0
        for force in self._model.force_elements:
            if force.joint_of == joint.name and (found := self._resisting(force)):
                damping, friction = damping + found[0], friction + found[1]
        return damping, friction

    def _resisting(self, force: Force) -> tuple[float, float] | None:
        """Damping and friction of a force whose law is -c rate or -F tanh(rate/0.01), None of any other."""
        law, rate = sympy.sympify(getattr(force, "law", None) or 0), sympy.Symbol("rate", real=True)
        symbol = next((s for s in law.free_symbols if s.name == "rate"), rate)
        slope = law.diff(symbol)
        if not slope.free_symbols - self._numbers.keys() and law.subs(symbol, 0) == 0:
            return -self._number(slope), 0.0
        steps = law.atoms(sympy.tanh)
        if len(steps) == 1 and not (factor := law / next(iter(steps))).free_symbols - self._numbers.keys():
            return 0.0, -self._number(factor)
        return None

    def _loop(self, root: Element, joint: Joint) -> None:
        element, place = SubElement(root, "loop", name=joint.name, type=_LOOPS[joint.kind]), self._vector(joint.at)
        for tag, body in (("predecessor", joint.base), ("successor", joint.follower)):
            end = SubElement(element, tag, link=_WORLD if body == GROUND else body)
            SubElement(end, "origin", xyz=_text(place - self._origins[body]))
        if joint.axes:
            SubElement(element, "axis", xyz=_text(self._vector(joint.axes[0])))

    def _drive(self, root: Element, force: Force) -> None:
        """A drive of a force that is an input, else a note of one that is no resistance of a joint."""
        inputs = {p.symbol for p in self._model.parameters if p.binding is Binding.INPUT}
        if force.joint_of and getattr(force, "law", None) in inputs:
            SubElement(SubElement(root, "transmission", name=force.name), "joint", name=force.joint_of)
        elif not (force.joint_of and self._resisting(force)):
            self._unwritten.append(force.name)


def _problem(span: Span, element: str, message: str, hint: str) -> Problem:
    return Problem(span=span, element=element, message=message, hint=hint)


def _text(values: Any) -> str:
    return " ".join(repr(float(f"{x:.14g}") + 0.0) for x in values)
