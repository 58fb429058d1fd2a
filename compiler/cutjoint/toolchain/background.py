"""A compile that nobody waits for: in a process of its own, which goes on when its parent ends.

The process reads at its standard input what to build into the cache, as its parent would have.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from tempfile import TemporaryFile
from typing import Any

from cutjoint.emit.source import Generated, Source
from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain.build import build, place_of
from cutjoint.toolchain.cache import cache_folder, is_sound
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.drivers import Kind, interpreter_is_there
from cutjoint.toolchain.objects import missing_sources
from cutjoint.toolchain.progress import forecast

_START = "from cutjoint.toolchain.background import main; main()"


class BuildPending(Exception):  # noqa: N818 -- no error
    """Code ``generated`` in so many ``seconds`` is still being compiled by another ``process``; ``wait`` gives its result."""

    def __init__(
        self, process: subprocess.Popen[bytes], forecast: float, generated: Generated, seconds: float, wait: Callable[[], Any]
    ) -> None:  # fmt: skip
        super().__init__(f"compiling takes about {forecast:.0f} s")
        self.process, self.generated, self.seconds, self.wait = process, generated, seconds, wait

    @property
    def done(self) -> bool:
        """Return whether the result is there."""
        return self.process.poll() == 0


def build_in_background(source: Source, *, flags: Sequence[str], patience: float) -> tuple[subprocess.Popen[bytes], float] | None:
    """Begin to compile a source, if that takes longer than ``patience`` (s) and its program can be interpreted meanwhile; else None.
    The process, and how long it will take (s). Raises ToolchainError: there is no compiler, or the process cannot be started."""
    compiler = find_compiler()
    if is_sound(place_of(source, compiler, flags, Kind())) or not interpreter_is_there(source.driver, compiler, flags):
        return None
    seconds = forecast(missing_sources(source, compiler, flags), [*compiler.key, *flags])
    return (_begin(source, flags), seconds) if seconds > patience else None


def main() -> None:
    """Build what standard input says."""
    os.nice(10)
    asked = json.load(sys.stdin)
    build(Source(**asked["source"]), flags=asked["flags"], kind=Kind())


def _begin(source: Source, flags: Sequence[str]) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "CUTJOINT_CACHE": str(cache_folder()), "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment, "start_new_session": True}
    try:
        with TemporaryFile("w+", encoding="utf-8") as file:
            json.dump({"source": asdict(source), "flags": list(flags)}, file)
            file.seek(0)
            return subprocess.Popen([sys.executable, "-P", "-c", _START], stdin=file, **quiet)
    except OSError as error:
        raise ToolchainError(f"a build in the background cannot be started: {error.strerror}; use --implementation generated") from error
