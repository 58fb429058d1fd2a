"""The verification problems: their models, reference motions, step sizes, and how errors are measured.

A01 to A05 are problems of the IFToMM library of computational benchmark problems, SC3D is Haug's spatial slider-crank (1989).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

from cutjoint.run.results import Trajectory
from cutjoint_bench.studies.checkout import DATA, MODELS

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A model with its reference.

    ``outputs`` are compared with ``exact``, a function of times (n,) with values (n, outputs), counted as the outputs are.
    ``threshold``, in the outputs' unit, is the size below which errors are taken as absolute.  ``steps`` are three step sizes (s), each
    half of the one before, for the observed order over the first ``smooth`` seconds; the middle one is the scene's own.
    """

    name: str
    title: str
    model: str
    outputs: tuple[str, ...]
    unit: str
    threshold: float
    steps: tuple[float, float, float]
    smooth: float
    exact: Callable[[Array], Array]

    @property
    def path(self) -> Path:
        return MODELS / f"{self.model}.yaml"


@dataclass(frozen=True, kw_only=True)
class Errors:
    """The ``largest`` error (in the outputs' unit) and the ``scaled`` one: the root mean square of error / max(|exact|, threshold)."""

    largest: float
    scaled: float


def measure_errors(problem: Problem, run: Trajectory) -> Errors:
    """The errors of a run over all its rows."""
    exact = problem.exact(run.t)
    difference = np.stack([run[column] for column in problem.outputs], axis=1) - exact
    scaled = difference / np.maximum(np.abs(exact), problem.threshold)
    return Errors(largest=float(np.abs(difference).max()), scaled=float(np.sqrt(np.mean(scaled**2))))


def observed_orders(errors: list[Errors]) -> list[float]:
    """The order that each halving of the step shows in the largest error."""
    return [float(np.log2(a.largest / b.largest)) for a, b in pairwise(errors)]


@cache
def read_reference(name: str) -> dict[str, Array]:
    """Columns of a reference file in tests/data by name."""
    path = DATA / name
    with path.open(encoding="utf-8") as stream:
        header = stream.readline().rstrip("\n").split(",")
        rows = np.loadtxt(stream, delimiter=",")
    return {column: rows[:, i] for i, column in enumerate(header)}


def reference_rows(name: str, columns: tuple[str, ...], t: Array) -> Array:
    """The rows of a reference file at the given times, (n, columns).

    Raises:
        ValueError: the file has no row at one of the times.
    """
    reference = read_reference(name)
    rows = np.clip(np.searchsorted(reference["t"], t - 1e-9), 0, len(reference["t"]) - 1)
    if np.abs(reference["t"][rows] - t).max() > 1e-9:
        raise ValueError(f"{name} has no row at some of the times asked for; choose steps that divide its spacing")
    return np.stack([reference[column][rows] for column in columns], axis=1)


def exact_pendulum(t: Array) -> Array:
    """x and y of a pendulum of 1 m released from the horizontal: sin(th/2) = k cd(sqrt(g) t), k = sin(45 deg), th from below."""
    half = np.sqrt(0.5) * ellipj(ellipk(0.5) - np.sqrt(9.81) * t, 0.5)[0]  # cd(u) = sn(K - u)
    return np.stack([-2 * half * np.sqrt(1 - half**2), 2 * half**2 - 1], axis=1)


def _four_bar(t: Array) -> Array:
    return reference_rows("ref_a02_fourbar_N2.csv", ("x_B0", "y_B0"), t)


def _andrews(t: Array) -> Array:
    """The crank's angle from its position at the start."""
    return reference_rows("ref_a03_andrews_iftomm.csv", ("beta",), t) + 0.062


def _flyball(t: Array) -> Array:
    return reference_rows("ref_a05_flyball.csv", ("s",), t)


def _slider_crank(t: Array) -> Array:
    return reference_rows("ref_slidercrank3d_slender.csv", ("s_slider",), t)


# Steps: small enough for the dt^2 term to lead, large enough for the error to stand well above the fixed point's tolerance (1e-6 of the
# accelerations, 1e-8 for A03 and SC3D) and the reference's 13 digits.
PROBLEMS = (
    Problem(
        name="A01", title="planar pendulum", model="pendulum", outputs=("bob.x", "bob.y"), unit="m", threshold=0.1,
        steps=(2e-3, 1e-3, 5e-4), smooth=10.0, exact=exact_pendulum,
    ),
    # beyond 0.71 s the singular poses magnify whatever error there is
    Problem(
        name="A02", title="two-window four-bar", model="four_bar", outputs=("tip.x", "tip.y"), unit="m", threshold=0.1,
        steps=(2e-3, 1e-3, 5e-4), smooth=0.6, exact=_four_bar,
    ),
    Problem(
        name="A03", title="Andrews' mechanism", model="andrews", outputs=("crank.angle",), unit="rad", threshold=1.0,
        steps=(2.5e-5, 1.25e-5, 6.25e-6), smooth=0.05, exact=_andrews,
    ),
    # the stiff modes (-8075, -1444 1/s) hardly move at the start and are damped within 2 ms: what is seen is the slow motion
    Problem(
        name="A05", title="flyball governor", model="flyball", outputs=("slider.z",), unit="m", threshold=0.1,
        steps=(2e-4, 1e-4, 5e-5), smooth=10.0, exact=_flyball,
    ),
    Problem(
        name="SC3D", title="spatial slider-crank", model="slider_crank", outputs=("slider.x",), unit="m", threshold=0.1,
        steps=(1e-3, 5e-4, 2.5e-4), smooth=5.0, exact=_slider_crank,
    ),
)  # fmt: skip
