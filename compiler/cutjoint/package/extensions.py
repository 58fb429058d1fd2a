"""The door for other packages: what they add to cutjoint, by entry points.

An `ExtensionPoint` is a group of entry points, and the contract that each of them gives.  The additions of this project's own packages are
known by their names, so that a command offers them, and names the package of one that is not installed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar, cast

from cutjoint.package.errors import CutjointError


class Named(Protocol):
    """A record with a name."""

    @property
    def name(self) -> str:
        """The name, by which the record is asked for."""


C = TypeVar("C")
R_co = TypeVar("R_co", bound=Named, covariant=True)

#: The package of this project's own additions.
BENCH = "cutjoint-bench"


class MissingPackageError(CutjointError, RuntimeError):
    """An addition is asked for whose package is not installed."""


def find_package(*modules: str, otherwise: Exception) -> Any:
    """The first of the ``modules`` of a package that is an extra; all are imported. Raises the error ``otherwise``: it is not installed."""
    try:
        first, *_ = map(import_module, modules)
    except ImportError:
        raise otherwise from None
    return first


@dataclass(frozen=True, kw_only=True)
class DriverExtension(Generic[R_co]):
    """A linear solver, an integrator or a number type that simulators may have: its ``record``, and the ``folder`` of its C++.

    A driver is built with the folder as `runtime/driver/CMakeLists.txt` says; its C++ registers what it adds by
    `runtime/include/cutjoint/extension.hpp`.
    """

    record: R_co
    folder: Path

    @property
    def name(self) -> str:
        """The word of options."""
        return self.record.name


@dataclass(frozen=True, kw_only=True)
class ExtensionPoint(Generic[C]):
    """A kind of additions: its ``group`` of entry points, the word ``what`` of messages, and the package of each known one."""

    group: str
    what: str
    packages: Mapping[str, str]

    def names(self) -> list[str]:
        """The known additions, then those of other packages that are installed."""
        return list({**self.packages, **self.installed()})

    def load(self, name: str) -> C:
        """An addition by its name.

        Raises:
            MissingPackageError: its package is not installed.
        """
        if (point := self.installed().get(name)) is not None:
            return cast(C, point.load())
        package = self.packages[name]
        raise MissingPackageError(f"{name} is {self.what} of the package {package}, which is not installed; pip install {package}")

    def installed(self) -> dict[str, EntryPoint]:
        """The entry points that there are, by name."""
        return {point.name: point for point in _entry_points().select(group=self.group)}


#: The entry points of all packages, which are read once.
_entry_points = cache(entry_points)

#: Commands of click.
COMMANDS: ExtensionPoint[Any] = ExtensionPoint(group="cutjoint.commands", what="a command", packages={"bench": BENCH})

#: Records of `run/additions.py`.
EXPORTERS: ExtensionPoint[Any] = ExtensionPoint(
    group="cutjoint.exporters", what="an export", packages=dict.fromkeys(("mujoco", "exudyn", "pinocchio"), BENCH)
)  # fmt: skip
