"""Paths that callers give, the folders templates/ and runtime/, in the package of a wheel or beside it in a checkout, and the version."""

import re
from hashlib import sha256
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import TypeAlias

from cutjoint.package.errors import RunError

#: A path as a caller gives it.
AnyPath: TypeAlias = str | PathLike[str]

_PACKAGE = Path(__file__).resolve().parent.parent

#: Files that the present command writes, with their options.
OUTPUTS: dict[Path, str] = {}


def require_input(path: Path) -> None:
    """Raises RunError if a file that is read is one that the present command writes."""
    for output, option in OUTPUTS.items():
        if path.is_file() and output.is_file() and output.samefile(path):
            raise RunError(f"{option} {output}: that is {path.name}, which the command reads; write the results elsewhere")


def path_of(path: AnyPath | None) -> Path | None:
    """The path that a caller gives, None if there is none."""
    return None if path is None else Path(path)


def templates_folder() -> Path:
    """The folder of the Jinja2 templates."""
    return _find("templates")


def runtime_folder() -> Path:
    """The folder of the C++ runtime."""
    return _find("runtime")


def licence() -> str:
    """The text of the licence of the runtime, which exported code contains."""
    return _find("LICENSE").read_text(encoding="utf-8")


def licence_of_musl() -> str:
    """The text of the licence of the mathematics, which modules of WebAssembly contain."""
    return (runtime_folder() / "libm" / "COPYRIGHT").read_text(encoding="utf-8")


def library_folder() -> Path:
    """The folder of the submodels that the package ships."""
    return _PACKAGE / "library"


def binaries_folder() -> Path:
    """The folder of programs and libraries that do without a compiler; only wheels for a platform have it (`scripts/wheel`)."""
    return _PACKAGE / "binaries"


def code_folders() -> tuple[Path, ...]:
    """All that the compiler is made of: its modules, the templates and the runtime."""
    return _PACKAGE, templates_folder(), runtime_folder()


def _find(name: str) -> Path:
    for candidate in (_PACKAGE / name, _PACKAGE.parent.parent / name):
        if candidate.exists():
            return candidate
    raise FileNotFoundError(f"{name} of cutjoint is missing; install cutjoint again")


__version__ = version("cutjoint")

_MARK = re.compile(r"( from model '\w+') \(sha256 [0-9a-f]{12}\)")


def origin_of(name: str, text: str) -> str:
    """The version and the model, by its name and the first digits of the digest of its file's text."""
    mark = f" (sha256 {sha256(text.encode()).hexdigest()[:12]})" if text else ""
    return f"cutjoint {__version__} from model '{name}'{mark}"


def without_mark(generated: str) -> str:
    """Generated text without the digest of the model file: models that differ elsewhere share what is compiled."""
    return _MARK.sub(r"\1", generated)
