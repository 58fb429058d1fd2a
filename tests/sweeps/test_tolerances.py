"""Tolerances beside closed forms: moments of sums and products, shares, yields, and the least cost."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm, triang, truncnorm

from cutjoint import sweep
from cutjoint.model.errors import ModelError
from cutjoint.sweeps.reading import read_study_text

_MODEL = """
cutjoint: 1
name: block
gravity: [0, 0, 0]
parameters:
  a: {value: 2, binding: param}
  b: {value: 3, binding: param}
  c: {value: 5, binding: param}
points: {rod: [1, 2, 3]}
bodies: {block: {mass: 1, centre_of_mass: rod}}
joints: {slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: z}}
scenes: {rest: {end: 1.0e-3, output_step: 1.0e-3}}
"""
_PARAMETERS = {"a": {"normal": 0.01}, "b": {"uniform": 0.03}, "c": {"triangular": 0.06}}
_OBJECTIVES = {
    "sum": {"end": "a + 2*b - c", "limits": [2.95, 3.1]}, "product": {"end": "a*b*c"}, "square": {"end": "a**2 + b**2 + c**2 + 0*block.z"},
}  # fmt: skip
#: Standard deviations of the three.
_S = np.array([0.01, 0.03 / np.sqrt(3), 0.06 / np.sqrt(6)])


def _study(folder: Path, **changes: Any) -> dict[str, Any]:
    (folder / "model.yaml").write_text(_MODEL, encoding="utf-8")
    return {
        "cutjoint_study": 1, "model": str(folder / "model.yaml"), "parameters": _PARAMETERS, "objectives": _OBJECTIVES,
        "design": {"tolerances": 20_000, "seed": 1}, **changes,
    }  # fmt: skip


@pytest.mark.cpp
def test_independent(tmp_path: Path) -> None:
    done = sweep(_study(tmp_path), tmp_path / "t.parquet")
    g = np.array([1.0, 2.0, -1.0])
    found = done.find_tolerance("sum", (2.95, 3.1))
    assert np.allclose(found.gradient, g, rtol=1e-9)
    assert np.allclose(found.deviations, _S, rtol=1e-9)
    s = np.sqrt(np.sum((g * _S) ** 2))
    assert found.first_deviation == pytest.approx(s, rel=1e-9)
    assert np.allclose(found.shares, (g * _S) ** 2 / s**2, rtol=1e-9)
    assert found.first_passed == pytest.approx(norm.cdf(3.1, 3, s) - norm.cdf(2.95, 3, s), abs=1e-9)
    assert found.deviation == pytest.approx(s, rel=4 / np.sqrt(2 * 20_000))
    assert abs(found.passed - found.first_passed) < 0.02  # the sum of three distributions is no normal one
    product, square = (done.find_tolerance(name) for name in ("product", "square"))
    assert np.allclose(product.gradient, [15.0, 10.0, 6.0], rtol=1e-9)
    assert square.second_mean == pytest.approx(38 + np.sum(_S**2), rel=1e-10)  # exact of squares
    assert abs(square.mean - square.second_mean) < 4 * square.deviation / np.sqrt(20_000)


@pytest.mark.cpp
def test_correlated(tmp_path: Path) -> None:
    study = _study(
        tmp_path, parameters={"a": {"normal": 0.01}, "b": {"normal": 0.02}, "c": {"normal": 0.03, "mean": 4}},
        design={"tolerances": 20_000, "seed": 2, "correlations": [["a", "b", 0.8], ["b", "c", -0.5]]},
    )  # fmt: skip
    done = sweep(study, tmp_path / "t.parquet")
    found, g, s = done.find_tolerance("sum"), np.array([1.0, 2.0, -1.0]), np.array([0.01, 0.02, 0.03])
    C = np.outer(s, s) * np.array([[1, 0.8, 0], [0.8, 1, -0.5], [0, -0.5, 1]])
    assert found.first_mean == pytest.approx(4.0)
    assert found.first_deviation == pytest.approx(np.sqrt(g @ C @ g), rel=1e-9)
    assert np.allclose(found.shares, g * (C @ g) / (g @ C @ g), rtol=1e-8)
    assert found.deviation == pytest.approx(found.first_deviation, rel=4 / np.sqrt(2 * 20_000))
    assert np.allclose(np.corrcoef([done[n][:20_000] for n in "abc"])[0, 1], 0.8, atol=0.01)


@pytest.mark.cpp
def test_cheapest(tmp_path: Path) -> None:
    done = sweep(_study(tmp_path, design={"tolerances": 2}), tmp_path / "t.parquet")
    found, costs, limits = done.find_tolerance("sum"), {"a": 1.0, "b": 2.0}, (2.9, 3.2)
    cheapest = found.cheapest(limits, costs, wanted=0.99)

    def passed(s: Any) -> float:
        whole = np.sqrt(s[0] ** 2 + 4 * s[1] ** 2 + _S[2] ** 2)
        return float(norm.cdf(3.2, 3, whole) - norm.cdf(2.9, 3, whole))

    assert passed([cheapest["a"], cheapest["b"]]) == pytest.approx(0.99, abs=1e-9)
    best = minimize(lambda s: 0.01 * (1 / s[0] + 2 / s[1]), [0.01, 0.01], method="SLSQP", bounds=[(1e-3, 1)] * 2, options={"ftol": 1e-14},
        constraints={"type": "ineq", "fun": lambda s: passed(s) - 0.99})  # fmt: skip
    assert np.allclose(list(cheapest.values()), best.x, rtol=1e-4)


@pytest.mark.parametrize("design", [{"tolerances": 2}, {"tolerances": 3, "correlations": [["a", "b", 0.5]]}])
def test_an_interrupted_sweep_goes_on_and_leaves_its_table_alone(tmp_path: Path, design: Any) -> None:
    """Its parts know their own manifest, which has come back from a file."""
    objectives = {"place": {"value": "block.z", "of": "equilibrium"}}
    study = _study(tmp_path, parameters={"a": {"normal": 0.01}, "b": {"normal": 0.02}}, objectives=objectives, design=design)
    out, notes = tmp_path / "out" / "t.parquet", list[str]()
    out.parent.mkdir()

    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(study, out, threads=1, progress=stop)
    assert (tmp_path / "out" / "t.parquet.parts" / "manifest.json").is_file()
    assert sweep(study, out, threads=1, note=notes.append).table.num_rows == design["tolerances"] + 5
    assert [path.name for path in out.parent.iterdir()] == ["t.parquet"]
    assert not [note for note in notes if "manifest" in note]


def test_distributions_of_variables_and_vectors(tmp_path: Path) -> None:
    import json

    study = _study(
        tmp_path, tunable=["rod.*"], design={"tolerances": 4000},
        parameters={"a": {"normal": 0.1, "from": 1.9, "to": 2.3}, "c": {"triangular": 1}, "rod": {"normal": "2 mm"}, "b": 4},
    )  # fmt: skip
    read = read_study_text(json.dumps(study), "s")
    assert [v.name for v in read.variables] == ["a", "c", "rod.x", "rod.y", "rod.z", "b"]
    drawn = read.values[:4000]
    kinds = [truncnorm(-1, 3, 2, 0.1), triang(0.5, 4, 2), *(norm(x, 2e-3) for x in (1, 2, 3))]
    for column, kind in zip(drawn.T, kinds, strict=False):
        quantiles = np.linspace(0.05, 0.95, 19)
        assert np.allclose(kind.cdf(np.quantile(column, quantiles)), quantiles, atol=4 * 0.5 / np.sqrt(4000))
    assert np.allclose(read.values[4000], [kind.mean() for kind in kinds] + [4.0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameters": {"a": {"normal": 0}}}, "a distribution has a width above zero; write a plain number for a constant"),
        ({"parameters": {"a": {"normal": 1, "uniform": 1}}}, "needs one of normal, uniform, triangular; write for example"),
        ({"parameters": {"a": {"uniform": 1, "from": 1}}}, "'from' and 'to' cut off a normal distribution alone; remove them"),
        ({"parameters": {"a": {"normal": 1, "from": 3}}}, "the mean 2 is not between from and to; write limits about it"),
        ({"parameters": {"a": [1, 2]}}, "tolerances need one scene and distributions, no lists; write for example {normal: 0.1 mm}"),
        ({"design": {"tolerances": 9, "correlations": [["a", "b", 0.5]]}}, "'b' has no normal distribution; correlate variables"),
        ({"parameters": {"a": {"normal": 1}, "b": {"normal": 1}}, "design": {"tolerances": 9, "correlations": [["a", "b", 1.5]]}},
         "no variables have these correlations; write smaller ones"),
        *(({"parameters": {"a": {"normal": 1}, "b": {"normal": 1}}, "design": {"tolerances": 9, "correlations": pairs}},
           "each pair of two variables stands once; write [one, other, correlation]")
          for pairs in ([["a", "a", 0.5]], [["a", "b", 0.5], ["b", "a", -0.5]])),
        ({"objectives": {"sum": {"end": "a", "limits": [2, 1]}}}, "the limits enclose nothing; write the smaller one first"),
    ],
)  # fmt: skip
def test_wrong(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=re.escape(message)):
        sweep(_study(tmp_path, **changes), tmp_path / "t.parquet")
