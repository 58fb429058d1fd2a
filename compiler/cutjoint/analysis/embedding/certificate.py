"""Check a certificate of `cutjoint check --proof` with python-flint alone: ``python certificate.py FILE``.

A loop has equations F(q, s) = 0 and series p(q) for its dependent coordinates s. With Y near the inverse of F_s, a pose s = p + e has::

    e   = -Y F(q, p) + (I - Y F_s) e                          F_s at (q, p + e)
    e'  = -Y (F' + D e) + (I - Y F_s) e'                      ' = d/dq of F(q, p(q)); D, D2 = first and second derivatives
    e'' = -Y (F'' + D2 e + 2 D e') + (I - Y F_s) e''          by h of F_s(q + h, p + e + h (p' + e') + h^2 p''/2)

On a cell of q, and where |e|, |e'| <= R, let |Y F| <= c, |Y F'| <= c', |Y F''| <= c'', |I - Y F_s| <= M, |Y D| <= E, |Y D2| <= E2. If
c + M R < R, exactly one solution has |e| <= R (Krawczyk). It has |e| <= b, |e'| <= d and |e''| <= a if c + M b <= b <= R,
c' + E b + M d <= d <= R and c'' + E2 b + 2 E d + M a <= a.
"""

import json
import sys
from collections import namedtuple
from math import perm
from typing import Any

from flint import arb, arb_mat, arb_poly, arb_series, ctx

TERMS, BITS = 10, 128  #: of Taylor expansions of residuals, and of numbers
#: A power series in h, with its partial derivatives by those dependent coordinates that it depends on.
Dual = namedtuple("Dual", "value partials", defaults=({},))


def chain(value: Any, *parts: tuple[Any, Dual]) -> Dual:
    """A value whose partial derivatives are the sum of factors times those of other ones."""
    partials: dict[int, Any] = {}
    for factor, (_, own) in parts:
        partials |= {j: partials.get(j, 0) + factor * x for j, x in own.items()}
    return Dual(value, partials)


OPERATIONS: dict[str, Any] = {
    "add": lambda a, b: chain(a.value + b.value, (1, a), (1, b)),
    "sub": lambda a, b: chain(a.value - b.value, (1, a), (-1, b)),
    "mul": lambda a, b: chain(a.value * b.value, (b.value, a), (a.value, b)),
    "div": lambda a, b: chain(a.value * (1 / b.value), (1 / b.value, a), (-a.value / (b.value * b.value), b)),
    "neg": lambda a: chain(-a.value, (-1, a)),
    "sqrt": lambda a: chain(a.value.sqrt(), (arb(0.5) / a.value.sqrt(), a)),
    "sin": lambda a: chain(a.value.sin(), (a.value.cos(), a)),
    "cos": lambda a: chain(a.value.cos(), (-a.value.sin(), a)),
}


def residual(loop: dict[str, Any], place: list[Dual]) -> list[Dual]:
    """The rows F at a place (q, s); nodes are ``[place, i]``, ``[const, x]``, or an operation with the numbers of earlier nodes."""
    values: list[Dual] = []
    for operation, *args in loop["nodes"]:
        if operation in OPERATIONS:
            values.append(OPERATIONS[operation](*(values[i] for i in args)))
        else:
            values.append(place[args[0]] if operation == "place" else Dual(arb_series([arb(args[0])])))
    return [values[i] for i in loop["rows"]]


