"""Planar mechanisms: joints are replaced by planar ones, and constraints of cut joints normal to the plane are dropped.

Joints that rotate about the plane's normal or slide normal to it confine bodies to the plane under any load.  Other bodies, such as a rod
between balls, stay there if they and everything attached to them are symmetric about the plane: each part is
its own reflection, and nothing pushes it out of the plane.  Columns of the mechanism in its plane stand for those of the whole one.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, fields, replace

import sympy

from cutjoint.elements.force import Mirror
from cutjoint.elements.joint import ATTITUDE, Direction
from cutjoint.formulate.quantities import needs_place
from cutjoint.model.elements.build import Elements
from cutjoint.model.elements.mirror import ANGLES, coordinate_signs, mirror_elements
from cutjoint.model.expressions.evaluate import evaluate, substitute
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES, reaction_component, reported_element
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import (
    COORDINATES,
    GROUND,
    Binding,
    Force,
    Joint,
    JointForce,
    JointKind,
    Model,
    Output,
    Reaction,
    Scalar,
    Scene,
    Vector,
)
from cutjoint.reduce.plane import AsymmetryError, InPlane, Plane, is_same, is_zero, restrict
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import reached

_PARALLEL = 1e-12  #: sine of the angle within which directions given in digits count as parallel

_ROTATIONS = (JointKind.REVOLUTE, JointKind.PLANAR)
_MIRRORED = {"mass": "mass", "centre_of_mass": "centre of mass", "inertia": "inertia"}  #: fields of a body that a reflection keeps
#: Fields of a force that say who it is and what it acts on.
_NAMING = frozenset({"name", "span", "active", "base", "follower", "body"})


def drop_idle_equations(model: Model, scene: Scene) -> Outcome:
    """The pass: cut revolute joints of plane loops become points on their axes, where nobody asks for a reaction in the loop."""
    topology, outcome = build_topology(model), Outcome(model=model, scene=scene)
    values = {p.symbol: p.value for p in model.parameters if p.binding is Binding.CONST}
    joint_of = topology.joint_of
    for loop in topology.loops:
        cut = next(joint for joint in topology.cuts if joint.name == loop.cut)
        if cut.kind is not JointKind.REVOLUTE:
            continue
        others = [joint_of[body].joint for body in loop.bodies]
        odd = next((j for j in others if not _moves_across(j, cut.axes[0], values)), None)
        names = {cut.name, *(j.name for j in others)}
        sensor = next((r for r in model.reactions if getattr(r, "joint", "") in names), None)
        if odd is None and sensor is None:
            free = replace(cut, kind=JointKind.POINT_ON_LINE)
            freed = replace(outcome.model, joints=tuple(free if j.name == cut.name else j for j in outcome.model.joints))
            note = Note(element=cut.name, text="needs two of its equations: its loop moves in a plane", span=cut.span)
            outcome = replace(outcome, model=freed, done=(*outcome.done, note))
        else:
            why = f"'{odd.name}' leaves the plane" if odd is not None else f"'{sensor.name}' is a reaction in its loop"  # type: ignore[union-attr]
            note = Note(element=cut.name, text=f"keeps its five equations: {why}", span=cut.span)
            outcome = replace(outcome, left=(*outcome.left, note))
    return outcome


def _moves_across(joint: Joint, normal: Vector, values: dict[object, float]) -> bool:
    """Return whether a joint moves parallel to a plane of this normal: it rotates about the normal or slides across it."""
    if joint.kind is JointKind.FIXED:
        return True
    if joint.kind in _ROTATIONS:
        return all(abs(x) <= _PARALLEL for x in _numbers(sympy.Matrix(joint.axes[0]).cross(sympy.Matrix(normal)), values))
    if joint.kind is not JointKind.PRISMATIC:
        return False
    along = sum((x * y for x, y in zip(joint.axes[0], normal, strict=True)), sympy.Integer(0))
    return abs(_numbers([along], values)[0]) <= _PARALLEL


def _numbers(expressions: object, values: dict[object, float]) -> list[float]:
    return [evaluate(sympy.sympify(e), values) for e in expressions]  # type: ignore[attr-defined]


def flatten(model: Model, scene: Scene) -> Outcome:
    """The pass: a mechanism that moves in planes parallel to y = 0, x = 0 or z = 0 gets planar coordinates.
    ``left`` says why one stays of which joints hold a body in a plane."""
    left: list[Note] = []
    for plane in (Plane(axis=axis) for axis in "yxz"):
        confined = reached((j.base, j.follower) for j in model.joints if _holds(j, plane))
        try:
            return _flatten(model, scene, plane, confined)
        except AsymmetryError as error:
            left += [replace(error.note, text=f"{error.note.text}: it may leave the plane")] if confined != {GROUND} else []
    return Outcome(model=model, scene=scene, left=tuple(left[:1]))


def _holds(joint: Joint, plane: Plane) -> bool:
    """Return whether a joint keeps the planes of its bodies parallel and at constant distance."""
    match joint.kind:
        case JointKind.FIXED:
            return True
        case JointKind.REVOLUTE | JointKind.PLANAR:
            return plane.along_normal(joint.axes[0])
        case JointKind.PRISMATIC:
            return plane.within(joint.axes[0])
    return False


def _flatten(model: Model, scene: Scene, plane: Plane, confined: Collection[str]) -> Outcome:
    """The model in a plane. Raises AsymmetryError: something may leave it, or no joint kind stands for what is left of a joint."""
    loose = [b.name for b in model.bodies if b.name not in confined]
    if loose:
        require_own_images(model, scene, plane, loose)
    cuts = {joint.name for joint in build_topology(model).cuts}
    in_plane = {j.name: _restricted(j, plane) for j in model.joints if j.name not in cuts}
    made = PlaneModel(model=model, plane=plane, in_plane=in_plane)
    changed = made.scene(scene)
    flat = made.flat(changed)
    kinds = [(joint, in_plane[joint.name].joint.kind) for joint in model.joints if joint.name in in_plane]
    notes = tuple(
        Note(element=j.name, text=f"moves in the plane {plane} alone: a {kind} joint in place of a {j.kind} one", span=j.span)
        for j, kind in kinds if kind is not j.kind
    )  # fmt: skip
    if not notes:
        return Outcome(model=model, scene=scene)
    flat = replace(flat, joints=tuple(replace(j, cut=True) if j.name in cuts else j for j in flat.joints))
    return Outcome(model=flat, scene=changed, done=notes)


def _restricted(joint: Joint, plane: Plane) -> InPlane:
    """A joint of the tree with its motions in the plane; guides of the others must be zero."""
    found = restrict(joint, plane)
    for coordinate, guide in zip(COORDINATES[joint.kind], joint.guide or (), strict=False):
        if coordinate not in found.kept and not is_zero(guide):
            raise AsymmetryError(joint.name, f"has a guide of its {coordinate} that moves it out of the plane {plane}", joint.span)
    return found


@dataclass(frozen=True, kw_only=True)
class PlaneModel:
    """A model whose tree joints have the motions in a plane alone, ``in_plane`` by name."""

    model: Model
    plane: Plane
    in_plane: Mapping[str, InPlane]

    def scene(self, scene: Scene) -> Scene:
        """A scene of it. Raises AsymmetryError: the scene leaves the plane, or asks for what a plane model does not determine."""
        tyres = any(f.has_road and scene.switches.get(f.name, f.active) for f in self.model.forces)
        if tyres and scene.road.parts:
            what = "a surface" if "surface" in scene.road.parts else "patches of friction"
            raise AsymmetryError(scene.name, f"has {what} on its road, which need not be symmetric", scene.span)
        return replace(
            scene, positions=self._states(scene.positions), rates=self._states(scene.rates),
            switches={name: is_on for name, is_on in scene.switches.items() if name not in self._idle},
            outputs=tuple(self._output(o) for o in scene.outputs),
        )  # fmt: skip

    def flat(self, scene: Scene) -> Model:
        """The model, with its ``scene`` alone."""
        joints = tuple(self.in_plane[j.name].joint if j.name in self.in_plane else j for j in self.model.joints)
        return replace(self.model, joints=joints, forces=tuple(self._forces()), scenes={scene.name: scene})

    @property
    def _idle(self) -> frozenset[str]:
        """The forces on coordinates that would leave the plane."""
        forces = (f for f in self.model.forces if f.joint_of in self.in_plane)
        return frozenset(f.name for f in forces if f.coordinate_of not in self.in_plane[f.joint_of].kept)

    def _forces(self) -> Iterator[Force]:
        idle = self._idle
        for force in (f for f in self.model.forces if f.name not in idle):
            if isinstance(force, JointForce) and force.joint in self.in_plane:
                name, sign = self.in_plane[force.joint].kept[force.coordinate]
                yield replace(force, coordinate=name, law=Mirror.reflected(force.law, sign))
            else:
                yield force

    def _states(self, states: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Initial coordinates or speeds by "joint.component"."""
        found: dict[str, Scalar] = {}
        for key, value in states.items():
            name, _, component = key.rpartition(".")
            joint = next(j for j in self.model.joints if j.name == name)
            if component in ATTITUDE:
                raise AsymmetryError(name, "starts with an attitude, which the pass does not compare", joint.span)
            if name not in self.in_plane:
                found[key] = value
            elif component in (kept := self.in_plane[name].kept):
                found[f"{name}.{kept[component][0]}"] = kept[component][1] * value
            elif not is_zero(value):
                raise AsymmetryError(name, f"starts with a {component} that leaves the plane {self.plane}", joint.span)
        return found

    def _output(self, output: Output) -> Output:
        match reported_element(self.model, output):
            case Reaction() as reaction if reaction.joint in self.in_plane:
                is_moment, direction = reaction_component(reaction, output.quantity)
                if not (self.plane.along_normal(direction) if is_moment else self.plane.within(direction)):
                    text = f"has the output {output.quantity}, which a model in the plane {self.plane} does not determine"
                    raise AsymmetryError(reaction.name, text, output.span)
            case Joint() as joint if joint.name in self.in_plane:
                return self._joint_output(joint, output)
            case Force() as force:
                if force.name in self._idle:
                    raise AsymmetryError(force.name, "is an output, but acts on bodies that rest in the plane", output.span)
                held = self.in_plane.get(force.joint_of) if output.quantity == "force" else None
                return _scaled(output, held.kept[force.coordinate_of][1] if held else 1, force.name)
        return output

    def _joint_output(self, joint: Joint, output: Output) -> Output:
        found = self.in_plane[joint.name]
        if output.quantity in found.kept:
            quantity, factor = found.kept[output.quantity]
            return _scaled(output, factor, joint.name, quantity)
        if output.quantity in found.unknown:
            raise AsymmetryError(joint.name, f"has the output {output.quantity}, which a plane model does not determine", output.span)
        plane = self.plane  # a coordinate that would leave it: a quantity of the same unit of a body of the joint, times zero
        by_unit = {"m": plane.axis, "m/s": f"v{plane.axis}", "rad": ANGLES[plane.across], "rad/s": f"w{plane.across}"}
        quantity = by_unit[JOINT_QUANTITIES[joint.kind][output.quantity]]
        body = next(b.name for b in self.model.bodies if b.name in (joint.base, joint.follower))
        return _scaled(output, 0, body, quantity)


