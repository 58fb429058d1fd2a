"""Sweeps beside single runs of the command line's simulator, and what becomes of calls that stop."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import sympy
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.records import Scene
from cutjoint.run.outputs import OutputError
from cutjoint.run.scenes import with_default_closure
from cutjoint.run.simulation import simulate
from cutjoint.sweeps.parts import missing
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.work import Chunk, Rows, Threads, Work
from cutjoint.topology.reading import read_model
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.listening import listen

from .studies import PRESS, study

pytestmark = needs_cpp


def _single(scene: Scene, parameters: Mapping[str, float], rates: Mapping[str, float], **how: Any) -> Any:
    """A run of the press by the simulator of the command line."""
    model = read_model(MODELS / "press.yaml")
    started = {**scene.rates, **{name: sympy.Float(value, 17) for name, value in rates.items()}}
    held = with_default_closure(Scene(**{**scene.__dict__, "rates": started}), "recursive", how.get("integrator"), how.get("dt"))
    artifact = compile_scene(model, held)
    return simulate(artifact, parameters=parameters, error=False, **how)


def test_rows_are_those_of_single_runs(tmp_path: Path) -> None:
    done = cutjoint.sweep(study(tmp_path, design={"sobol": 4}), tmp_path / "out.parquet")
    scene = read_model(MODELS / "press.yaml").scenes["turn"]
    for run in range(4):
        stiffness, rate = done["stiffness"][run], done["pin.angle_rate"][run]
        alone = _single(scene, {"stiffness": stiffness}, {"pin.angle_rate": rate}, dt=1e-3, end=0.2)
        x, v, force = alone["slider.x"], alone["slider.vx"], alone["spring.force"]
        assert done["top"][run] == max(x[10:])
        assert done["speed"][run] == pytest.approx(np.sqrt(np.mean(v**2)), rel=1e-14)
        assert done["load"][run] == pytest.approx(np.mean(np.abs(force)) * stiffness, rel=1e-14)
        assert done["slider.x(t)"][run].tolist() == [*x[::7], *([x[-1]] if (len(x) - 1) % 7 else [])]
    assert done.units["slider.x(t)"] == done.units["top"] == "m"
    assert done.units["stiffness"] == "N/m"
    assert done.failures == [None] * 4


WAYS: list[dict[str, Any]] = [
    {"integrator": "rk4"}, {"method": "augmented"}, {"method": "recursive-newton"}, {"integrator": "dormand-prince", "tolerance": 1e-8},
    {"integrator": "dop853", "tolerance": 1e-8},
    {"method": "recursive-newton", "integrator": "radau5", "tolerance": 1e-8},
]  # fmt: skip


@pytest.mark.parametrize("how", with_heavy(WAYS, *WAYS[2:]), ids=str)
def test_integrators_and_methods(how: dict[str, Any], tmp_path: Path) -> None:
    scene = read_model(MODELS / "press.yaml").scenes["turn"]
    asked = {"parameters": {"stiffness": [3000]}, "rates": None, "design": "grid", "trajectories": None, "dt": 1e-3}
    done = cutjoint.sweep(study(tmp_path, **asked, **how), tmp_path / "out.parquet")
    options = {"dt": 1e-3, "end": 0.2, **how}
    method = str(options.pop("method", "recursive"))
    artifact = compile_scene(read_model(MODELS / "press.yaml"), scene, CompileOptions(method=method))
    alone = simulate(artifact, parameters={"stiffness": 3000.0}, error=False, **options)
    error = 1e-13 if "tolerance" not in how else 1e-7  # its steps end at rows here, and are interpolated there
    assert done["top"][0] == pytest.approx(max(alone["slider.x"][10:]), rel=error)


def test_workers_and_parts_do_not_matter(tmp_path: Path) -> None:
    path, contents = study(tmp_path), []
    for threads in (1, 3):
        out = tmp_path / f"{threads}.parquet"
        cutjoint.sweep(path, out, threads=threads)
        contents.append(out.read_bytes())
    assert contents[0] == contents[1]
    assert not list(tmp_path.glob("*.parts"))
    assert pq.read_table(tmp_path / "1.parquet")["run"].to_pylist() == list(range(40))


def test_a_mapping_is_a_study(tmp_path: Path) -> None:
    cutjoint.sweep(study(tmp_path), tmp_path / "file.parquet")
    cutjoint.sweep(PRESS, tmp_path / "mapping.parquet")
    one, other = (pq.read_table(tmp_path / f"{name}.parquet") for name in ("file", "mapping"))
    assert one.equals(other)


def test_a_run_that_fails_is_a_row(tmp_path: Path) -> None:
    """A crank that begins so fast that a step of the pendulum's rule cannot be found; the others are done."""
    rows = [{"pin.angle_rate": 10}, {"pin.angle_rate": 1e9}, {"pin.angle_rate": 5}]
    done = cutjoint.sweep(
        study(tmp_path, parameters=None, rates=None, design={"list": rows}, output_step=0.01, dt=0.01), tmp_path / "out.parquet"
    )
    assert [failure is None for failure in done.failures] == [True, False, True]
    assert np.isnan(done["failure_time"]).tolist() == [True, False, True]
    assert np.isnan(done["top"]).tolist() == [False, True, False]
    assert "press.yaml" in str(done.failures[1]) or ";" in str(done.failures[1])
    assert [len(values) for values in done["slider.x(t)"]][::2] == [4, 4]


