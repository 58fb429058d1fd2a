"""The files that ``compile --out`` writes: the generated source and the simulator."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole


def require_no_model(names: Iterable[str], folder: Path, model: Path) -> None:
    """Check that none of the files of some ``names`` that go into a folder is the ``model``.

    Raises:
        OutputError: one is.
    """
    require_apart({"the model": model}, documents=[(f"--out {folder}: file", folder / name) for name in names])


def write_compiled(files: Mapping[str, str], program: str, built: Path, folder: Path) -> None:
    """Write generated ``files``, by name, and a copy of the program that was ``built`` into a folder; each replaces an earlier one as a
    whole.

    An earlier program that is running goes on.

    Raises:
        OutputError: a file cannot be written.
    """
    for name, text in files.items():
        write_whole(folder / name, text)
    os.chmod(write_whole(folder / program, built.read_bytes()), built.stat().st_mode & 0o777)
