"""The Python interface: its names, its arguments, its output, and that nothing half done passes for a result."""

from __future__ import annotations

import inspect
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.compile import pipeline
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import ModelLike, find_scene
from cutjoint.tasks import batch
from cutjoint.tasks.batch import BatchArtifact
from cutjoint_bench.generic.artifact import compile_generic_model
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.fuzz.press import environment

PRESS = MODELS / "press.yaml"
#: So stiff a spring that no step of the scene's length converges.
STIFF = {"stiffness": 1e9}
#: Characters of a screen.
SCREEN = 80 * 24


@cache
def press(method: str = "recursive") -> Artifact:
    return cutjoint.compile_model(PRESS, method=method)


@cache
def batches() -> BatchArtifact:
    return cutjoint.compile_batch(PRESS)


@needs_cpp
def test_the_page_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    page = (ROOT / "docs" / "how-to" / "python.md").read_text(encoding="utf-8")
    parts = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(compile("".join(parts), "python.md", "exec"), {})
    assert "press.yaml" in capsys.readouterr().out


def test_all_that_is_exported_is_there() -> None:
    assert sorted(cutjoint.__all__) == cutjoint.__all__ == dir(cutjoint)
    for name in cutjoint.__all__:
        assert getattr(cutjoint, name).__name__ == name
        assert getattr(cutjoint, name).__doc__


def test_the_import_is_light() -> None:
    script = "import sys, cutjoint; print([n for n in ('sympy', 'numpy', 'yaml', 'cutjoint.compile.pipeline') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment())
    assert done.stdout == "[]\n"


def test_the_list_of_commands_imports_none_of_them() -> None:
    known = "print([n for n in ('sympy', 'numpy', 'yaml') if n in sys.modules])"
    script = f"import sys, atexit, cutjoint.cli; atexit.register(lambda: {known}); cutjoint.cli.main()"
    done = subprocess.run([sys.executable, "-c", script, "--help"], capture_output=True, text=True, check=True, env=environment())
    assert done.stdout.endswith("[]\n")
    context = click.Context(main)
    for name in main.list_commands(context):
        known = main.get_command(context, name)
        assert known is not None
        assert f"  {name}  ".ljust(len("  equilibrium  ")) + known.get_short_help_str(61) in done.stdout


@needs_cpp
def test_a_run_that_fails_raises_what_the_command_line_says(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    with pytest.raises(cutjoint.FailedRunError) as error:
        cutjoint.simulate(press(), parameters=STIFF, dt=1e-3, out=out)
    run = error.value.trajectory
    assert run.failure is not None
    assert run.table == tmp_path / "run.partial.csv"
    said = CliRunner().invoke(main, ["simulate", str(PRESS), "--set", "stiffness=1e9", "--dt", "1e-3", "--out", str(out)])
    assert said.exit_code == 1
    assert str(error.value) in said.output
    returned = cutjoint.simulate(press(), parameters=STIFF, dt=1e-3, check=False)
    assert returned.failure is not None
    assert returned.failure.summary == run.failure.summary
    assert np.array_equal(returned["slider.x"], run["slider.x"])


def test_models_are_compiled_by_the_method_of_their_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "compile_scene", lambda model, scene, options: options.method)
    text = PRESS.read_text(encoding="utf-8").replace("turn: {", "turn: {method: augmented, ")
    named = read_model_text(text, "press.yaml")
    found = [cutjoint.compile_model(PRESS), cutjoint.compile_model(named), cutjoint.compile_model(named, method="classical")]
    assert found == ["recursive", "augmented", "classical"]


@needs_cpp
def test_a_batch_with_a_run_that_fails_raises_after_all_have_ended() -> None:
    cases = [{"stiffness": 2000.0}, STIFF]
    with pytest.raises(cutjoint.FailedBatchError, match=r"run 2: (.|\n)*1 of 2 runs failed") as error:
        cutjoint.simulate_batch(batches(), cases, dt=1e-3)
    whole = cutjoint.simulate_batch(batches(), cases, dt=1e-3, check=False)
    assert str(error.value.batch.failures[1]) == str(whole.failures[1])
    assert whole.failures[0] is None
    assert cutjoint.simulate_batch(batches(), cases[:1], dt=1e-3).maximum["slider.x"] == pytest.approx(whole.maximum["slider.x"][:1])


