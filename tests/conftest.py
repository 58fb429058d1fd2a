"""Folders of models and data; generated code is compiled fast rather than made fast, and without warnings."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.fewer_cases import left_out

if TYPE_CHECKING:
    from tests.view.browser import Page

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"
DATA = ROOT / "tests" / "data"

gc.set_threshold(100_000)  # as commands have it: an eighth less time
# Modules are compiled once, here and in the commands that tests start, also where the environment says that bytecode is not kept
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
_FAST = os.environ.setdefault("CUTJOINT_FLAGS", "-O1") == "-O1"
os.environ.setdefault("CUTJOINT_STRICT", "1")
os.environ.setdefault("CUTJOINT_IMPLEMENTATION", "generated")  # whatever a machine's speed and cache are

def pytest_configure(config: pytest.Config) -> None:
    """Let tests of motions run generated code (`tests/physics/simulation.py`) where heavy tests are asked for, as by `make full`;
    else compile libraries of loaded models and sweeps, FMUs and C exports without optimisation: in half the time."""
    if "heavy" in str(config.getoption("markexpr")).replace("not heavy", ""):
        os.environ["CUTJOINT_TEST_CODE"] = "generated"
    elif _FAST:
        from cutjoint.compile.c_export import FLAGS, Standalone
        from cutjoint.export.fmu.archive import Fmu
        from cutjoint.toolchain import wasm

        build = Standalone.build_library

        def build_library(self: Standalone, flags: Sequence[str] = FLAGS) -> Path:
            return build(self, ("-O0",) if tuple(flags) == FLAGS else flags)

        Standalone.build_library = build_library  # type: ignore[method-assign]
        Fmu.build.__defaults__ = (("-O0",),)
        wasm._CXX, wasm._C = (tuple("-O0" if word == "-O2" else word for word in words) for words in (wasm._CXX, wasm._C))


#: Compilers are found by tests with this mark only; `make quick` leaves these out.
needs_cpp = pytest.mark.cpp

#: The compiler of all other tests: none.
_NO_COMPILER = "/this/test/needs/the/mark/needs_cpp"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Hide the compiler from tests that do not say that they need it, and from what they start."""
    known = os.environ.get("CXX")
    if item.get_closest_marker("cpp") is None:
        os.environ["CXX"] = _NO_COMPILER
    try:
        return (yield)
    finally:
        os.environ.pop("CXX", None)
        if known is not None:
            os.environ["CXX"] = known


#: Folders whose tests run what is compiled; elsewhere a test that needs a compiler says so by the mark.
_COMPILING = tuple(
    f"tests/{folder}/" for folder in (
        "bench", "compile_run", "coupling", "edges", "export", "fmu", "images", "packaging", "pages", "physics", "runtime", "standalone",
        "fits", "sweeps", "toolchain",
    )
)  # fmt: skip

#: Tests of measuring, peers' programs and other platforms: the first case of each stands for all in `make test`.
_ONE_CASE = (
    "tests/bench/", "tests/export/", "tests/fmu/test_platforms", "tests/fmu/test_targets", "tests/standalone/test_other",
)  # fmt: skip


#: Derivations: `make quick` has the first case of each test, and none of those that take seconds.
_DERIVING = tuple(f"tests/{folder}/" for folder in ("analysis", "formulate", "program", "report", "topology"))
_SECONDS = (
    "tests/analysis/test_linearisation.py::test_trees_in_motion", "tests/analysis/test_linearisation.py::test_cut_joints_in_motion",
    "tests/emit/test_source.py::test_a_check_of_the_run", "tests/emit/test_source.py::test_a_rotation_is_not",
    "tests/emit/test_source.py::test_no_folder", "tests/emit/test_source.py::test_quantities", "tests/emit/test_source.py::test_same_bytes",
    "tests/emit/test_source.py::test_scenes_that_differ", "tests/formulate/test_against_dense.py::test_iltis",
    "tests/formulate/test_natural.py::test_reaction_of_a_cut_joint", "tests/formulate/test_natural.py::test_tangents",
    "tests/fuzz/test_command.py", "tests/fuzz/test_models.py", "tests/model/test_problems.py::test_problems_without_end",
    "tests/program/test_loops.py::test_the_code_of_a_chain", "tests/report/test_explain_formulas.py::test_printed_formulas",
    "tests/test_same_code.py", "tests/topology/test_operations.py",
    "tests/topology/test_search.py::test_no_cuts_by_hand", "tests/view/test_damaged_pages.py",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests of folders that compile, and those that are left to `make test` and to `make full`; of all tests those that compile
    come first, since a file that takes minutes would leave the other processors idle at the end."""
    seen: set[str] = set()
    fewer = left_out(item.nodeid for item in items)
    for item in items:
        if item.nodeid.startswith(_COMPILING):
            item.add_marker(pytest.mark.cpp)
        test = item.nodeid.partition("[")[0]
        if item.nodeid in fewer or (test in seen and test.startswith(_ONE_CASE)):
            item.add_marker(pytest.mark.heavy)
        if test.startswith(_SECONDS) or (test in seen and test.startswith(_DERIVING)):
            item.add_marker(pytest.mark.slow)
        seen.add(test)
    if [Path(path).name for path in config.args] == ["tests"]:
        items.sort(key=lambda item: not item.nodeid.startswith(_COMPILING))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what compiles where the tools are missing."""
    if item.get_closest_marker("cpp") and not (shutil.which("cmake") and shutil.which("ninja")):
        pytest.skip("needs cmake and ninja")


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    """Chromium without a window; what opens it is not in all copies of the tests' mechanisms (tests/test_same_code.py)."""
    from tests.view.browser import CHROMIUM, opened

    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with opened() as page:
        yield page


def with_heavy(cases: Iterable[Any], *heavy: Any) -> list[Any]:
    """Cases of a parametrised test, some of them for `make full` only."""
    return [_heavy(case) if case in heavy else case for case in cases]


def _heavy(case: Any) -> Any:
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.heavy)