def _scaled(output: Output, factor: float, element: str, quantity: str = "") -> Output:
    """An output that is read from another column, or from another multiple of its own."""
    read = replace(output, element=element, quantity=quantity or output.quantity, factor=factor * output.factor)
    return read if read.column == output.column else replace(read, stands_for=output.column)


def require_own_images(model: Model, scene: Scene, plane: Plane, loose: Collection[str]) -> None:
    """Check that bodies which no joint holds in a plane, and all that touches them, are their own images; forces may be in pairs.
    Raises AsymmetryError: one is not, or gravity pulls out of the plane."""
    if not plane.within(model.gravity):
        raise AsymmetryError(model.name, f"has gravity that pulls out of the plane {plane}", model.span)
    elements = _fix_inputs(model, scene)
    joints = tuple(j for j in elements.joints if {j.base, j.follower} & set(loose))
    names = {j.name for j in joints}
    forces = tuple(f for f in elements.forces if f.active and (f.joint_of in names or set(f.bodies) & set(loose)))
    touched = Elements(tuple(b for b in elements.bodies if b.name in loose), joints, forces, (), ())
    mirrored = mirror_elements(touched, plane.axis)
    for body, reflection in zip(touched.bodies, mirrored.bodies, strict=True):
        differ = [text for name, text in _MIRRORED.items() if not is_same(getattr(reflection, name), getattr(body, name))]
        if differ and not body.is_massless:
            raise AsymmetryError(body.name, f"is not symmetric about the plane {plane}: its {differ[0]} is not", body.span)
    signs = {j.name: _joint_signs(j, reflection, plane) for j, reflection in zip(joints, mirrored.joints, strict=True)}
    free = list(forces)
    for force, image in zip(forces, mirrored.forces, strict=True):
        same = next((f for f in free if _is_image(force, image, f, signs)), None)
        if same is None:
            raise AsymmetryError(force.name, f"is not symmetric about the plane {plane}, nor has it an image there", force.span)
        free.remove(same)