def expand(loop: dict[str, Any], middle: Any, at: Any, terms: int) -> list[Any]:
    """The place (q, p(q)) as power series in h at q = at + h; ``at`` is a ball about ``middle``."""
    ctx.cap = terms
    q, count = arb_series([at, 1]), max(len(s["coefficients"]) for s in loop["series"])
    if loop["periodic"]:
        waves = [(k * q).sin_cos() for k in range(1, count // 2 + 1)]
        basis: list[Any] = [arb_series([1]), *(wave for sine, cosine in waves for wave in (cosine, sine))]
    else:
        x = arb_poly([(middle - arb(loop["middle"])) * arb(loop["scale"]), arb(loop["scale"])])
        basis = [arb_poly([1]), x]
        while len(basis) < count:
            basis.append(2 * x * basis[-1] - basis[-2])
    values = [sum((arb(c) * x for c, x in zip(s["coefficients"], basis, strict=False)), 0 * basis[0]) for s in loop["series"]]
    values = values if loop["periodic"] else [_taylor(each, at - middle, terms) for each in values]
    return [q, *(value + arb(s["growth"]) * q for value, s in zip(values, loop["series"], strict=True))]


def _taylor(polynomial: Any, at: Any, terms: int) -> Any:
    found = []
    for k in range(terms):
        found.append(polynomial(at))
        polynomial = polynomial.derivative() * (arb(1) / (k + 1))
    return arb_series(found)


def examine(loop: dict[str, Any], lower: float, upper: float, box: float) -> dict[str, Any]:
    """Bounds of a cell by name; R is ``box`` times the sizes of coordinates, "c" are c, c' and c'', "F" is of all rows."""
    ctx.prec = BITS
    middle, cell = arb((lower + upper) / 2), arb(lower).union(arb(upper))
    width, size, R = (cell - middle).abs_upper(), len(loop["series"]), [(arb(box) * arb(s)).upper() for s in loop["sizes"]]
    thin, last = (residual(loop, [Dual(x) for x in expand(loop, middle, at, n)]) for at, n in ((middle, TERMS), (cell, TERMS + 1)))
    F = [arb_mat([[row.value[k]] for row in rows]) for k, rows in enumerate([thin] * TERMS + [last])]
    q, *p = expand(loop, middle, cell, 3)
    near = [Dual(x + arb_series([arb(0, r), arb(0, r)]), {j: arb_series([1])}) for j, (x, r) in enumerate(zip(p, R, strict=True))]
    rows = residual(loop, [Dual(q), *near])
    jacobian, turned, bent = (arb_mat([[row.partials.get(j, 0 * q)[k] for j in range(size)] for row in rows]) for k in range(3))
    J = jacobian.mid()
    Y = (J.inv() if len(rows) == size else (J.transpose() * J).inv() * J.transpose()).mid()
    YF, unit = [Y * f for f in F], arb_mat([[int(i == j) for j in range(size)] for i in range(size)])
    return {
        "R": R, "M": magnitudes(unit - Y * jacobian), "E": magnitudes(Y * turned), "E2": magnitudes(2 * (Y * bent)),
        "c": [_summed(YF, width, order) for order in range(3)], "F": _summed(F, width, 0), "J": magnitudes(jacobian),
        "rest": [x * width**TERMS for (x,) in magnitudes(YF[-1])],
    }  # fmt: skip


def magnitudes(matrix: Any) -> list[list[Any]]:
    return [[x.abs_upper() for x in row] for row in matrix.tolist()]


def _summed(terms: list[Any], width: Any, order: int) -> list[Any]:
    parts = [[perm(k, order) * x * width ** (k - order) for (x,) in magnitudes(f)] for k, f in enumerate(terms) if k >= order]
    return [sum(part) for part in zip(*parts, strict=True)]


def times(matrix: list[list[Any]], x: list[Any]) -> list[Any]:
    return [sum((a * b for a, b in zip(row, x, strict=True)), arb(0)) for row in matrix]


def holds(found: dict[str, Any], bounds: list[list[float]]) -> bool:
    """Return whether there is one solution within R, and its errors and those of both derivatives are at most ``bounds``."""
    (b, d, a), R, c = ([arb(x) for x in each] for each in bounds), found["R"], found["c"]
    whole, *own = (times(found["M"], x) for x in (R, b, d, a))
    first, second, twice = times(found["E"], b), times(found["E2"], b), times(found["E"], d)
    return all(
        c[0][i] + whole[i] < R[i] and c[0][i] + own[0][i] <= b[i] and b[i] <= R[i] and c[1][i] + first[i] + own[1][i] <= d[i]
        and d[i] <= R[i] and c[2][i] + second[i] + 2 * twice[i] + own[2][i] <= a[i] for i in range(len(R))
    )  # fmt: skip


def left_over(found: dict[str, Any], errors: list[float]) -> float:
    """A bound of all rows F at the solution; 0 where they are as many as the coordinates."""
    moved = times(found["J"], [arb(x) for x in errors])
    return max(float((f + x).upper()) for f, x in zip(found["F"], moved, strict=True)) * (len(moved) > len(errors))


def check(loop: dict[str, Any]) -> str:
    """The reason why a loop is not proved; empty if it is."""
    end = loop["range"][0]
    for lower, upper, box, bounds in loop["cells"]:
        found = examine(loop, lower, upper, box)
        pairs = [*zip([*bounds, [left_over(found, bounds[0]), -box]], [*loop["bounds"], [loop["redundant"], -loop["box"]]], strict=True)]
        if lower != end or not holds(found, bounds) or not all(x <= y for own, most in pairs for x, y in zip(own, most, strict=True)):
            return f"the cell from {lower} to {upper} does not hold, follow the one before, or have the bounds of the loop"
        end = upper
    return "" if end == loop["range"][1] else f"no cell begins at {end}"


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        results = {loop["independent"]: check(loop) for loop in json.load(file)["loops"]}
    print("\n".join(f"{name}: {reason or 'proved'}" for name, reason in results.items()))
    sys.exit(any(results.values()))
