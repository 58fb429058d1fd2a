"""`cutjoint gradient`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from cutjoint.commands import options, table
from cutjoint.model.records import Binding
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import parameter_values
from cutjoint.run.scenes import take_model
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import Array, RunAdjoint, RunDerivative, weigh

#: The objective that is the pose at rest where a scene begins.
REST = "rest"

#: The step of a difference, as a share of the number, or in its unit where that is smaller than 1e-3.
_SHARE = 1e-3


@table.command("gradient")
def command(
    model: Path, scene: str | None, integrator: str | None, dt: float | None, end: float | None, opened: tuple[str, ...],
    changes: tuple[str, ...], asked: tuple[str, ...], by: tuple[str, ...], objective: str, from_rest: bool, check: bool,
) -> None:  # fmt: skip
    """Run MODEL and print how its outputs change with parameters and inputs, for the steps as taken; where there are more of these than
    outputs, from the end of the run on.

    The states at the beginning stay as they are, unless they are those of a pose at rest that changes too.
    """
    read, chosen = take_model(model, scene, opened)
    given = options.read_parameters(changes)
    with options.progress_bar(f"compiling {model.name}"):
        backwards = (len(by) or sum(p.binding is not Binding.CONST for p in read.parameters)) > (len(asked) or len(chosen.outputs))
        sim = load_scene(read, chosen, integrator=integrator, linearise=True, adjoint=backwards)
    sim.parameters.update({name: value for name, value in parameter_values(read, given).items() if name in sim.parameters})
    for name in given:
        if name in sim.inputs:
            sim.inputs[name] = float(given[name])
    sim.reset(dt=dt)
    sim.choose()
    names = list(by) or [*sim.parameters, *sim.inputs]
    steps, every = _count_steps(sim, chosen.end if end is None else end, chosen.output_step)
    start = sim.snapshot()
    try:
        outputs, begin = list(asked) or list(sim.outputs), None
        if from_rest or objective == REST:
            rest = sim.rest_derivative(outputs, names)
            begin = rest.states
        run: RunAdjoint | RunDerivative
        if objective == REST:
            run = RunDerivative(times=np.zeros(1), values=rest.values[None], slopes=rest.slopes[None], outputs=rest.outputs, by=rest.by)
            steps, (value, slope) = 0, run.end
        elif backwards:
            run = back = sim.play_adjoint(steps, outputs, names, objective, every=every, begin=begin)
            value, slope = back.objectives, back.slopes
        else:
            run = sim.play_derivative(steps, outputs, names, every=every, begin=begin)
            value, slope = getattr(run, objective)
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(str(error.args[0])) from None
    options.out.print(_tabled(sim, run, objective, value, slope))
    if check:
        ends = partial(_course, sim, None if begin is not None else start, run, steps, every, "end" if objective == REST else objective)
        sim.restore(start)
        share = _error(sim, ends, run, slope)
        options.out.print(f"off differences of runs by {share:.1e} of the largest", markup=False)


def _count_steps(sim: Simulation, end: float, output_step: float) -> tuple[int, int]:
    """The steps of a run to a time, and how many there are between rows."""
    every = max(1, round(output_step / sim.settings.step))
    return every * max(1, round((end - sim.time) / sim.settings.step / every)), every


def _tabled(sim: Simulation, run: RunAdjoint | RunDerivative, objective: str, value: Array, slope: Array) -> Table:
    made = Table(title=f"{objective} of outputs, {run.times[0]:g} to {run.times[-1]:g} s", title_justify="left", box=None)
    for heading in ("by", *run.outputs):
        made.add_column(heading, justify="left" if heading == "by" else "right")
    units = sim.outputs.units or {}
    made.add_row("", *(f"{x + 0.0:.6g} {units[name]}" for name, x in zip(run.outputs, value, strict=True)))
    for name, row in zip(run.by, slope.T, strict=True):
        made.add_row(name, *(f"{x + 0.0:.6g}" for x in row))
    return made


def _error(sim: Simulation, course: Callable[[str, float], Array], run: RunAdjoint | RunDerivative, slope: Array) -> float:
    """The largest error of slopes beside central differences of fourth order, as a share of the largest slope by the same number."""
    errors, start = [], sim.snapshot()
    for name, row in zip(run.by, slope.T, strict=True):
        sim.restore(start)
        numbers = next((numbers for numbers in (sim.states, sim.parameters) if name in numbers), None)
        value = sim.present_input(name) if numbers is None else numbers[name]
        h = _SHARE * max(abs(value), 1.0 if value == 0.0 else 1e-3)
        ends = [course(name, value + way * h) for way in (-2, -1, 1, 2)]
        found = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        size = np.abs(found).max()
        errors.append(np.abs(row - found).max() / size if size > 0.0 else np.abs(row).max())
    return float(max(errors, default=0.0))


def _course(
    sim: Simulation, start: bytes | None, run: RunAdjoint | RunDerivative, steps: int, every: int, objective: str, name: str, value: float
) -> Array:  # fmt: skip
    """The objective of a run with another number from the same states, a snapshot, or from the scene's start."""
    if start is not None:
        sim.restore(start)
    states, before = {**sim.states}, (dict(sim.parameters), sim.inputs.array.copy())
    next(numbers for numbers in (states, sim.parameters, sim.inputs) if name in numbers)[name] = value
    if start is None:
        sim.reset()
    else:
        sim.set_states(np.array([*states.values()]))
    places = [sim.outputs.place(output) for output in run.outputs]
    rows = np.vstack([sim.outputs.array, sim.play(steps)[every - 1 :: every]])[:, places]
    sim.parameters.update(before[0])
    sim.inputs.array[:] = before[1]
    found, _ = weigh(objective, run.times, rows, run.outputs)
    return found
