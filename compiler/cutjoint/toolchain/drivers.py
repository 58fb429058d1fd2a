"""The parts of simulators that do not depend on the model: libraries that are built once for all models.

`make_drivers` builds them in a folder of the installation, which all caches use.  Missing parts are stored in the cache with the first
simulator that needs them.
"""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from cutjoint.methods import DEFAULT_PRECISION, INTEGRATORS, PRECISIONS, SOLVERS
from cutjoint.package.errors import ToolchainError
from cutjoint.package.locations import binaries_folder
from cutjoint.package.system import PROGRAM
from cutjoint.toolchain.cache import (
    cache_folder,
    digest_of,
    exclusive,
    fetch,
    installed_folder,
    is_sound,
    require_writable,
    runtime_digest,
    store,
    tree_digest,
)
from cutjoint.toolchain.cmake import build_project, plain_runtime, plain_tree
from cutjoint.toolchain.compiler import Compiler, resolve
from cutjoint.toolchain.temporary import plain_folder

#: The kinds of drivers, as `Source.driver` has them.
DRIVERS = ("recursive", "lagrangian")

#: The simulator of a driver that interprets programs, as a part of it, and the file of each simulator.
INTERPRETER, SIMULATOR = "interpreter", f"simulator{PROGRAM}"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """The kind of a simulator: its number type, and ``additions``, solvers and integrators of other packages."""

    precision: str = DEFAULT_PRECISION
    additions: tuple[str, ...] = ()

    @property
    def number(self) -> tuple[str, ...]:
        """The name of the number type, and a digest of its C++."""
        return self.precision, *map(tree_digest, self._number_folder())

    @property
    def key(self) -> tuple[str, ...]:
        """The number type, and digests of all C++ that the additions have."""
        return *self.number, *map(tree_digest, self._added_folders())

    def definitions(self, folder: Path) -> tuple[str, ...]:
        """The definitions for CMake; ``folder`` receives copies of extensions whose paths are not plain."""
        number = PRECISIONS[self.precision]
        extensions = dict.fromkeys((*self._number_folder(), *self._added_folders()))
        copies = [plain_tree(tree, folder / f"extension_{i}") for i, tree in enumerate(extensions)]
        header = f"{copies[0]}/{number.header}" if number.header else ""
        return (
            f"-DCUTJOINT_PRECISION={self.precision}", f"-DCUTJOINT_REAL={number.type}", f"-DCUTJOINT_REAL_HEADER={header}",
            f"-DCUTJOINT_EXTENSIONS={';'.join(map(str, copies))}",
        )  # fmt: skip

    def _number_folder(self) -> tuple[Path, ...]:
        return () if self.precision in PRECISIONS else (PRECISIONS.added.load(self.precision).folder,)

    def _added_folders(self) -> tuple[Path, ...]:
        solvers = SOLVERS.added.names() if self.additions else ()
        doors = ((SOLVERS if name in solvers else INTEGRATORS).added for name in self.additions)
        return tuple(sorted({door.load(name).folder for door, name in zip(doors, self.additions, strict=True)}))


@dataclass(frozen=True, kw_only=True)
class Part:
    """A library of the driver, or a program: its ``name`` in CMake, and the digest of all that it follows from."""

    name: str
    digest: str

    @property
    def file(self) -> str:
        """The file that is built."""
        return SIMULATOR if self.name == INTERPRETER else f"lib{self.name}.a"

    def place(self, folder: Path) -> Path:
        """The place of the part in one of the folders of libraries."""
        return folder / f"{self.name}-{self.digest}" / self.file

    @property
    def places(self) -> tuple[Path, Path]:
        """The locations of the part: the installation and the cache."""
        return self.place(_installed_drivers()), self.place(cache_folder())

    def fetch(self, folder: Path) -> Path | None:
        """A copy in a folder; None if there is nothing to copy."""
        return next((folder / self.file for place in self.places if fetch(place, folder / self.file)), None)


def driver_parts(driver: str, compiler: Compiler, flags: Sequence[str], kind: Kind) -> tuple[Part, ...]:
    """The parts of a driver, one of DRIVERS; none of anything else.

    Starts and integrators are compiled with the flags of generated code, the rest where an addition needs it.
    """
    if driver not in DRIVERS:
        return ()
    plain, own = [runtime_digest(), *compiler.key], [driver, runtime_digest(part=driver), *kind.key]
    flagged = [*plain, *resolve(flags)]
    rest = flagged if kind.additions else plain
    digests = {"initial_state": flagged, "driver": [*rest, *own], "integrators": [*flagged, *own]}
    return tuple(Part(name=name, digest=digest_of(each)) for name, each in digests.items())


