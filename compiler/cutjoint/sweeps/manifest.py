"""What a table is of, in plain data: digests, versions, design.  No date, host or folder is in it."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from typing import Any

from cutjoint.sweeps.kernel import Kernel
from cutjoint.sweeps.records import Study
from cutjoint.version import __version__

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
        "lanes": {kernel.scene: kernel.lanes for kernel in kernels},
        "compiler": target.compiler,
        "flags": list(target.flags),
        "processor": [target.machine, *target.features],
        "design": dict(study.design),
        "runs": study.runs,
        "versions": {name: version(name) for name in ("numpy", "pyarrow")},
    }  # fmt: skip
