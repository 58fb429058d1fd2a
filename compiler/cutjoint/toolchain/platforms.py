"""Platforms that code is compiled for: this machine's, and others by Debian's cross-compilers."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain.compiler import Compiler, ask_version, find_compiler, find_tool, require_tools

_AVX2 = ("-mavx2", "-mfma")
#: GCC does not align the stack for AVX on Windows (its bug 54412); the assembler writes moves that take any address.
_UNALIGNED = "-Wa,-muse-unaligned-vector-move"


@dataclass(frozen=True, kw_only=True)
class Platform:
    """A system and a processor as CMake names them, and how to compile for them.

    ``tools``: prefix of the tools; ``package``: Debian's package of these; ``suffix``: ending of modules; ``avx2``: flags for processors
    with AVX2 and FMA, if any.
    """

    system: str
    processor: str
    tools: str
    package: str
    suffix: str = ".so"
    avx2: tuple[str, ...] = ()

    def is_here(self) -> bool:
        """Return whether it is this machine's platform."""
        return (platform.system(), platform.machine()) == (self.system, self.processor)

    def find_compiler(self) -> Compiler:
        """The compiler: this machine's own as `toolchain.compiler.find_compiler` has it, else the cross-compiler.
        Raises ToolchainError: a tool is missing, or the program does not say a version."""
        if self.is_here():
            return find_compiler()
        require_tools()
        found = find_tool(f"{self.tools}-g++")
        if found is None:
            words = f"which compiles for {self.system} on {self.processor}; apt-get install {self.package}"
            raise ToolchainError(f"missing: {self.tools}-g++, {words}")
        return Compiler(command=(found,), version=ask_version((found,)))

    @property
    def settings(self) -> tuple[str, ...]:
        """CMake's settings for the platform; none for this machine."""
        if self.is_here():
            return ()
        return (
            f"-DCMAKE_SYSTEM_NAME={self.system}", f"-DCMAKE_SYSTEM_PROCESSOR={self.processor}", f"-DCMAKE_C_COMPILER={self.tools}-gcc",
            f"-DCMAKE_FIND_ROOT_PATH=/usr/{self.tools}", "-DCMAKE_FIND_ROOT_PATH_MODE_LIBRARY=ONLY",
        )  # fmt: skip


#: Platforms by the names that commands use.
PLATFORMS: Mapping[str, Platform] = {
    "linux-x86_64": Platform(system="Linux", processor="x86_64", tools="x86_64-linux-gnu", package="g++-x86-64-linux-gnu", avx2=_AVX2),
    "windows-x86_64": Platform(
        system="Windows", processor="x86_64", tools="x86_64-w64-mingw32", package="g++-mingw-w64-x86-64", suffix=".dll",
        avx2=(*_AVX2, _UNALIGNED),
    ),
    "linux-aarch64": Platform(system="Linux", processor="aarch64", tools="aarch64-linux-gnu", package="g++-aarch64-linux-gnu"),
}  # fmt: skip


def name_here() -> str | None:
    """The name of this machine's platform; None if it has none."""
    return next((name for name, known in PLATFORMS.items() if known.is_here()), None)
