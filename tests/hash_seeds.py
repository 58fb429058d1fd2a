"""Programs under several seeds of Python's hashes, which order sets."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def outputs(program: str, *seeds: str) -> list[str]:
    """The output of a program under each seed; the runs are side by side.

    Raises:
        CalledProcessError: a run fails.
    """
    command = [sys.executable, "-c", program]
    runs = [
        subprocess.Popen(command, cwd=ROOT, env={**os.environ, "PYTHONHASHSEED": seed}, stdout=subprocess.PIPE, text=True) for seed in seeds
    ]
    printed = [run.communicate()[0].strip() for run in runs]
    for run in runs:
        if run.returncode:
            raise subprocess.CalledProcessError(run.returncode, command)
    return printed
