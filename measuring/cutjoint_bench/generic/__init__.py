"""The generic solver: the runtime's other mechanism, which interprets a description of the model in place of code made for it."""

from __future__ import annotations

from pathlib import Path

#: The modules of the generic solver, and its C++, which includes the product's and the solvers of `ADDITIONS`.
FOLDER = Path(__file__).resolve().parent
RUNTIME, ADDITIONS = FOLDER.parent / "runtime", FOLDER.parent / "driver"
