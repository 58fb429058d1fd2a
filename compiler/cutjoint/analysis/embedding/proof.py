"""Proof of embedded loops: cells of the range on which `certificate.py` shows existence, uniqueness and error bounds of their functions."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise
from typing import Any, cast

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.formulate.recursive.embedding.open_geometry import joints_of, loop_residual
from cutjoint.model.records import EmbeddedLoop, Model
from cutjoint.package.extensions import MissingPackageError, find_package
from cutjoint.program.blocks import Builder
from cutjoint.program.lower import Lowering
from cutjoint.program.scalars import Scalar
from cutjoint.topology.build import build_topology

#: The number of cells at first, how often a cell may be halved, and the failures at the end of which the search stops.
_CELLS, _HALVINGS, _FAILURES = 64, 8, 50

#: The neighbourhood (rad, shares of the loop's size) in which a branch is shown to be the only one, at most; the contraction of a cell.
_BOX, _CONTRACTION = 0.1, 0.5


@dataclass(frozen=True)
class LoopProof:
    """The entry of a loop in a certificate, without ``cells`` where nothing is proved, and a ``reason``."""

    entry: Mapping[str, Any]
    reason: str = ""

    def __str__(self) -> str:
        e = self.entry
        if self.reason:
            return f"{e['independent']}: no proof: {self.reason}"
        errors, rates, curvatures = (max(zip(bounds, e["names"], strict=True)) for bounds in e["bounds"])
        lower, upper = e["range"]
        over = "its whole range" if self.is_whole else f"{lower:.6g} to {upper:.6g} of {e['asked'][0]:.6g} to {e['asked'][1]:.6g}"
        words = (
            f"{e['independent']}: proved on {over}: one solution within {e['box']:.2g} of the functions; errors at most {errors[0]:.2g} "
            f"({errors[1]}), of first derivatives {rates[0]:.2g} ({rates[1]}), of second ones {curvatures[0]:.2g} ({curvatures[1]})"
        )
        return words if e["redundant"] == 0 else f"{words}; dependent equations hold within {e['redundant']:.2g}"

    @property
    def is_whole(self) -> bool:
        """Return whether all of the range is proved."""
        return bool(self.entry.get("cells")) and list(self.entry["range"]) == list(self.entry["asked"])


def prove_loops(model: Model) -> tuple[LoopProof, ...]:
    """The proofs of the embedded loops of a model. Raises MissingPackageError: python-flint is not installed."""
    find_package("flint", otherwise=MissingPackageError("proofs need the package python-flint: pip install 'cutjoint[proof]'"))
    return tuple(_prove(model, embedded_loop) for embedded_loop in model.embedded_loops)


def certificate_of(model: Model, proofs: Sequence[LoopProof]) -> str:
    """The text of the certificate, JSON."""
    loops = [proof.entry for proof in proofs if not proof.reason]
    document = {"cutjoint_certificate": 1, "model": model.name, "sha256": sha256(model.content.encode()).hexdigest(), "loops": loops}
    return json.dumps(document) + "\n"


def _prove(model: Model, embedded_loop: EmbeddedLoop) -> LoopProof:
    from cutjoint.analysis.embedding.certificate import OPERATIONS

    functions, name = embedded_loop.functions, {"independent": embedded_loop.independent}
    if functions.drive_range is not None and functions.drive_range.half > 0:
        return LoopProof(name, "a guide moves it")
    entry = _entry(model, embedded_loop)
    if not entry["names"]:
        return LoopProof(name, "it has no dependent coordinate")
    if unknown := {node[0] for node in entry["nodes"]} - {*OPERATIONS, "place", "const"}:
        return LoopProof(name, f"its equations have the operation '{min(unknown)}'")
    lower, upper = functions.range.lower, functions.range.upper
    if functions.is_periodic:
        upper = float(np.nextafter(lower + 2 * np.pi, np.inf)) + 4e-16 * abs(lower)
    asked = [lower, upper]
    cells = _longest(list(_search(entry, np.linspace(lower, upper, _CELLS + 1).tolist())))
    if not cells:
        return LoopProof(name, "the iteration contracts nowhere: the functions are not near one solution")
    found = {
        "range": [cells[0][0], cells[-1][1]], "asked": asked, "box": min(cell[2] for cell in cells),
        "bounds": np.max([cell[3] for cell in cells], axis=0).tolist(), "redundant": max(cell[4] for cell in cells),
    }  # fmt: skip
    return LoopProof(entry | found | {"cells": [cell[:4] for cell in cells]})


def _entry(model: Model, embedded_loop: EmbeddedLoop) -> dict[str, Any]:
    """The equations and functions of a loop as `certificate.py` reads them."""
    functions, names, sizes = embedded_loop.functions, list[str](), list[float]()
    joints = joints_of(model, embedded_loop)
    points = [np.array(joint.at, dtype=float) for joint in joints if not any(getattr(x, "free_symbols", ()) for x in joint.at)]
    size = float(max((np.abs(a - b).max() for a in points for b in points), default=1.0)) or 1.0
    for name, series in functions.series.items():
        element = next(joint.element for joint in joints if joint.name == name)
        own = [*element.coordinates, *(f"rodrigues_{i}" for i in range(1, 4) if element.has_ball)]
        names += [f"{name}.{x}" for x in own]
        sizes += [size if x in element.coordinates and x not in element.angles else 1.0 for x in own]
        assert len(own) == len(series)
    b = Builder()
    block = loop_residual(b, build_topology(model), embedded_loop)
    low = Lowering()
    low.lower([block])
    nodes = low.graph.nodes
    rows = [row for (row,) in low.elements[block] if nodes[row].op != "const" or nodes[row].data != 0.0]
    return {
        "independent": embedded_loop.independent, "names": names, "sizes": sizes, "periodic": functions.is_periodic,
        "middle": functions.range.middle, "scale": 1 / functions.range.half,
        "series": [{"growth": s.growth, "coefficients": [c for (c,) in s.coefficients]} for x in functions.series.values() for s in x],
        "nodes": [_node(n) for n in nodes],
        "rows": rows,
    }  # fmt: skip


def _node(node: Scalar) -> list[Any]:
    if node.op == "symbol":
        return ["place", cast(tuple[str, int], node.data)[1]]
    return ["const", node.data] if node.op == "const" else [node.op, *node.args]


def _search(entry: Mapping[str, Any], ends: Sequence[float]) -> Iterator[tuple[Any, ...]]:
    """The cells that hold, from the lower end on: ends, box, bounds of errors and of both derivatives, of dependent equations."""
    from cutjoint.analysis.embedding.certificate import examine, holds, left_over

    failures, first = 0, ends[1] - ends[0]
    waiting = list(pairwise(ends))[::-1]
    while waiting and failures < _FAILURES:
        lower, upper = waiting.pop()
        middle, least = (lower + upper) / 2, upper - lower < 1.5 * first / 2**_HALVINGS
        box = min(_BOX, upper - lower)
        try:
            found = examine(dict(entry), lower, upper, box)
        except (ValueError, ZeroDivisionError):  # a denominator or the Jacobian may be zero in the cell
            found = None
        if found is not None and (bounds := _bounds(found, wanted=1.0 if least else _CONTRACTION)) and holds(found, bounds):
            sharp = all(rest <= c / 4 or rest < 1e-14 for rest, c in zip(found["rest"], found["c"][0], strict=True))
            if sharp or least:
                yield lower, upper, box, bounds, left_over(found, bounds[0])
                continue
        if least:
            failures += 1
        else:
            waiting += [(middle, upper), (lower, middle)]


def _bounds(found: Mapping[str, Any], wanted: float) -> list[list[float]] | None:
    """Bounds of errors and of derivatives a little above the least; None where the contraction is not as strong as ``wanted``."""
    M, E, E2, c, R = (np.array(found[name], dtype=float) for name in ("M", "E", "E2", "c", "R"))
    if not ((M @ R) / R).max() < wanted:
        return None

    def solved(right: Array) -> Array:
        return 1.001 * np.linalg.solve(np.eye(len(R)) - M, right) + 1e-25

    errors = solved(c[0])
    rates = solved(c[1] + E @ errors)
    return [errors.tolist(), rates.tolist(), solved(c[2] + E2 @ errors + 2 * E @ rates).tolist()]


def _longest(cells: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """The longest row of cells that adjoin each other."""
    rows: list[list[tuple[Any, ...]]] = []
    for cell in cells:
        if rows and rows[-1][-1][1] == cell[0]:
            rows[-1].append(cell)
        else:
            rows.append([cell])
    return max(rows, key=lambda row: row[-1][1] - row[0][0], default=[])
