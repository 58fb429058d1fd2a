"""The formats of files of other programs, by their names: a command that finds none imports no reader."""

from pathlib import Path

from cutjoint.package.locations import AnyPath

#: The formats that are read, by the endings of files.
READERS = {".urdf": "URDF", ".sdf": "SDF", ".world": "SDF", ".xml": "MJCF", ".mjcf": "MJCF"}


def is_foreign(path: AnyPath) -> bool:
    """Return whether a file is one of another program, by its ending."""
    return Path(path).suffix.lower() in READERS


def name_of(path: Path) -> Path:
    """The name of the model file that a file becomes: robot.urdf.yaml of robot.urdf."""
    return path.with_name(f"{path.name}.yaml")
