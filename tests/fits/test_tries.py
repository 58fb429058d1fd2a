"""Several starts and a bootstrap: what is done stays, on this machine and by Dask, and one that fails does not end the others."""

from __future__ import annotations

import pickle
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster
from pyarrow import parquet

import cutjoint
from cutjoint.fits.fit import Solver, _try_one
from cutjoint.fits.reading import read_fit
from cutjoint.package.errors import RunError
from cutjoint.run.outputs import OutputError
from cutjoint.run.stopping import StopRequest
from tests.fits.slide import study_of


def test_starts_go_on_where_they_were_interrupted(tmp_path: Path) -> None:
    study, said = study_of(tmp_path, starts={"count": 4}), list[str]()

    def stop(text: str) -> None:
        if text == "starts: 2 of 4 fits":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        cutjoint.fit(study, out=tmp_path / "fit.json", note=stop)
    assert "of 4 runs are in" in stopped.value.__notes__[0]
    found = cutjoint.fit(study, out=tmp_path / "fit.json", note=said.append)
    assert "2 of 4 runs are in" in next(text for text in said if "continuing" in text)
    assert found["stiffness"] == pytest.approx(200.0, rel=1e-6)
    assert found["damping"] == pytest.approx(2.0, rel=1e-6)
    whole = cutjoint.fit(study)
    assert (found.starts, found.values.tolist()) == (whole.starts, whole.values.tolist())
    names = parquet.read_table(tmp_path / "fit.starts.parquet").column_names
    assert {"stiffness at the start", "stiffness fitted", "cost of fit"} < set(names)
    (tmp_path / "d.csv").write_text((tmp_path / "d.csv").read_text().replace("\n0.01", "\n0.0101"))
    assert cutjoint.fit(study, out=tmp_path / "fit.json", note=said.append).values.tolist() != whole.values.tolist()  # new data


def test_parts_of_another_study_are_said_before_the_fit(tmp_path: Path) -> None:
    study, said = study_of(tmp_path, bootstrap={"count": 4}), list[str]()

    def stop(text: str) -> None:
        if text == "bootstrap: 2 of 4 fits":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cutjoint.fit(study, out=tmp_path / "fit.json", note=stop)
    study["parameters"]["damping"]["to"] = 40
    with pytest.raises(OutputError, match=r"fit\.bootstrap\.parquet\.parts has rows of another study: study differ; remove it"):
        cutjoint.fit(study, out=tmp_path / "fit.json", note=said.append)
    assert not any("run 1" in text for text in said)


def test_fits_that_all_fail_are_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Solver, "_try", lambda *_: np.full((2, 5), np.nan))
    with pytest.raises(RunError, match="starts: the fits from all of them fail"):
        cutjoint.fit(study_of(tmp_path, starts={"count": 2}))
    with pytest.raises(RunError, match="bootstrap: fewer than two of its fits succeed"):
        cutjoint.fit(study_of(tmp_path, bootstrap={"count": 2}))


def test_a_start_that_fails_is_named_and_the_others_count(tmp_path: Path) -> None:
    study, said = study_of(tmp_path, starts={"count": 4}), list[str]()
    study["parameters"]["damping"]["from"] = "-1e7 N*s/m"  # runs with less than none diverge
    found = cutjoint.fit(study, note=said.append)
    assert np.isnan(found.starts).any()
    assert any(text.startswith("starts: fit ") and "failed: " in text for text in said)
    assert found["damping"] == pytest.approx(2.0, rel=1e-6)


def test_workers_of_dask_find_the_same(tmp_path: Path) -> None:
    study = study_of(tmp_path, noise=1e-3, starts={"count": 2}, bootstrap={"count": 6})
    alone = cutjoint.fit(study, out=tmp_path / "alone")
    with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address="127.0.0.1:0") as cluster:
        found = cutjoint.fit(study, out=tmp_path / "dask", scheduler=cluster.scheduler_address)
    assert found.values.tolist() == alone.values.tolist()
    assert found.deviations.tolist() == alone.deviations.tolist()
    for table in ("starts", "bootstrap"):
        assert (tmp_path / f"dask.{table}.parquet").read_bytes() == (tmp_path / f"alone.{table}.parquet").read_bytes()


_ELSEWHERE = """
import pickle, sys
import numpy as np
tries = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(pickle.dumps(tries(0, np.array([150.0, 3.0]))))
"""


def test_tries_bring_their_libraries_to_a_machine_without_them(tmp_path: Path) -> None:
    """The place of the library on this machine is no file there."""
    solver = Solver(read_fit(study_of(tmp_path)), lambda text: None)
    tries = partial(_try_one, solver.study, solver.runs.sims, solver.deviations, StopRequest())
    (sim,) = solver.runs.sims.values()
    content, path, *more = sim.library._made_with
    sim.library._made_with = (content, path.with_name("libgone.so"), *more)  # type: ignore[assignment]
    done = subprocess.run([sys.executable, "-c", _ELSEWHERE], input=pickle.dumps(tries), capture_output=True, check=True)
    assert pickle.loads(done.stdout)[3] == pytest.approx(200.0, rel=1e-6)
