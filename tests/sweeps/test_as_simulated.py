"""Hosts that name no integrator beside `simulate`: the same rule of steps, and rows as near as a run promises."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.export.fmu.description import write_description
from cutjoint.methods import METHODS, Implementation
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.run.settings import GOAL, Options, find_integrator
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint.topology.reading import read_model
from tests.conftest import MODELS, needs_cpp
from tests.fmu.slaves import OK, Slave
from tests.mechanisms.bouncing import bouncing_text

pytestmark = needs_cpp

_PRESS = (MODELS / "press.yaml").read_text(encoding="utf-8").replace("end: 2", "end: 0.6")
_STOP = "forces:\n  buffer: {kind: joint_force, joint: rail, law: {stop: {side: above, at: 60 mm, stiffness: 40 kN/m, damping: 200}}}\n"

#: Models that name neither integrator nor step: one with events, one with a loop, one with both; a parameter with two values.
TEXTS = {
    "bounce": bouncing_text(5.0, 0.3).replace(", numerics: {dt: 0.01}", "").replace(
        "mass: {mass: 1.0", "mass: {mass: load").replace(
        "bodies:\n", "parameters: {load: {value: 1, unit: kg, binding: param}}\nbodies:\n"),
    "press": _PRESS,
    "stopped": _PRESS.replace("name: press", "name: stopped").replace("forces:\n", _STOP),
}  # fmt: skip
CHANGED = {"bounce": ("load", (0.8, 1.1)), "press": ("stiffness", (1500.0, 3000.0)), "stopped": ("stiffness", (1500.0, 3000.0))}

every_model = pytest.mark.parametrize("name", TEXTS)


def _write(name: str, folder: Path, **numerics: Any) -> Path:
    """The model's file, its scene with settings of steps."""
    data = yaml.safe_load(TEXTS[name])
    for scene in data["scenes"].values():
        scene.update({"numerics": numerics} if numerics else {})
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return file


@cache
def _runs(name: str) -> tuple[Any, ...]:
    """Runs of `simulate` for both values of the parameter."""
    model = read_model_text(TEXTS[name], f"{name}.yaml")
    parameter, values = CHANGED[name]
    artifact = compile_scene(model, find_scene(model, None))
    return tuple(simulate(artifact, parameters={parameter: value}) for value in values)


def _require_near(found: Any, run: Any, name: str) -> None:
    """An output over time, as far from that of the run as its promise and that of the other one let it be."""
    size = 1.0 if run.units[name] in ("m", "rad") else max(1.0, float(np.max(np.abs(run[name]))))
    assert np.max(np.abs(np.asarray(found) - run[name])) <= 2 * GOAL * size, name


@every_model
def test_a_sweep_has_the_rows_of_single_runs(name: str, tmp_path: Path) -> None:
    model, (parameter, values) = read_model(_write(name, tmp_path)), CHANGED[name]
    outputs = [output.column for output in find_scene(model, None).outputs]
    study = {
        "cutjoint_study": 1, "model": f"{tmp_path}/{name}.yaml", "parameters": {parameter: list(values)}, "design": "grid",
        "trajectories": {"outputs": outputs},
    }  # fmt: skip
    done = cutjoint.sweep(study, tmp_path / "out.parquet")
    scene = find_scene(model, None).name
    assert done.failures == [None, None]
    assert {key: done.manifest[key][scene] for key in ("integrator", "tolerance", "events", "lanes")} == {
        "integrator": "dormand-prince", "tolerance": 1e-7, "events": True, "lanes": 1
    }  # fmt: skip
    assert done.manifest["step"][scene] == find_scene(model, None).output_step
    for i, run in enumerate(_runs(name)):
        assert run.error.converged
        for output in outputs:
            _require_near(done[f"{output}(t)"][i], run, output)


@every_model
def test_a_loaded_model_has_them_too(name: str, tmp_path: Path) -> None:
    sim, (parameter, values) = cutjoint.load(_write(name, tmp_path)), CHANGED[name]
    assert (sim.settings.integrator, sim.settings.tolerance, sim.settings.events) == ("dormand-prince", 1e-7, True)
    for value, run in zip(values, _runs(name), strict=True):
        sim.parameters[parameter] = value
        sim.reset()
        rows = [list(sim.outputs.array)]
        rows += [list(row) for row in sim.run(len(run.t) - 1)]
        assert sim.time == pytest.approx(run.t[-1])
        for i, output in enumerate(sim.outputs):
            _require_near([row[i] for row in rows], run, output)
    many = cutjoint.rollout(sim.reset(), len(run.t) - 1, parameters={parameter: values})
    assert many.shape[:2] == (2, len(run.t) - 1)


@every_model
def test_a_batch_has_them_too(name: str, tmp_path: Path) -> None:
    model, (parameter, values) = read_model(_write(name, tmp_path)), CHANGED[name]
    done = simulate_batch(compile_scene_batch(model, find_scene(model, None)), [{parameter: v} for v in values], out=tmp_path / "out.csv")
    assert (done.settings.integrator, done.settings.tolerance, done.side_by_side) == ("dormand-prince", 1e-7, False)
    for i, run in enumerate(_runs(name)):
        for output in run.columns:
            places = {"end": run[output][-1], "smallest": np.min(run[output]), "largest": np.max(run[output])}
            size = 1.0 if run.units[output] in ("m", "rad") else max(1.0, float(np.max(np.abs(run[output]))))
            for kind, value in places.items():
                assert abs(getattr(done, kind)[output][i] - value) <= 2 * GOAL * size, (output, kind)
    rows = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 3
    assert rows[1].startswith(f"{values[0]!r},,")