@needs_cpp
def test_a_run_against_the_clock_that_fails_raises() -> None:
    with pytest.raises(cutjoint.FailedRealTimeError) as error:
        cutjoint.run_in_real_time(press(), parameters=STIFF, dt=1e-3)
    assert error.value.times.failure is not None
    assert str(error.value.times.failure) in str(error.value)
    returned = cutjoint.run_in_real_time(press(), parameters=STIFF, dt=1e-3, check=False)
    assert str(returned.failure) == str(error.value.times.failure)


@needs_cpp
def test_such_an_error_comes_back_from_another_process() -> None:
    with pytest.raises(cutjoint.FailedRunError) as error:
        cutjoint.simulate(press(), parameters=STIFF, dt=1e-3)
    copy = pickle.loads(pickle.dumps(error.value))
    assert str(copy) == str(error.value)
    assert str(copy.trajectory.failure) == str(error.value.trajectory.failure)


@needs_cpp
@pytest.mark.parametrize(
    "call",
    [
        lambda path, out: cutjoint.read_model(path),
        lambda path, out: cutjoint.compile_model(path, out=out),
        lambda path, out: cutjoint.simulate(press(), out=out, steps=f"{out}.steps", end=0.01),
        lambda path, out: cutjoint.simulate_batch(cutjoint.compile_batch(path), [{"stiffness": 2000.0}], out=out),
        lambda path, out: cutjoint.run_in_real_time(press(), end=0.01, out=out),
        lambda path, out: cutjoint.find_equilibrium(path),
        lambda path, out: cutjoint.find_initial_state(path),
        lambda path, out: cutjoint.find_modes(path, at=0.0),
        pytest.param(lambda path, out: compile_generic_model(path), marks=pytest.mark.heavy),
    ],
)  # fmt: skip
def test_paths_are_texts_or_paths(call: Callable[[Any, Any], Any], tmp_path: Path) -> None:
    for kind in (str, Path):
        call(kind(PRESS), kind(tmp_path / "out"))


@needs_cpp
def test_a_file_a_model_and_an_artifact_are_as_good(monkeypatch: pytest.MonkeyPatch) -> None:
    model = cutjoint.read_model(PRESS)
    artifact = compile_interpreted(model, find_scene(model, None))
    states = [cutjoint.find_initial_state(given)["slider.x"] for given in (PRESS, model, artifact)]
    assert states[1:] == states[:1] * 2
    monkeypatch.setattr(batch, "compile_scene", lambda model, scene, options: compile_interpreted(model, scene, method=options.method))
    runs = [cutjoint.simulate(given, end=0.02, error=False) for given in (str(PRESS), model, artifact)]
    assert [list(run["slider.x"]) for run in runs[1:]] == [list(runs[0]["slider.x"])] * 2
    tunable = cutjoint.simulate(PRESS, tunable=["B.*"], parameters={"B.z": 0.05}, end=0.02, error=False, method="recursive-newton")
    assert tunable["slider.x"][-1] != runs[0]["slider.x"][-1]


def test_all_that_takes_a_model_takes_it_in_each_form() -> None:
    """But for what is before a model: its readers, and the topology that is made of it alone."""
    functions = {name: made for name in cutjoint.__all__ if inspect.isfunction(made := getattr(cutjoint, name))}
    first = {name: next(iter(inspect.signature(made).parameters.values())) for name, made in functions.items()}
    takes = {name: parameter.annotation for name, parameter in first.items() if parameter.name in ("model", "path")}
    others = {name: annotation for name, annotation in takes.items() if "ModelLike" not in str(annotation) and annotation != ModelLike}
    assert others == {"build_topology": "Model", "random_vibration": cutjoint.StateSpace, "read_model": "AnyPath", "write_view": "AnyPath"}


@needs_cpp
def test_the_earlier_name_of_the_solver_s_tolerance_works_with_a_warning() -> None:
    how = {"end": 0.02, "integrator": "dormand-prince", "error": False}
    with pytest.warns(FutureWarning, match=r"simulate\(tolerance=\.\.\.\) is now simulate\(solver_tolerance=\.\.\.\)"):
        old = cutjoint.simulate(press(), tolerance=1e-3, **how)
    assert list(old["slider.x"]) == list(cutjoint.simulate(press(), solver_tolerance=1e-3, **how)["slider.x"])
    assert list(old["slider.x"]) != list(cutjoint.simulate(press(), solver_tolerance=1e-9, **how)["slider.x"])


