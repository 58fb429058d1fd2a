"""The result of a pass on a model and a scene, and its notes."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.model.records import Model, Scene, Span


@dataclass(frozen=True, kw_only=True)
class Note:
    """The fate of an ``element`` of the file in a pass, or the reason that it was left: ``words`` complete the sentence that its name
    begins."""

    element: str
    words: str
    span: Span

    def __str__(self) -> str:
        return f"{self.span}: '{self.element}' {self.words}"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The model and scene after a pass: ``done`` has notes of its changes, ``left`` of changes that it did not make, each with the reason.

    The columns that the scene asks for keep their names.
    """

    model: Model
    scene: Scene
    done: tuple[Note, ...] = ()
    left: tuple[Note, ...] = ()
