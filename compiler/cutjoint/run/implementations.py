"""The contract of an implementation of models beside generated code and its interpreter, which another package adds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Scene
    from cutjoint.run.artifact import Artifact


@dataclass(frozen=True, kw_only=True)
class Backend:
    """An implementation of models beside generated code and its interpreter.

    ``compile`` makes a simulator ready for a model in a scene by a method.  ``code`` are the folders of all that it is made of, besides the
    product: cached runs follow from them.  ``solvers`` are the linear solvers of methods that have one.  It is imported for cached runs
    too, and so imports modules that compile at their first use.
    """

    name: str
    compile: Callable[[Model, Scene, str], Artifact]
    code: tuple[Path, ...]
    solvers: Mapping[str, str]
