"""The files that ``compile --out`` writes: the generated source and the simulator."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole

SIMULATOR = "simulator"


def require_no_model(files: Mapping[str, str], folder: Path, model: Path) -> None:
    """Check that none of the files that go into a folder is the ``model``.

    Raises:
        OutputError: one is.
    """
    require_apart({"the model": model}, documents=[(f"--out {folder}: file", folder / name) for name in (*files, SIMULATOR)])


def write_compiled(files: Mapping[str, str], simulator: Path, folder: Path) -> None:
    """Write generated ``files``, by name, and a copy of the simulator into a folder; each replaces an earlier one as a whole.

    An earlier simulator that is running goes on.

    Raises:
        OutputError: a file cannot be written.
    """
    for name, text in files.items():
        write_whole(folder / name, text)
    os.chmod(write_whole(folder / SIMULATOR, simulator.read_bytes()), simulator.stat().st_mode & 0o777)
