"""Docstrings and comments of constants begin with their subject or with a verb, never with a pronoun or a conjunction."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OPENINGS = frozenset({"what", "whatever", "those", "who", "whom", "whose", "whether", "how", "where", "when", "which", "why"})
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def docstrings_of(text: str) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring in a Python text, in its order."""
    documented = [node for node in ast.walk(ast.parse(text)) if isinstance(node, DOCUMENTED) and ast.get_docstring(node)]
    for node in sorted(documented, key=lambda node: node.body[0].lineno):
        yield node.body[0].lineno, ast.get_docstring(node) or ""


def comments_of(text: str) -> Iterator[tuple[int, str]]:
    """Line and first line of each comment of a constant, which ``#:`` begins, in a Python text."""
    lines = ["", *(line.strip() for line in text.splitlines())]
    yield from ((i, line[2:]) for i, line in enumerate(lines) if line[:2] == "#:" != lines[i - 1][:2])


def wrong_openings(texts: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Line and first words of each text that opens without its subject."""
    for line, text in texts:
        words = [word.strip(".,:;`'\"") for word in text.lower().split()]
        if words[0] in OPENINGS or words[:2] == ["the", "same"]:
            yield line, " ".join(words[:3])


@pytest.mark.parametrize(
    ("folder", "texts_of"),
    [("compiler", docstrings_of), ("measuring", docstrings_of), ("tests", docstrings_of), ("compiler", comments_of)],
)
def test_texts_open_with_their_subject(folder: str, texts_of: Callable[[str], Iterable[tuple[int, str]]]) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    found = [
        f"{file.relative_to(ROOT)}:{line}: '{words} ...': begin with a noun or a verb"
        for file in files for line, words in wrong_openings(texts_of(file.read_text(encoding="utf-8")))
    ]  # fmt: skip
    assert files
    assert not found, "\n".join(found)


def test_every_kind_of_docstring_is_read() -> None:
    text = '"""What a module is."""\nclass A:\n    """The same."""\n    async def f():\n        """\n        Whether: so.\n        """\n'
    assert [line for line, _ in wrong_openings(docstrings_of(text))] == [1, 3, 5]


def test_comments_of_constants_are_read_from_their_first_line() -> None:
    text = "#: What a\n#: whole is.\nA = 1\n\n    #: One, and\n    #: where it is.\n    b = 2  #: which is b\n"
    assert [line for line, _ in wrong_openings(comments_of(text))] == [1]


@pytest.mark.parametrize("opening", ["Return whether it is.", "The sameness.", "Wholes.", "Rows, where there are any."])
def test_subjects_and_verbs_are_openings(opening: str) -> None:
    assert not list(wrong_openings(docstrings_of(f'"""{opening}"""')))