def test_scenes_and_starts_that_follow_from_parameters(tmp_path: Path) -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8")
    text = text.replace("parameters: {", "parameters: {begin: {value: 8, unit: rad/s, binding: param}, ")
    text = text.replace("angle_rate: 10", "angle_rate: begin") + "  slow: {end: 0.1, output_step: 5 ms, rates: {pin.angle_rate: begin/2}}\n"
    (tmp_path / "press.yaml").write_text(text, encoding="utf-8")
    asked: Mapping[str, Any] = {"end": None, "rates": None, "trajectories": {"outputs": ["pin.angle_rate"]}}
    path = study(tmp_path, **asked, model="press.yaml", scenes=["turn", "slow"], parameters={"begin": [4, 9]}, design="grid")
    done = cutjoint.sweep(path, tmp_path / "out.parquet")
    assert done["scene"].tolist() == ["turn", "turn", "slow", "slow"]
    assert [values[0] for values in done["pin.angle_rate(t)"]] == pytest.approx([4, 9, 2, 4.5], rel=1e-12)
    assert [len(values) for values in done["pin.angle_rate(t)"]] == [201, 201, 21, 21]


#: A body that a ball holds, turned at the start by parameters in three ways.
TURNED = """
cutjoint: 1
name: turned
gravity: [0, 0, 0]
parameters:
  bend: {value: 0.3, unit: rad, binding: param}
  size: {value: 1, unit: "1", binding: param}
bodies: {arm: {mass: 1, centre_of_mass: [1, 0, 0], inertia: [1, 2, 3]}}
joints: {ball: {kind: spherical, bodies: [ground, arm], at: [0, 0, 0]}}
outputs: [arm.x, arm.y, arm.z]
scenes:
  euler: {end: 0.01, output_step: 0.01, positions: {ball.attitude: {euler: [bend, 0.4, 2*bend], order: zyx}}}
  vector: {end: 0.01, output_step: 0.01, positions: {ball.attitude: {rotation_vector: [0.2, bend, -bend]}}}
  given: {end: 0.01, output_step: 0.01, positions: {ball.attitude: {quaternion: [size*cos(bend), 0, size*sin(bend), 0]}}}
"""


def test_attitudes_that_follow_from_parameters(tmp_path: Path) -> None:
    (tmp_path / "turned.yaml").write_text(TURNED, encoding="utf-8")
    asked = {
        "parameters": {"bend": [0, 0.7], "size": [1.0009, 1.002]}, "rates": None, "end": None, "trajectories": None, "design": "grid",
        "objectives": {axis: {"maximum": f"arm.{axis}", "to": 0} for axis in "xyz"},
    }  # fmt: skip
    path = study(tmp_path, model="turned.yaml", scenes=["euler", "vector", "given"], **asked)
    done = cutjoint.sweep(path, tmp_path / "out.parquet")
    for run, (scene, bend, size) in enumerate(zip(done["scene"], done["bend"], done["size"], strict=True)):
        if scene == "given" and size > 1.001:
            assert "out of its range" in str(done.failures[run])
            continue
        turn = {
            "euler": Rotation.from_euler("ZYX", [bend, 0.4, 2 * bend]), "vector": Rotation.from_rotvec([0.2, bend, -bend]),
            "given": Rotation.from_rotvec([0, 2 * bend, 0]),
        }[scene]  # fmt: skip
        assert [done[axis][run] for axis in "xyz"] == pytest.approx(turn.apply([1, 0, 0]), abs=1e-14)
    assert done.failures.count(None) == 10


