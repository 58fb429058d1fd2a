"""Studies that are wrong are refused before a compiler is called, each with its line and what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc

from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError
from cutjoint.sweeps.document import REDUCTIONS
from cutjoint.sweeps.reading import read_study, read_study_text
from cutjoint.sweeps.table import Layout, require_room
from tests.conftest import MODELS, ROOT

from .studies import study

_HEAD = f"cutjoint_study: 1\nmodel: {MODELS / 'press.yaml'}\n"
_END = "objectives: {top: {maximum: slider.x}}\n"

_WRONG = {
    "unknown parameter": (
        f"{_HEAD}parameters: {{stifness: {{from: 1, to: 2, count: 3}}}}\n{_END}",
        ["s:3:14: parameter 'stifness': the model has no such name; did you mean 'stiffness'?"],
    ),
    "empty range": (
        f"{_HEAD}parameters:\n  stiffness: {{from: 2 kN/m, to: 1 kN/m, count: 3}}\n{_END}",
        ["s:4:33: parameter 'stiffness': the range from 2000 to 1000 is empty; write the smaller number first"],
    ),
    "wrong unit": (
        f"{_HEAD}parameters: {{stiffness: [1 kN/m, 2 m]}}\n{_END}",
        ["s:3:34: parameter 'stiffness': parameters.stiffness needs N/m, got m"],
    ),
    "no count": (
        f"{_HEAD}parameters: {{stiffness: {{from: 1, to: 2}}}}\n{_END}",
        ["s:3:14: parameter 'stiffness': a grid needs the number of values; write count: 10 beside from and to"],
    ),
    "a count": (
        f"{_HEAD}parameters: {{stiffness: {{from: 1, to: 2, count: 2}}}}\ndesign: {{sobol: 4}}\n{_END}",
        ["s:3:42: parameter 'stiffness': 'count' belongs to a grid; leave it out: the design has the number of runs"],
    ),
    "by ratios from zero": (
        f"{_HEAD}parameters: {{stiffness: {{from: 0, to: 2, scale: log}}}}\ndesign: {{sobol: 4}}\n{_END}",
        ["s:3:32: parameter 'stiffness': a logarithmic range begins above zero; write scale: linear, or a positive 'from'"],
    ),
    "unknown output": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjectives:\n  a: {{maximum: slider.y0}}\n  b: {{end: 'slder.x + 1'}}\n",
        ["s:5:16: objective 'a': 'slider.y0': 'slider' has no quantity 'y0'; did you mean 'y'?",
         "s:6:12: objective 'b': 'slder.x + 1': unknown element 'slder'; did you mean 'slider'?"],
    ),
    "a pattern without a constant": (
        f"{_HEAD}tunable: ['*mass*', 'crank.masss']\nparameters: {{stiffness: [1, 2]}}\n{_END}",
        ["s:3:21: study: tunable: no constant that could be tunable is called 'crank.masss'; did you mean 'crank.mass'?"],
    ),
    "no code": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjectives: {{a: {{maximum: '__import__(\"os\").getcwd()'}}}}\n",
        ["s:4:27: objective 'a': '__import__(\"os\").getcwd()': '__import__('os').getcwd()' is not allowed in an expression; use numbers, "
         "names, + - * / **, comparisons inside where, and the listed functions"],
    ),
    "two reductions": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjectives: {{a: {{end: slider.x, mean: slider.x}}}}\n",
        ["s:4:14: objective 'a': has end and mean; write one of end, minimum, maximum, range, mean, rms, deviation, integral, percentile, "
         "crossing, frequency, amplitude"],
    ),
    "no level": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjectives: {{a: {{percentile: slider.x}}}}\n",
        ["s:4:14: objective 'a': percentile and crossing need 'at'; write for example {percentile: x, at: 95}"],
    ),
    "empty window": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjectives: {{a: {{end: slider.x, from: 3 s}}}}\n",
        ["s:4:14: objective 'a': the window of time is empty; write from and to between 0 and 2 s"],
    ),
    "grid as a mapping": (
        f"{_HEAD}parameters: {{stiffness: {{from: 1, to: 2, count: 2}}}}\ndesign: {{grid: 15}}\n{_END}",
        ["s:4:1: design: needs the word grid (with a list or a count for each parameter), {latin_hypercube: runs}, {sobol: runs}, "
         "{sobol_indices: points}, {tolerances: runs}, {csv: file} or {list: [...]}"],
    ),
    "no run": (
        f"{_HEAD}parameters: {{stiffness: {{from: 1, to: 2}}}}\ndesign: {{sobol: 0}}\n{_END}",
        ["s:4:17: design: sobol: must be at least 1, not 0"],
    ),
    "no variable": (f"{_HEAD}{_END}", ["s:1:1: design: there is no variable; write for example parameters: {stiffness: {from: 1, to: 2}}"]),
    "nothing asked": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\n",
        ["s:1:1: study: there are no objectives and no trajectories; write for example objectives: {peak: {maximum: body.z}}"],
    ),
    "unknown scene": (f"{_HEAD}scenes: [trn]\n{_END}", ["s:3:10: study: scenes: the model has no scene 'trn'; did you mean 'turn'?"]),
    "unknown coordinate": (
        f"{_HEAD}rates: {{pin.angle_rat: [1, 2]}}\n{_END}",
        ["s:3:9: rate 'pin.angle_rat': the model has no such name; did you mean 'pin.angle_rate'?"],
    ),
    "all at once": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nscenes: [turn, trn]\nend: -1\nflag: 1\n"
        "objectives:\n  a: {maximum: slider.y0, unit: kg}\n",
        ["s:4:16: study: scenes: the model has no scene 'trn'; did you mean 'turn'?",
         "s:5:6: study: end: -1 is below 0; write a larger number",
         "s:6:1: study: unknown field 'flag'; did you mean 'flags'?",
         "s:8:16: objective 'a': 'slider.y0': 'slider' has no quantity 'y0'; did you mean 'y'?"],
    ),
    "unknown field": (
        f"{_HEAD}parameters: {{stiffness: [1, 2]}}\nobjctives: {{}}\n",
        ["s:4:1: study: unknown field 'objctives'; did you mean 'objectives'?"],
    ),
    "too many runs": (
        f"{_HEAD}parameters: {{stiffness: {{from: 1, to: 2, count: 100000}}}}\n"
        f"rates: {{pin.angle_rate: {{from: 1, to: 2, count: 100000}}}}\n{_END}",
        ["s:1:1: design: 10000000000 runs are more than 1e+08; write smaller counts, or a sequence such as {sobol: 1000}"],
    ),
    "no table": (
        f"{_HEAD}design: {{csv: none.csv}}\n{_END}",
        [
            "s:3:15: design: none.csv cannot be read: No such file or directory; "
            "write the path of a table; in a study, from the study's folder"
        ],
    ),
    "rows that differ": (
        f"{_HEAD}design: {{list: [{{stiffness: 1}}, {{pin.angle_rate: 1}}]}}\n{_END}",
        ["s:3:33: design: run 1 sets pin.angle_rate, but run 0 stiffness; set the same names in each"],
    ),
    "no model": (
        f"cutjoint_study: 1\nmodel: none.yaml\n{_END}",
        ["s:2:8: study: model: there is no file none.yaml; write its path from the folder of the study"],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "said"), _WRONG.values(), ids=_WRONG.keys())
def test_wrong_studies(text: str, said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError) as raised:
        read_study_text(text, "s")
    assert str(raised.value).splitlines() == said


def test_wrong_cells(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("stiffness\n1000\n\none\n1,2\n", encoding="utf-8")
    with pytest.raises(ModelError) as raised:
        read_study(study(tmp_path, parameters=None, rates=None, design={"csv": "runs.csv"}))
    table = tmp_path / "runs.csv"
    said = str(raised.value)
    assert f"{table}:4: column 'stiffness': 'one' is not a finite number; write a plain number in SI units" in said
    assert f"{table}:5: 2 values for 1 column; write values of stiffness" in said


def test_no_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = read_study(study(tmp_path))
    monkeypatch.setattr("cutjoint.sweeps.table.shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(RunError, match=r"study\.yaml:12:1: design: 40 runs take about .* GB at .*, which has 1e-06 GB left; write fewer"):
        require_room(Layout(study=read, manifest={}), tmp_path / "out.parquet")


def _values(folder: Path, **changes: Any) -> tuple[list[str], np.ndarray]:
    read = read_study(study(folder, **changes))
    return [v.name for v in read.variables], read.values


def test_grid(tmp_path: Path) -> None:
    parameters: Mapping[str, Any] = {"stiffness": {"from": 10, "to": 1000, "count": 3, "scale": "log"}}
    names, values = _values(tmp_path, parameters=parameters, rates={"pin.angle_rate": [1, "2 rad/s"]}, design="grid")
    assert names == ["stiffness", "pin.angle_rate"]
    np.testing.assert_allclose(values, [[10, 1], [10, 2], [100, 1], [100, 2], [1000, 1], [1000, 2]], rtol=1e-15)


def test_list_and_table_are_the_same(tmp_path: Path) -> None:
    rows = [{"stiffness": "1 kN/m", "pin.angle_rate": 7}, {"stiffness": 2000, "pin.angle_rate": "60 deg/s"}]
    (tmp_path / "runs.csv").write_text(f"stiffness, pin.angle_rate\n1000,7\n2000,{float(np.radians(60))!r}\n", encoding="utf-8")
    none: Mapping[str, Any] = {"parameters": None, "rates": None}
    listed, table = _values(tmp_path, **none, design={"list": rows}), _values(tmp_path, **none, design={"csv": "runs.csv"})
    assert listed[0] == table[0] == ["stiffness", "pin.angle_rate"]
    np.testing.assert_allclose(listed[1], table[1], rtol=1e-15)


def test_sequences_are_scipys(tmp_path: Path) -> None:
    low, high = [1000, 5], [4000, 10]
    _, sobol = _values(tmp_path, design={"sobol": 8, "seed": 3})
    np.testing.assert_allclose(sobol, qmc.scale(qmc.Sobol(2, rng=3).random(8), low, high), rtol=1e-15)
    _, cube = _values(tmp_path, design={"latin_hypercube": 5, "seed": 1})
    np.testing.assert_allclose(cube, qmc.scale(qmc.LatinHypercube(2, rng=1).random(5), low, high), rtol=1e-15)
    assert sorted(((cube[:, 0] - 1000) / 3000 * 5).astype(int)) == [0, 1, 2, 3, 4]  # one in each fifth


def test_digests_are_of_what_is_asked(tmp_path: Path) -> None:
    first, second = read_study(study(tmp_path)), read_study(study(tmp_path, design={"sobol": 40, "seed": 4}))
    path = study(tmp_path)
    path.write_text("# the same\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    assert read_study(path).digest == first.digest != second.digest


def test_the_study_of_the_page_is_one(tmp_path: Path) -> None:
    """That of docs/reference/study-file.md, beside the model that it names."""
    page = (ROOT / "docs" / "reference" / "study-file.md").read_text(encoding="utf-8")
    text = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)[0]
    read = read_study_text(text, str(ROOT / "examples" / "axle" / "study.yaml"))
    assert (read.runs, [v.name for v in read.variables], [o.name for o in read.objectives]) == (
        100_000, ["rack_height", "damping"], ["bump_steer", "ride"],
    )  # fmt: skip
    for name in REDUCTIONS:
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    ("value", "unit"),
    [
        ("slider.vx", "m/s"), ("abs(slider.vx)", "m/s"), ("-slider.vx", "m/s"),
        ("abs(slider.vx) - abs(2*slider.vx)", ""), ("2*slider.vx", ""),
    ],
)  # fmt: skip
def test_what_is_known_of_units(value: str, unit: str, tmp_path: Path) -> None:
    (objective,) = read_study(study(tmp_path, objectives={"a": {"maximum": value}})).objectives
    assert objective.unit == unit


@pytest.mark.parametrize(
    ("objective", "factor"),
    [
        ({"maximum": "pin.angle", "unit": "deg"}, 180 / np.pi), ({"maximum": "2*pin.angle", "unit": "mrad"}, 1e3),
        ({"range": "slider.x - rod.x", "unit": "mm"}, 1e3), ({"integral": "slider.vx", "unit": "mm"}, 1e3),
        ({"crossing": "pin.angle", "at": "1 deg", "unit": "ms"}, 1e3), ({"frequency": "slider.x", "unit": "Hz"}, 1.0),
        ({"rms": "slider.x*slider.vx", "unit": "cm^2/s"}, 1e4), ({"maximum": "slider.x"}, 1.0),
        ({"maximum": "3*spring.force", "unit": "kN"}, 1e-3),
    ],
)  # fmt: skip
def test_objectives_are_converted_to_their_units(objective: dict[str, object], factor: float, tmp_path: Path) -> None:
    (read,) = read_study(study(tmp_path, objectives={"a": objective})).objectives
    assert read.factor == pytest.approx(factor, rel=1e-14)
    assert read.unit == objective.get("unit", "m")


@pytest.mark.parametrize(
    ("objective", "words"),
    [
        ({"maximum": "pin.angle", "unit": "kg"}, "unit kg does not fit: it is in an angle or a plain number"),
        ({"maximum": "slider.x", "unit": "m/s"}, "unit m/s does not fit: it is in m"),
        ({"maximum": "pin.angle_rate", "unit": "Hz"}, "Hz leaves open whether turns or radians"),
        ({"integral": "slider.vx", "unit": "m/s"}, "unit m/s does not fit: it is in m"),
        ({"crossing": "slider.x", "at": 0.1, "unit": "mm"}, "unit mm does not fit: it is in s"),
        ({"crossing": "slider.x", "at": "1 deg"}, "at needs m, got an angle or a plain number"),
        ({"maximum": "slider.x + slider.vx"}, "m and m/s"),
        ({"maximum": "slider.x", "unit": "furlungs"}, "unknown unit 'furlungs'"),
        ({"maximum": "pin.angle*180/pi", "unit": "deg"}, "the unit converts, and the expression is multiplied by 57.2958 for it already"),
        ({"range": "(slider.x - rod.x)*1000", "unit": "mm"}, "multiplied by 1000 for it already"),
    ],
)  # fmt: skip
def test_units_that_do_not_fit_are_reported(objective: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=re.escape(words)):
        read_study(study(tmp_path, objectives={"a": objective}))
