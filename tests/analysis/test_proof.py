"""Proofs of embedded loops, beside closed forms in 50 digits, planted errors, and closed poses by Newton's method in 40 digits."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.analysis.embedding.proof import LoopProof, _search, prove_loops
from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Interval, Model
from cutjoint.run.scenes import load_model
from tests.analysis.test_assembled import RAILS, SWING
from tests.conftest import MODELS
from tests.mechanisms.one_degree import four_bar, spatial

certificate = pytest.importorskip("cutjoint.analysis.embedding.certificate", reason="needs python-flint")

PRESS = MODELS / "press.yaml"


@lru_cache
def embedded(text: str) -> Model:
    model = read_model_text(text, "model.yaml")
    return embed_loops(model, next(iter(model.scenes.values()))).model


def prove(text: str) -> LoopProof:
    (proof,) = prove_loops(embedded(text))
    return proof


def with_functions(model: Model, **changes: Any) -> Model:
    """A model with one embedded loop whose functions are changed."""
    (loop,) = model.embedded_loops
    return replace(model, embedded_loops=(replace(loop, functions=replace(loop.functions, **changes)),))


def value(entry: Any, name: str, q: Any) -> Any:
    """A function of a certificate in mpmath: cosines and sines of multiples, or Chebyshev polynomials by their definition."""
    series = entry["series"][entry["names"].index(name)]
    if entry["periodic"]:
        basis = [mpmath.cos((k + 1) // 2 * q) if k % 2 else mpmath.sin(k // 2 * q) for k in range(len(series["coefficients"]))]
        basis[0] = mpmath.mpf(1)
    else:
        angle = mpmath.acos((q - mpmath.mpf(entry["middle"])) * mpmath.mpf(entry["scale"]))
        basis = [mpmath.cos(k * angle) for k in range(len(series["coefficients"]))]
    return series["growth"] * q + sum(c * x for c, x in zip(series["coefficients"], basis, strict=True))


def samples(entry: Any, count: int = 60) -> list[Any]:
    """Coordinates inside the range, at which derivatives are differences of both sides."""
    lower, upper = entry["range"]
    return [mpmath.mpf(x) for x in np.linspace(lower, upper, count + 2)[1:-1].tolist()]


def largest(entry: Any, name: str, closed: Any) -> list[float]:
    """The largest errors of a function and of its two derivatives at samples; ``closed`` is its closed form."""
    step = mpmath.mpf(10) ** -12

    def error(q: Any) -> Any:
        return value(entry, name, q) - closed(q)

    found = []
    for q in samples(entry):
        before, now, after = (error(q + k * step) for k in (-1, 0, 1))
        found.append((abs(now), abs(after - before) / (2 * step), abs(after - 2 * now + before) / step**2))
    return [float(max(column)) for column in zip(*found, strict=True)]


def assert_tight(entry: Any, name: str, true: list[float]) -> None:
    """The bounds are above the errors at samples, and not many times above the largest of them."""
    at = entry["names"].index(name)
    for error, bounds, times in zip(true, entry["bounds"], (10, 100, 1000), strict=True):
        assert error <= bounds[at] < times * error


def test_the_press_errs_by_less_than_its_bound_and_not_by_much_less() -> None:
    """Slider-crank: slide = r sin q + sqrt(l^2 - r^2 cos^2 q) less its start, a full turn."""
    model, scene = load_model(PRESS, None)
    (proof,) = prove_loops(embed_loops(model, scene).model)
    entry: Any = proof.entry
    assert proof.is_whole
    assert entry["range"][1] - entry["range"][0] > 2 * np.pi
    assert len(entry["rows"]) == len(entry["names"])
    assert entry["redundant"] == 0
    with mpmath.workdps(50):
        r = mpmath.mpf(0.1)
        square = mpmath.mpf(0.3) ** 2 + r**2

        def slide(q: Any) -> Any:
            return r * mpmath.sin(q) + mpmath.sqrt(square - (r * mpmath.cos(q)) ** 2) - mpmath.mpf(0.3)

        assert_tight(entry, "rail.displacement", largest(entry, "rail.displacement", slide))


def test_a_four_bar_errs_by_less_than_its_bound_and_not_by_much_less() -> None:
    """The rocker's angle from the crossing of two circles; a = left, b = bar, c = right, ground of 1 m."""
    entry: Any = prove(SWING % "").entry
    assert entry["independent"] in ("a", "d")
    with mpmath.workdps(50):
        one, high, bar = mpmath.mpf(1), mpmath.mpf(1.2), 1 + (mpmath.mpf(1.2) - 1) ** 2
        here, there = (one, high) if entry["independent"] == "a" else (high, one)
        other = "d" if entry["independent"] == "a" else "a"
        side = 1 if other == "d" else -1

        def angle(q: Any) -> Any:
            """The angle of the other link about y, from z to x, whose end is at the bar's length from the first link's."""
            x, z = here * mpmath.sin(q) - side, here * mpmath.cos(q)
            distance, towards = mpmath.hypot(x, z), mpmath.atan2(x, z)
            opening = mpmath.acos((there**2 + distance**2 - bar) / (2 * there * distance))
            return towards + side * opening

        assert_tight(entry, f"{other}.angle", largest(entry, f"{other}.angle", angle))


