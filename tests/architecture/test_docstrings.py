"""Docstrings begin with their subject or with a verb, never with a pronoun or a conjunction."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OPENINGS = frozenset({"what", "whatever", "those", "who", "whom", "whose", "whether", "how", "where", "when", "which", "why"})
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def wrong_openings(text: str) -> Iterator[tuple[int, str]]:
    """Line and first words of each docstring in a Python text that opens without its subject, in the file's order."""
    documented = [node for node in ast.walk(ast.parse(text)) if isinstance(node, DOCUMENTED) and ast.get_docstring(node)]
    for node in sorted(documented, key=lambda node: node.body[0].lineno):
        words = [word.strip(".,:;`'\"") for word in (ast.get_docstring(node) or "").lower().split()]
        if words[0] in OPENINGS or words[:2] == ["the", "same"]:
            yield node.body[0].lineno, " ".join(words[:3])


@pytest.mark.parametrize("folder", ["compiler", "measuring", "tests"])
def test_docstrings_open_with_their_subject(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    found = [
        f"{file.relative_to(ROOT)}:{line}: '{words} ...': begin with a noun or a verb"
        for file in files for line, words in wrong_openings(file.read_text(encoding="utf-8"))
    ]  # fmt: skip
    assert files
    assert not found, "\n".join(found)


def test_every_kind_of_docstring_is_read() -> None:
    text = '"""What a module is."""\nclass A:\n    """The same."""\n    async def f():\n        """\n        Whether: so.\n        """\n'
    assert [line for line, _ in wrong_openings(text)] == [1, 3, 5]


@pytest.mark.parametrize("opening", ["Return whether it is.", "The sameness.", "Wholes.", "Rows, where there are any."])
def test_subjects_and_verbs_are_openings(opening: str) -> None:
    assert not list(wrong_openings(f'"""{opening}"""'))
