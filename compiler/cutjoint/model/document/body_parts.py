"""The shapes of bodies in a model file."""

import re
from typing import Annotated, TypeAlias

from pydantic import Field, StrictBool, StrictFloat, StrictInt, StrictStr, model_validator

from cutjoint.model.document.values import ByForm, Direction, Inertia, Number, Part, Point, Triple, shape_error
from cutjoint.model.text import printable

MAX_SHAPES = 1000
MESHES = (".glb", ".stl", ".obj")  #: the endings of meshes that can be drawn


class Solid(Part):
    """A shape with a volume; a hole takes its mass away."""

    at: Point
    density: Number | None = None
    mass: Number | None = None
    hole: StrictBool = False

    @model_validator(mode="after")
    def _density_or_mass(self) -> "Solid":
        if (self.density is None) == (self.mass is None):
            raise shape_error("needs either density or mass")
        return self


class Box(Solid):
    """A cuboid around ``at``: its lengths along its own x, y, z, two of which may be given."""

    box: Triple
    x: Direction | None = None
    y: Direction | None = None
    z: Direction | None = None


class CylinderSize(Part):
    """Radius and length of a cylinder."""

    radius: Number
    length: Number


class Cylinder(Solid):
    """A solid cylinder around ``at``."""

    cylinder: CylinderSize
    axis: Direction


class Sphere(Solid):
    """A solid sphere of a radius around ``at``."""

    sphere: Number


class RodEnds(Part):
    """The two ends of a rod."""

    from_: Point = Field(alias="from")
    to: Point


class Rod(Part):
    """A slender rod."""

    rod: RodEnds
    mass: Number


class PointMass(Part):
    """A mass without extent."""

    point: Point
    mass: Number


Shape: TypeAlias = Annotated[
    Box | Cylinder | Sphere | Rod | PointMass,
    ByForm(
        {"box": Box, "cylinder": Cylinder, "sphere": Sphere, "rod": Rod, "point": PointMass},
        "needs one of box, cylinder, sphere, rod, point",
    ),
]


class Visual(Part):
    """The picture of a body: a mesh in a file beside the model, or a ``colour`` alone.
    ``scale`` times as large, its origin ``at`` a point, its axes along two of ``x``, ``y``, ``z``."""

    mesh: StrictStr | None = None
    colour: StrictStr | None = None
    at: Point | None = None
    scale: StrictInt | StrictFloat | None = None
    x: Direction | None = None
    y: Direction | None = None
    z: Direction | None = None

    @model_validator(mode="after")
    def _drawable(self) -> "Visual":
        if self.mesh is None and (self.colour is None or any(x is not None for x in (self.at, self.scale, self.x, self.y, self.z))):
            raise shape_error("needs a mesh, or a colour alone")
        if self.mesh is not None:
            _require_mesh(self.mesh)
        if self.colour is not None and not re.fullmatch("#[0-9a-fA-F]{6}", self.colour):
            raise shape_error(f"'{printable(self.colour)}' is no colour", "write red, green and blue as \"#d9480f\", in quotes")
        if self.scale is not None and not 1e-9 <= self.scale <= 1e9:
            raise shape_error("scale is not between 1e-9 and 1e9")
        return self


def _require_mesh(mesh: str) -> None:
    """Check that a text names a mesh in the folder of the model file or below it."""
    if not mesh.lower().endswith(MESHES):
        raise shape_error(f"mesh '{printable(mesh)}' is of no kind that is known", f"name a file that ends in {', '.join(MESHES)}")
    parts = mesh.split("/")
    if len(mesh) > 500 or "" in parts or ".." in parts or "\\" in mesh or ":" in mesh or not mesh.isprintable():
        raise shape_error(f"mesh '{printable(mesh[:80])}' is not below the model file's folder", "put it there, and name it from there")


class Body(Part):
    """A rigid body, by its mass and inertia or by its shapes; the inertia is about ``about``, by default its centre of mass."""

    mass: Number | None = None
    centre_of_mass: Point | None = None
    inertia: Inertia | None = None
    about: Point | None = None
    shapes: Annotated[tuple[Shape, ...], Field(min_length=1, max_length=MAX_SHAPES)] | None = None
    massless: StrictBool = False
    visual: Visual | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "Body":
        fields = {name for name in ("mass", "centre_of_mass", "inertia", "about") if getattr(self, name) is not None}
        if self.shapes is not None and (fields or self.massless):
            raise shape_error("its shapes give mass, centre and inertia", f"remove {', '.join(sorted(fields)) or 'massless'}")
        if self.massless and fields & {"mass", "about"}:
            raise shape_error("a massless body has no mass", "remove it, or 'massless'")
        if self.shapes is None and not self.massless and not {"mass", "centre_of_mass"} <= fields:
            raise shape_error("needs mass and centre_of_mass, or shapes", "add them, or write massless: true")
        if "about" in fields and "inertia" not in fields:
            raise shape_error("'about' belongs to an inertia", "add inertia, or remove about")
        return self
