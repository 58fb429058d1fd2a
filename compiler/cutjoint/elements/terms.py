"""The material of elements' records: expressions, vectors, places in the user's file, and the joint kinds that code distinguishes."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import PurePath
from typing import Any, TypeAlias

#: A SymPy expression (SymPy ships no types).
Scalar: TypeAlias = Any
#: Three expressions: components in the global design frame.
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True, kw_only=True, order=True)
class Span:
    """The place of an element in the user's file; line and column count from one."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def seen_from(self, other: "Span") -> str:
        """The line, with the file's name where that is another one."""
        return f"line {self.line}" if self.file == other.file else self.place

    @property
    def place(self) -> str:
        """File name and line without the folder, for generated files."""
        return f"{PurePath(self.file).name}:{self.line}"


class JointKind(StrEnum):
    """Kinds that passes, exporters or pictures treat separately; ``cutjoint.elements.joints`` lists and describes all."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    CYLINDRICAL = "cylindrical"
    SCREW = "screw"
    UNIVERSAL = "universal"
    CONSTANT_VELOCITY = "constant_velocity"
    PLANAR = "planar"
    SPHERICAL = "spherical"
    POINT_ON_LINE = "point_on_line"
    DISTANCE = "distance"
    FREE = "free"
