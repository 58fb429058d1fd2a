"""What results of the cache follow from: files of models, sources of the product, versions."""

import codecs
import re
import sys
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from importlib.metadata import requires, version
from pathlib import Path

from cutjoint.package.locations import binaries_folder, require_input

#: The largest number of bytes that are read of a model file: above the limit of models, so that a truncated file never matches.
LARGEST = 8_000_000


def digests_of(files: Iterable[str]) -> dict[str, str]:
    """The digests of files as they are. Raises OSError: one cannot be read."""
    found = {}
    for file in files:
        require_input(Path(file))
        with Path(file).open("rb") as stream:
            content = stream.read(LARGEST).removeprefix(codecs.BOM_UTF8)
        try:
            content.decode()
        except UnicodeDecodeError:  # the text of such a file is that in Latin-1
            content = content.decode("latin-1").encode()
        found[file] = sha256(content).hexdigest()
    return found


@cache
def code_digest(folders: tuple[Path, ...]) -> str:
    """The digest of the sources in folders, as they were at the first call."""
    code, others = sha256(), binaries_folder()
    for folder in folders:
        for path in sorted(p for p in folder.rglob("*") if p.suffix not in ("", ".pyc") and not p.is_relative_to(others) and p.is_file()):
            content = path.read_bytes()
            code.update(f"{path.relative_to(folder)}\0{len(content)}\0".encode() + content)
    return code.hexdigest()


@cache
def versions() -> tuple[str, ...]:
    """The versions of Python, of this package and of its requirements."""
    required = [re.split(r"[^\w.-]", line)[0] for line in requires("cutjoint") or () if "extra ==" not in line]
    return (sys.version, *(f"{name} {version(name)}" for name in ("cutjoint", *required)))
