"""The documentation as a site: it builds without a broken link, and says of the commands what they say."""

from __future__ import annotations

import runpy
import shutil
import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT


def test_the_site_builds_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "zensical.toml", tmp_path)
    command = [Path(sys.executable).with_name("zensical"), "build", "--strict"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {path.stem for path in (tmp_path / "results" / "site").glob("*.html")}
    assert pages >= {path.stem for path in (ROOT / "docs").glob("*.md")}


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("[nowhere](nowhere.md)", encoding="utf-8")
    command = [Path(sys.executable).with_name("zensical"), "build", "--strict"]
    (tmp_path / "zensical.toml").write_text('[project]\nsite_name = "x"\n', encoding="utf-8")
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode != 0


def test_all_pages_stand_in_the_list_of_the_site() -> None:
    listed = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    assert [path.name for path in sorted((ROOT / "docs").glob("*.md")) if f'"{path.name}"' not in listed] == []


def test_the_page_of_commands_is_what_they_say() -> None:
    page = runpy.run_path(str(ROOT / "scripts" / "commands"))["page"]()
    assert page == (ROOT / "docs" / "commands.md").read_text(encoding="utf-8"), "run scripts/commands"
