"""The wheel with programs and libraries for a platform: $CUTJOINT_BINARIES, which `scripts/wheel` sets, is their folder, named as that."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Binaries(BuildHookInterface[Any]):
    """Puts the folder into the package and the platform into the wheel's name; without a folder the wheel is for all."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if folder := os.environ.get("CUTJOINT_BINARIES"):
            build_data["force_include"][folder] = "cutjoint/binaries"
            build_data["tag"] = f"py3-none-{Path(folder).name}"
            build_data["pure_python"] = False
