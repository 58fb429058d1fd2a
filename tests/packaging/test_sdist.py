"""The source distributions: the product's tests find what they read, measuring has its package."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path

from tests.conftest import ROOT

#: Folders that tests read beside their own.
READ = ("compiler", "measuring", "docs", "generated/four_bar", "models", "runtime", "templates")


def files_of_sdist(project: Path, out: Path) -> set[str]:
    """The paths in the source distribution of a project."""
    subprocess.run([sys.executable, "-m", "build", "--sdist", "--outdir", str(out), str(project)], check=True, capture_output=True)
    (archive,) = out.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        return {name.partition("/")[2] for name in files.getnames()}


def sources(project: Path, folder: str) -> set[str]:
    """The files of a folder of a project."""
    return {str(p.relative_to(project)) for p in (project / folder).rglob("*") if p.is_file() and p.suffix != ".pyc"}


def test_the_source_distribution_of_measuring_has_its_package(tmp_path: Path) -> None:
    assert sources(ROOT / "measuring", "cutjoint_bench") <= files_of_sdist(ROOT / "measuring", tmp_path)


def test_the_source_distribution_has_what_its_tests_read(tmp_path: Path) -> None:
    held = files_of_sdist(ROOT, tmp_path)
    wanted = {path for folder in READ for path in sources(ROOT, folder)}
    assert wanted <= held, sorted(wanted - held)
    assert {"Makefile", "CONTRIBUTING.md", "CHANGELOG.md", "scripts/sanitize", "tests/conftest.py"} <= held
