"""Random model files: a source or problems with their places.  $CUTJOINT_FUZZ multiplies the number of examples."""

from __future__ import annotations

import json
import os
import random
import re
import subprocess
import tempfile
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cutjoint.compile import pipeline
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import runtime_folder
from cutjoint.run.run_file import make_run_file
from cutjoint.run.simulator import call_simulator
from cutjoint.toolchain.build import build, write_source
from cutjoint.toolchain.compiler import find_compiler
from tests.conftest import needs_cpp

from .models import make_document, write
from .mutations import any_model
from .odd import NASTY, ODD_NAMES
from .pipeline import Outcome, compile_text

CORPUS = Path(__file__).parent / "corpus"
SHARE = float(os.environ.get("CUTJOINT_FUZZ", "1"))


@given(st.randoms(use_true_random=False).map(any_model))
@settings(max_examples=int(60 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_any_model(text: str) -> None:
    compile_text(text)


def _case(path: Path) -> Any:
    return pytest.param(path, marks=needs_cpp) if path.stem.startswith("cpp_") else path


@pytest.mark.parametrize("path", [_case(path) for path in sorted(CORPUS.glob("*.yaml"))], ids=lambda path: path.stem)
def test_corpus(path: Path) -> None:
    """Inputs that failed once."""
    outcome = compile_text(path.read_text(encoding="utf-8"))
    if path.stem.startswith("cpp_"):
        assert outcome.source is not None, outcome.problems
        check_syntax(outcome)


def accepted(number: int) -> list[Outcome]:
    """The first accepted models that the generator makes."""
    found: list[Outcome] = []
    for seed in count():
        outcome = compile_text(write(make_document(random.Random(seed))))
        found += [outcome] if outcome.source is not None else []
        if len(found) == number:
            break
    return found


def check_syntax(outcome: Outcome) -> None:
    """The generated code compiles without a warning."""
    assert outcome.source is not None
    with tempfile.TemporaryDirectory() as name:
        write_source(outcome.source, Path(name))
        flags = ["-std=c++20", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-fsyntax-only", f"-I{runtime_folder() / 'include'}"]
        sources = sorted(str(path) for path in Path(name).glob("*.cpp"))
        done = subprocess.run([*find_compiler().command, *flags, *sources], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:4000]


@needs_cpp
@pytest.mark.heavy
def test_a_sample_compiles_and_runs() -> None:
    """The code of accepted models compiles without a warning; that of some of them runs for two steps."""
    outcomes = accepted(int(6 * SHARE))
    for outcome in outcomes:
        check_syntax(outcome)
    for outcome in outcomes[:: max(1, len(outcomes) // 2)]:
        assert outcome.source is not None
        assert outcome.model is not None
        assert outcome.scene is not None
        short = replace(outcome.scene, end=2 * outcome.scene.numerics.step, output_step=outcome.scene.numerics.step)
        run = make_run_file(outcome.model, short, {}, task="simulate", out=os.devnull)
        summary = call_simulator(build(outcome.source, flags=("-O0",)).path, run.entries())
        assert summary["status"] == "done" or summary["message"], summary


# Nothing of a model file reaches C++ or CMake as it is.

PLAIN = {"name": "plain", "parameter": "size", "unit": "kg", "body": "arm", "joint": "hinge", "force": "drag", "scene": "fall"}


def named(**changes: str) -> str:
    """A model with the given names and unit."""
    n = {**PLAIN, **changes}
    body = {"mass": n["parameter"], "centre_of_mass": [1, 0, f"sin({n['parameter']})"], "inertia": [0.1, 0.2, 0.2]}
    joint = {"kind": "revolute", "bodies": ["ground", n["body"]], "at": [0, 0, 0], "axis": [0, 1, 0]}
    if n["unit"] != "kg":
        body["mass"] = 2
    document = {
        "cutjoint": 1,
        "name": n["name"],
        "gravity": [0, 0, -9.81],
        "parameters": {n["parameter"]: {"value": 2, "unit": n["unit"], "binding": "param"}},
        "bodies": {n["body"]: body},
        "joints": {n["joint"]: joint},
        "forces": {n["force"]: {"kind": "load", "body": n["body"], "torque": [0, f"sin({n['parameter']})", 0]}},
        "scenes": {n["scene"]: {"end": 2, "outputs": [f"{n['body']}.x", f"{n['joint']}.angle", f"{n['force']}.Mx"]}},
    }
    return json.dumps(document)


@pytest.mark.parametrize("place", sorted(PLAIN))
def test_nasty_names_and_units_are_refused_or_harmless(place: str) -> None:
    for nasty in NASTY:
        outcome = compile_text(named(**{place: nasty}))
        if outcome.source is not None and re.search(r"[^A-Za-z0-9_*^/ ]", nasty):
            assert all(nasty not in content for content in outcome.source.files.values() if len(nasty) > 2), nasty
            assert place in ("scene", "unit"), f"{nasty!r} is no {place}"


@pytest.mark.parametrize("unit", ["N\n*m", "N *\tm", "N * m"])
def test_units_stay_on_one_line(unit: str) -> None:
    outcome = compile_text(named(unit=unit))
    assert outcome.source is not None, outcome.problems
    line = next(x for x in outcome.source.files["description.cpp"].splitlines() if '"size"' in x)
    assert line.count('"') == 4


@pytest.mark.parametrize("file", ["a\n#error x.yaml", "a\\", "*/ b.yaml", 'a"b.yaml', "a\rb", "{{ x }}.yaml", "a\u2028b"])
def test_file_names_stay_in_their_comment(file: str) -> None:
    model = read_model_text(named(), file)
    scene = next(iter(model.scenes.values()))
    _, _, source = pipeline.generate(model, scene, scene.outputs)
    for name, content in source.files.items():
        for line in content.splitlines():
            assert line.isprintable(), (name, line)
            assert "#error" not in line or line.lstrip().startswith("//")
            assert not line.endswith("\\")


@needs_cpp
def test_odd_names_compile() -> None:
    """Names that are allowed do not meet those of the runtime, of the generated code or of C++, whatever they name."""
    names = [n for n in ODD_NAMES if n not in ("nan", "inf", "null", "pi", "yes")]
    rng = random.Random(3)
    for _ in range(int(6 * SHARE)):
        chosen = rng.sample(names, 7)
        outcome = compile_text(named(**{**dict(zip(sorted(PLAIN), chosen, strict=True)), "unit": "kg"}))
        if outcome.source is None:
            assert all("meaning of its own" in x or "needs " in x for x in outcome.problems), outcome.problems
        else:
            check_syntax(outcome)
