"""Many simulations at once."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import Array


def rollout(
    simulation: Simulation, steps: int, *, parameters: Mapping[str, Sequence[float]] | None = None,
    inputs: Mapping[str, Sequence[float]] | None = None, snapshots: Sequence[bytes] | None = None, threads: int | None = None,
) -> Array:  # fmt: skip
    """Many simulations from a state or several: the outputs of each at the end of each step, (simulations, steps, outputs).

    ``parameters`` and ``inputs``, which are held, have a value for each simulation, ``snapshots`` a state; where there are none all start
    as ``simulation`` stands, which itself stays.  They run in ``threads`` (as many as there are processors).  Where a step fails, the
    rows from there on are NaN.

    Raises:
        ValueError: the numbers of simulations differ, or there is nothing to tell it by.
        KeyError: there is no such parameter or input.
        SimulationError: there was no `Simulation.reset`.
    """
    given = (parameters or {}, inputs or {})
    counts = {np.atleast_1d(column).size for columns in given for column in columns.values()}
    counts |= {len(snapshots)} if snapshots is not None else set()
    if not counts:
        raise ValueError("how many simulations? give a parameter or an input a value for each, or snapshots")
    if len(counts) != 1:
        raise ValueError(f"parameters, inputs and snapshots need one and the same number of simulations, not {sorted(counts)}")
    common = simulation.snapshot()
    rows = np.full((counts.pop(), steps, len(simulation.outputs)), np.nan)

    def run(i: int) -> None:
        one = Simulation(simulation.library)
        one.restore(common if snapshots is None else snapshots[i])
        for values, columns in zip((one.parameters, one.inputs), given, strict=True):
            for name, column in columns.items():
                values[name] = np.atleast_1d(column)[i]
        simulation.library.play(one.address, steps, rows[i].ctypes.data)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(run, range(len(rows))))
    return rows