def test_planted_errors_are_found() -> None:
    """A coefficient that is 1e-9 off, smaller bounds, a missing cell, a wider range, and another equation."""
    entry = json.loads(json.dumps(dict(prove(SWING % "").entry)))
    assert certificate.check(entry) == ""
    c = entry["series"][0]["coefficients"]
    wrong = [
        {"series": [{**entry["series"][0], "coefficients": [c[0], c[1] + 1e-9, *c[2:]]}, *entry["series"][1:]]},
        *({"bounds": [[x / 2 if i == k else x for x in each] for i, each in enumerate(entry["bounds"])]} for k in range(3)),
        *(
            {"cells": [[*cell[:3], [[x / 2 if i == k else x for x in b] for i, b in enumerate(cell[3])]] for cell in entry["cells"]]}
            for k in range(3)
        ),
        {"cells": entry["cells"][:3] + entry["cells"][4:]},
        {"range": [entry["range"][0], entry["range"][1] + 1e-3]},
        {"box": 2 * entry["box"]},
        {"nodes": [[n[0], n[1] + 1e-9] if n[0] == "const" and abs(n[1]) > 0.1 else n for n in entry["nodes"]]},
    ]  # fmt: skip
    for change in wrong:
        assert certificate.check(entry | change), change


def test_second_derivatives_have_both_terms_of_the_product_rule() -> None:
    """Of (E e)'' = E'' e + 2 E' e' + E e'' in one coordinate: 0.01 + 0.5 * 0.1 + 2 * 0.3 * 0.2 + 0.1 a <= a from a = 0.2 on."""
    arb = certificate.arb
    found = {name: [[arb(x)]] for name, x in (("M", 0.1), ("E", 0.3), ("E2", 0.5))}
    found |= {"R": [arb(1)], "c": [[arb(0.01)]] * 3}
    assert certificate.holds(found, [[0.1], [0.2], [0.2001]])
    assert not certificate.holds(found, [[0.1], [0.2], [0.1999]])


def test_the_checker_needs_no_more_than_flint(tmp_path: Path) -> None:
    """The command writes a certificate; the module, copied, checks it in an interpreter that cannot import the package."""
    out, copy = tmp_path / "press.json", tmp_path / "checker.py"
    result = CliRunner().invoke(main, ["check", str(PRESS), "--proof", str(out)])
    assert result.exit_code == 0, result.output
    assert "pin: proved on its whole range: one solution within" in " ".join(result.output.split())
    source = Path(certificate.__file__).read_text(encoding="utf-8")
    assert source.count("\n") <= 150
    copy.write_text("import sys\nsys.modules['cutjoint'] = None\n" + source, encoding="utf-8")
    run = [sys.executable, str(copy), str(out)]
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout == "pin: proved\n"
    document = json.loads(out.read_text(encoding="utf-8"))
    document["loops"][0]["series"][0]["coefficients"][1] += 1e-9
    out.write_text(json.dumps(document), encoding="utf-8")
    failed = subprocess.run(run, capture_output=True, text=True, check=False)
    assert failed.returncode == 1
    assert "does not hold" in failed.stdout


def test_functions_of_a_pose_that_is_not_closed_have_no_proof() -> None:
    """Functions that a coarse tolerance allows have a large bound; those that are off by more than their neighbourhood have none."""
    model = read_model_text(SWING % "", "swing.yaml")
    scene = model.scenes["fall"]
    coarse = replace(scene, numerics=replace(scene.numerics, loop_tolerance=1e-4))
    found = embed_loops(model, coarse).model
    (proof,) = prove_loops(found)
    assert 1e-9 < max(proof.entry["bounds"][0]) < 1e-2
    (loop,) = found.embedded_loops
    moved = {
        joint: tuple(replace(s, coefficients=((s.coefficients[0][0] + 0.5,), *s.coefficients[1:])) for s in series)
        for joint, series in loop.functions.series.items()
    }  # fmt: skip
    (none,) = prove_loops(with_functions(found, series=moved))
    assert str(none) == f"{loop.independent}: no proof: the iteration contracts nowhere: the functions are not near one solution"


