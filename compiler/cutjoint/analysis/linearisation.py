"""Equations of motion linearised about a state, in as many unknowns as there are degrees of freedom.

With x the change of the coordinates, y that of the speeds and a that of the accelerations,

    M a + C y + K x + J^T mu = 0,    J x = 0,    J y + G x = 0,    x' = y + W x

G is the change of the loops' rates with the pose; W turns what quaternions change by with the angular velocity that they change on.
With N a basis of the null space of J, N^T M N = 1, and P the change of the speeds that keeps the loops' rates zero (J P = -G N,
N^T M P = 0), x = N z and y = N w + P z satisfy

    z' = w + N^T M W N z         w' = -N^T C N w - N^T (K N + C P) z

The forces of the loops vanish.  Equations that follow from others change neither N nor P.  At rest G and W are zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.topology.conditioning import TOLERANCE


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """The matrices above: ``M``, ``C``, ``K``, ``W`` (speeds, speeds), ``J``, ``G`` (equations, speeds), with a name for each speed's
    coordinate, the state's coordinates ``q``, and whether it is one ``at_rest``."""

    names: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    W: Array
    J: Array
    G: Array
    q: Array
    at_rest: bool


@dataclass(frozen=True, kw_only=True)
class ReducedSystem:
    """The linearised equations in independent unknowns.

    ``basis`` N (speeds, freedoms), ``stiffness`` and ``damping`` (freedoms, freedoms) beside a unit mass, and ``first_order``, the matrix
    of (z, w)'.
    """

    basis: Array
    stiffness: Array
    damping: Array
    first_order: Array


class NoMassError(ValueError):
    """A direction that the loops leave free moves no mass."""


def free_directions(J: Array) -> Array:
    """An orthonormal basis (speeds, freedoms) of the null space of J; equations that follow from others do no harm."""
    if 0 in J.shape:
        return np.eye(J.shape[1])
    _, values, right = np.linalg.svd(J)
    rank = int(np.sum(values > TOLERANCE * values.max(initial=0.0)))
    return np.asarray(right[rank:].T)


def reduce_system(of: Linearisation) -> ReducedSystem:
    """The equations of the directions that the loops leave free.

    Raises:
        NoMassError: one of these directions moves no mass.
    """
    N = _of_unit_mass(of, free_directions(of.J))
    P = _kept_rates(of, N)
    stiffness, damping, turning = N.T @ (of.K @ N + of.C @ P), N.T @ of.C @ N, N.T @ of.M @ of.W @ N
    return ReducedSystem(
        basis=N, stiffness=stiffness, damping=damping, first_order=np.block([[turning, np.eye(N.shape[1])], [-stiffness, -damping]])
    )


#: A direction whose mass is this share of what its coordinates move one by one has none.
_MASSLESS = 1e-12


def _of_unit_mass(of: Linearisation, free: Array) -> Array:
    mass = free.T @ of.M @ free
    values, vectors = np.linalg.eigh((mass + mass.T) / 2)
    if len(values) and values[0] <= _MASSLESS * values[-1]:
        name = of.names[int(np.abs(free @ vectors[:, 0]).argmax())]
        raise NoMassError(
            f"'{name}' can move without moving a mass, so that its mode has no frequency; give a body that it moves mass and inertia"
        )
    return np.asarray(free @ vectors / np.sqrt(values))


def _kept_rates(of: Linearisation, N: Array) -> Array:
    if not len(of.J) or not of.G.any():
        return np.zeros_like(N)
    P = np.linalg.lstsq(of.J, -of.G @ N, rcond=TOLERANCE)[0]
    return np.asarray(P - N @ (N.T @ of.M @ P))
