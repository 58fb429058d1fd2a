"""The model of a run, as callers in Python give it, and its scene: their choice and the scene's settings."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

from cutjoint.methods import DEFAULT_INTEGRATOR, DEFAULT_METHOD, INTEGRATORS, METHODS
from cutjoint.package.errors import RunError

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Scene
    from cutjoint.package.locations import AnyPath


def find_scene(model: Model, name: str | None) -> Scene:
    """The scene of a name; by default the only one, or an empty one if the model has none.
    Raises RunError: there is no such scene, or several and none was named."""
    if name is None and len(model.scenes) <= 1:
        return next(iter(model.scenes.values()), _empty_scene(model))
    if name is None or name not in model.scenes:
        requested = "name a scene" if name is None else f"no scene '{name}'"
        raise RunError(f"{model.span.file}: {requested}; the model has {', '.join(model.scenes) or 'none'}")
    return model.scenes[name]


def in_scene(model: Model, scene: Scene) -> Model:
    """The model with the guides that its joints have in a scene."""
    joints = model.joints if model.written is None else model.written
    if scene.guides:
        changed = tuple(replace(joint, guide=scene.guides[joint.name]) if joint.name in scene.guides else joint for joint in joints)
        return replace(model, joints=changed, written=joints)
    return model if model.written is None else replace(model, joints=joints, written=None)


def find_case(model: Model, name: str | None) -> tuple[Model, Scene]:
    """The model in the scene of a name (`find_scene`), and the scene."""
    scene = find_scene(model, name)
    return in_scene(model, scene), scene


def _empty_scene(model: Model) -> Scene:
    from cutjoint.model.records import Numerics, Road, Scene

    return Scene(
        name="rest", end=1.0, output_step=1e-3, pose="design", positions={}, rates={}, inputs={}, switches={}, road=Road(),
        numerics=Numerics(), outputs=(), span=model.span,
    )  # fmt: skip


def with_closure(scene: Scene, closure: str) -> Scene:
    """The scene with another closure; its penalty settings stay."""
    return replace(scene, numerics=replace(scene.numerics, closure=closure))


def with_default_closure(scene: Scene, method: str, integrator: str | None, dt: float | None = None) -> Scene:
    """The scene with the closure that belongs to the requested integrator, or to fixed steps ``dt`` (s), if it names none."""
    own = scene.numerics
    requested = integrator or (None if dt is None or own.integrator else DEFAULT_INTEGRATOR)
    if own.closure is not None or requested is None or requested not in INTEGRATORS or method not in METHODS:
        return scene
    usual = INTEGRATORS[requested].closure
    return with_closure(scene, usual) if usual in METHODS[method].closures else scene


def with_loops(scene: Scene, loops: str | None) -> Scene:
    """The scene with another loop closure; unchanged if ``loops`` is None."""
    return scene if loops in (None, scene.numerics.loops) else replace(scene, numerics=replace(scene.numerics, loops=loops))


def with_settings(scene: Scene, method: str, changes: Mapping[str, float]) -> Scene:
    """The scene with other settings for one method."""
    settings = {**scene.numerics.methods.get(method, {}), **changes}
    return replace(scene, numerics=replace(scene.numerics, methods={**scene.numerics.methods, method: settings}))


@runtime_checkable
class Compiled(Protocol):
    """A model that is compiled for a scene."""

    @property
    def model(self) -> Model:
        """The model."""

    @property
    def scene(self) -> Scene:
        """The scene."""


ModelLike: TypeAlias = "AnyPath | Model | Compiled"


def model_of(source: ModelLike, tunable: Sequence[str] = ()) -> Model:
    """The model, whatever its scenes are.

    Raises:
        ModelError: the file is wrong.
        RunError: numbers are to be ``tunable`` after the file was read.
    """
    if isinstance(source, str | PathLike):
        from cutjoint.run.reading import read_model  # cached runs do not need it

        return read_model(source, tunable=tunable)
    from cutjoint.model.records import Model

    if not isinstance(source, Model | Compiled):
        raise TypeError(f"a model is its file, what read_model has made of it, or an artifact, not {type(source).__name__}")
    if tunable:
        raise RunError("constants become tunable while the file is read; give the file, or read_model(path, tunable=[...])")
    return source if isinstance(source, Model) else source.model


def load_model(source: ModelLike, scene: str | None = None, tunable: Sequence[str] = ()) -> tuple[Model, Scene]:
    """The model (`model_of`), and its scene of a name: without one the scene that it is compiled for, or the only one.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such scene, or numbers are to be ``tunable`` after the file was read.
    """
    model = model_of(source, tunable)
    return (model, source.scene) if scene is None and isinstance(source, Compiled) else find_case(model, scene)


def method_of(scene: Scene, offered: Collection[str] = METHODS) -> str:
    """The method that a scene names, if it is among those ``offered``; else the default one."""
    return scene.method if scene.method in offered else DEFAULT_METHOD
