"""Many simulations at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cutjoint.emit.standalone import LANES
from cutjoint.stepping.lanes import Lanes
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import Array


def rollout(
    simulation: Simulation, steps: int, *, parameters: Mapping[str, Sequence[float]] | None = None,
    inputs: Mapping[str, Sequence[float]] | None = None, snapshots: Sequence[bytes] | None = None, threads: int | None = None,
) -> Array:  # fmt: skip
    """Many simulations from a state or several: the outputs of each at the end of each step, (simulations, steps, outputs).

    ``parameters`` and ``inputs``, which are held, have a value for each simulation, ``snapshots`` a state; where there are none all start
    as ``simulation`` stands, which itself stays.  They run in ``threads`` (as many as there are processors), whose number changes nothing.
    Where a step fails, the rows from there on are NaN.  So many steps by the trapezoidal rule of method recursive that it pays to compile
    for it go eight at a time in lanes, which have the same numbers up to rounding.

    Raises:
        ValueError: the numbers of simulations differ, or there is nothing to tell it by.
        KeyError: there is no such parameter or input.
        SimulationError: there was no `Simulation.reset`.
        ToolchainError: the compiler failed.
    """
    given = (parameters or {}, inputs or {})
    counts = {np.atleast_1d(column).size for columns in given for column in columns.values()}
    counts |= {len(snapshots)} if snapshots is not None else set()
    if not counts:
        raise ValueError("how many simulations? give a parameter or an input a value for each, or snapshots")
    if len(counts) != 1:
        raise ValueError(f"parameters, inputs and snapshots need one and the same number of simulations, not {sorted(counts)}")
    number, common = counts.pop(), simulation.snapshot()
    begins = [common] * number if snapshots is None else snapshots
    columns = [{name: np.broadcast_to(np.asarray(values, dtype=np.float64), number) for name, values in each.items()} for each in given]
    rows = np.full((number, steps, len(simulation.outputs)), np.nan)
    lanes = simulation.library.lanes
    if lanes is not None and lanes.pay(steps * number):
        perform, at_once = _in_lanes(simulation, lanes, begins, columns, rows), LANES
    else:
        perform, at_once = _alone(simulation, begins, columns, rows), 1
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(perform, range(0, number, at_once)))
    return rows


def _alone(simulation: Simulation, begins: Sequence[bytes], columns: Sequence[Mapping[str, Array]], rows: Array) -> Callable[[int], None]:
    """What plays one of the simulations."""

    def run(i: int) -> None:
        one = Simulation(simulation.library)
        one.restore(begins[i])
        for values, given in zip((one.parameters, one.inputs), columns, strict=True):
            for name, column in given.items():
                values[name] = column[i]
        simulation.library.play(one.address, rows.shape[1], rows[i].ctypes.data)

    return run


def _in_lanes(
    simulation: Simulation, lanes: Lanes, begins: Sequence[bytes], columns: Sequence[Mapping[str, Array]], rows: Array
) -> Callable[[int], None]:
    """What plays as many of them as there are lanes, from one on."""
    parameters, inputs = (
        ([values.place(name) for name in given], np.column_stack([*given.values()]) if given else np.empty((len(begins), 0)))
        for values, given in zip((simulation.parameters, simulation.inputs), columns, strict=True)
    )
    lanes.compile()

    def run(first: int) -> None:
        part = slice(first, first + LANES)
        lanes.play(begins[part], (parameters[0], parameters[1][part]), (inputs[0], inputs[1][part]), rows[part])

    return run
