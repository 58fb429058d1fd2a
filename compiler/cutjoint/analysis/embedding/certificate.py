"""Check a certificate of `cutjoint check --proof` with python-flint alone: ``python certificate.py FILE``.

A loop has equations F(q, s) = 0 and series p(q) for its dependent coordinates s. With Y near the inverse of F_s, the deviation e = s - p
of a closed pose and its derivative by q are fixed points of::

    e  = -Y F(q, p) + (I - Y F_s) e             e' = -Y (dF(q, p)/dq + D e) + (I - Y F_s) e'        D = d/dh F_s(q + h, p + e + h p')

On a cell of q, and where |e| <= R, let |Y F| <= c, |I - Y F_s| <= M, |Y dF/dq| <= c', |Y D| <= E. If c + M R < R, exactly one solution has
|e| <= R (Krawczyk). If c + M b <= b and c' + E b + M d <= d, it has |e| <= b and |e'| <= d.
"""

import json
import sys
from typing import Any

from flint import arb, arb_mat, arb_poly, arb_series, ctx

TERMS, BITS = 10, 128  #: of Taylor expansions of residuals, and of numbers


class Dual:
    """A power series in h, with its partial derivatives by those dependent coordinates that it depends on."""

    def __init__(self, value: Any, partials: dict[int, Any] | None = None) -> None:
        self.value, self.partials = value, partials or {}


def chain(value: Any, *parts: tuple[Any, Dual]) -> Dual:
    """A value whose partial derivatives are the sum of factors times those of other ones."""
    partials: dict[int, Any] = {}
    for factor, one in parts:
        for j, x in one.partials.items():
            partials[j] = partials[j] + factor * x if j in partials else factor * x
    return Dual(value, partials)


OPERATIONS: dict[str, Any] = {
    "add": lambda a, b: chain(a.value + b.value, (1, a), (1, b)),
    "sub": lambda a, b: chain(a.value - b.value, (1, a), (-1, b)),
    "mul": lambda a, b: chain(a.value * b.value, (b.value, a), (a.value, b)),
    "div": lambda a, b: chain(a.value / b.value, (1 / b.value, a), (-a.value / (b.value * b.value), b)),
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
    sums = [sum((arb(c) * x for c, x in zip(s["coefficients"], basis, strict=False)), 0 * basis[0]) for s in loop["series"]]
    values = sums if loop["periodic"] else [_taylor(each, at - middle, terms) for each in sums]
    return [q, *(value + arb(s["growth"]) * q for value, s in zip(values, loop["series"], strict=True))]


def _taylor(polynomial: Any, at: Any, terms: int) -> Any:
    found = []
    for k in range(terms):
        found.append(polynomial(at))
        polynomial = polynomial.derivative() * (arb(1) / (k + 1))
    return arb_series(found)


def examine(loop: dict[str, Any], lower: float, upper: float, box: float) -> dict[str, Any]:
    """c, M, c' and E of a cell, R as ``box`` times the sizes of coordinates, and |F(q, p)| and |F_s| of all rows."""
    ctx.prec = BITS
    middle, cell = arb((lower + upper) / 2), arb(lower).union(arb(upper))
    width, size = (cell - middle).abs_upper(), len(loop["series"])
    R = [arb(box) * arb(s) for s in loop["sizes"]]
    wide = [Dual(x) for x in expand(loop, middle, cell, 2)]
    moved = [Dual(wide[j].value + arb(0, R[j - 1].upper()), {j - 1: arb_series([1])}) for j in range(1, size + 1)]
    rows = residual(loop, [wide[0], *moved])
    jacobian, turned = (arb_mat([[row.partials.get(j, wide[0].value * 0)[k] for j in range(size)] for row in rows]) for k in range(2))
    near = jacobian.mid()
    Y = (near.inv() if len(rows) == size else (near.transpose() * near).inv() * near.transpose()).mid()
    thin = residual(loop, [Dual(x) for x in expand(loop, middle, middle, TERMS)])
    last = residual(loop, [Dual(x) for x in expand(loop, middle, cell, TERMS + 1)])
    F = [arb_mat([[row.value[k]] for row in thin]) for k in range(TERMS)] + [arb_mat([[row.value[TERMS]] for row in last])]
    M, E, YF = Y * jacobian, Y * turned, [Y * f for f in F]
    return {
        "R": R,
        "M": [[(int(i == j) - M[i, j]).abs_upper() for j in range(size)] for i in range(size)],
        "E": [[E[i, j].abs_upper() for j in range(size)] for i in range(size)],
        "c": [sum(f[i, 0].abs_upper() * width**k for k, f in enumerate(YF)) for i in range(size)],
        "rate": [sum(k * f[i, 0].abs_upper() * width ** (k - 1) for k, f in enumerate(YF) if k) for i in range(size)],
        "rest": [YF[-1][i, 0].abs_upper() * width**TERMS for i in range(size)],
        "F": [sum(f[i, 0].abs_upper() * width**k for k, f in enumerate(F)) for i in range(len(rows))],
        "J": [[jacobian[i, j].abs_upper() for j in range(size)] for i in range(len(rows))],
    }  # fmt: skip


def times(matrix: list[list[Any]], x: list[Any]) -> list[Any]:
    return [sum((a * b for a, b in zip(row, x, strict=True)), arb(0)) for row in matrix]


def holds(found: dict[str, Any], errors: list[float], rates: list[float]) -> bool:
    """Return whether there is one solution within R, whose errors are at most ``errors`` and those of its derivatives ``rates``."""
    b, d, R = [arb(x) for x in errors], [arb(x) for x in rates], found["R"]
    whole, first, second, pushed = times(found["M"], R), times(found["M"], b), times(found["M"], d), times(found["E"], b)
    return all(
        found["c"][i] + whole[i] < R[i] and b[i] <= R[i] and found["c"][i] + first[i] <= b[i]
        and found["rate"][i] + pushed[i] + second[i] <= d[i] for i in range(len(b))
    )  # fmt: skip


def left_over(found: dict[str, Any], errors: list[float]) -> float:
    """A bound of all rows F at the solution; 0 where they are as many as the coordinates."""
    moved = times(found["J"], [arb(x) for x in errors])
    return max(float((f + x).upper()) for f, x in zip(found["F"], moved, strict=True)) * (len(moved) > len(errors))


def check(loop: dict[str, Any]) -> str:
    """The reason why a loop is not proved; empty if it is."""
    end, bounds = loop["range"][0], [*loop["errors"], *loop["rates"], loop["redundant"]]
    for lower, upper, box, errors, rates in loop["cells"]:
        found = examine(loop, lower, upper, box)
        if lower != end or not holds(found, errors, rates):
            return f"the cell from {lower} to {upper} does not hold or not follow the one before"
        if not all(x <= y for x, y in zip([*errors, *rates, left_over(found, errors)], bounds, strict=True)) or not box >= loop["box"]:
            return f"the cell from {lower} to {upper} has other bounds than the loop"
        end = upper
    return "" if end == loop["range"][1] else f"no cell begins at {end}"


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        results = {loop["independent"]: check(loop) for loop in json.load(file)["loops"]}
    print("\n".join(f"{name}: {reason or 'proved'}" for name, reason in results.items()))
    sys.exit(any(results.values()))
