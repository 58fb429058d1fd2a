"""Docstrings and comments of constants begin with their subject or with a verb, never with a pronoun or a conjunction.

A sentence of a docstring, or a part of it before a colon or a semicolon, has one relative pronoun at most.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OPENINGS = frozenset({"what", "whatever", "those", "who", "whom", "whose", "whether", "how", "where", "when", "which", "why"})
RELATIVES = re.compile(r"\b(what|whatever|which|who|whom|whose)\b", re.IGNORECASE)
CODE = re.compile(r"``[^`]*``|`[^`]*`")
SENTENCE_ENDS = re.compile(r"(?<=[.;:])\s+|\n\n")
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


def crowded_sentences(text: str) -> Iterator[tuple[int, str]]:
    """Line of a docstring and first words of each of its sentences with more than one relative pronoun outside of code."""
    for line, docstring in docstrings_of(text):
        for sentence in SENTENCE_ENDS.split(CODE.sub("x", docstring)):
            if len(RELATIVES.findall(sentence)) > 1:
                yield line, " ".join(sentence.split()[:6])


@pytest.mark.parametrize("texts_of", [docstrings_of, comments_of])
@pytest.mark.parametrize("folder", ["compiler", "measuring", "tests"])
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


@pytest.mark.parametrize("folder", ["compiler", "measuring", "tests"])
def test_sentences_have_one_relative_pronoun_at_most(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    found = [
        f"{file.relative_to(ROOT)}:{line}: '{words} ...': make two sentences of it"
        for file in files for line, words in crowded_sentences(file.read_text(encoding="utf-8"))
    ]  # fmt: skip
    assert files
    assert not found, "\n".join(found)


def test_pronouns_are_counted_by_sentences_outside_of_code() -> None:
    text = '"""A body, which moves.\n\nA joint that knows what it holds, and whose\naxis turns; one whose ``which`` turns."""\n'
    assert list(crowded_sentences(text)) == [(1, "A joint that knows what it")]
    assert not list(crowded_sentences('"""A body, which moves: a joint whose ``what`` and `which` stand.  One who turns."""\n'))
