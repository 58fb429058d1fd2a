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

#: Statements whose tests run for so long, or need tools so rare, that `make full` alone has them.
FULL_ALONE = {
    "10 km from the origin the run is the same", "constrained motion of the Iltis by `recursive`, `augmented`, `classical` at 1e-4 s",
    "exported code on ARM", "proofs of 10 planar and 10 spatial random loops", "ten seconds of the Iltis",
}  # fmt: skip


def statements() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """The claims of the page's tables with their tests: files or folders under tests/, and functions of them or ""."""
    file = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        found = []
        for name in re.findall(r"`([^`]+)`", cells[-1]) if line.startswith("|") else ():
            path, _, function = name.partition("::")
            if path and not list((ROOT / "tests").glob(f"{path}/test_*.py" if "test_" not in path else path)):
                continue
            file = path or file
            found.append((file, function))
        if found:
            yield cells[0], found


@cache
def functions(path: Path) -> dict[str, bool]:
    """The test functions of a file, and whether `make test` has a case of them."""
    name, found = path.relative_to(ROOT).as_posix(), {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            heavy = any(ast.unparse(mark) == "pytest.mark.heavy" for mark in node.decorator_list)
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
    tests = dict(statements())
    assert len(tests) > 150
    assert {claim for claim, found in tests.items() if True not in [is_run(*each) for each in found]} == FULL_ALONE


def test_lists_name_tests_that_there_are() -> None:
    wrong = [
        f"{file}::{pattern}" for file, patterns in FULL.items() for pattern in patterns
        if pattern.partition("[")[0] not in ("*", *functions(ROOT / file))
    ]  # fmt: skip
    assert not wrong
