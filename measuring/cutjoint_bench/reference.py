"""Reference solutions: independent of the methods that are compared, by two routes that must agree.

One route integrates the equations of natural coordinates by a Runge-Kutta method of order 8 with projections, the other the recursive
equations, which are derived, evaluated and solved another way, by extrapolation; both in 113 or 64 bits with steps of their own.  Where the
speed of a guide jumps, masses jump with it: the projections of the first route are that impact, while loops of the second are drawn
together by their stabilisation; the two are then apart by what this takes, and the first is the reference.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from math import nan
from typing import Any

import numpy as np

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS, PLAIN_CLOSURE, Formulation
from cutjoint.model.records import Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Array, Trajectory
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.cache import cache_folder, exclusive, read_record, write_record
from cutjoint_bench.progress import Say, silently
from cutjoint_bench.records import Case

#: The routes: formulation by name of the integrator.
ROUTES: Mapping[str, str] = {"Runge-Kutta": "classical", "extrapolation": "recursive"}

#: The relative error that a step of a route may have, by the number type in which references are integrated.  Roads with kinks and long
#: scenes of large models do with the shorter, which is ten times faster.
TOLERANCES: Mapping[str, float] = {"quad": 1e-16, "extended": 1e-12}

#: Penalty of the relative route (N/m), as large as the type's digits allow: multipliers are corrected in each evaluation until nothing of
#: it is left.
PENALTIES: Mapping[str, float] = {"quad": 1e9, "extended": 1e6}


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A reference solution: ``columns`` over ``t``, and how far the two routes are apart in places (m) and velocities (m/s).

    ``provenance`` says by what it was made; the two distances are nan where there is one route alone.
    """

    t: Array
    columns: Mapping[str, Array]
    position_apart: float
    velocity_apart: float
    provenance: Mapping[str, Any]


def find_reference(case: Case, *, precision: str = "quad", say: Say = silently) -> Reference:
    """The reference of a case, from the cache where it is; ``precision`` is one of TOLERANCES, ``say`` receives what is being done.

    Raises:
        RunError: neither route reaches the end.
    """
    if case.motion is not None:
        return _exact(case)
    case = replace(case, scene=_with_one_penalty(case.scene))
    say(f"{case.name}: compiling the reference")
    artifacts = {route: _compiled(case, method, precision) for route, method in ROUTES.items()}
    key = _key(case, artifacts, TOLERANCES[precision])
    place = cache_folder() / "references" / f"{key}.json"
    if (record := read_record(place)) is not None:
        return _from_json(record)
    with exclusive(place):
        if (record := read_record(place)) is None:
            say(f"{case.name}: integrating the reference")
            record = _as_json(_integrate(case, artifacts, precision))
            write_record(place, record)
    return _from_json(record)


def _with_one_penalty(scene: Scene) -> Scene:
    """The scene with one of PENALTIES for all cut joints: proximal penalties, which follow from masses, are light near singular poses."""
    return replace(scene, numerics=replace(scene.numerics, closure=PLAIN_CLOSURE))


def _exact(case: Case) -> Reference:
    """The motion of a case that is known."""
    assert case.motion is not None
    t: Array = np.arange(round(case.scene.end / case.scene.output_step) + 1, dtype=np.float64) * case.scene.output_step
    return Reference(t=t, columns=case.motion(t), position_apart=nan, velocity_apart=nan, provenance={"precision": "exact", "routes": []})


def _compiled(case: Case, method: str, precision: str) -> Artifact | None:
    """The route's simulator; None where its formulation does not take the case."""
    try:
        options = CompileOptions(method=method, outputs=case.outputs, precision=precision, additions=("reference",))
        return compile_scene(case.model, case.scene, options)
    except RunError:
        return None


def _key(case: Case, artifacts: Mapping[str, Artifact | None], tolerance: float) -> str:
    """Covers the model, the simulators and their input."""
    runs = [
        make_run_file(case.model, case.scene, case.parameters, task="simulate", method=a.method, options=PLAIN_STEPS).entries()
        for a in artifacts.values() if a
    ]  # fmt: skip
    binaries = [a.binary.path.parent.name for a in artifacts.values() if a]
    return sha256(json.dumps([binaries, runs, tolerance, PENALTIES], sort_keys=True).encode()).hexdigest()[:32]


def _integrate(case: Case, artifacts: Mapping[str, Artifact | None], precision: str) -> Reference:
    tolerance = TOLERANCES[precision]
    with ThreadPoolExecutor(max_workers=2) as pool:
        jobs = {route: pool.submit(_route, case, a, tolerance) for route, a in artifacts.items() if a is not None}
        runs = {route: job.result() for route, job in jobs.items()}
    done = {route: run for route, run in runs.items() if run.failure is None}
    if not done:
        raise RunError(f"{case.name}: no reference: " + "; ".join(f"{route}: {run.failure}" for route, run in runs.items()))
    first = next(iter(done.values()))
    places, velocities = (_apart(list(done.values()), names) for names in (("x", "y", "z"), ("vx", "vy", "vz")))
    provenance = {
        "precision": precision, "tolerance": tolerance, "routes": list(done),
        "left out": {route: str(run.failure) for route, run in runs.items() if run.failure is not None},
        "digests": {route: a.source.digest for route, a in artifacts.items() if a is not None},
        "compiler": next(a.binary.compiler for a in artifacts.values() if a is not None),
        "seconds": {route: run.seconds for route, run in done.items()},
    }  # fmt: skip
    return Reference(t=first.t, columns=first.columns, position_apart=places, velocity_apart=velocities, provenance=provenance)


def _route(case: Case, artifact: Artifact, tolerance: float) -> Trajectory:
    penalty = PENALTIES[artifact.precision] if METHODS[artifact.method].formulation is Formulation.RECURSIVE else None
    of_case = replace(artifact, scene=case.scene)
    return simulate(
        of_case, dt=case.scene.output_step, penalty=penalty, tolerance=tolerance, parameters=case.parameters, integrator="reference",
        check=False,
    )  # fmt: skip


def _apart(runs: list[Trajectory], names: tuple[str, ...]) -> float:
    """The largest distance between two runs in columns of these quantities."""
    if len(runs) < 2:
        return nan
    first, second = runs
    columns = [c for c in first.columns if c.rpartition(".")[2] in names]
    return max(float(np.abs(first[c] - second[c]).max()) for c in columns)


def _as_json(reference: Reference) -> dict[str, Any]:
    return {**asdict(reference), "t": reference.t.tolist(), "columns": {name: c.tolist() for name, c in reference.columns.items()}}


def _from_json(data: dict[str, Any]) -> Reference:
    columns = {name: np.array(values) for name, values in data["columns"].items()}
    return Reference(**{**data, "t": np.array(data["t"]), "columns": columns})
