"""Each statement of docs/evidence/verification.md has a test that exists, and one that `make test` runs."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.conftest import ROOT
from tests.fewer_cases import FULL

PAGE = ROOT / "docs" / "evidence" / "verification.md"

#: Statements whose tests run for so long, or need tools so rare, that `make full` alone has them, by reason.
REASONS = {
    "seconds of motion of the vehicle": (
        "10 km from the origin the run is the same", "anti-lock braking on split friction, 0.8 and 0.3",
        "constrained motion of the Iltis by `recursive`, `augmented`, `classical` at 1e-4 s", "mirrored bumps",
        "ten seconds of the Iltis", "the Iltis on four posts, all outputs that do not drift",
        "a library car with struts and five-link axle on a circle at 20 m/s, 2 to 6 m/s^2, both ways",
        "a car on a skid pad, a leaning motorcycle whose wheel spins have no initial guess", "the paper's scenes: airborne time and peaks",
    ),
    "a solver or numbers that take minutes to compile": (
        "all functions of the recursion", "tangents of the implicit methods",
        "A, B, C, D of a linearisation, E, F by parameters, and step derivatives",
        "least squares and eigenvalues of the core",
    ),
    "hundreds of runs, or steps of more digits": (
        "proofs of 10 planar and 10 spatial random loops", "reference of A01", "two routes to the reference of the slider-crank",
        "two routes to the reference of the governor", "the observer of `examples/`: gains by linearisation",
        "C99 for controllers: branches of its file, by a run of the scene and 100 000 random calls, counted by gcov (GCC 12, `-O0`)",
    ),
    "qemu, Frama-C": (
        "exported code on ARM", "C99 for controllers on ARM",
        "C99 for controllers: no undefined behaviour in calls of any order with any finite numbers, any state; press, also by "
        "`rk4`, four-bar, a cart with a ball by `rk4` and `recursive-newton`, a tyre on a road",
        "C99 for controllers: the bound on instructions of a step",
        "the observer of `examples/`: no undefined behaviour with any finite measurements and states",
    ),
}  # fmt: skip
FULL_ALONE = {claim for claims in REASONS.values() for claim in claims}


def statements() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """The claims of the page's tables with their tests: files or folders under tests/, and functions of them or ""."""
    file = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        found = []
        for name in re.findall(r"`([^`]+)`", cells[-1]) if line.startswith("|") else ():
            path, _, function = name.partition("::")
            if path and not list((ROOT / "tests").glob(f"{path}/test_*.py" if "test_" not in path else path)):
                assert "test_" not in path, f"{PAGE.name}: there is no {path}"
                continue
            file = path or file
            found.append((file, function))
        if found:
            yield cells[0], found


@cache
def functions(path: Path) -> dict[str, bool]:
    """The test functions of a file, and whether `make test` has a case of them."""
    name, found, all_heavy = path.relative_to(ROOT).as_posix(), {}, False
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark":
            all_heavy = "pytest.mark.heavy" in {ast.unparse(part) for part in ast.walk(node.value)}
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            heavy = all_heavy or any(ast.unparse(mark) == "pytest.mark.heavy" for mark in node.decorator_list)
            found[node.name] = not heavy and not {node.name, "*"} & {*FULL.get(name, ())}
    return found


def is_run(file: str, function: str) -> bool:
    path = ROOT / "tests" / file
    if path.is_dir():
        return any(any(functions(each).values()) for each in path.glob("test_*.py"))
    found = functions(path)
    assert not function or function in found, f"{PAGE.name}: {file} has no {function}"
    return found[function] if function else any(found.values())


def test_each_statement_has_a_test_that_make_test_runs() -> None:
    tests = list(statements())
    assert len(tests) > 150
    assert {claim for claim, found in tests if True not in [is_run(*each) for each in found]} == FULL_ALONE


def test_lists_name_tests_that_there_are() -> None:
    wrong = [
        f"{file}::{pattern}" for file, patterns in FULL.items() for pattern in patterns
        if pattern.partition("[")[0] not in ("*", *functions(ROOT / file))
    ]  # fmt: skip
    assert not wrong


def test_the_bound_on_branches_of_c99_is_that_of_its_test() -> None:
    source = (ROOT / "tests" / "standalone" / "test_c99_coverage.py").read_text(encoding="utf-8")
    (bound,) = re.findall(r'\["Taken at least once"\]\[0\] > (\d+)\n', source)
    assert f" more than {bound} % taken; " in PAGE.read_text(encoding="utf-8")
