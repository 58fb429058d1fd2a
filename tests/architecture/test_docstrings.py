"""Prose of the code: short first sentences in docstrings, and no private words anywhere."""

from __future__ import annotations

import inspect
import re
import subprocess
from collections.abc import Iterator

import cutjoint
from tests.conftest import ROOT

#: Private words of earlier versions, with the words of the field in `docs/reference/glossary.md`.
RETIRED = (
    r"from (the|their|its) end on|from the end of (a|the) run on|\bslopes? of (the |a )?(run|output|step|objective)s?\b|without a word"
    r"|told by name|folders? that stands? alone|play_adjoint|play_derivative|follow_courses|push_along|push_beside|way_on|held_as_usual"
    r"|\bis_poor\b|\btake_model\b|TakesLong|balance_slopes|falls apart|\bfreedoms\b"
    r"|\bregimes?\b|\bcourses\b|\bstrayed\b|held_controllers|\bnought\b"
    r"|\btold\b|\btwins\b|(generic|dense) twin|with_asked_loops|\bSight\b|\bindifferent direction"
)
#: Files that name earlier words to accept them, or that others have written.
EXEMPT = re.compile(
    r"^(CHANGELOG\.md|tests/architecture/test_docstrings\.py|compiler/cutjoint/(commands|model|package)/renamed\.py|tests/.*renamed.*"
    r"|templates/view/vendor/.*|runtime/libm/.*|docs/bench/.*|docs/sweep/.*|docs/.*\.(svg|png|gif)|tests/data/.*|tests/fuzz/corpus/.*)$"
)


def public() -> Iterator[tuple[str, object]]:
    """The functions and classes of `cutjoint`, and their public members, by name."""
    for name in cutjoint.__all__:
        found = getattr(cutjoint, name)
        yield name, found
        if inspect.isclass(found) and not issubclass(found, Exception):
            own = {key: value for key, value in vars(found).items() if not key.startswith("_")}
            yield from ((f"{name}.{key}", value) for key, value in own.items() if callable(value) or isinstance(value, property))


def first_lines() -> Iterator[tuple[str, str]]:
    """The first lines of docstrings of all modules, classes and functions, by file and line, found as text."""
    for path in sorted(path for folder in ("compiler", "measuring") for path in (ROOT / folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for match in re.finditer(r'(?:\A|:[ ]*(?:#.*)?\n)[ ]*r?"""(.*)', text):
            yield f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, match.start(1)) + 1}", match[1].removesuffix('"""')


def test_the_first_sentences_of_docstrings_are_short() -> None:
    """At most 25 words, on one line."""
    firsts = list(first_lines())
    assert len(firsts) > 3000
    wrong = [f"{place}: the first sentence does not end on its first line" for place, line in firsts if not re.search(r"\.(\s|$)", line)]
    wrong += [f"{place}: more than 25 words" for place, line in firsts if len(re.split(r"(?<=\.)\s", line)[0].split()) > 25]
    assert not wrong, "\n".join(wrong)


def test_what_is_public_has_docstrings() -> None:
    assert [name for name, found in public() if not inspect.getdoc(found)] == []


def test_no_file_has_a_private_word() -> None:
    search = ["git", "grep", "-I", "-n", "-o", "-E", RETIRED]
    lines = subprocess.run(search, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    assert any(line.startswith("tests/architecture/test_docstrings.py:") for line in lines)
    found = [line for line in lines if not EXEMPT.match(line.partition(":")[0])]
    assert not found, "\n".join(found[:50])
