"""The combinations of parameters that data leave open, from the Jacobian of residuals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutjoint.fits.records import Array

#: Singular values below these shares of the largest: nothing changes to the accuracy of derivatives; hardly anything does.
NULL, NEAR = 1e-8, 1e-4

#: A share in a combination below which a name is left out, and the collinearity (Brun, Reichert and Kuensch, 2001) that is much.
_SHARE, COLLINEAR = 0.05, 20.0


@dataclass(frozen=True, kw_only=True)
class Identifiability:
    """What data determine of the parameters.

    * ``singular_values``: of the Jacobian by parameters as shares of their sizes, the largest first
    * ``open``, ``nearly_open``: combinations that the data do not determine, or hardly, with shares by names
    * ``collinear``: pairs with their index
    """

    singular_values: Array
    open: tuple[dict[str, float], ...]
    nearly_open: tuple[dict[str, float], ...]
    collinear: tuple[tuple[str, str, float], ...]


def identify(jacobian: Array, names: Sequence[str], sizes: Array, samples: int) -> Identifiability:
    """Judge a Jacobian (residuals, parameters) whose residuals are in units of their standard deviations.
    Those behind the ``samples`` are of priors, which may be as narrow as they like."""
    scaled = jacobian * sizes
    singular, directions = decompose(scaled)
    largest = decompose(scaled[:samples])[0][0] or 1.0
    lengths = np.linalg.norm(scaled, axis=0)
    unit = scaled / np.where(lengths > NULL * largest, lengths, np.inf)
    pairs = []
    for i in range(len(names)):
        for j in range(i):
            product = min(abs(float(unit[:, i] @ unit[:, j])), 1.0)
            if 1 - 1 / COLLINEAR**2 < product < 1 - NULL:  # beyond, a combination of both is open
                pairs.append((names[j], names[i], float(1 / np.sqrt(1 - product))))
    return Identifiability(
        singular_values=singular, open=_named(directions[singular <= NULL * largest], names),
        nearly_open=_named(directions[(singular > NULL * largest) & (singular <= NEAR * largest)], names), collinear=tuple(pairs),
    )  # fmt: skip


def decompose(matrix: Array) -> tuple[Array, Array]:
    """Singular values and right singular vectors of a matrix (rows, columns), as many as columns."""
    _, found, directions = np.linalg.svd(np.linalg.qr(matrix, mode="r"), full_matrices=True)
    return np.pad(found, (0, matrix.shape[1] - len(found))), directions


def _named(directions: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Combinations by names.  The largest share is 1; several are combined so that each has a parameter of its own."""
    if not len(directions):
        return ()
    rows = directions.copy()
    for i in range(len(rows)):  # Gauss-Jordan elimination with complete pivoting makes names few
        rest = np.abs(rows[i:])
        row, column = (int(place) for place in np.unravel_index(rest.argmax(), rest.shape))
        rows[[i, i + row]] = rows[[i + row, i]]
        rows[i] /= rows[i, column]
        for j in range(len(rows)):
            if j != i:
                rows[j] -= rows[j, column] * rows[i]
    return tuple({name: round(float(x), 3) for name, x in zip(names, row, strict=True) if abs(x) > _SHARE} for row in rows)


def describe(combination: dict[str, float]) -> str:
    """A combination in words: relative changes that cancel."""
    return ", ".join(f"{name} {100 * share:+.3g} %" for name, share in combination.items())
