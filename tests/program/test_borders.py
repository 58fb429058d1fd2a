"""Parts of systems of equations: what no entry couples, beside components that SciPy finds."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from cutjoint.program.borders import part


@pytest.mark.parametrize("seed", range(3))
def test_parts_are_coupled_by_the_border_alone(seed: int) -> None:
    """Four blocks in any order beside two unknowns that see all: these are the border."""
    order = np.random.default_rng(seed).permutation(22)
    blocks = [order[i : i + 5].tolist() for i in range(0, 20, 5)]
    border = order[20:].tolist()
    entries = [(int(i), int(j)) for block in blocks for i, j in product(block, [*block, *border])]
    parts = part(22, entries, [border, *([int(i)] for i in order[:20])])
    assert {i for i in range(22) if parts[i] == max(parts)} == set(border)
    kept = [(i, j) for i, j in entries if i not in border and j not in border]
    rows, columns = zip(*kept, strict=True)
    number, found = connected_components(csr_array((np.ones(len(kept)), (rows, columns)), shape=(22, 22)))
    inner = [i for i in range(22) if i not in border]
    assert number == 4 + len(border)
    assert all((found[i] == found[j]) == (parts[i] == parts[j]) for i, j in product(inner, inner))


def test_a_border_that_saves_nothing_stays_empty() -> None:
    full = list(product(range(6), range(6)))
    assert part(6, full, [[i] for i in range(6)]) == [0] * 6
    star = [(i, j) for i in range(10) for j in range(6)] + [(i, i) for i in range(10)]
    assert part(10, star, [range(6), *([i] for i in range(6, 10))]) == [0] * 10  # four parts of one unknown
    assert part(3, [(0, 1)], [[i] for i in range(3)]) == [0, 0, 1]
