"""Random matrices with the structure of a vehicle in natural coordinates: a hub of four nodes and branches that couple to it and inside.

A node is a point or a unit vector, so that its three coordinates make 3 x 3 blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cutjoint.sparse.pattern import Pattern, make_pattern

Array = NDArray[np.float64]

HUB = 4


def node_pairs(branches: int, nodes: int) -> tuple[int, list[tuple[int, int]]]:
    """The number of nodes, and the pairs that share a body: an arm, a carrier, a rod and a strut in each branch, then a chain."""
    cliques = [list(range(HUB))]
    for branch in range(branches):
        own = [HUB + branch * nodes + k for k in range(nodes)]
        hub = [(branch + k) % HUB for k in range(HUB)]
        cliques += [[*hub[:2], *own[:2]], own[:4], [own[min(3, nodes - 1)], hub[2]], [own[-1], own[0], hub[3]]]
        cliques += [own[k - 2 : k + 1] for k in range(4, nodes)]
    pairs = {pair for clique in cliques for pair in combinations(sorted(set(clique)), 2)}
    return HUB + branches * nodes, sorted(pairs)


def spd_matrix(seed: int, branches: int = 4, nodes: int = 5) -> Array:
    """Like an augmented tangent: dense 3 x 3 blocks, positive definite."""
    random = np.random.default_rng(seed)
    count, pairs = node_pairs(branches, nodes)
    matrix = 0.1 * np.eye(3 * count)
    for a, b in pairs:
        both = [*range(3 * a, 3 * a + 3), *range(3 * b, 3 * b + 3)]
        factor = random.normal(size=(6, 4))
        matrix[np.ix_(both, both)] += factor @ factor.T
    return matrix


def kkt_matrix(seed: int, branches: int = 4, nodes: int = 5, massless: int = 4) -> tuple[Array, int]:
    """Like a classical tangent, [A, J^T; J, 0] with singular A, and the size n of A.

    A has masses m I, none at some nodes, and an unsymmetric block for each strut.
    """
    random = np.random.default_rng(seed)
    count, pairs = node_pairs(branches, nodes)
    light = {int(k) for k in random.choice(np.arange(HUB, count), size=massless, replace=False)}
    mass = np.diag([0.0 if k in light else float(random.uniform(5, 20)) for k in range(count)])
    for a, b in pairs:
        if not {a, b} & light:
            mass[a, b] = mass[b, a] = random.uniform(0.2, 1)
    A = np.kron(mass, np.eye(3))
    for branch in range(branches):
        ends = (HUB + branch * nodes + nodes - 1, (branch + 3) % HUB)
        both = [3 * end + k for end in ends for k in range(3)]
        A[np.ix_(both, both)] += random.normal(size=(6, 6))
    J = _jacobian(random, 3 * count, pairs, light)
    return np.block([[A, J.T], [J, np.zeros((len(J), len(J)))]]), 3 * count


def _jacobian(random: np.random.Generator, n: int, pairs: Sequence[tuple[int, int]], light: set[int]) -> Array:
    """Independent rows that touch a body's nodes: three for each node without mass, then one for most other pairs."""
    touched = []
    for k in sorted(light):
        mine = [pair for pair in pairs if k in pair]
        touched += [mine[i % len(mine)] for i in range(3)]
    touched += [pair for i, pair in enumerate(pairs) if i % 4 != 3 and not set(pair) & light]
    J = np.zeros((len(touched), n))
    for row, pair in zip(J, touched, strict=True):
        for node in pair:
            row[3 * node : 3 * node + 3] = random.normal(size=3)
    return J


def pattern_of(matrix: Array, *, symmetric: bool) -> Pattern:
    """The pattern of the entries that are not zero, with the whole diagonal if it is symmetric."""
    rows, columns = np.nonzero(matrix)
    diagonal = [(k, k) for k in range(len(matrix))] if symmetric else []
    return make_pattern(len(matrix), [*zip(rows.tolist(), columns.tolist(), strict=True), *diagonal], symmetric=symmetric)


def values_of(pattern: Pattern, matrix: Array) -> Array:
    """The values of the pattern's entries."""
    return np.array([matrix[i, j] for i, j in pattern.entries()])


def nearby(matrix: Array, seed: int, count: int) -> list[Array]:
    """Matrices of the same pattern and symmetry, with values that differ by a few percent."""
    random = np.random.default_rng(seed)
    noise = [random.normal(scale=0.03, size=matrix.shape) for _ in range(count)]
    return [matrix * np.exp(one + one.T) for one in noise]
