"""Generated code compiles whatever a model and its elements are called."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.emit.classes import LANES
from cutjoint.emit.source import name_of_mechanism, name_of_system
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import runtime_folder
from cutjoint.run.scenes import with_closure
from cutjoint.toolchain.build import write_text
from cutjoint.toolchain.compiler import find_compiler
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.sources import source_of_batch
from tests.reduce.test_rolling import CART

FOUR_BAR = (MODELS / "four_bar.yaml").read_text(encoding="utf-8")

#: Flags for code of several instances of the mechanism of a batch.
_BATCH = (f"-DCUTJOINT_REAL={LANES}", "-include", "cutjoint/core/mechanism/instances.hpp")


def files_of(text: str, kind: str) -> Mapping[str, str]:
    """The generated files of a model, for a method or for batches."""
    model = read_model_text(text, "m.yaml")
    scene = next(iter(model.scenes.values()))
    if kind != "batch":
        return generate(model, scene, scene.outputs, method=kind)[2].files
    return source_of_batch(model, with_closure(scene, "penalty"), scene.outputs)[1].files


def named(name: str, kind: str) -> Mapping[str, str]:
    return files_of(FOUR_BAR.replace("name: four_bar", f"name: {name}"), kind)


def libraries(files: Mapping[str, str], kind: str) -> list[tuple[list[str], tuple[str, ...]]]:
    """The sources of CMake's targets, with the options of each."""
    if kind == "batch":
        code = [name for name in files if name.endswith(".cpp") and "unity" not in name]
        beside = [name for name in code if name.startswith("side_by_side/")]
        return [(["interface.cpp"], ()), ([name for name in code if name not in (*beside, "interface.cpp")], ()), (beside, _BATCH)]
    project = files["CMakeLists.txt"]
    lists = (project.partition(f"set({name}")[2].partition(")\n")[0] for name in ("starting", "running"))
    start, system = (re.findall(r"[\w/]+\.cpp", found) for found in lists)
    return [(start, ()), (["main.cpp"], ()), *([(system, ())] if system else [])]


def check(files: Mapping[str, str], kind: str, folder: Path) -> None:
    """The compiler takes the files as the build gives them to it."""
    for name, text in files.items():
        write_text(folder / name, text)
    for number, (sources, options) in enumerate(libraries(files, kind)):
        whole = folder / f"unity_{number}.cxx"
        whole.write_text("".join(f'#include "{name}"\n' for name in sources), encoding="utf-8")
        flags = ["-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-march=native", *options]
        command = [*find_compiler().command, *flags]
        places = [f"-I{runtime_folder() / 'include'}", f"-I{folder}"]
        done = subprocess.run([*command, *places, str(whole)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@needs_cpp
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("precision", "recursive"), ("factorisation", "augmented"), ("stabilisation", "recursive-newton"),
        ("description", "recursive-newton"),
        ("weights", "augmented"), ("system_description", "recursive-newton"), ("mask", "batch"),
    ],
)  # fmt: skip
def test_a_model_may_be_called_as_what_the_runtime_has(name: str, kind: str, tmp_path: Path) -> None:
    check(named(name, kind), kind, tmp_path)


#: Words of C++ and macros of its headers.
WORDS = re.findall(r"\w+", """
    alignas and asm auto bool break case catch char class concept const constexpr const_cast continue co_await decltype default
    delete do double else enum explicit export extern float for friend goto if import inline int long module mutable namespace new
    noexcept not nullptr operator or private protected public register requires return short signed sizeof static struct switch
    template this throw try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor EOF INFINITY NAN
    NULL assert errno i386 linux main std stderr stdin stdout unix Real q v t
""")


def chain(words: Sequence[str]) -> str:
    """A chain whose bodies, joints, parameters and forces have words as names, four words a link; a road under its first wheel."""
    bodies, joints, parameters, forces, last = [], [], [], [], "ground"
    for i, (body, joint, parameter, force) in enumerate(zip(*[iter(words)] * 4, strict=False)):
        bodies.append(f"  {body}: {{mass: 1, centre_of_mass: [{i}.5, 0, 0], inertia: [0.1, 0.1, 0.1]}}")
        joints.append(f"  {joint}: {{kind: revolute, bodies: [{last}, {body}], at: [{i}, 0, 0], axis: [0, 1, 0]}}")
        parameters.append(f"  p_{parameter}: {{value: 1, binding: param}}")
        forces.append(f"  {force}: {{kind: joint_force, joint: {joint}, law: '-p_{parameter}*sign(rate)'}}")
        last = body
    parts = {"parameters": parameters, "bodies": bodies, "joints": joints, "forces": forces}
    sections = "".join(f"{name}:\n" + "\n".join(lines) + "\n" for name, lines in parts.items())
    return f"cutjoint: 1\nname: namespace\ngravity: [0, 0, -9.81]\n{sections}scenes: {{class: {{end: 1}}}}\n"


@needs_cpp
@pytest.mark.parametrize("kind", ["recursive", "augmented"])
def test_words_of_cpp_are_names(kind: str, tmp_path: Path) -> None:
    check(files_of(chain(WORDS[:40] if kind == "augmented" else WORDS), kind), kind, tmp_path)


@needs_cpp
@pytest.mark.parametrize("name", ["main", "float", "new", "std", "errno", "linux", "evaluate", "class"])
def test_a_model_may_be_called_by_a_word_of_cpp(name: str, tmp_path: Path) -> None:
    check(named(name, "recursive"), "recursive", tmp_path)


def with_tyres(*names: str) -> str:
    """The cart with tyres of such names on its wheel; what a tyre shares with itself is numbered."""
    before, _, after = CART.partition("  tyre:\n")
    tyre, after = after.partition("outputs:")[0], after.partition("scenes:")[2]
    outputs = ", ".join(f"{name}.Fy" for name in names)
    return f"{before}{''.join(f'  {name}:{chr(10)}{tyre}' for name in names)}outputs: [{outputs}]\nscenes:{after}"


@needs_cpp
def test_what_is_numbered_is_no_macro_and_no_road(tmp_path: Path) -> None:
    """M_PI_2, M_PI_4 and M_SQRT1_2 are macros, and `road_w_1` is the road of the tyre `w_1`."""
    files = files_of(with_tyres("M_PI", "M_SQRT1", "road_w", "w_1"), "recursive")
    for expected in ("const Real M_PI_1 = ", "const Real M_SQRT1_1 = ", "const Real road_w_2 = ", "roads_[road_w_1]"):
        assert expected in files["report.cpp"]
    check(files, "recursive", tmp_path)


@pytest.mark.parametrize("kind", [*METHODS, "batch"])
def test_no_class_hides_a_name_that_generated_code_uses(kind: str) -> None:
    """A model that is called as what the runtime declares, and a header or the mechanism's sources name, has a class of another name."""
    headers = "".join(p.read_text(encoding="utf-8") for p in (runtime_folder() / "include" / "cutjoint").rglob("*.hpp"))
    declared = set(re.findall(r"^\s*(?:class|struct|using|enum class|concept) ([A-Z]\w*)", headers, re.M))
    used = set()
    for name, text in named("thing", kind).items():
        if name.endswith(".hpp") or (name.endswith(".cpp") and not name.startswith(("system_", "factor", "solve", "main", "interface"))):
            used |= set(re.findall(r"(?<![\w.:])[A-Z]\w*", re.sub(r'//.*|"[^"]*"', "", text))) & declared
    assert {"Stabilisation", "Precision"} <= used
    for name in used:
        own = name_of_mechanism(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower())
        assert name not in (own, name_of_system(own))
