"""Pairs of bodies and joints under a reflection, found by place, not by names.

They are found along joints from the ground outwards: where a joint leads on from a body, a joint like its image leads on from that
body's image, and the bodies at their other ends are images of each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import sympy

from cutjoint.model.elements import Elements
from cutjoint.model.mirror import mirror_elements
from cutjoint.model.records import GROUND, Binding, Joint, Model, Scene, Vector
from cutjoint.reduce.half.plane import Plane, Same, is_same, put_in


def settle(model: Model, scene: Scene) -> Elements:
    """The elements as the scene has them, with functions of time in place of inputs."""
    inputs = {
        p.symbol: scene.inputs.get(p.name, sympy.Integer(0) if p.value == 0 else sympy.Float(p.value))
        for p in model.parameters if p.binding is Binding.INPUT
    }  # fmt: skip
    forces = (replace(f, active=scene.switches.get(f.name, f.active)) for f in model.forces)
    return Elements(
        tuple(put_in(b, inputs) for b in model.bodies), tuple(put_in(j, inputs) for j in model.joints),
        tuple(put_in(f, inputs) for f in forces), (), (),
    )  # fmt: skip


def find_pairs(elements: Elements, plane: Plane, same: Same = is_same) -> Pairs:
    """The images of bodies and joints as far as joints lead to them; ``same`` compares what should be alike."""
    pairs = Pairs(elements=elements, plane=plane, mirrored=mirror_elements(elements, plane.axis), same=same)
    queue = [GROUND]
    for body in queue:
        for joint in elements.joints:
            if body in (joint.base, joint.follower) and joint.name not in pairs.joints:
                queue.extend(pairs.follow(joint))
    return pairs


@dataclass(kw_only=True)
class Pairs:
    """Images of bodies and joints as they are found; ``mirrored`` are the elements' reflections."""

    elements: Elements
    plane: Plane
    mirrored: Elements
    same: Same = is_same
    bodies: dict[str, str] = field(default_factory=lambda: {GROUND: GROUND})
    joints: dict[str, str] = field(default_factory=dict)

    @property
    def any(self) -> bool:
        """Return whether some element has another one as its image."""
        return any(name != image for images in (self.bodies, self.joints) for name, image in images.items())

    def reflection(self, joint: Joint) -> Joint:
        """A joint as the mirror shows it."""
        return next(m for m in self.mirrored.joints if m.name == joint.name)

    def signs(self, joint: Joint, candidate: Joint) -> tuple[int, ...] | None:
        """The signs by which the axes of a joint's image are turned against a candidate's, see `axis_signs`."""
        return axis_signs(self.reflection(joint), candidate, self.same)

    def follow(self, joint: Joint) -> list[str]:
        """Find the image of a joint at a body whose image is known, and so that of the body at its other end; returns what is new."""
        candidates = [c for c in self.elements.joints if self._may_be_image(joint, c)]
        if not candidates:
            return []
        image = max(candidates, key=lambda c: self._likeness(joint, c))
        self.joints |= {joint.name: image.name, image.name: joint.name}
        found = []
        for one, other in ((joint.base, image.base), (joint.follower, image.follower)):
            found += [name for name in dict.fromkeys((one, other)) if name not in self.bodies]
            self.bodies |= {one: other, other: one}
        return found

    def _may_be_image(self, joint: Joint, candidate: Joint) -> bool:
        if candidate.name in self.joints or self.signs(joint, candidate) is None:
            return False
        ends = ((joint.base, candidate.base), (joint.follower, candidate.follower))
        return all(self.bodies.get(a, b) == b and self.bodies.get(b, a) == a for a, b in ends)

    def _likeness(self, joint: Joint, candidate: Joint) -> tuple[int, bool]:
        """The number of joints around with an image like a joint around the candidate; of equals, an element is its own image."""
        around = [j for j in self.elements.joints if {j.base, j.follower} & ({joint.base, joint.follower} - {GROUND})]
        there = [j for j in self.elements.joints if {j.base, j.follower} & ({candidate.base, candidate.follower} - {GROUND})]
        matched = sum(any(self.signs(j, c) is not None for c in there) for j in around)
        return matched, joint.name == candidate.name


def axis_signs(reflection: Joint, candidate: Joint, same: Same) -> tuple[int, ...] | None:
    """For each axis 1 where the candidate's has the direction of the reflection's, -1 where the opposite; None for another joint."""
    if reflection.kind is not candidate.kind or not same(reflection.at, candidate.at):
        return None
    if not same(reflection.to, candidate.to) or not same(reflection.pitch, candidate.pitch):
        return None
    signs = [_axis_sign(a, b, same) for a, b in zip(reflection.axes, candidate.axes, strict=True)]
    return None if 0 in signs else tuple(signs)


def _axis_sign(a: Vector, b: Vector, same: Same) -> int:
    if same(a, b):
        return 1
    return -1 if same(a, (-b[0], -b[1], -b[2])) else 0
