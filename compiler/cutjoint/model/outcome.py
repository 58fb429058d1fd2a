"""The result of a pass on a model and a scene, and its notes; elements transferred to another body when one is removed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from cutjoint.model.records import Model, Scene, Span


@dataclass(frozen=True, kw_only=True)
class Note:
    """The action of a pass on an ``element`` of the file, or the reason for none: ``text`` complete the sentence that its name begins."""

    element: str
    text: str
    span: Span

    def __str__(self) -> str:
        return f"{self.span}: '{self.element}' {self.text}"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The model and scene after a pass: ``done`` has notes of its changes, ``left`` of changes that it did not make, each with the reason.
    The scene's output columns keep their names."""

    model: Model
    scene: Scene
    done: tuple[Note, ...] = ()
    left: tuple[Note, ...] = ()


#: A pass. It reads ``scene.outputs`` for the outputs that it must keep.
Pass: TypeAlias = Callable[[Model, Scene], Outcome]


def transfer_elements(model: Model, body: str, to: str) -> Model:
    """The model without a body; its elements stand on another that moves with it."""
    return replace(
        model,
        bodies=tuple(b for b in model.bodies if b.name != body),
        joints=tuple(_transferred(joint, body, to) for joint in model.joints),
        forces=tuple(_transferred(force, body, to) for force in model.forces),
        reactions=tuple(_transferred(reaction, body, to) for reaction in model.reactions),
        markers=tuple(_transferred(marker, body, to) for marker in model.markers),
    )


def _transferred(element: Any, body: str, to: str) -> Any:
    changed = {name: to for name in ("base", "follower", "body") if getattr(element, name, None) == body}
    return replace(element, **changed) if changed else element


def bodies_of(element: Any) -> set[str]:
    """The bodies that an element stands on; a force on a joint's coordinate names none."""
    return {getattr(element, name) for name in ("base", "follower", "body") if hasattr(element, name)}
