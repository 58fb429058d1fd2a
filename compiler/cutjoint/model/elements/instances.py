"""The tree of instances: a submodel may hold submodels and instances of its own.

The name of a submodel is looked up where its instance is defined, then in the enclosing parts of the document, the model last.
"""

from collections.abc import Iterator, Sized
from dataclasses import dataclass
from typing import TypeAlias

from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path

MAX_ELEMENTS = 20_000  #: elements of the model with all its instances
MAX_NESTED = 20  #: instances within each other


@dataclass(frozen=True)
class Level:
    """A part of the document at a ``path``."""

    part: model_file.Document | model_file.Submodel
    path: Path


#: A part of the document and the parts around it, the model first.
Levels: TypeAlias = tuple[Level, ...]


@dataclass(frozen=True)
class Use:
    """An instance by its full name, in the instance ``owner``, "" in the model. ``around`` are the parts in which it stands, ``levels`` its
    submodel and the parts around that, empty if there is none. ``fault`` says why it cannot stand there, "" if it can."""

    name: str
    owner: str
    path: Path
    instance: model_file.Instance
    around: Levels
    levels: Levels
    fault: str

    @property
    def submodel(self) -> model_file.Submodel | None:
        """The submodel; None where there is none, or a fault."""
        part = self.levels[-1].part if self.levels and not self.fault else None
        return part if isinstance(part, model_file.Submodel) else None

    @property
    def at(self) -> Path:
        """The place of its submodel in the document."""
        return self.levels[-1].path


def find_uses(model: model_file.Document) -> Iterator[Use]:
    """All instances, each before those inside it; no more than a model may have."""
    count = count_elements(model)
    for use in _below((Level(model, ()),), "", ()):
        count += 1 if use.submodel is None else 1 + count_elements(use.submodel)
        yield use
        if count > 2 * MAX_ELEMENTS:
            return


def _below(levels: Levels, owner: str, around: tuple[Path, ...]) -> Iterator[Use]:
    prefix = f"{owner}." if owner else ""
    part, path = levels[-1].part, levels[-1].path
    for name, instance in part.instances.items():
        found = _look_up(levels, instance.use)
        fault = "stands inside itself" if found and found[-1].path in around else ""
        if len(around) == MAX_NESTED:
            fault = fault or f"stands more than {MAX_NESTED} deep in others"
        yield Use(prefix + name, owner, (*path, "instances", name), instance, levels, found, fault)
        if found and not fault:
            yield from _below(found, prefix + name, (*around, found[-1].path))


def _look_up(levels: Levels, name: str) -> Levels:
    for i in reversed(range(len(levels))):
        part, path = levels[i].part, levels[i].path
        if name in part.submodels:
            return (*levels[: i + 1], Level(part.submodels[name], (*path, "submodels", name)))
    return ()


def find_submodels(model: model_file.Document) -> Iterator[Level]:
    """All submodels of the document."""
    waiting = [Level(model, ())]
    while waiting:
        level = waiting.pop(0)
        inner = [Level(part, (*level.path, "submodels", name)) for name, part in level.part.submodels.items()]
        yield from inner
        waiting += inner


def count_elements(part: model_file.Elements) -> int:
    """The number of elements of a part, without those of its instances."""
    sections: tuple[Sized, ...] = (
        part.points, part.bodies, part.joints, part.gears, part.forces, part.reactions, part.markers, part.states, part.signals,
        part.controllers, part.outputs,
    )  # fmt: skip
    return sum(len(section) for section in sections)
