"""The model and the scene of a mechanism in its plane, with the columns that stand for those of the whole one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from cutjoint.elements.joint import ATTITUDE
from cutjoint.model.elements.mirror import ANGLES, reflected_law
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES, reaction_component, reported_element
from cutjoint.model.records import Force, Joint, JointForce, Model, Output, Reaction, Scalar, Scene
from cutjoint.reduce.plane import AsymmetryError, InPlane, Plane, is_zero


@dataclass(frozen=True, kw_only=True)
class PlaneModel:
    """A model whose tree joints have the motions in a plane alone, ``in_plane`` by name."""

    model: Model
    plane: Plane
    in_plane: Mapping[str, InPlane]

    def scene(self, scene: Scene) -> Scene:
        """A scene of it.

        Raises:
            AsymmetryError: the scene leaves the plane, or asks for what a plane model does not determine.
        """
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
                yield replace(force, coordinate=name, law=reflected_law(force.law, sign))
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
                return self._reaction_output(reaction, output)
            case Joint() as joint if joint.name in self.in_plane:
                return self._joint_output(joint, output)
            case Force() as force:
                return self._force_output(force, output)
        return output

    def _reaction_output(self, reaction: Reaction, output: Output) -> Output:
        is_moment, direction = reaction_component(reaction, output.quantity)
        if self.plane.along_normal(direction) if is_moment else self.plane.within(direction):
            return output
        text = f"has the output {output.quantity}, which a model in the plane {self.plane} does not determine"
        raise AsymmetryError(reaction.name, text, output.span)

    def _joint_output(self, joint: Joint, output: Output) -> Output:
        found = self.in_plane[joint.name]
        if output.quantity in found.kept:
            quantity, factor = found.kept[output.quantity]
            return _scaled(output, factor, joint.name, quantity)
        if output.quantity in found.unknown:
            raise AsymmetryError(joint.name, f"has the output {output.quantity}, which a plane model does not determine", output.span)
        return self._zero(joint, output)

    def _zero(self, joint: Joint, output: Output) -> Output:
        """A coordinate that would leave the plane: a quantity of the same unit of a body of the joint, times zero."""
        plane = self.plane
        by_unit = {"m": plane.axis, "m/s": f"v{plane.axis}", "rad": ANGLES[plane.across], "rad/s": f"w{plane.across}"}
        quantity = by_unit[JOINT_QUANTITIES[joint.kind][output.quantity]]
        body = next(b.name for b in self.model.bodies if b.name in (joint.base, joint.follower))
        return _scaled(output, 0, body, quantity)

    def _force_output(self, force: Force, output: Output) -> Output:
        if force.name in self._idle:
            raise AsymmetryError(force.name, "is an output, but acts on bodies that rest in the plane", output.span)
        joint = self.in_plane.get(force.joint_of) if output.quantity == "force" else None
        return _scaled(output, joint.kept[force.coordinate_of][1] if joint else 1, force.name)


def _scaled(output: Output, factor: float, element: str, quantity: str = "") -> Output:
    """An output that is read from another column, or from another multiple of its own."""
    read = replace(output, element=element, quantity=quantity or output.quantity, factor=factor * output.factor)
    return read if read.column == output.column else replace(read, stands_for=output.column)