def interpreter_part(driver: str, compiler: Compiler, flags: Sequence[str]) -> Part:
    """The simulator of a driver that interprets programs."""
    parts = driver_parts(driver, compiler, flags, Kind())
    return Part(name=INTERPRETER, digest=digest_of([*(part.digest for part in parts), runtime_digest(part=INTERPRETER)]))


def shipped_simulator(driver: str) -> Path:
    """The simulator of a driver that interprets programs, as wheels for a platform have it."""
    return binaries_folder() / f"simulator-{driver}{PROGRAM}"


def shipped_interpreter(driver: str) -> Path:
    """That simulator in the cache, where runs find it by the digest of the file.
    Raises ToolchainError: it cannot be read, or the cache cannot be written."""
    shipped = shipped_simulator(driver)
    try:
        digest = sha256(shipped.read_bytes()).hexdigest()[:32]
    except OSError as error:
        raise ToolchainError(f"{shipped}: {error.strerror}; install cutjoint again") from error
    _, cached = Part(name=INTERPRETER, digest=digest).places
    if not is_sound(cached):
        store(shipped, cached)
    return cached


def interpreter_is_there(driver: str, compiler: Compiler, flags: Sequence[str]) -> bool:
    """Return whether the simulator of a driver that interprets programs has been built."""
    return driver in DRIVERS and any(map(is_sound, interpreter_part(driver, compiler, flags).places))


@contextmanager
def parts_for(parts: Sequence[Part], folder: Path, library: Path) -> Iterator[tuple[list[str], list[Part]]]:
    """Definitions for CMake of the parts that there are, copied into a folder, and the parts that are to be built for a ``library``.

    Of several processes that build parts, one builds each part and the others wait for it here. Raises ToolchainError: parts are missing
    and the library cannot be written.
    """
    with ExitStack() as stack:
        for part in parts:
            if not any(map(is_sound, part.places)):
                stack.enter_context(exclusive(part.place(library)))
                if library != cache_folder():
                    with suppress(ToolchainError):  # where the cache cannot be written nobody builds there
                        stack.enter_context(exclusive(part.place(cache_folder())))
        copies = {part: part.fetch(folder) for part in parts}
        found = [f"-DCUTJOINT_{part.name.upper()}={copy}" for part, copy in copies.items() if copy]
        yield found, [part for part, copy in copies.items() if not copy]


def store_parts(missing: Sequence[Part], out: Path, library: Path) -> None:
    """Put parts that are in a folder, that of a build for example, into a library."""
    for part in missing:
        store(out / part.file, part.place(library))


def make_drivers(driver: str, compiler: Compiler, flags: Sequence[str], kind: Kind, library: Path | None = None) -> bool:
    """Build the parts of a driver for a ``library``: by default in the installation, else, if that is not writable, in the cache.
    Parts for other versions of the runtime are removed from the installation.  Returns whether anything had to be built. Raises
    ToolchainError: a tool is missing, the compiler refused the code, or neither place can be written."""
    library = _library() if library is None else library
    parts = driver_parts(driver, compiler, flags, kind)
    if kind == Kind():
        parts = (*parts, interpreter_part(driver, compiler, flags))
    with plain_folder(library) as folder, parts_for(parts, folder, library) as (definitions, missing):
        if missing:
            runtime = plain_runtime(folder)
            project = (f"-DCUTJOINT_DRIVER_KIND={driver}", *kind.definitions(folder), *definitions)
            build_project(runtime / "driver" / "alone", folder / "out", compiler, flags, *project)
            store_parts(missing, folder / "out", library)
        store_parts([part for part in parts if not is_sound(part.place(library))], folder, library)  # parts that only the cache had
    return bool(missing)


def _installed_drivers() -> Path:
    """The folder of the drivers of this version of the runtime, inside the installation."""
    return installed_folder() / f"drivers-{runtime_digest()}"


def _library() -> Path:
    installed = _installed_drivers()
    try:
        require_writable(installed)
    except ToolchainError:
        return cache_folder()
    for folder in installed.parent.glob("drivers-*"):
        if folder != installed:
            shutil.rmtree(folder, ignore_errors=True)
    return installed
