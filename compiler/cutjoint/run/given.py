"""A model as callers in Python give it: its file, the model itself, or a compiled one."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Protocol, TypeAlias, runtime_checkable

from cutjoint.methods import DEFAULT_METHOD, METHODS
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath
from cutjoint.run.scenes import find_case
from cutjoint.topology.reading import read_model


@runtime_checkable
class Compiled(Protocol):
    """A model that is compiled for a scene."""

    @property
    def model(self) -> Model:
        """The model."""

    @property
    def scene(self) -> Scene:
        """The scene."""


Given: TypeAlias = AnyPath | Model | Compiled


def take_model(given: Given, scene: str | None = None, opened: Sequence[str] = ()) -> tuple[Model, Scene]:
    """The model, and its scene of a name: without one the scene that it is compiled for, or the only one.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such scene, or numbers are to be ``opened`` after the file was read.
    """
    if isinstance(given, str | PathLike):
        return find_case(read_model(given, opened=opened), scene)
    if not isinstance(given, Model | Compiled):
        raise TypeError(f"a model is its file, what read_model has made of it, or an artifact, not {type(given).__name__}")
    if opened:
        raise RunError("numbers are opened while the file is read; give the file, or read_model(path, opened=[...])")
    if isinstance(given, Model):
        return find_case(given, scene)
    return (given.model, given.scene) if scene is None else find_case(given.model, scene)


def method_of(scene: Scene) -> str:
    """The method that a scene names; one that leaves the choice open, or names none, has the default one."""
    return scene.method if scene.method in METHODS else DEFAULT_METHOD