def test_a_batch_with_equal_steps_goes_side_by_side(tmp_path: Path) -> None:
    """Also where the command names the step; runs are the same in any number of threads, and one that fails is a row."""
    (tmp_path / "cases.csv").write_text("stiffness\n1500\n3000\n", encoding="utf-8")
    words = ["batch", str(_write("press", tmp_path)), str(tmp_path / "cases.csv"), "--out", str(tmp_path / "out.csv")]
    for more, said in (([], "tolerance 1e-07, runs one by one"), (["--dt", "0.001"], "trapezoidal, steps of 0.001 s")):
        done = CliRunner().invoke(main, [*words, *more])
        assert done.exit_code == 0, done.output
        assert said in " ".join(done.output.split()), done.output
    model = read_model(tmp_path / "press.yaml")
    artifact, cases = compile_scene_batch(model, find_scene(model, None)), [{"stiffness": 2000.0 + 100 * k} for k in range(5)]
    one, two = (simulate_batch(artifact, cases, threads=threads) for threads in (1, 2))
    assert all(np.array_equal(one.end[name], two.end[name]) for name in one.units)
    assert simulate_batch(artifact, []).cases == ()


@every_model
@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_has_them_too(name: str, version: int, tmp_path: Path) -> None:
    model, (parameter, values) = read_model(_write(name, tmp_path)), CHANGED[name]
    fmu = make_fmu(model, find_scene(model, None), version=version)
    described = write_description(fmu.subject, fmu.interface, version)
    assert "dormand-prince, steps of at most" in described
    run, slave = _runs(name)[0], Slave(fmu)
    assert slave.set(**{parameter: values[0]}) == OK
    assert slave.initialise() == OK
    rows = [slave.get()]
    for begin, end in zip(run.t, run.t[1:], strict=False):
        assert slave.step(begin, end - begin) == OK
        rows.append(slave.get())
    for i, output in enumerate(run.columns):
        _require_near([row[i] for row in rows], run, output)


@pytest.mark.parametrize(
    ("numerics", "method", "expected"),
    [({}, "recursive", ("dormand-prince", 1e-7)), ({"dt": 2e-3}, "recursive", ("trapezoidal", 1e-6)),
     ({"integrator": "rk4"}, "recursive", ("rk4", 1e-6)), ({"integrator": "trapezoidal"}, "recursive", ("trapezoidal", 1e-6)),
     ({"tolerance": 1e-9}, "recursive", ("dormand-prince", 1e-9)), ({}, "recursive-newton", ("radau5", 1e-7)),
     ({}, "augmented", ("trapezoidal", 1e-6)), ({"integrator": "rk4"}, "recursive-newton", ("radau5", 1e-7))],
    ids=str,
)  # fmt: skip
def test_what_decides(numerics: dict[str, Any], method: str, expected: tuple[str, float], tmp_path: Path) -> None:
    """The rule of `simulate`, also where the file or the method say something; folders keep equal steps."""
    model = read_model(_write("press", tmp_path, **numerics))
    scene = find_scene(model, None)
    made = generate(model, scene, scene.outputs, method=method)
    found = make_standalone(made).settings
    assert (found.integrator, found.tolerance) == expected
    assert found.integrator == find_integrator(scene.numerics, METHODS[method], Implementation.GENERATED, Options()).name
    folder = make_standalone(made, equal_steps=True)
    assert folder.integrator == (numerics.get("integrator", "trapezoidal") if method == "recursive" else "trapezoidal")


def test_a_scene_that_wants_more_has_smaller_tolerances(tmp_path: Path) -> None:
    file = _write("press", tmp_path)
    for wanted, tolerance in ((1e-6, 1e-9), (1e-2, 1e-7), (1e-10, 1e-11)):
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
        data["scenes"]["turn"]["accuracy"] = wanted
        file.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
        model = read_model(file)
        scene = find_scene(model, None)
        assert make_standalone(generate(model, scene, scene.outputs)).settings.tolerance == pytest.approx(tolerance)


def test_the_command_says_how_runs_step(tmp_path: Path) -> None:
    study = {"cutjoint_study": 1, "model": f"{_write('press', tmp_path)}", "parameters": {"stiffness": [2000]}, "design": "grid",
             "objectives": {"top": {"maximum": "slider.x"}}}  # fmt: skip
    path = tmp_path / "study.yaml"
    path.write_text(yaml.safe_dump(study), encoding="utf-8")
    said = CliRunner().invoke(main, ["sweep", str(path), "--out", str(tmp_path / "out.parquet")]).output
    assert "steps of scene 'turn': dormand-prince, steps of at most 0.01 s, tolerance 1e-07, runs one by one" in said.replace("\n", " ")
