"""The origin of a table in plain data: digests, versions, design.  No date, host or folder is in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from hashlib import sha256
from importlib.metadata import version
from typing import Any

from cutjoint.package.version import __version__
from cutjoint.run.settings import StepSettings
from cutjoint.sweeps.kernel import Kernel
from cutjoint.sweeps.records import Study

#: The form of tables; another number where columns or their meaning change.
FORMAT = 2


def make_manifest(study: Study, kernels: Sequence[Kernel]) -> dict[str, Any]:
    """The manifest of a study's table; rows that have the same one are the same, bit by bit."""
    target = kernels[0].target
    return {
        "format": FORMAT,
        "cutjoint": __version__,
        "name": study.model.name,
        "model": sha256(study.model.text.encode()).hexdigest(),
        "study": study.digest,
        "source": {kernel.scene: kernel.source for kernel in kernels},
        "library": {kernel.scene: kernel.digest for kernel in kernels},
        "method": study.method,
        **{each.name: {k.scene: getattr(k.steps, each.name) for k in kernels} for each in fields(StepSettings)},
        "lanes": {kernel.scene: kernel.lanes for kernel in kernels},
        "compiler": target.compiler,
        "flags": list(target.flags),
        "processor": [target.machine, *target.features],
        "design": dict(study.design),
        "runs": study.runs,
        "versions": {name: version(name) for name in ("numpy", "pyarrow")},
    }  # fmt: skip


def steps_of(manifest: Mapping[str, Any]) -> dict[str, str]:
    """The steps of each scene's runs, in words."""
    return {
        scene: f"{StepSettings(**{each.name: manifest[each.name][scene] for each in fields(StepSettings)})}, runs {_together(lanes)}"
        for scene, lanes in manifest["lanes"].items()
    }


def _together(lanes: int) -> str:
    return "one by one" if lanes == 1 else f"{lanes} side by side"