def test_ranges_that_are_missing() -> None:
    assert missing([], 5) == [(0, 5)]
    assert missing([(0, 2), (3, 5)], 9) == [(2, 3), (5, 9)]
    assert missing([(0, 9)], 9) == []


def _killed(path: Path, out: Path, number: int) -> int:
    """A sweep in another process that a signal ends as soon as it has left rows; returns how many parts there are."""
    call = "from cutjoint.cli import main; main()"
    process = subprocess.Popen([sys.executable, "-c", call, "sweep", str(path), "--out", str(out), "--threads", "1"], preexec_fn=listen)
    folder, end = out.with_name(f"{out.name}.parts"), time.monotonic() + 60
    while not list(folder.glob("*.parquet")) and time.monotonic() < end and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, number)
    process.wait(60)
    return len(list(folder.glob("0*.parquet")))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_call_that_was_stopped_goes_on(number: int, tmp_path: Path) -> None:
    path = study(tmp_path, end=4.0, design={"sobol": 1024})
    cutjoint.sweep(path, tmp_path / "whole.parquet")
    out = tmp_path / "out.parquet"
    assert _killed(path, out, number) >= 1
    assert not out.exists()
    done = cutjoint.sweep(path, out)
    assert 0 < done.performed < 1024
    assert out.read_bytes() == (tmp_path / "whole.parquet").read_bytes()


def test_rows_of_another_study_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    _killed(study(tmp_path, end=4.0, design={"sobol": 1024}), out, signal.SIGKILL)
    with pytest.raises(OutputError, match=r"out\.parquet\.parts has rows of another study: study, design differ; remove it, or write else"):
        cutjoint.sweep(study(tmp_path, end=4.0, design={"sobol": 1024, "seed": 9}), out)


def test_a_damaged_part_is_made_anew(tmp_path: Path) -> None:
    path, out = study(tmp_path, end=4.0, design={"sobol": 1024}), tmp_path / "out.parquet"
    _killed(path, out, signal.SIGKILL)
    first = min(out.with_name("out.parquet.parts").glob("0*.parquet"))
    first.write_bytes(first.read_bytes()[:-20])
    assert read_study(path).runs == 1024
    cutjoint.sweep(path, out)
    assert pq.read_table(out)["run"].to_pylist() == list(range(1024))


def test_the_command_says_what_there_is(tmp_path: Path) -> None:
    path, out = study(tmp_path), tmp_path / "out.parquet"
    first = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out)])
    assert first.exit_code == 0, first.output
    assert f"results: {out}, 40 runs, 9 columns" in first.output.replace("\n", "")
    again = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out)])
    assert "all runs were already done" in again.output
    os.link(path, tmp_path / "study.parquet")
    clash = CliRunner().invoke(main, ["sweep", str(path), "--out", str(tmp_path / "study.parquet")])
    assert clash.exit_code == 1
    assert "that is study.yaml, which the command reads" in clash.output


def test_failures_are_reported_by_their_reasons(tmp_path: Path) -> None:
    rows = [{"slider.mass": m, "pin.angle_rate": w} for m, w in ((2, 5), (-1, 5), (2, 1e9), (-3, 5), (2, 2e9), (-2, 6))]
    path = study(tmp_path, open=["slider.mass"], parameters=None, rates=None, design={"list": rows}, output_step=0.01, dt=0.01)
    said = CliRunner().invoke(main, ["sweep", str(path), "--out", str(tmp_path / "out.parquet")]).output
    assert "5 of them failed:\n  3 like run 1: " in said
    assert "press.yaml:9:3: body 'slider': with these parameters the mass is negative: -1 kg; set other values\n  2 like run 2: " in said


