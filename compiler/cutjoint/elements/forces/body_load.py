"""A force or a torque on one body."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from cutjoint.elements.force import Choice, Force, ForceElement, ForceField, Law, Mirror, Reader, Shape
from cutjoint.elements.interaction import Carrier, Point
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.elements.terms import Vector

_FORCE = Law({**dict.fromkeys(("x", "y", "z"), "m"), **dict.fromkeys(("vx", "vy", "vz"), "m/s")}, "N")
_TORQUE = Law(dict.fromkeys(("wx", "wy", "wz"), "rad/s"), "N*m")


def _problem(part: Any) -> tuple[str, ...]:
    if (part.force is None) == (part.torque is None):
        return "needs either force or torque", "write two loads for both"
    return ("a force needs 'at', a torque has no point",) if (part.force is None) != (part.at is None) else ()


@dataclass(frozen=True, kw_only=True)
class BodyLoad(Force):
    """A force at a point of a body, or a torque on it when ``point`` is None.

    ``components`` are three expressions in N (or N m) in ``axes`` ("global" or "body") over ``x y z`` (m),
    ``vx vy vz`` (m/s) of the point in those axes' directions (positions always global), ``t`` and parameters;
    those of a torque over the body's angular velocity ``wx wy wz`` (rad/s) in those axes, ``t`` and parameters.
    With ``moving_only`` the load is absent while the equilibrium is sought.
    """

    element: ClassVar[ForceElement] = ForceElement(
        kind="load",
        text="A force or a torque on one body.",
        fields=(
            ForceField("body", Shape.BODY), ForceField("at", Shape.POINT, None), ForceField("force", Shape.TRIPLE, None),
            ForceField("torque", Shape.TRIPLE, None), ForceField("let", Shape.NAMES, {}),
            ForceField("axes", Choice(("global", "body")), "global"), ForceField("moving_only", Shape.SWITCH, False),
        ),
        problem=_problem,
        interaction=Wrench(point=Point(Carrier.BODY, "point")),
        laws=("components",),
        forms=(_FORCE, _TORQUE),
        quantities=dict.fromkeys(("Fx", "Fy", "Fz"), "N"), components=True,
    )  # fmt: skip

    body: str
    point: Vector | None
    axes: str
    components: Vector
    moving_only: bool

    @classmethod
    def read(cls, reader: Reader) -> Self:
        is_force = reader.field("force") is not None
        name, law = ("force", _FORCE) if is_force else ("torque", _TORQUE)
        components = reader.triple(name, law, let="let")
        return cls(
            **reader.common(), body=reader.body("body"), point=reader.point("at") if reader.field("at") is not None else None,
            axes=reader.field("axes"), components=components, moving_only=reader.field("moving_only"),
        )  # fmt: skip

    @property
    def has_frame(self) -> bool:
        """Return whether the load has components along axes of the body."""
        return self.axes == "body"

    @property
    def needs_attitude(self) -> bool:
        """Return whether the load has components in the body's axes, or a torque."""
        return self.has_frame or self.point is None

    @property
    def quantities(self) -> Mapping[str, str]:
        """The components, those of a torque under other names."""
        return super().quantities if self.point is not None else dict.fromkeys(("Mx", "My", "Mz"), "N*m")

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the load: a force mirrors as a vector, a torque as a rotation."""
        x, y, z = (mirror.law(component) for component in self.components)
        image = mirror.rotation if self.point is None else mirror.vector
        return replace(super().mirrored(mirror, signs), components=image((x, y, z)))
