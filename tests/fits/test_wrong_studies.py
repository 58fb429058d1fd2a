"""What is wrong with the data or the study of a fit is said with its place."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import cutjoint
from cutjoint.fits.data import read_data
from cutjoint.fits.fit import _spread
from cutjoint.fits.reading import read_fit
from cutjoint.fits.records import Signal
from cutjoint.sweeps.reading import read_study
from tests.fits.studies import ARM, press_study, write


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "it cannot be read: it is empty; write a line of names, then a line of numbers"),
        ("time,x\n0,1\n\n1,a\n", "line 4: 'a' is no number; below its first line of names it has numbers alone"),
        ("time;x\n0,5;1,5\n", "line 2: '0,5' is no number"),
        ("time,x\n0,1,2\n", "line 2 has 3 values for 2 names"),
        ("time,x,y,x\n0,1,2,3\n", "two columns are named 'x'; rename or remove one"),
    ],
)
def test_what_is_wrong_with_data_has_its_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "d.csv").write_text(text)
    with pytest.raises(cutjoint.CutjointError, match=rf"d\.csv: .*{words}"):
        read_data(tmp_path / "d.csv", "time")


def test_channels_of_mdf_that_are_not_one_column_of_numbers_are_named(tmp_path: Path) -> None:
    """Channels of the same name in two groups, texts and, without the samples that are marked as invalid, numbers."""
    asammdf = pytest.importorskip("asammdf")
    t, file = np.arange(4.0), tmp_path / "d.mf4"
    texts = {"val_0": 0, "text_0": "N", "val_1": 1, "text_1": "D"}
    gear = asammdf.Signal(np.array([0, 1, 1, 0], dtype="u1"), t, name="gear", conversion=texts)
    speeds = [asammdf.Signal(t + shift, t + shift, name="speed") for shift in (0, 10)]
    angle = asammdf.Signal(np.array([0.5, 1, 999, 2]), t, name="angle", invalidation_bits=np.array([False, False, True, False]))
    with asammdf.MDF(version="4.10") as written:
        for signals in ([speeds[0], gear], [speeds[1]], [angle]):
            written.append(signals)
        written.save(file)
    column = read_data(file, "")
    assert [of.tolist() for of in column("angle")] == [[0, 1, 3], [0.5, 1, 2]]
    for name, words in {
        "speed": "2 groups have a channel 'speed'; save one of them alone", "gear": "the samples of channel 'gear' are no numbers",
        "angel": "there is no channel 'angel'; did you mean 'angle'",
    }.items():  # fmt: skip
        with pytest.raises(cutjoint.CutjointError, match=rf"d\.mf4: {words}"):
            column(name)
    file.write_bytes(b"speed " * 100)
    with pytest.raises(cutjoint.CutjointError, match=r"d\.mf4: it cannot be read: .*magic header"):
        read_data(file, "")


def test_a_constant_column_has_the_size_of_its_value() -> None:
    """The standard deviation of 0.9 thirty times is that of its sum's rounding, not 0."""
    values = np.full(30, 0.9)
    assert 0 < np.std(values) < 1e-15
    one, none = sympy.Integer(1), sympy.Integer(0)
    signal = Signal(
        text="a", unit="m", value=one, times=np.arange(30.0), values=values, deviation=np.nan, gain=one, bias=none, delay=none
    )  # fmt: skip
    assert _spread(signal) == 0.9


