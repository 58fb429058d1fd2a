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


def near(repository: Path, *arguments: str) -> list[str]:
    done = subprocess.run([sys.executable, "scripts/near", *arguments], cwd=repository, stdout=subprocess.PIPE, text=True, check=True)
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


def test_the_nearest_are_first_and_as_many_as_asked_for(repository: Path) -> None:
    """A file's own name says more than what it imports, and a change in half of this more than one in a sixth."""
    files = {
        "test_a": "import cutjoint.high\nimport cutjoint.other\nimport cutjoint.more\n",
        "test_b": "import cutjoint.low\nimport cutjoint.other\n",
        "test_very_low": "import cutjoint.high\nimport cutjoint.other\nimport cutjoint.more\n",
    }  # fmt: skip
    for name, text in {"compiler/cutjoint/other": "", "compiler/cutjoint/more": "", **{f"tests/{n}": t for n, t in files.items()}}.items():
        (repository / f"{name}.py").write_text(text, encoding="utf-8")
    subprocess.run((*GIT, "add", "."), cwd=repository, check=True)
    subprocess.run((*GIT, "commit", "-q", "-m", "more"), cwd=repository, check=True)
    with (repository / "compiler/cutjoint/low.py").open("a", encoding="utf-8") as file:
        file.write("\n")
    nearest = [f"tests/{name}.py" for name in ("test_very_low", "test_b", "test_high", "test_a")]
    assert near(repository) == nearest
    assert near(repository, "HEAD", "2") == nearest[:2]


def test_a_new_test_file_is_near(repository: Path) -> None:
    (repository / "tests" / "test_new.py").write_text("", encoding="utf-8")
    assert near(repository) == ["tests/test_new.py"]
