"""Parts of systems of equations: what no entry couples, beside components that SciPy finds."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from cutjoint.program.borders import align_parts, part


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


def test_parts_of_the_same_entries_stand_side_by_side() -> None:
    """Seven parts of two unknowns beside a border of one, the fourth with an entry more: of the others four and two."""
    parts = [p for p in range(7) for _ in range(2)] + [7]
    of_part = [(0, 0), (0, 1), (1, 1), (14, 0), (1, 14)]
    entries = [(i if i == 14 else 2 * p + i, j if j == 14 else 2 * p + j) for p in range(7) for i, j in of_part]
    unknown = {j: j for j in range(15)}
    found = align_parts(parts, [*entries, (7, 6), (2, 99), *((2 * p + 1, 98) for p in range(7))], unknown)
    assert found.numbers == [4, 2, 1, 1]
    assert [found.parts[2 * p] for p in range(7)] == [0, 1, 2, 6, 3, 4, 5]
    assert found.parts[14] == 7
    four, two, *others = found.groups
    assert others == [[], []]
    for groups, members in ((four, (0, 1, 2, 4)), (two, (5, 6))):
        assert len(groups) == 6  # five entries, and the column that is in no part, which all share
        for group in groups:
            for p, (row, column) in zip(members, group, strict=True):
                assert row == 14 or row // 2 == p
                assert column in (14, 98) or column // 2 == p
        assert len({entry for group in groups for entry in group}) == 6 * len(members)
