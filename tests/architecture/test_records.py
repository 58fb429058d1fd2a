"""Records stand between stages: code that is emitted knows nothing of the file that simulators read."""

from __future__ import annotations

import re
from pathlib import Path

COMPILER = Path(__file__).resolve().parents[2] / "compiler" / "cutjoint"


def test_emitted_code_knows_no_run_file() -> None:
    files = sorted((COMPILER / "emit").rglob("*.py"))
    assert files
    assert [file.name for file in files if "run_file" in file.read_text(encoding="utf-8")] == []


def test_run_files_are_read_by_fields() -> None:
    """One module writes their keys."""
    keyed = re.compile(r"""\brun_file\[["']|\bfile\[["']numerics""")
    assert [path.name for path in sorted(COMPILER.rglob("*.py")) if keyed.search(path.read_text(encoding="utf-8"))] == []
