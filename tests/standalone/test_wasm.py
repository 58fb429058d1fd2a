"""Modules of WebAssembly: their motion is that of the native core, in two engines, and their host says what is wrong."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.compile.c_export import Standalone
from cutjoint.model.expressions.functions import leave_to_host
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import MissingToolsError, RunError
from cutjoint.toolchain import wasm
from tests.conftest import MODELS
from tests.view.conftest import call

from .c_exports import folder_of_model, standalone_of

NODE = which("node")
needs_wasm = pytest.mark.skipif(NODE is None or find_spec("ziglang") is None, reason="needs Node.js, and ziglang of PyPI")

#: Models by name, a method, an integrator and steps: a loop, natural coordinates, Newton's iteration, adaptive steps, inputs.
CASES = [
    ("press", "recursive", "trapezoidal", 400), ("four_bar", "augmented", None, 200), ("press", "recursive-newton", None, 200),
    ("slider_crank", "recursive", "dormand-prince", 100), ("delta", "recursive", None, 100),
]  # fmt: skip

#: Sines of two C libraries differ in the last bit, and iterations end by their tolerance (`test_other_processors.py`).
NEAR = 1e-9


def in_node(folder: Path, alone: Standalone, script: str) -> str:
    """The output of a script of Node.js that has the ``model`` of a folder."""
    (folder / f"{alone.name}.wasm").write_bytes(alone.build_module())
    for name, text in alone.module_files.items():
        (folder / name).write_text(text, encoding="utf-8")
    begin = f"import {{ load }} from './{alone.name}.mjs';\nconst model = await load();\n"
    (folder / "host.mjs").write_text(begin + script, encoding="utf-8")
    return subprocess.run(["node", "host.mjs"], cwd=folder, check=True, capture_output=True, text=True).stdout


def natively(
    folder: Path, alone: Standalone, steps: int, flags: Sequence[str] = ("-O1", "-ffp-contract=off")
) -> NDArray[np.float64]:  # fmt: skip
    """The outputs of the folder's own program at the end of each step."""
    dt = alone.settings.step
    (folder / "own.run").write_text(f"end {steps * dt!r}\noutput_step {dt!r}\n", encoding="utf-8")
    program = alone.build_simulator(flags)
    done = subprocess.run([program, folder / "own.run"], check=True, capture_output=True, text=True)
    return np.array([[float(x) for x in line.split(",")] for line in done.stdout.splitlines()[1:]])


ROWS = """
const sim = model.create(), rows = [];
sim.start();
for (let row = 0; row <= STEPS; row++) {
  if (row) sim.advance(row * model.facts.dt);
  rows.push([sim.time, ...sim.outputs]);
}
console.log(JSON.stringify(rows));
"""


@needs_wasm
@pytest.mark.cpp
@pytest.mark.parametrize(("name", "method", "integrator", "steps"), CASES)
def test_a_module_moves_as_the_native_core(name: str, method: str, integrator: str | None, steps: int, tmp_path: Path) -> None:
    alone = standalone_of(name, method=method, integrator=integrator)
    here = natively(tmp_path, alone, steps)
    there = np.array(json.loads(in_node(tmp_path, alone, ROWS.replace("STEPS", str(steps)))))
    assert here.shape == there.shape == (steps + 1, 1 + len(alone.parts.stepped.columns))
    assert np.abs(here[-1] - here[0]).max() > 1e-3  # it moves
    scale = np.maximum(1, np.abs(here).max(axis=0))
    assert (np.abs(there - here).max(axis=0) / scale).max() < (1e-6 if method == "recursive-newton" else NEAR)


@needs_wasm
@pytest.mark.cpp
@pytest.mark.parametrize(("name", "method", "integrator", "steps"), CASES)
def test_a_reproducible_folder_has_the_bits_of_the_module(
    name: str, method: str, integrator: str | None, steps: int, tmp_path: Path
) -> None:  # fmt: skip
    """Also with other optimisations, and for this processor, which may have products and sums in one operation."""
    alone = replace(standalone_of(name, method=method, integrator=integrator), reproducible=True)
    here = natively(tmp_path, alone, steps, ("-O3", "-march=native"))
    there = np.array(json.loads(in_node(tmp_path, alone, ROWS.replace("STEPS", str(steps)))))
    assert np.array_equal(here, there)


def test_only_reproducible_folders_have_mathematics() -> None:
    plain = standalone_of("press")
    more = replace(plain, reproducible=True).files
    reported = ("CMakeLists.txt", "README.md")
    same = {name: text for name, text in plain.files.items() if name not in reported}
    assert {name: text for name, text in more.items() if name in same} == same
    assert {"libm/sin.c", "libm/names.h", "libm/COPYRIGHT"} <= set(more) - set(plain.files)
    assert "libm" not in plain.files["CMakeLists.txt"].replace("libmvec", "").replace("LIBMVEC", "")


@needs_wasm
def test_two_engines_have_the_same_bits(tmp_path: Path) -> None:
    wasmtime = pytest.importorskip("wasmtime")
    alone = standalone_of("press")
    script = "const sim = model.create(); sim.start(); console.log(Buffer.from(sim.run(300).buffer).toString('hex'));"
    here = bytes.fromhex(in_node(tmp_path, alone, script))
    store = wasmtime.Store()
    module = wasmtime.Module(store.engine, alone.build_module())
    assert not module.imports
    of = wasmtime.Instance(store, module, []).exports(store)
    of["_initialize"](store)
    memory, columns = of["memory"], len(alone.parts.stepped.columns)
    at, rows = memory.data_len(store), memory.data_len(store) + 65536
    memory.grow(store, 3)
    sim = of["press_create"](store, at, alone.size)
    assert of["press_start"](store, sim) == 0
    assert of["press_run"](store, sim, 300, rows) == 0
    assert bytes(memory.read(store, rows, rows + 8 * 300 * columns)) == here
    assert len(set(here)) > 100


