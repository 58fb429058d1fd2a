"""A body's inertia as a whole: ten parameters of which all values are physical.

The pseudo-inertia J (4 x 4, first and second moments of the mass) is J = J0 + the change of L L^T, whose factor is
exp(a) [[exp(d1), s12, s13, t1], [0, exp(d2), s23, t2], [0, 0, exp(d3), t3], [0, 0, 0, 1]] (Rucker and Wensing, 2022).
"""

from collections.abc import Mapping
from math import inf

import numpy as np
import sympy

from cutjoint.fits.records import Parameter
from cutjoint.model.records import Scalar, Span
from cutjoint.package.errors import RunError


def tie_inertia(body: str, known: Mapping[str, float], span: Span) -> tuple[tuple[Parameter, ...], Mapping[str, Scalar]]:
    """Ten parameters ``BODY.a`` to ``BODY.t3``, and mass, centre of mass and inertia of a body as functions of these.
    They are dimensionless changes of the model's. Raises RunError: its numbers do not stand in the file, or no density has them."""
    centre, inertia = (tuple(f"{body}.centre_of_mass.{axis}" for axis in "xyz"), tuple(f"{body}.inertia.{i}" for i in range(6)))
    if missing := [name for name in (f"{body}.mass", *centre, *inertia) if name not in known]:
        raise RunError(f"'{missing[0]}' is no number of the model file; write mass, centre_of_mass: [x, y, z] and numbers of inertia")
    m, c = known[f"{body}.mass"], np.array([known[name] for name in centre])
    xx, yy, zz, xy, xz, yz = (known[name] for name in inertia)
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = np.trace(about) / 2 * np.eye(3) - about
    try:
        factor = np.linalg.cholesky(second / m).tolist()
    except np.linalg.LinAlgError:
        raise RunError(f"no density has the mass and inertia of '{body}': the largest moment is not below the sum of the others") from None
    # J = m [[S + c c', c], [c', 1]] with S = F F'; the change acts in the axes of F, where the body is a unit one
    symbols = [sympy.Symbol(f"{body}.{name}", real=True) for name in ("a", "d1", "d2", "d3", "s12", "s23", "s13", "t1", "t2", "t3")]
    a, d1, d2, d3, s12, s23, s13, t1, t2, t3 = symbols
    upper = sympy.Matrix([[sympy.exp(d1), s12, s13, t1], [0, sympy.exp(d2), s23, t2], [0, 0, sympy.exp(d3), t3], [0, 0, 0, 1]])
    frame = sympy.Matrix([[*row, x] for row, x in zip(factor, c, strict=True)] + [[0, 0, 0, 1]])
    pseudo = frame * upper * upper.T * frame.T
    mass = m * sympy.exp(2 * a)
    place = pseudo[:3, 3]
    moments = mass * (pseudo[:3, :3] - place * place.T)
    new = moments.trace() * sympy.eye(3) - moments
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    ties = {f"{body}.mass": mass, **dict(zip(centre, place, strict=True)),
            **{name: new[pair] for name, pair in zip(inertia, pairs, strict=True)}}  # fmt: skip
    made = (
        Parameter(name=str(s), symbol=s, unit="", start=0.0, low=-inf, high=inf, mean=inf, deviation=inf, size=1.0, span=span)
        for s in symbols
    )  # fmt: skip
    return tuple(made), ties