def test_a_part_of_the_range_is_named() -> None:
    """Functions of a tolerance of 0.1 come so close to the change point that their derivatives are too far off there."""
    model = read_model_text(SWING % "", "swing.yaml")
    scene = model.scenes["fall"]
    coarse = replace(scene, numerics=replace(scene.numerics, loop_tolerance=0.1, loop_terms=30))
    (proof,) = prove_loops(embed_loops(model, coarse).model)
    assert not proof.is_whole
    (lower, upper), asked = proof.entry["range"], proof.entry["asked"]
    assert lower == asked[0]
    assert 0.9 * asked[1] < upper < asked[1]
    assert f"a: proved on {lower:.6g} to {upper:.6g} of {asked[0]:.6g} to {asked[1]:.6g}: one solution" in str(proof)
    assert certificate.check(json.loads(json.dumps(dict(proof.entry)))) == ""


def test_a_denominator_that_may_be_zero_proves_nothing() -> None:
    """s = q q/q with the function s = q: all but the cells about 0."""
    nodes = [["place", 0], ["place", 1], ["mul", 0, 0], ["div", 2, 0], ["sub", 1, 3]]
    series = [{"growth": 1.0, "coefficients": [0.0]}]
    entry = {"nodes": nodes, "rows": [4], "series": series, "periodic": False, "middle": 0.0, "scale": 1.0, "sizes": [1.0]}
    cells = list(_search(entry, [-1.0, -0.3, 0.3, 1.0]))
    assert cells[0][0] == -1.0
    assert cells[-1][1] == 1.0
    assert not any(lower <= 0.0 <= upper for lower, upper, *_ in cells)
    with pytest.raises(ValueError, match="power series"):
        certificate.examine(entry, -0.1, 0.1, 0.1)


def test_what_cannot_be_proved_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert str(prove(RAILS)).endswith(": no proof: it has no dependent coordinate")
    (guided,) = prove_loops(with_functions(embedded(SWING % ""), drive_range=Interval(lower=0.0, upper=1.0)))
    assert str(guided) == "a: no proof: a guide moves it"
    file = tmp_path / "swing.yaml"
    file.write_text(SWING % ", positions: {d.angle: 0.1}", encoding="utf-8")
    words = "--proof: no loop of the model is embedded, for the reasons above"
    for path, expected in ((file, words), (PRESS, "proofs need the package python-flint: pip install 'cutjoint[proof]'")):
        result = CliRunner().invoke(main, ["check", str(path), "--proof", str(tmp_path / "x.json")])
        assert result.exit_code == 1
        assert expected in " ".join(result.output.split())
        monkeypatch.setitem(sys.modules, "flint", None)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("make", [four_bar, spatial])
def test_random_mechanisms(make: Any, seed: int) -> None:
    """20 loops: their whole range is proved and checked, and Newton's method in 40 digits is within the bounds."""
    proof = prove(make(seed))
    entry: Any = json.loads(json.dumps(dict(proof.entry)))
    assert proof.is_whole, str(proof)
    assert certificate.check(entry) == ""
    with mpmath.workdps(40):
        for q in samples(entry, 7):
            start = [value(entry, name, q) for name in entry["names"]]
            closed = mpmath.findroot(lambda *s, q=q: rows(entry, [q, *s])[: len(s)], start, tol=1e-60)
            for s, found, bound in zip(start, closed, entry["bounds"][0], strict=True):
                assert abs(s - found) <= bound


def rows(entry: Any, place: list[Any]) -> list[Any]:
    """The rows of a certificate in mpmath."""
    known, values = {"add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
                     "neg": lambda a: -a, "sqrt": mpmath.sqrt, "sin": mpmath.sin, "cos": mpmath.cos}, []  # fmt: skip
    for op, *args in entry["nodes"]:
        if op in known:
            values.append(known[op](*(values[i] for i in args)))
        else:
            values.append(place[args[0]] if op == "place" else mpmath.mpf(args[0]))
    return [values[i] for i in entry["rows"]]
