"""Limits of the fixed point of the recursive method, predicted from its map along a scene's trajectory."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.run.artifact import Artifact
from cutjoint.run.result_files import RunTables
from cutjoint.run.results import Array
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import Options
from cutjoint.run.simulator import call_simulator
from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.cases import make_rows
from cutjoint_bench.driver import REFERENCE
from cutjoint_bench.records import Case

#: Rows at which the map is looked at, at most.
MOST_STATES = 500


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The largest step, s, with a contracting map at every state, and the time in s of the state that sets it."""

    contracts: float
    time: float


def predict_limit(case: Case, artifact: Artifact) -> Prediction | None:
    """Predict the largest step of a case compiled by the recursive method; None where its penalty follows the step.

    With the accelerations a of a state, the map from accelerations to accelerations has the Jacobian
    dt^2/4 da/dq + dt/2 da/dv (eqs. 43, 44), which contracts while its spectral radius is below one.  Mixed iterations may go beyond, in
    two directions at a time.
    """
    if case.scene.numerics.by_step:
        return None
    contracts, time = inf, 0.0
    for t, stiffness, damping in _tangents(case, artifact):
        if (found := _limit(stiffness, damping, contracts)) < contracts:
            contracts, time = found, t
    return Prediction(contracts=contracts, time=time)


def _tangents(case: Case, artifact: Artifact) -> Iterator[tuple[float, Array, Array]]:
    """Time, da/dq and da/dv at rows of a run at the scene's own step, which ends where it fails."""
    scene = replace(case.scene, output_step=make_rows(case.scene.output_step, case.scene.end, MOST_STATES))
    own = compile_scene(artifact.model, scene, CompileOptions(outputs=case.outputs, additions=(REFERENCE.name,)))
    options = Options(integrator="trapezoidal", events="crossed")
    file = make_run_file(own.model, own.scene_as_compiled, case.parameters, task="simulate", method=own.method, options=options)
    with temporary_folder() as folder, RunTables(None, out=None) as tables:
        path = folder / "tangents.jsonl"
        entries = {**file.entries(), **tables.places, "integrator": "fixed-point-map", "tangents_out": str(path)}
        call_simulator(own.binary.path, entries)
        for line in path.read_text(encoding="utf-8").splitlines():
            found = json.loads(line)
            columns = (np.array(found[name], dtype=float) for name in ("stiffness", "damping"))
            stiffness, damping = (c.reshape(int(len(c) ** 0.5), -1).T for c in columns)
            yield found["t"], stiffness, damping


def _limit(stiffness: Array, damping: Array, known: float) -> float:
    """The step at which the map has a spectral radius of one, to a part in a thousand; at most the known one."""

    def is_below(dt: float) -> bool:
        return bool(np.abs(np.linalg.eigvals(dt * dt / 4 * stiffness + dt / 2 * damping)).max(initial=0.0) < 1.0)

    high = min(known, 1e3)
    if is_below(high):
        return known
    low = high
    while not is_below(low):
        low, high = low / 2, low
    while high > 1.001 * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return low
