"""A file of another program as the text of a model file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cutjoint.importing.closing import close
from cutjoint.importing.document import Document
from cutjoint.importing.mjcf import read_mjcf
from cutjoint.importing.robot import Robot
from cutjoint.importing.sdf import read_sdf
from cutjoint.importing.urdf import read_urdf
from cutjoint.importing.xml import Node
from cutjoint.package.locations import AnyPath

#: Readers by the endings of files.
READERS: dict[str, Callable[[Path], tuple[Robot, Node]]] = {".urdf": read_urdf, ".sdf": read_sdf, ".xml": read_mjcf, ".mjcf": read_mjcf}


@dataclass(frozen=True)
class Imported:
    """The ``text`` of a model file; ``notes`` are sentences of decisions, ``left_out`` counts tags and attributes that were not taken."""

    text: str
    notes: tuple[str, ...]
    left_out: dict[str, int]


def is_foreign(path: AnyPath) -> bool:
    """Return whether a file is one of another program, by its ending."""
    return Path(path).suffix.lower() in READERS


def name_of(path: Path) -> Path:
    """The name of the model file that a file becomes: robot.urdf.yaml of robot.urdf."""
    return path.with_name(f"{path.name}.yaml")


def import_file(path: Path, *, free: bool = False) -> Imported:
    """A file of another program as a model file; with ``free`` its base moves freely, else it stands on the ground unless the file says it.

    Raises ModelError, with places in the file, for what is wrong in it or cannot be said in a model file.
    """
    robot, root = READERS[path.suffix.lower()](path)
    robot.leave_out_idle()
    document = Document(robot, close(robot), path.parent, free=free)
    left_out = dict(root.left_out())
    return Imported(document.text(path.name, left_out), tuple(document.notes), left_out)
