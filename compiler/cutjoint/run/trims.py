"""The scene that a trim makes: the start, inputs and parameters that it finds in place of what the file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy

from cutjoint.analysis.trims import Given, Trimmed
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.inputs import with_held_inputs
from cutjoint.run.road_field import surface_of
from cutjoint.run.roads import WheelRoad
from cutjoint.run.run_file import Evaluator, following, formulated_start, parameter_values


def find_trim(model: Model, scene: Scene, changes: Mapping[str, float]) -> tuple[Model, Scene, Trimmed]:
    """The model and the scene with what the scene's trim finds, where ``changes`` are values (SI units) of parameters and inputs.

    Raises:
        RunError: there is no such start, it is not determined, or a change is one of what is to be found.
    """
    assert scene.trim is not None
    if found := [unknown.name for unknown in scene.trim.find if unknown.name in changes]:
        words = f"trim: '{found[0]}' is to be found; leave out its value, or take it out of 'find'"
        raise RunError(f"{scene.trim.span}: scene '{scene.name}': {words}")
    given = given_numbers(model, scene, changes)
    begun, _ = with_held_inputs(model, scene, changes)
    trimmed: Trimmed = formulated_start(model, begun).trim(given)
    inputs = {u.name: trimmed.unknowns[u.name] for u in scene.trim.find if u.kind == "input"}
    parameters = tuple(replace(p, value=trimmed.unknowns.get(p.name, given.parameters.get(p.name, p.value))) for p in model.parameters)
    start = replace(
        begun, trim=None, assemble=(), near=(), positions=_numbers(trimmed.coordinates), rates=_numbers(trimmed.rates),
        starts=_numbers(trimmed.states), inputs={**begun.inputs, **_numbers(inputs)},
    )  # fmt: skip
    return replace(model, parameters=parameters), start, trimmed


def given_numbers(model: Model, scene: Scene, changes: Mapping[str, float]) -> Given:
    """The numbers of a scene that is trimmed."""
    assert scene.trim is not None
    values = parameter_values(model, changes)
    value, plain = Evaluator(model, values), replace(scene, trim=None, assemble=())
    parts = following(model, plain, values, ("positions", "rates", "roads"))
    return Given(
        parameters=values, positions=parts["positions"], rates=parts["rates"],
        roads={tyre: WheelRoad.of(**road, on_it=surface_of(scene.road)) for tyre, road in parts["roads"].items()},
        held=[value(aim.value, f"{aim.span}: trim: '{aim.name}'") for aim in (*scene.assemble, *scene.trim.hold)],
        bounds={u.name: (value(u.bounds[0], u.name), value(u.bounds[1], u.name)) for u in scene.trim.find if u.bounds},
    )  # fmt: skip


def _numbers(values: Mapping[str, float]) -> dict[str, sympy.Float]:
    return {name: sympy.Float(value, 17) for name, value in values.items()}
