"""Many simulations at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike

from cutjoint.compile.c_export import lanes_break_even
from cutjoint.emit.classes import MOST_LANES
from cutjoint.stepping.library import Lanes
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import Array


def rollout(
    simulation: Simulation, steps: int, *, parameters: Mapping[str, ArrayLike] | None = None,
    inputs: Mapping[str, ArrayLike] | None = None, snapshots: Sequence[bytes] | None = None, threads: int | None = None,
) -> Array:  # fmt: skip
    """Many simulations from one state or several: outputs at the end of each step, (simulations, steps, outputs).

    Rows after a failed step are NaN.  Results do not depend on the number of threads.

    Args:
        parameters: (simulations,) values by name.
        inputs: (simulations,) constant or (simulations, steps) values by name.
        snapshots: a state for each simulation; default: the present state of ``simulation``.
        threads: default: all processors.

    Raises:
        ValueError: the numbers of simulations or steps differ, or no argument says the number of simulations.
        KeyError: there is no such parameter or input.
        SimulationError: there was no `Simulation.reset`.
        ToolchainError: the compiler failed.
    """
    held, trajectories = _split(inputs or {}, steps)
    constants = (_columns(parameters or {}), held)
    counts = {len(column) for columns in (*constants, trajectories) for column in columns.values() if column.ndim}
    counts |= {len(snapshots)} if snapshots is not None else set()
    if not counts and any(constants):
        counts = {1}
    if not counts:
        raise ValueError("number of simulations unknown: give an array of values for a parameter or an input, or snapshots")
    if len(counts) != 1:
        raise ValueError(f"parameters, inputs and snapshots need one and the same number of simulations, not {sorted(counts)}")
    number, common = counts.pop(), simulation.snapshot()
    begins = [common] * number if snapshots is None else snapshots
    columns = [{name: np.broadcast_to(values, number) for name, values in each.items()} for each in constants]
    rows = np.full((number, steps, len(simulation.outputs)), np.nan)
    lanes = simulation.library.lanes
    if trajectories or lanes is None or not lanes_break_even(lanes.operations, steps * number):
        perform, at_once = _alone(simulation, begins, columns, trajectories, rows), 1
    else:
        perform, at_once = _in_lanes(simulation, lanes, begins, columns, rows), MOST_LANES
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(perform, range(0, number, at_once)))
    return rows


def _split(inputs: Mapping[str, ArrayLike], steps: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """Constant inputs, and those with a value for each step."""
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in inputs.items()}
    trajectories = {name: values for name, values in arrays.items() if values.ndim > 1}
    for name, values in trajectories.items():
        if values.ndim > 2 or values.shape[1] != steps:
            raise ValueError(f"input '{name}': an array {values.shape} is none of (simulations,) and (simulations, {steps})")
    return _columns({name: values for name, values in arrays.items() if name not in trajectories}), trajectories


def _columns(by_name: Mapping[str, ArrayLike]) -> dict[str, Array]:
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in by_name.items()}
    for name, values in arrays.items():
        if values.ndim > 1:
            raise ValueError(f"parameter '{name}': an array {values.shape} has not one value for each simulation")
    return arrays


def _alone(
    simulation: Simulation, begins: Sequence[bytes], columns: Sequence[Mapping[str, Array]], trajectories: Mapping[str, Array], rows: Array
) -> Callable[[int], None]:  # fmt: skip
    """A function that runs one of the simulations, by its index."""
    places = [(simulation.inputs.place(name), trajectory) for name, trajectory in trajectories.items()]

    def run(i: int) -> None:
        one = Simulation(simulation.library)
        one.restore(begins[i])
        for values, by_name in zip((one.parameters, one.inputs), columns, strict=True):
            for name, column in by_name.items():
                values[name] = column[i]
        take, first, step = simulation.library.run, rows[i].ctypes.data, rows.strides[1]
        if not places:
            take(one.address, rows.shape[1], first)
            return
        inputs = one.inputs.array
        for k in range(rows.shape[1]):
            for place, trajectory in places:
                inputs[place] = trajectory[i, k]
            if take(one.address, 1, first + k * step):
                return

    return run


def _in_lanes(
    simulation: Simulation, lanes: Lanes, begins: Sequence[bytes], columns: Sequence[Mapping[str, Array]], rows: Array
) -> Callable[[int], None]:  # fmt: skip
    """A function that runs simulations together, at most as many as there are lanes, from an index on."""
    parameters, inputs = (
        ([values.place(name) for name in by_name], np.column_stack([*by_name.values()]) if by_name else np.empty((len(begins), 0)))
        for values, by_name in zip((simulation.parameters, simulation.inputs), columns, strict=True)
    )
    lanes.compile()

    def run(first: int) -> None:
        part = slice(first, first + MOST_LANES)
        lanes.run(begins[part], (parameters[0], parameters[1][part]), (inputs[0], inputs[1][part]), rows[part])

    return run
