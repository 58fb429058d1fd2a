"""Distances of a run from a reference."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.run.results import Array, Trajectory
from cutjoint.run.run_file import Evaluator
from cutjoint_bench.cases import QUANTITIES
from cutjoint_bench.records import Case, Errors
from cutjoint_bench.reference import Reference

Indices: TypeAlias = NDArray[np.intp]


def measure_errors(case: Case, run: Trajectory, reference: Reference) -> Errors:
    """The errors at the rows that a run and its reference have in common."""
    mine, known = _common(run.t, reference.t)
    if not len(mine):
        return Errors()
    bodies = [b.name for b in case.model.bodies if all(f"{b.name}.{q}" in c for q in QUANTITIES for c in (run.columns, reference.columns))]
    watched = largest_difference(case, run, reference, mine, known)
    if not bodies:
        return Errors(outputs=watched, residual=run.statistics.residuals.position)

    def distances(names: str) -> Array:
        """Shape (bodies, rows)."""
        return np.array([
            np.sqrt(sum((run[f"{body}.{name}"][mine] - reference.columns[f"{body}.{name}"][known]) ** 2 for name in names.split()))
            for body in bodies
        ])  # fmt: skip

    places, velocities = distances("x y z"), distances("vx vy vz")
    return Errors(
        position=float(places.max()), velocity=float(velocities.max()), mean_position=_mean(places), mean_velocity=_mean(velocities),
        energy=_energy_error(case, {n: c[mine] for n, c in run.columns.items()}, {n: c[known] for n, c in reference.columns.items()}),
        residual=run.statistics.residuals.position, outputs=watched,
    )  # fmt: skip


def largest_difference(case: Case, run: Trajectory, reference: Reference, mine: Indices, known: Indices) -> float:
    """The largest error of the watched columns at common rows, m or rad; nan where there is none, or the run lacks one."""
    if not case.watched or not case.watched.keys() <= run.columns.keys() & reference.columns.keys():
        return nan
    return max(size * float(np.abs(run[name][mine] - reference.columns[name][known]).max()) for name, size in case.watched.items())


def exceeds_from(case: Case, run: Trajectory, reference: Reference, limit: float) -> float:
    """The first time (s) at which a body is further than a limit (m) from where it should be; nan if none is."""
    mine, known = _common(run.t, reference.t)
    bodies = [b.name for b in case.model.bodies if all(f"{b.name}.{q}" in c for q in "xyz" for c in (run.columns, reference.columns))]
    places = ([run[f"{body}.{q}"][mine] - reference.columns[f"{body}.{q}"][known] for q in "xyz"] for body in bodies)
    beyond = [~(np.linalg.norm(differences, axis=0) <= limit) for differences in places]
    rows = np.flatnonzero(np.any(beyond, axis=0)) if beyond else np.zeros(0, dtype=np.intp)
    return float(run.t[mine][rows[0]]) if rows.size else nan


def _common(mine: Array, known: Array) -> tuple[Indices, Indices]:
    """The rows of both that have the same time, to a thousandth of the distance between the reference's."""
    apart = (known[1] - known[0]) if len(known) > 1 else 1.0
    nearest = np.clip(np.searchsorted(known, mine - apart / 2), 0, len(known) - 1)
    same = np.abs(known[nearest] - mine) < 1e-3 * apart
    return np.flatnonzero(same), nearest[same]


def _mean(distances: Array) -> float:
    return float(np.sqrt((distances**2).mean()))


def _energy_error(case: Case, mine: Mapping[str, Array], known: Mapping[str, Array]) -> float:
    """The difference of the energies that follow from places and velocities, relative to the largest kinetic energy."""
    kinetic, weight = energies(case, known)
    size = float(np.abs(kinetic).max())
    found = sum(energies(case, mine))
    return float(np.abs(found - kinetic - weight).max()) / size if size > 0 else nan


def energies(case: Case, columns: Mapping[str, Array]) -> tuple[Array, Array]:
    """The kinetic energy of translation and the potential energy of weight of all bodies over the rows, J."""
    value = Evaluator(case.model, case.parameters)
    gravity = [value(g) for g in case.model.gravity]
    kinetic = weight = np.zeros(len(next(iter(columns.values()))))
    for body in case.model.bodies:
        if not all(f"{body.name}.{q}" in columns for q in QUANTITIES):
            continue
        mass = value(body.mass)
        kinetic = kinetic + mass / 2 * sum(columns[f"{body.name}.{v}"] ** 2 for v in ("vx", "vy", "vz"))
        weight = weight - mass * sum(g * columns[f"{body.name}.{x}"] for g, x in zip(gravity, "xyz", strict=True))
    return kinetic, weight
