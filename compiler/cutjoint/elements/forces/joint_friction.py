"""Friction in a joint that depends on the joint's load."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

from cutjoint.elements.force import Bristle, ForceElement, ForceField, Mirror, OnJoint, Reader, Shape
from cutjoint.elements.interactions.on_coordinate import CoordinateFriction
from cutjoint.elements.terms import Scalar

#: Fields of the joint's load; the others are coefficients and those of the bristle.
_OF_LOAD = {"preload": "N", "radius": "m", "arm": "m", "thrust_radius": "m"}


@dataclass(frozen=True, kw_only=True)
class JointFriction(OnJoint):
    """Coulomb and Stribeck friction on one scalar coordinate of a joint, in ``unit`` "m" or "rad".

    The load in N is ``preload`` and, if ``carried``, the load by the reaction of the joint: its force across the slide or axis, of an angle
    the force along the axis times ``thrust_radius``/``bearing_radius``, and the moment across the slide or axis over ``arm``, with that
    about a slide that cannot turn. Of these three the last two count where their lengths are not None. ``law`` is the force per N of load,
    over ``rate`` and the bristle.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="joint_friction",
        text="Dry friction on one of a joint's coordinates, from the load that the joint carries or a constant one. At rest it sticks.",
        fields=(
            ForceField("joint", Shape.JOINT), ForceField("coordinate", Shape.COORDINATE, None, words=" of a joint with several"),
            ForceField("coefficient", Shape.NUMBER, words=" of sliding"),
            ForceField("static", Shape.NUMBER, None, words=" static coefficient (default: that of sliding)"),
            ForceField("stribeck_speed", Shape.NUMBER, None, words=": Stribeck velocity of the decay to the sliding value", unit="m/s"),
            ForceField("radius", Shape.NUMBER, None, words=" of the bearing: torque = coefficient*load*radius", unit=_OF_LOAD["radius"]),
            ForceField("arm", Shape.NUMBER, None, words=": the bending moment divided by it adds to the load", unit=_OF_LOAD["arm"]),
            ForceField(
                "thrust_radius", Shape.NUMBER, None, words=": the axial force times `thrust_radius`/`radius` adds to the load",
                unit=_OF_LOAD["thrust_radius"],
            ),
            ForceField("preload", Shape.NUMBER, 0, words=": constant part of the load", unit=_OF_LOAD["preload"]),
            ForceField("carried", Shape.SWITCH, True, words=": whether the joint's reaction force adds to the load"),
            ForceField("presliding", Shape.NUMBER, 1e-4, words=": elastic displacement before sliding", unit="m"),
            ForceField("damping_speed", Shape.NUMBER, 0.01, words=": speed at which the damping of sticking saturates", unit="m/s"),
            ForceField("settling", Shape.NUMBER, 1e-3, words=": time constant of the friction force in sliding", unit="s"),
        ),
        interaction=CoordinateFriction(),
        laws=("law",),
    )  # fmt: skip

    law: Scalar
    bristle: Bristle
    preload: Scalar
    carried: bool
    bearing_radius: Scalar | None
    arm: Scalar | None
    thrust_radius: Scalar | None

    @classmethod
    def read(cls, reader: Reader) -> Self:
        joint, coordinate, unit = reader.coordinate("joint", "coordinate")
        law, bristle = reader.friction(unit)
        preload, radius, arm, thrust_radius = (
            None if reader.field(name) is None else reader.number(name, unit=of) for name, of in _OF_LOAD.items()
        )
        return cls(
            **reader.common(), joint=joint, coordinate=coordinate, unit=unit, law=law, bristle=bristle, preload=preload,
            carried=reader.field("carried"), bearing_radius=radius, arm=arm, thrust_radius=thrust_radius,
        )  # fmt: skip

    @property
    def quantities(self) -> Mapping[str, str]:
        """The force on the coordinate, and the load."""
        return {"force": "N" if self.unit == "m" else "N*m", "load": "N"}

    @property
    def by_load(self) -> bool:
        return self.carried

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The force itself: it is the same in the image."""
        return self