@needs_wasm
def test_simulations_are_independent_and_go_on_from_snapshots_bit_by_bit(tmp_path: Path) -> None:
    script = """
    const [a, b] = [model.create(), model.create()];
    a.start(); b.start();
    a.run(50);
    const at = a.time, snapshot = a.save(), rows = a.run(50);
    b.run(7);
    b.restore(snapshot);
    const same = b.time === at && Buffer.from(b.run(50).buffer).equals(Buffer.from(rows.buffer));
    b.free();
    const c = model.create();
    c.start();
    const mine = a.time, poses = a.poses.slice(0, 16);
    const named = model.poses.map((p) => p.name);
    console.log(JSON.stringify({ same, fresh: c.time, mine, norm: Math.hypot(...poses.slice(3, 7)), named }));
    """
    model = read_model_text((MODELS / "press.yaml").read_text(encoding="utf-8"), "press.yaml")
    said = json.loads(in_node(tmp_path, folder_of_model(model, poses=True), script))
    assert said["same"] is True
    assert (said["fresh"], said["named"]) == (0, ["crank", "rod", "slider"])
    assert said["mine"] == pytest.approx(100 * 0.001, abs=1e-12)
    assert said["norm"] == pytest.approx(1, abs=1e-14)


@needs_wasm
def test_a_host_is_reported_what_is_wrong(tmp_path: Path) -> None:
    script = """
    const said = [], sim = model.create();
    const wrong = (call) => {
      try { call(); said.push('nothing'); } catch (error) { said.push(`${error.name} ${error.status ?? ''}: ${error.message}`); }
    };
    wrong(() => sim.step());
    wrong(() => sim.outputs);
    sim.start();
    wrong(() => sim.setInput('q9', 0));
    wrong(() => sim.setInput('q1', NaN));
    wrong(() => sim.setInput(77, 0));
    wrong(() => sim.restore(new Uint8Array(3)));
    wrong(() => { sim.setInput('q1', 1e4); sim.run(50); });
    sim.free();
    wrong(() => sim.step());
    console.log(JSON.stringify(said));
    """
    said = json.loads(in_node(tmp_path, standalone_of("delta"), script))
    assert said[0] == "SimulationError -3: the simulation has not been started"
    assert said[1] == "Error : the simulation has not been started"
    assert said[2].startswith("Error : the model 'delta' has no input 'q9'; it has q1, q2, q3")
    assert said[3].startswith("SimulationError -4: a number is not finite")
    assert said[4].startswith("SimulationError -2:")
    assert said[5].startswith("Error : a snapshot has ")
    assert re.match(r"SimulationError [1-9]\d*: .*delta\.yaml:\d+", said[6])
    assert said[7] == "Error : the simulation has been given back"


def test_types_say_what_the_host_has() -> None:
    alone = standalone_of("delta")
    script, types = alone.module_files["delta.mjs"], alone.module_files["delta.d.mts"]
    assert 'export type Input = "q1" | "q2" | "q3";' in types
    for name in ("Model", "Simulation"):
        body = re.search(rf"^class {name} {{\n(.*?)^}}", script, re.MULTILINE | re.DOTALL)
        declared = re.search(rf"^export class {name} {{\n(.*?)^}}", types, re.MULTILINE | re.DOTALL)
        assert body is not None
        assert declared is not None
        methods = set(re.findall(r"^  (?:get )?([a-z]\w*)\(.*\) {", body[1], re.MULTILINE)) - {"constructor"}
        fields = {"facts", "exports", *(f"{kind}s" for kind in ("parameter", "input", "output", "coordinate", "speed", "equation", "pose"))}
        assert methods | (fields | {"startCoordinates", "startSpeeds"} if name == "Model" else set()) == set(
            re.findall(r"^  (?:readonly )?([a-z]\w*)[(:]", declared[1], re.MULTILINE)
        )
    assert len(script.splitlines()) <= 300


@needs_wasm
def test_the_command_writes_a_module(tmp_path: Path) -> None:
    said = call("compile", MODELS / "press.yaml", "--target", "wasm", "--out", tmp_path / "out")
    assert re.search(r"press\.wasm, \d+ kB, with its calls in JavaScript \(press\.mjs\)", said)
    assert (tmp_path / "out/press.wasm").read_bytes()[:4] == b"\0asm"
    assert {"press.mjs", "press.d.mts", "press.h", "press.cpp"} <= {file.name for file in (tmp_path / "out").iterdir()}


def test_what_modules_cannot_have_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (MODELS / "pendulum.yaml").read_text(encoding="utf-8")
    monkeypatch.setattr(wasm, "find_zig", lambda: None)
    with pytest.raises(MissingToolsError, match=r"missing: ziglang, which compiles for WebAssembly; pip install 'cutjoint\[compiler\]'"):
        standalone_of("pendulum").build_module()
    text = text.replace("outputs:", "forces:\n  drag: {kind: joint_force, joint: pin, law: \"drag(rate)\"}\noutputs:")
    asked = read_model_text(f"{text}\nfunctions:\n  drag: {{arguments: [v]}}\n", "pendulum.yaml")
    with pytest.raises(RunError, match=r"target wasm: function 'drag' is left to a host, but modules call none; provide its code"):
        folder_of_model(leave_to_host(asked)).build_module()


def test_sections_are_those_of_the_specification() -> None:
    assert wasm.with_section(b"", b"x" * 200)[:4] == b"\0\xd1\x01\x08"  # 0xd1 0x01 is 209 in groups of seven bits
    assert wasm.with_section(b"m", b"ab") == b"m\0\x0b\x08cutjointab"
