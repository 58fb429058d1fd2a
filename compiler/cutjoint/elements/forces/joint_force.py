"""Forces on the coordinates of a joint, and on all rotations of a ball."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from cutjoint.elements.force import Force, ForceElement, ForceField, Law, LawForce, Mirror, OnJoint, Reader, Shape
from cutjoint.elements.interaction import Carrier, Frame
from cutjoint.elements.interactions.attitude_force import AttitudeForce
from cutjoint.elements.interactions.on_coordinate import OnCoordinate
from cutjoint.elements.terms import Scalar, Vector

_SLIDE = Law({"position": "m", "rate": "m/s"}, "N")
_TURN = Law({"position": "rad", "rate": "rad/s"}, "N*m")


def law_on(unit: str) -> Law:
    """The variables and units of a law on a coordinate in a unit: torques on angles, also for an invalid unit."""
    return _SLIDE if unit == "m" else _TURN


@dataclass(frozen=True, kw_only=True)
class JointForce(OnJoint, LawForce):
    """A generalised force on one scalar coordinate of a joint, named as in the joint's kind, in ``unit`` "m" or "rad".
    ``law`` is in N (N m on an angle) over ``position``, ``rate`` of the coordinate, ``t`` and parameters."""

    element: ClassVar[ForceElement] = ForceElement(
        kind="joint_force",
        text="A force on a joint coordinate. Name it if the joint has several.",
        fields=(ForceField("joint", Shape.JOINT), ForceField("coordinate", Shape.COORDINATE, None), ForceField("law", Shape.LAW)),
        interaction=OnCoordinate(),
        laws=("law",),
        forms=(_SLIDE, _TURN),
    )

    @classmethod
    def read(cls, reader: Reader) -> Self:
        joint, coordinate, unit = reader.coordinate("joint", "coordinate")
        return cls(**reader.common(), joint=joint, coordinate=coordinate, unit=unit, law=reader.law("law", law=law_on(unit)))

    @property
    def variables(self) -> Law:
        return law_on(self.unit)

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the force: its law has the sign of its coordinate."""
        return replace(self, law=mirror.reflected(self.law, signs.get(self.joint, {}).get(self.coordinate, 1)))


@dataclass(frozen=True, kw_only=True)
class BallSpring(Force):
    """The spring and the damper of a joint with three rotational degrees of freedom, the field ``spring`` of a spherical joint.

    The torque on ``follower`` is -``stiffness`` (N m) times its rotation vector from the attitude of rest, less ``damping`` (N m s) times
    its angular velocity relative to ``base``. The base has the reaction. At rest the follower's design axes stand as ``axes`` of the base.
    ``of`` is the joint's name.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="ball_spring",
        text="A spring and a damper on all turns of a joint.",
        fields=(),
        interaction=AttitudeForce(frame=Frame(Carrier.BASE, "axes")),
        laws=("stiffness", "damping"), components=True,
        quantities={
            **dict.fromkeys(("Mx", "My", "Mz"), "N*m"), **dict.fromkeys(("rx", "ry", "rz"), "rad"), "potential": "J",
        },
    )  # fmt: skip

    of: str
    base: str
    follower: str
    axes: tuple[Vector, Vector, Vector]
    stiffness: Scalar
    damping: Scalar

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the spring."""
        return replace(self, axes=mirror.frame(self.axes))

    def follows_law(self, quantity: str) -> bool:
        """Return whether a quantity follows from the law; the potential does."""
        return quantity == "potential" or super().follows_law(quantity)
