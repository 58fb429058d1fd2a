"""Which tests are for `make full` alone, and which cases of others stay in `make test`, by subject.

``FULL`` of each module has tests, "*" for all of a file, or patterns of cases that are for `make full` alone: they compile for long what a
test beside them compiles in another way, or say of the vehicle, or of another method, what others say of small models.  ``KEPT`` has, by
file and test, or "*" for all others of the file, patterns of the cases that stay: they differ in a kind, a method, a seed or a compiler.
`tests/architecture/test_verification_page.py` sees to it that each statement of docs/evidence/verification.md keeps a test in `make test`,
and `python -m cutjoint_bench.studies.planted` that each planted fault is seen there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase

from tests.fewer_cases import derivations, others, physics, standalone

FULL: Mapping[str, tuple[str, ...]] = {**derivations.FULL, **others.FULL, **physics.FULL, **standalone.FULL}
KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {**derivations.KEPT, **others.KEPT, **physics.KEPT, **standalone.KEPT}


def left_out(names: Iterable[str]) -> set[str]:
    """The node ids among ``names`` that are for `make full` only: those of `FULL`, and others but never all cases of a test."""
    cases: dict[str, list[str]] = {}
    for name in names:
        cases.setdefault(name.partition("[")[0], []).append(name)
    found: set[str] = set()
    for test, given in cases.items():
        file, _, function = test.rpartition("::")
        whole = [pattern for pattern in FULL.get(file, ()) if pattern.partition("[")[0] == function]
        if function in whole or "*" in FULL.get(file, ()):
            found.update(given)
            continue
        cases_left = [pattern.partition("[")[2].removesuffix("]") for pattern in whole]
        found.update(name for name in given if any(fnmatchcase(name.partition("[")[2][:-1], pattern) for pattern in cases_left))
        kept = KEPT.get(file, {})
        patterns = kept.get(function, kept.get("*"))
        if patterns is None:
            continue
        rest = [name for name in given if not any(fnmatchcase(name.partition("[")[2][:-1], pattern) for pattern in patterns)]
        if len(rest) < len(given):
            found.update(rest)
    return found