def test_what_is_no_model_is_reported() -> None:
    with pytest.raises(TypeError, match="a model is its file, what read_model has made of it, or an artifact, not int"):
        cutjoint.simulate(5)  # type: ignore[arg-type]
    with pytest.raises(cutjoint.RunError, match=r"constants become tunable while the file is read; .* read_model\(path, tunable="):
        cutjoint.find_equilibrium(cutjoint.read_model(PRESS), tunable=["B.*"])
    with pytest.raises(cutjoint.RunError, match="no scene 'fast'; the model has turn"):
        cutjoint.find_equilibrium(cutjoint.read_model(PRESS), scene="fast")


@needs_cpp
def test_a_scene_begins_where_its_run_does() -> None:
    state, run = cutjoint.find_initial_state(PRESS), cutjoint.simulate(press(), end=0.01)
    assert state["slider.x"] == pytest.approx(run["slider.x"][0], abs=1e-12)
    assert state["slider.vx"] == pytest.approx(run["slider.vx"][0], abs=1e-9)
    assert (state["pin.angle_rate"], state.units["pin.angle_rate"]) == (pytest.approx(10), "rad/s")
    assert state.undetermined == ()


@needs_cpp
@pytest.mark.parametrize("at", [0.0, 0.1])
def test_modes_of_a_file_are_those_of_its_scene(at: float) -> None:
    modes = cutjoint.find_modes(PRESS, scene="turn", at=at)
    assert (modes.time, modes.degrees_of_freedom) == (pytest.approx(at), 1)


@needs_cpp
def test_a_column_that_is_not_there_is_an_error_that_suggests() -> None:
    run, state = cutjoint.simulate(press(), end=0.01), cutjoint.find_initial_state(PRESS)
    batch = cutjoint.simulate_batch(batches(), [{"stiffness": 2000.0}])
    for values in (run, run.columns, run.units, run.error, run.error.max_error, state, state.units, batch.end, batch.maximum, batch.units):
        with pytest.raises(KeyError, match=r"no column 'slidr\.x'; did you mean 'slider\.x'\?"):
            values["slidr.x"]
    with pytest.raises(KeyError, match=r"no column 'zzz'; there is: pin\.angle, slider\.vx, slider\.x, spring\.force"):
        run["zzz"]


def results() -> list[object]:
    """Objects that a user of Python comes upon, of a small model and of a large one that is not compiled."""
    iltis = cutjoint.read_model(MODELS / "iltis.yaml")
    found: list[object] = [iltis, *iltis.scenes.values(), cutjoint.build_topology(iltis), batches()]
    for method in ("recursive", "augmented", "recursive-newton"):
        artifact = press(method)
        found += [artifact, *(value for value in vars(artifact).values()), artifact.mechanism, *artifact.equations.functions]
        found += [artifact.topology, *artifact.program.functions]
    run = cutjoint.simulate(press())
    failed = cutjoint.simulate(press(), parameters=STIFF, dt=1e-3, check=False)
    found += [run, run.error, failed, failed.failure, run.statistics, cutjoint.run_in_real_time(press(), end=0.5)]
    found += [cutjoint.simulate_batch(batches(), [{"stiffness": 2000.0 + k} for k in range(100)], end=0.1)]
    return [*found, cutjoint.find_initial_state(PRESS), cutjoint.find_equilibrium(PRESS), cutjoint.find_modes(PRESS, at=0.1)]


@needs_cpp
def test_a_repr_fits_a_screen() -> None:
    long = {type(found).__name__: len(repr(found)) for found in results() if len(repr(found)) > SCREEN}
    assert not long


def test_choices_of_a_compilation_are_keywords() -> None:
    """All of `CompileOptions`, and no other."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'methd'"):
        cutjoint.compile_model(PRESS, methd="augmented")
    with pytest.raises(cutjoint.RunError, match="no method 'euler'"):
        cutjoint.compile_model(PRESS, scene="turn", method="euler", precision="double", flags=("-O1",), lanes=False)