def test_an_empty_study_is_no_model(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text("")
    with pytest.raises(cutjoint.CutjointError, match=r"study.yaml:1:1: file: the file is empty; a fit starts with 'cutjoint_fit: 1'"):
        cutjoint.fit(tmp_path / "study.yaml")
    with pytest.raises(cutjoint.CutjointError, match="the file is empty; a study starts with 'cutjoint_study: 1'"):
        read_study(tmp_path / "study.yaml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"parameters": {"stifness": {}}}, "no model has a number of this name"),
        ({"parameters": {"stiffness": {"start": 5, "from": 6}}}, "is not between its bounds"),
        ({"parameters": {"stiffness": {"from": 6, "to": 5}}}, "its bounds 6 and 5 enclose nothing; write the smaller one under 'from'"),
        ({"parameters": {"stiffness": {"start": "5 kg"}}}, "needs"),
        ({"ties": {"nothing": "stiffness"}}, "is no number of the models"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.xx": {}}}}}, "slider.xx"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.x": {"unit": "kg"}}}}}, "unit kg does not fit"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"pin.angle_rate": {"unit": "Hz", "column": "slider.x"}}}}}, "Hz leaves"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.x": {"column": "slide.x"}}}}},
         r"study\.yaml:1:\d+: experiment 'run': .*d\.csv: there is no column 'slide\.x'; did you mean 'slider"),
        ({"experiments": {"run": {"data": "none.csv", "signals": {"slider.x": {}}}}},
         r"study\.yaml:1:\d+: experiment 'run': there is no file .*none\.csv; write its path from the folder of the study"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.x": {}}, "validation": True}}}, "for validation"),
        ({"starts": {"count": 3}}, "several starts lie between bounds"),
        ({"dt": 0}, "dt must be greater than zero"),
        ({"parameters": {"stiffness": {"size": 0}}}, "a size is above zero"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.x": {"unit": "foo"}}}}}, "experiment 'run': unknown unit 'foo'"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"slider.x": {"unit": "degC", "gain": 1}}}}}, "degC does not begin at zero"),
        ({"experiments": {"run": {"data": "d.csv", "start": {"pin.angle": "3 kg"}, "signals": {"slider.x": {}}}}}, "'3 kg' is in another"),
        ({"experiments": {"run": {"data": "d.csv", "start": {"pin.angle_rate": "3 Hz"}, "signals": {"slider.x": {}}}}}, "Hz leaves"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"pin.angle_rate": {"column": "slider.x", "bias": "1 Hz"}}}}}, "Hz leaves"),
        ({"experiments": {"run": {"data": "d.csv", "signals": {"pin.angle_rate": {"deviation": "1 Hz", "column": "slider.x"}}}}}, "Hz l"),
        ({"dt": 0, "experiments": {"run": {"data": "d.csv", "from": 9, "time_unit": "foo", "signals": {"slider.x": {}}}}},
         r"(?s)unknown unit 'foo'.*there are no samples in the window of time.*dt must be greater than zero|dt must.*unknown.*no samples"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    write(tmp_path / "d.csv", np.arange(3.0), slider_x=np.zeros(3))
    study = {**press_study("d.csv", ["stiffness"], {"slider.x": {}}), **change}
    (tmp_path / "study.yaml").write_text(json.dumps(study))
    with pytest.raises(cutjoint.CutjointError, match=words):
        cutjoint.fit(tmp_path / "study.yaml")


@pytest.mark.parametrize(
    ("times", "values", "words"),
    [
        ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0], "the times of column 'torque' do not rise after 2 s; sort the rows and remove duplicates"),
        ([0.0, 1.0, 1.0], [1.0, 1.0, 1.0], "the times of column 'torque' do not rise"),
        ([50.0, 51.0, 52.0], [1.0, 1.0, 1.0], "no samples of it between 0 s and 1 s, where the signals are; see time"),
        ([0.0, 1.0, 2.0], [np.nan, np.nan, np.nan], "no samples of it between 0 s and 1 s"),
        ([np.nan, 0.5, 0.8], [1.0, np.nan, 1.0], None),
        ([-2.0, -1.0], [1.0, 1.0], None),
    ],
)  # fmt: skip
def test_inputs_are_of_the_time_of_the_run(tmp_path: Path, times: list[float], values: list[float], words: str | None) -> None:
    """The signals begin where the first row has no time, too."""
    (tmp_path / "arm.yaml").write_text(ARM.replace("parameters: {", "parameters: {push: {value: 0, unit: N*m, binding: input}, "))
    write(tmp_path / "d.csv", [np.nan, 0.0, 0.5, 1.0], pin_angle=[9.0, 1.0, 2.0, 3.0])
    write(tmp_path / "torque.csv", times, torque=values)
    run = {"data": "d.csv", "inputs": {"push": {"data": "torque.csv", "column": "torque"}}, "signals": {"pin.angle": {}}}
    study = {"cutjoint_fit": 1, "model": "arm.yaml", "dt": "1 ms", "parameters": {"friction": {}}, "experiments": {"a": run}}
    (tmp_path / "study.json").write_text(json.dumps(study))
    if words is not None:
        with pytest.raises(cutjoint.CutjointError, match=words):
            read_fit(tmp_path / "study.json")
    else:
        (read,) = read_fit(tmp_path / "study.json").experiments
        assert read.signals[0].times.tolist() == [0, 0.5, 1]
        assert list(np.asarray(read.inputs["push"]["t"])) == [t for t, x in zip(times, values, strict=True) if np.isfinite(t + x)]


def test_times_rise_in_the_window_alone(tmp_path: Path) -> None:
    """A recorder wrote its first row twice, and began again behind the last."""
    (tmp_path / "arm.yaml").write_text(ARM)
    data = write(tmp_path / "d.csv", [0.0, 0.0, 1.0, 2.0, 3.0, 0.5], pin_angle=[9.0, 9.0, 1.0, 2.0, 3.0, 9.0], start=np.full(6, 0.1))
    run = {"data": data, "from": 1, "to": 2.5, "start": {"pin.angle": "start"}, "signals": {"pin.angle": {}}}
    study = {"cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "parameters": {"friction": {}}, "experiments": {"a": run}}
    (read,) = read_fit(study).experiments
    assert read.signals[0].times.tolist() == [0, 1]
    del run["from"]
    with pytest.raises(cutjoint.CutjointError, match=r"the times of column 'pin\.angle' do not rise"):
        read_fit(study)


def test_numbers_of_wrong_units_have_no_other_faults(tmp_path: Path) -> None:
    """A bound, a prior or a size whose unit is wrong is not said to enclose nothing or to be zero as well."""
    (tmp_path / "arm.yaml").write_text(ARM)
    write(tmp_path / "d.csv", [0.0, 1.0], pin_angle=[0.0, 1.0])
    wrong = {"start": "3 m", "from": "1 N*m*s", "to": "5 kg", "prior": {"mean": "2 N*m*s", "deviation": "3 kg"}, "size": "4 s"}
    run = {"data": str(tmp_path / "d.csv"), "signals": {"pin.angle": {}}}
    study = {"cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "parameters": {"friction": wrong}, "experiments": {"a": run}}
    with pytest.raises(cutjoint.CutjointError) as found:
        read_fit(study)
    said = [re.sub(r".*friction\.(\S+) needs \S+, got (\S+).*", r"\1 \2", line) for line in str(found.value).splitlines()]
    assert said == ["start m", "to kg", "prior.deviation kg", "size s"]