def test_every_function_of_expressions(tmp_path: Path) -> None:
    """The generated code of each beside NumPy's, over the same outputs."""
    expected = {
        "sin(x*y)": lambda x, y, t: np.sin(x * y), "cos(x)": lambda x, y, t: np.cos(x), "tan(x)": lambda x, y, t: np.tan(x),
        "asin(x)": lambda x, y, t: np.arcsin(x), "acos(x)": lambda x, y, t: np.arccos(x), "atan(y)": lambda x, y, t: np.arctan(y),
        "atan2(y, x)": lambda x, y, t: np.arctan2(y, x), "sinh(x)": lambda x, y, t: np.sinh(x), "cosh(y)": lambda x, y, t: np.cosh(y),
        "tanh(y)": lambda x, y, t: np.tanh(y), "sqrt(x)": lambda x, y, t: np.sqrt(x), "log(x)": lambda x, y, t: np.log(x),
        "exp(2.5 - x/y**2*0)": lambda x, y, t: np.exp(2.5) + 0 * x, "exp(x - 1.25)": lambda x, y, t: np.exp(x - 1.25),
        "abs(y)": lambda x, y, t: np.abs(y), "sign(y)": lambda x, y, t: np.sign(y), "max(x, y*t)": lambda x, y, t: np.maximum(x, y * t),
        "min(x, y*t, x*x/x)": lambda x, y, t: np.minimum(x, y * t),
        "where(y < 0 and x > 0.3, y*t, -x)": lambda x, y, t: np.where((y < 0) & (x > 0.3), y * t, -x), "x**7": lambda x, y, t: x**7,
        "x**-3 + 1/y**(2/3)*0 + y**3": lambda x, y, t: x**-3.0 + y**3, "pi*x - 2": lambda x, y, t: np.pi * x - 2,
    }  # fmt: skip
    texts = [re.sub(r"\b([xy])\b", lambda found: {"x": "slider.x", "y": "slider.vx"}[found[1]], text) for text in expected]
    asked: Mapping[str, Any] = {"parameters": {"stiffness": [3000]}, "rates": None, "design": "grid", "objectives": None}
    shown = {"outputs": [*texts, "slider.x", "slider.vx", "t"]}
    done = cutjoint.sweep(study(tmp_path, **asked, trajectories=shown), tmp_path / "out.parquet")
    x, y, t = (done[f"{name}(t)"][0] for name in ("slider.x", "slider.vx", "t"))
    for text, formula in zip(texts, expected.values(), strict=True):
        with np.errstate(all="ignore"):
            np.testing.assert_allclose(done[f"{text}(t)"][0], formula(x, y, t), rtol=1e-13, atol=1e-13, err_msg=text)


class _Slow(Threads):
    """Workers that say of each run that it took a millisecond, and note the sizes of chunks."""

    def __init__(self, work: Work, number: int) -> None:
        super().__init__(work, 1)
        self.number, self.sizes = number, list[int]()

    def submit(self, chunk: Chunk) -> None:
        self.sizes.append(len(chunk.values))
        super().submit(chunk)

    def take(self, seconds: float) -> Rows | None:
        rows = super().take(seconds)
        return rows and replace(rows, seconds=1e-3 * len(rows.values))


@pytest.mark.parametrize(("number", "usual", "least"), [(2, 1000, 100), (96, 1500, 375)])
def test_chunks_have_work_enough(number: int, usual: int, least: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second, more where there are many workers; less at the end, and at the beginning, where it is not known."""
    found: list[_Slow] = []
    monkeypatch.setattr("cutjoint.sweeps.run._workers", lambda work, *_: found.append(_Slow(work, number)) or found[0])
    runs = 200 * usual
    asked = {"trajectories": None, "end": 0.002, "objectives": {"last": {"end": "slider.x"}}, "design": {"latin_hypercube": runs}}
    cutjoint.sweep(study(tmp_path, **asked), tmp_path / "out.parquet")
    sizes = found[0].sizes
    assert sum(sizes) == runs
    full = next(i for i, size in enumerate(sizes) if size >= 0.9 * usual)
    assert full <= 12  # a few chunks try how long a run takes
    assert max(sizes) <= usual + 1
    assert min(sizes[full:-1]) >= least
    assert sizes[-2] < usual
