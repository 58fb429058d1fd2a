"""The source distribution: its tests find what they read."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path

from tests.conftest import ROOT

#: Folders that tests read beside their own.
READ = ("benchmarks", "compiler", "docs", "generated/four_bar", "models", "runtime", "templates")


def test_the_source_distribution_has_what_its_tests_read(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "build", "--sdist", "--outdir", str(tmp_path), str(ROOT)], check=True, capture_output=True)
    (archive,) = tmp_path.glob("cutjoint-*.tar.gz")
    with tarfile.open(archive) as files:
        held = {name.partition("/")[2] for name in files.getnames()}
    wanted = {str(p.relative_to(ROOT)) for folder in READ for p in (ROOT / folder).rglob("*") if p.is_file() and p.suffix != ".pyc"}
    assert wanted <= held, sorted(wanted - held)
    assert {"Makefile", "CONTRIBUTING.md", "CHANGELOG.md", "scripts/sanitize", "tests/conftest.py"} <= held
