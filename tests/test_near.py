"""scripts/near: a change reaches the tests that import it, and those that name it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GIT = ("git", "-c", "user.name=nobody", "-c", "user.email=nobody")
FILES = {
    "compiler/cutjoint/__init__.py": "",
    "compiler/cutjoint/low.py": "ONE = 1\n",
    "compiler/cutjoint/high.py": "def two() -> int:\n    from cutjoint.low import ONE\n    return ONE + 1\n",
    "compiler/cutjoint/printed.py": "FILE = 'page.css'\n",
    "compiler/cutjoint/commands/__init__.py": "",
    "compiler/cutjoint/commands/draw.py": "import cutjoint.printed\n",
    "templates/page.css": "a {}\n",
    "measuring/cutjoint_bench/__init__.py": "",
    "tests/__init__.py": "",
    "tests/test_high.py": "from cutjoint.high import two\n",
    "tests/test_drawing.py": "COMMAND = \"draw\"\n",
    "tests/test_other.py": "import cutjoint\n",
    "tests/pages/__init__.py": "",
    "tests/pages/test_site.py": "import cutjoint\n",
    "docs/page.md": "# Page\n",
}

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="needs git")


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A small product with its tests, committed."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "near", tmp_path / "scripts")
    for command in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "base")):
        subprocess.run((*GIT, *command), cwd=tmp_path, check=True)
    return tmp_path


def near(repository: Path) -> list[str]:
    done = subprocess.run([sys.executable, "scripts/near"], cwd=repository, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.split()


@pytest.mark.parametrize(
    ("changed", "reached"),
    [
        ("compiler/cutjoint/low.py", ["tests/test_high.py"]),
        ("templates/page.css", ["tests/test_drawing.py"]),
        ("tests/test_other.py", ["tests/test_other.py"]),
        ("docs/page.md", ["tests/pages/test_site.py"]),
    ],
)
def test_a_change_reaches_what_imports_or_names_it(repository: Path, changed: str, reached: list[str]) -> None:
    assert near(repository) == []
    with (repository / changed).open("a", encoding="utf-8") as file:
        file.write("\n")
    assert near(repository) == reached


def test_a_new_test_file_is_near(repository: Path) -> None:
    (repository / "tests" / "test_new.py").write_text("", encoding="utf-8")
    assert near(repository) == ["tests/test_new.py"]
