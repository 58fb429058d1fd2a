"""A trajectory as a mapping, and in the hands of other packages."""

from __future__ import annotations

import copy
import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest

from cutjoint.package.extensions import MissingPackageError
from cutjoint.run.results import Columns, ErrorEstimate, Trajectory

T = np.array([0.0, 0.5, 1.0])
COLUMNS = Columns({"tip.z": T**2, "hinge.angle": 2 * T, "arm.<b>": -T})
UNITS = Columns({"tip.z": "m", "hinge.angle": "rad", "arm.<b>": "m"})


def a_run() -> Trajectory:
    return Trajectory(t=T, columns=COLUMNS, units=UNITS, steps=2, evaluations=4, seconds=0.0, undetermined=(), failure=None)


def test_it_is_a_mapping_from_names_to_columns() -> None:
    run = a_run()
    assert list(run) == ["t", "tip.z", "hinge.angle", "arm.<b>"]
    assert len(run) == 4
    assert run["t"] is T
    assert run["tip.z"] is COLUMNS["tip.z"]
    assert "tip.x" not in run
    assert {**run}.keys() == run.keys()
    with pytest.raises(KeyError, match=r"no column 'tip\.y'; did you mean 'tip\.z'"):
        run["tip.y"]


@pytest.mark.parametrize("again", [copy.copy, replace, lambda run: pickle.loads(pickle.dumps(run))], ids=["copy", "replace", "pickle"])
def test_a_copy_has_the_same(again) -> None:  # type: ignore[no-untyped-def]
    run = again(a_run())
    assert {name: list(values) for name, values in run.items()} == {name: list(values) for name, values in a_run().items()}
    assert run.units == UNITS
    assert run.steps == 2


def test_a_figure_has_a_panel_for_each_unit_and_a_line_for_each_column_of_each_run() -> None:
    run, other = a_run(), replace(a_run(), columns=Columns({"tip.z": 3 * T}))
    over_time = run.plot(compare={"stiff": other})
    labels = [[line.get_label() for line in panel.get_lines()] for panel in over_time.axes]
    assert labels == [["tip.z", "tip.z, stiff", "arm.<b>"], ["hinge.angle"]]
    assert [panel.get_ylabel() for panel in over_time.axes] == ["[m]", "[rad]"]
    assert over_time.axes[-1].get_xlabel() == "t [s]"
    chosen = run.plot("tip.z", over="hinge.angle")
    ((line,),) = [panel.get_lines() for panel in chosen.axes]
    assert (list(line.get_xdata()), list(line.get_ydata())) == (list(2 * T), list(T**2))
    assert chosen.axes[0].get_xlabel() == "hinge.angle [rad]"
    assert chosen._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(KeyError, match=r"no column 'tip\.y'"):
        run.plot("tip.y")


def test_a_notebook_has_a_row_for_each_column_with_the_error_where_it_is_known() -> None:
    run = a_run()
    html = run._repr_html_()
    assert "<tr><td>hinge.angle</td><td>rad</td><td>0</td><td>2</td><td>0</td><td>2</td></tr>" in html
    assert "arm.&lt;b&gt;" in html
    assert "<b>" not in html
    known = replace(run, estimator=lambda _: ErrorEstimate(max_error=dict.fromkeys(UNITS, 1e-5), units=UNITS, converged=True))
    assert known.error.converged
    assert ([*known.error], "tip.q" in known.error) == ([*UNITS], False)  # by numbers from 0, as Python reads what has no iterator
    assert "<td>2</td><td>0</td><td>2</td><td>1e-05</td></tr>" in known._repr_html_()
    assert "<td>" not in replace(run, t=T[:0], columns=Columns(dict.fromkeys(UNITS, T[:0])))._repr_html_()


def test_without_xarray_its_name_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingPackageError, match="needs the package xarray, which is not installed; pip install"):
        a_run().to_xarray()


def test_xarray_has_columns_over_time_with_units() -> None:
    pytest.importorskip("xarray")
    data = a_run().to_xarray()
    assert list(data["tip.z"].sel(t=0.5, method="nearest").dims) == []
    assert (data["tip.z"].attrs["units"], data["t"].attrs["units"]) == ("m", "s")
    assert list(data["hinge.angle"].values) == list(2 * T)


def test_a_data_frame_has_a_column_for_each() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(a_run())
    assert list(frame.columns) == ["t", "tip.z", "hinge.angle", "arm.<b>"]
    assert list(frame["tip.z"]) == list(T**2)
