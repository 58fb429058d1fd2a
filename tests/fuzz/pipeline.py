"""A model's text through the symbolic half of the compiler: a source, or problems with their places."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, replace
from zlib import crc32

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.analysis.mobility import GuideError
from cutjoint.compile import pipeline
from cutjoint.emit.source import Source
from cutjoint.formulate.records import Equations
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.functions import signatures_of
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import ConstantError
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import find_scene
from cutjoint.topology.spanning_tree import TopologyError

FILE = "fuzzed.yaml"
#: Seconds of processor time that a model may take.
SLOWEST = 10.0
_PLACED = re.compile(rf"{re.escape(FILE)}:\d+(:\d+)?: \S.*")


@dataclass(frozen=True)
class Outcome:
    """``problems`` of a refused model, or the ``source`` of an accepted one."""

    problems: tuple[str, ...] = ()
    source: Source | None = None
    model: Model | None = None
    scene: Scene | None = None
    equations: Equations | None = None


def compile_text(text: str) -> Outcome:
    """Compile a model's text; fails if it is neither compiled nor refused with places, or takes too long."""
    begin = time.process_time()
    outcome = _compile(text)
    seconds = time.process_time() - begin
    assert seconds < SLOWEST, f"took {seconds:.1f} s"
    for line in outcome.problems:
        assert _PLACED.fullmatch(line), f"no place or more than a line: {line!r}"
        assert line.isprintable(), repr(line)
    return outcome


def code_of(model: Model) -> str:
    """Code of the functions that a model declares: a tenth of the first argument, less what is in the memory."""
    made = ['#pragma GCC diagnostic ignored "-Wunused-parameter"\n'] if model.functions else []
    for function in model.functions:
        for signature in signatures_of(function).values():
            result = "result" if "" in function.results else "results"
            held = f" - static_cast<const unsigned char*>(memory)[{function.memory - 1}]" if function.words else ""
            value = f"for (int i = 0; i < {len(function.results)}; ++i) {result}[i] = 0.1 * arguments[0]{held};"
            derivatives = f"if (partials) for (int i = 0; i < {len(function.results) * len(function.arguments)}; ++i) partials[i] = 0;"
            update = f"static_cast<unsigned char*>(next)[{function.memory - 1}] += 1;"
            made.append(f"{signature} {{ {update if 'void* next' in signature else f'{value} {derivatives}'} }}\n")
    return "".join(made)


def _compile(text: str) -> Outcome:
    """A text's outcome; of one text in six all numbers are tunable, of another its masses."""
    tunable = {0: ["*"], 1: ["*.mass"]}.get(crc32(text.encode()) % 6, [])
    try:
        model = read_model_text(text, FILE, tunable=tunable)
        model = replace(model, code=code_of(model))
        scene = next(iter(model.scenes.values()), None) or find_scene(model, None)
        equations, _, source = pipeline.generate(model, scene, scene.outputs)
        make_run_file(model, scene, {}, task="simulate", out="table.csv")
    except (ModelError, ConstantError, TopologyError, NoInertiaError, GuideError, RunError) as error:
        problems = str(error).splitlines()
        return Outcome(problems=tuple(problems))
    return Outcome(source=source, model=model, scene=scene, equations=equations)
