"""Generated code as a function, and the same function by the interpreters of blocks and of scalars."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cutjoint.analysis.closing import design_coordinates, make_inputs
from cutjoint.emit.source import Source, environment
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.records import Model, Scene
from cutjoint.package.locations import runtime_folder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.records import Program
from cutjoint.run.run_file import make_run_file, parameter_values
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator import call_simulator
from cutjoint.toolchain.build import FLAGS, build
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.examine import HEADER, examining, with_files
from tests.oracles.scalars import interpret_scalars

Inputs: TypeAlias = Mapping[str, np.ndarray]


class FlatRoad:
    """Height and slope zero."""

    def height(self, x: float, y: float) -> float:
        return 0.0

    def slope(self, x: float, y: float) -> float:
        return 0.0


@dataclass(frozen=True)
class At:
    """One state of a model."""

    t: float
    q: np.ndarray
    v: np.ndarray
    multipliers: np.ndarray


def random_states(equations: RecursiveEquations, count: int, seed: int) -> list[At]:
    """States near the design position, with unit quaternions."""
    rng = np.random.default_rng(seed)
    states = []
    for _ in range(count):
        q = design_coordinates(equations) + rng.normal(scale=0.05, size=equations.coordinates)
        for chart in equations.charts:
            if chart.ball:
                e = slice(chart.q + chart.scalars, chart.q + chart.scalars + 4)
                q[e] /= np.linalg.norm(q[e])
        v = rng.normal(size=equations.speeds)
        states.append(At(float(rng.uniform(0, 3)), q, v, rng.normal(scale=100, size=len(equations.equation_names))))
    return states


def examined(source: Source, flags: Sequence[str] = FLAGS) -> Path:
    """The program that evaluates the functions of generated code."""
    return build(examining(source), flags=flags).path


def run_functions(source: Source, folder: Path, model: Model, scene: Scene, states: list[At]) -> list[dict[str, np.ndarray]]:
    """Results of the functions at the states, of generated code of a model without roads, compiled alone by $CXX with all warnings as
    errors: a tenth of the time of `examined`, which reads run files."""
    files = [name for name in source.files if name.endswith(".cpp") and "/" not in name and name not in ("main.cpp", "description.cpp")]
    for name in (*files, header := next(name for name in source.files if name.endswith(".hpp"))):
        (folder / name).write_text(source.files[name], encoding="utf-8")
    (folder / "functions.hpp").write_text("".join(f'#include "{name}"\n' for name in files), encoding="utf-8")
    (name,) = re.findall(r"^class (\w+) {$", source.files[header], re.MULTILINE)
    command = [*find_compiler().command, "-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-fno-math-errno", "-I.",
               f"-I{runtime_folder() / 'include'}", f"-DNAME={name}", Path(__file__).with_name("functions.cpp"), "-o", "functions", "-lm",
               "-lmvec"]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True)
    at, more = scene.numerics, len(model.states)
    parameters = list(parameter_values(model, {}).values())
    sizes = [len(states[0].q) + more, len(states[0].v) + more, len(states[0].multipliers), 0, len(parameters), len(states)]
    if columns := re.search(r" column\[(\d+)\] ", source.files[header]):
        sizes[3] = int(columns[1])
    numbers = [*sizes, at.penalty, at.damping_ratio, at.frequency, *parameters]
    for s in states:
        numbers += [s.t, *s.q, *[0.0] * more, *s.v, *[0.0] * more, *s.multipliers]
    text = " ".join(repr(float(x)) for x in numbers)
    lines = subprocess.run([folder / "functions"], input=text, check=True, capture_output=True, text=True).stdout.splitlines()
    names = ("vdot", "correction", "residual", "rate", "dz", "columns", "energy", "kinetic")
    rows = [np.array(line.split(), dtype=float) for line in lines]
    return [dict(zip(names, rows[i : i + 8], strict=True)) for i in range(0, len(rows), 8)]


@cache
def examined_interpreter(driver: str) -> Path:
    """The program that evaluates the functions of descriptions, as the interpreter of a driver does."""
    parts = ("operations.cpp", "factorisation.cpp")
    files = {name: (runtime_folder() / "interpreter" / name).read_text(encoding="utf-8") for name in (*parts, f"{driver}.cpp")}
    main = files.pop(f"{driver}.cpp").replace("return cutjoint::perform(", "return cutjoint::examine::perform(")
    view = {"banner_hash": "# interpreter", "stem": "interpreter", "start_sources": parts, "sources": [], "driver": driver}
    project = environment().get_template("CMakeLists.txt.jinja").render(view)
    source = Source(stem="interpreter", files={**files, "CMakeLists.txt": project}, digest="", driver=driver)
    return build(with_files(source, {"main.cpp": f'#include "{HEADER}"\n{main}'})).path


def run_evaluate(
    binary: Path, model: Model, scene: Scene, states: list[At], description: Mapping[str, Any] | None = None
) -> list[dict[str, np.ndarray]]:  # fmt: skip
    """Results of the functions at the states by a program that examines; ``description`` is that of the model, if it reads one."""
    run_file: dict[str, Any] = make_run_file(model, scene, {}, task="evaluate", options=PLAIN_STEPS).entries()
    further = [0.0] * len(model.states)  # first-order states, which stand behind coordinates and speeds
    run_file["states"] = [{"t": s.t, "q": [*s.q, *further], "v": [*s.v, *further], "lambda": list(s.multipliers)} for s in states]
    if description is not None:
        run_file["model"] = description
    results = call_simulator(binary, run_file)["results"]
    return [{name: np.array(values, dtype=float) for name, values in r.items()} for r in results]


def interpret(equations: RecursiveEquations, state: At) -> dict[str, np.ndarray]:
    """Results of the block interpreter, as `run_evaluate` has them."""
    roads = {name: FlatRoad() for name in equations.roads}

    def results(function: str, prefix: str, inputs: Inputs) -> np.ndarray:
        blocks = [b for target, b in equations.function(function).results.items() if target.startswith(prefix)]
        values = interpret_blocks(blocks, inputs, roads)
        return np.concatenate([values[b].ravel() for b in blocks]) if blocks else np.zeros(0)

    return _interpret(equations, state, results)


def interpret_program(program: Program, equations: RecursiveEquations, state: At) -> dict[str, np.ndarray]:
    """Results of the interpreter of scalars, as `run_evaluate` has them; it rounds as the program says."""
    roads = {name: FlatRoad() for name in equations.roads}

    def results(function: str, prefix: str, inputs: Inputs) -> np.ndarray:
        scalars = [r.scalar for r in program.function(function).results if r.target.startswith(prefix)]
        values = interpret_scalars(program.graph, scalars, inputs, roads)
        return np.array([values[n] for n in scalars])

    return _interpret(equations, state, results)


def _interpret(equations: RecursiveEquations, state: At, results: Callable[[str, str, Inputs], np.ndarray]) -> dict[str, np.ndarray]:
    """Each of the functions by ``results``, of a function, the beginning of its results' names, and the inputs."""
    inputs = make_inputs(equations, state.q, state.v, state.t)
    penalty = equations.scene.numerics.penalty
    inputs |= {"motion": np.ones(1), "penalties": np.full(max(len(equations.closures), 1), 1.0 if penalty is None else penalty)}
    for closure in equations.closures:
        inputs[f"lambda:{closure.joint}"] = state.multipliers[closure.first : closure.first + len(closure.names)]
    found = {name: results("evaluate", f"{name}:", inputs) for name in ("vdot", "correction")}
    found |= {name: results("constraint_residual", f"{name}:", inputs) for name in ("residual", "rate")}
    for closure in equations.closures:
        inputs[f"violation:{closure.joint}"] = found["residual"][closure.first : closure.first + len(closure.names)]
    found["dz"] = results("project", "dz:", inputs)
    for chart in equations.charts:
        inputs[f"vdot:{chart.joint}"] = found["vdot"][chart.v : chart.v + len(chart.speed_names)]
    return found | {"columns": results("report", "column:", inputs)}
