"""What makes a case hard along its motion: its fastest mode, how close it comes to a singular pose, and parts without mass."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from cutjoint.analysis.closing import evaluate_closures
from cutjoint.analysis.modes import find_mode_shapes
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import LINEARISED, Loops
from cutjoint.package.errors import CutjointError
from cutjoint.run.artifact import Artifact
from cutjoint.run.modes import NotReachedError, linearise_at
from cutjoint.run.results import Array
from cutjoint.run.run_file import parameter_values
from cutjoint.run.scenes import with_loops
from cutjoint.run.simulation import simulate
from cutjoint_bench.cases import make_rows
from cutjoint_bench.records import Case

#: Shares of a scene's time at which its modes are found, and the poses at most that are looked at.
SHARES, POSES = (0.02, 0.25, 0.5, 0.75, 0.98), 200

#: A pose this close (smallest singular value over the largest) is nearly singular.
NEARLY_SINGULAR = 0.03

#: A singular value below this share of the largest is rounding: its equation follows from the others in every pose.
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What makes a case hard; None where it could not be found.

    ``rate`` is the largest absolute eigenvalue (1/s) of the motion's linearisation, at ``rate_time`` s, of some times of it.  ``closeness``
    is the smallest singular value of the cut joints' Jacobian over the largest, 0 at a singular pose, least over the motion at
    ``closest_time`` s; None without loops.  ``singular_times`` are all at which the motion passes a pose that is nearly singular.
    ``massless`` are the bodies without mass.
    """

    rate: float | None = None
    rate_time: float | None = None
    closeness: float | None = None
    closest_time: float | None = None
    singular_times: tuple[float, ...] = ()
    massless: tuple[str, ...] = ()


def find_conditions(case: Case) -> Conditions:
    """The conditions of a case with its parameters."""
    values = parameter_values(case.model, case.parameters)
    found = Conditions(massless=tuple(b.name for b in case.model.bodies if _is_zero(b.mass, values)))
    with suppress(CutjointError, NotReachedError):
        scene = with_loops(case.scene, Loops.EXACT)
        artifact = compile_scene(case.model, scene, CompileOptions(method=LINEARISED, outputs=case.outputs))
        rates = list(_rates(case, artifact))
        if rates:
            rate, time = max(rates)
            found = replace(found, rate=rate, rate_time=time)
        poses = list(_closeness(case, artifact))
        if poses:
            closeness, time = min(poses)
            found = replace(found, closeness=closeness, closest_time=time, singular_times=passes(poses))
    return found


def passes(poses: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """The times at which the closeness to a singular pose is least among its neighbours, and nearly singular."""
    least = [inf, *(closeness for closeness, _ in poses), inf]
    return tuple(
        time for i, (closeness, time) in enumerate(poses, start=1)
        if closeness <= NEARLY_SINGULAR and least[i - 1] > closeness <= least[i + 1]
    )  # fmt: skip


def _is_zero(mass: Any, values: Mapping[str, float]) -> bool:
    return float(mass.subs(values) if hasattr(mass, "subs") else mass) == 0.0


def _rates(case: Case, artifact: Artifact) -> Iterator[tuple[float, float]]:
    """The largest absolute eigenvalue at some times, and the time."""
    equations = formulate_implicit(artifact.mechanism, ())
    for share in SHARES:
        with suppress(CutjointError, NotReachedError):
            time, linearised = linearise_at(artifact, equations, share * case.scene.end, case.parameters, None)
            modes = find_mode_shapes(linearised, time).modes
            yield max((abs(mode.eigenvalue) for mode in modes), default=0.0), time


def _closeness(case: Case, artifact: Artifact) -> Iterator[tuple[float, float]]:
    """The least singular value of the loops' Jacobian over the largest along the motion, and the time.

    Of equations that follow from others in every pose, as those of planar loops do, the singular value is zero and does not count.
    """
    equations = with_parameters(artifact.mechanism, parameter_values(case.model, case.parameters))
    if not equations.closures:
        return
    rows = make_rows(case.scene.output_step, case.scene.end, POSES)
    run = simulate(artifact.with_rows(rows), parameters=case.parameters, coordinates=True, error=False, check=False)
    if run.coordinates is None:
        return
    values = [_singular_values(equations, q, float(t)) for t, q in zip(run.t, run.coordinates, strict=True)]
    rank = max((int(np.sum(v > _ROUNDING * v[0])) for v in values if v.size), default=0)
    yield from ((float(v[rank - 1] / v[0]), float(t)) for t, v in zip(run.t, values, strict=True) if rank)


def _singular_values(equations: RecursiveEquations, q: Array, t: float) -> Array:
    return np.asarray(np.linalg.svd(evaluate_closures(equations, q, t)[1], compute_uv=False), dtype=np.float64)


def with_parameters(equations: RecursiveEquations, values: Mapping[str, float]) -> RecursiveEquations:
    """The equations whose parameters have these values by default."""
    return replace(equations, parameters=tuple(replace(p, value=values.get(p.name, p.value)) for p in equations.parameters))
