"""Object files of generated code by content: what did not change is not compiled again.

An object file follows from the code of its source and of the generated files that this includes, from the runtime's headers, the compiler,
its flags and the number type.  Comments are no code: neither a line of the model file that has moved nor a count of operations matters.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from cutjoint.package.locations import templates_folder
from cutjoint.toolchain.cache import cache_folder, digest_of, fetch, is_sound, runtime_digest
from cutjoint.toolchain.compiler import Compiler, resolve
from cutjoint.toolchain.drivers import DRIVERS, Kind

if TYPE_CHECKING:
    from cutjoint.emit.source import Source

#: The targets of the CMake projects of simulators and of libraries, and the templates of these.
_TARGETS = ("start", "mechanism", "simulator")
_OF_LIBRARIES = ("mechanism", "system", "interface")
_PROJECTS = ("CMakeLists.txt.jinja", "library/CMakeLists.txt.jinja", "objects.cmake.jinja")

_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
_COMMENT = re.compile(r"^ *//.*\n", re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Object:
    """The object of a generated file as a ``target`` of CMake compiles it, built or not."""

    target: str
    source: str
    digest: str

    @property
    def cached(self) -> Path:
        """The object's place in the cache."""
        return cache_folder() / f"object-{self.digest}" / "code.o"

    def built(self, out: Path) -> Path:
        """The path at which CMake builds it."""
        return out / "CMakeFiles" / f"{self.target}.dir" / f"{self.source}.o"

    def copied(self, folder: Path) -> Path:
        """The path at which CMake looks for a copy (CMakeLists.txt.jinja)."""
        return folder / self.target / f"{self.source}.o"


def find_objects(source: "Source", compiler: Compiler, flags: Sequence[str], kind: Kind) -> list[Object]:
    """The object files that a simulator or a library may consist of."""
    targets = _TARGETS if source.driver in DRIVERS else _OF_LIBRARIES
    # the origin of a target's definitions and headers; `start` is the same for all
    origins = {t: [t, runtime_digest(part=source.driver), source.driver, *kind.number] for t in targets} | {"start": [runtime_digest()]}
    how = {target: [_project_digest(), *compiler.key, *resolve(flags), *origins[target]] for target in targets}
    texts = {name: "\0".join(_code(source.files, name)) for name in source.files if name.endswith(".cpp")}
    return [Object(target=t, source=name, digest=digest_of([text, *how[t]])) for t in targets for name, text in texts.items()]


def missing_sources(source: "Source", compiler: Compiler, flags: Sequence[str]) -> dict[str, int]:
    """The generated files of which no object file is in the cache, and their bytes: what a build has to compile."""
    objects = find_objects(source, compiler, flags, Kind())
    there = {o.source for o in objects if is_sound(o.cached)}
    return {o.source: len(source.files[o.source]) for o in objects if o.source not in there}


def fetch_objects(objects: Sequence[Object], folder: Path) -> set[Object]:
    """Copy the object files that the cache has into a folder; returns which these are."""
    for o in objects:
        o.copied(folder).parent.mkdir(parents=True, exist_ok=True)
    return {o for o in objects if fetch(o.cached, o.copied(folder))}


def _code(files: Mapping[str, str], name: str) -> Iterator[str]:
    yield _COMMENT.sub("", files[name])
    for included in _INCLUDE.findall(files[name]):
        if included in files:
            yield from _code(files, included)


@cache
def _project_digest() -> str:
    """A digest of the projects, which tell how files are compiled."""
    return digest_of([(templates_folder() / project).read_text(encoding="utf-8") for project in _PROJECTS])
