"""Additions to the drivers of simulators, to compare by: solvers of Eigen and SuiteSparse, accurate solutions, and number types."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cutjoint.methods import SOLVERS, Integrator, Precision, Solver
from cutjoint.package.extensions import DriverExtension

_FOLDER = Path(__file__).resolve().parent


def _solver(name: str, *, symmetric: bool = False) -> DriverExtension[Solver]:
    """A solver of SuiteSparse, parts of which are under the GPL: a simulator that has it is not for handing on."""
    return DriverExtension(record=Solver(name=name, symmetric=symmetric, double_only=True), folder=_FOLDER / "suitesparse")


def _number(**record: Any) -> DriverExtension[Precision]:
    return DriverExtension(record=Precision(**record), folder=_FOLDER / "eigen")


EIGEN_LDLT, EIGEN_LU = (
    DriverExtension(record=Solver(name=name, symmetric=symmetric), folder=_FOLDER / "eigen")
    for name, symmetric in (("eigen-ldlt", True), ("eigen-lu", False))
)
CHOLMOD, KLU, UMFPACK = _solver("cholmod", symmetric=True), _solver("klu"), _solver("umfpack")
_SOLVERS = {extension.name: extension.record for extension in (EIGEN_LDLT, EIGEN_LU, CHOLMOD, KLU, UMFPACK)}
ADDED_SOLVERS = tuple(_SOLVERS)

#: The product's solver and these.
ALL_SOLVERS: Mapping[str, Solver] = {**SOLVERS, **_SOLVERS}

#: Accurate solutions to measure others by: extrapolation in relative coordinates (recursive) and a Runge-Kutta method of order 8 in natural
#: coordinates (classical).
REFERENCE = DriverExtension(
    record=Integrator(
        name="reference", methods=("recursive", "classical"), closures=("penalty", "proximal", "solved"), events=None, balances_energy=False
    ),
    folder=_FOLDER / "reference",
)

#: Numbers of 24, 64 (80-bit registers, x86) and 113 bits.  Above -O1, GCC takes minutes for a long function on the registers' stack.
SINGLE = _number(name="single", type="float", packed=True)
EXTENDED = _number(name="extended", type="long double", flags=("-O1",))
QUAD = _number(name="quad", type="cutjoint::Quad", header="include/cutjoint/quad.hpp", flags=("-O1",))