def _fix_inputs(model: Model, scene: Scene) -> Elements:
    """The elements as the scene has them, with functions of time in place of inputs."""
    inputs = {
        p.symbol: scene.inputs.get(p.name, sympy.Integer(0) if p.value == 0 else sympy.Float(p.value))
        for p in model.parameters if p.binding is Binding.INPUT
    }  # fmt: skip
    forces = tuple(replace(f, active=needs_place(f, model, scene, scene.outputs)) for f in model.forces)
    return Elements(substitute(model.bodies, inputs), substitute(model.joints, inputs), substitute(forces, inputs), (), ())


def _joint_signs(joint: Joint, reflection: Joint, plane: Plane) -> Mapping[str, int]:
    """1 for each coordinate that the reflection leaves unchanged, -1 for each that it reverses."""
    alike = all(is_same(getattr(reflection, name), getattr(joint, name)) for name in ("at", "to", "pitch"))
    axes = zip(reflection.axes, joint.axes, strict=True)
    of_axes = [1 if is_same(a, b) else -1 if is_same(a, (-b[0], -b[1], -b[2])) else 0 for a, b in axes]
    if not alike or 0 in of_axes:
        raise AsymmetryError(joint.name, f"is not symmetric about the plane {plane}", joint.span)
    of_directions = dict(zip((Direction.AXIS, Direction.AXIS_2), of_axes, strict=False))
    if of_axes:  # the second transverse direction is a product with two of the axes
        of_directions[Direction.ACROSS_1] = of_axes[0]
    by_axes = {m.coordinate: of_directions.get(m.direction, 1) for m in joint.element.scalar_motions}
    mirrored = coordinate_signs(plane.mirror, joint)
    signs = {name: mirrored[name] * by_axes.get(name, 1) for name in joint.element.coordinates}
    for coordinate, guide in zip(joint.element.coordinates, joint.guide or (), strict=False):
        if not is_same(signs[coordinate] * guide, guide):
            text = f"has a guide of its {coordinate} that moves it out of the plane {plane}, and is not zero in this scene"
            raise AsymmetryError(joint.name, text, joint.span)
    return signs


def _is_image(force: Force, reflection: Force, candidate: Force, signs: Mapping[str, Mapping[str, int]]) -> bool:
    if type(force) is not type(candidate):
        return False
    if force.joint_of:
        if (force.joint_of, force.coordinate_of) != (candidate.joint_of, candidate.coordinate_of):
            return False
        sign = signs[force.joint_of][force.coordinate_of]
        return is_same(tuple(Mirror.reflected(law, sign) for law in force.expressions), candidate.expressions)
    shown = {f.name: getattr(reflection, f.name) for f in fields(reflection) if f.name not in _NAMING}
    if force.bodies != candidate.bodies:
        if not force.interaction.swapped(force) or force.bodies[::-1] != candidate.bodies:
            return False
        shown |= reflection.interaction.swapped(reflection)
    return all(is_same(value, getattr(candidate, name)) for name, value in shown.items())
