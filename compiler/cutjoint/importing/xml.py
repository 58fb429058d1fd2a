"""XML of strangers as plain data with lines.  Document types and entities are refused, size, depth and number of elements bounded."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from cutjoint.model.document.source import read_text
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.model.text import is_number, printable

_DEPTH = 60
_ELEMENTS = 100_000
LARGEST = 1e12  #: the largest number taken from a file


@dataclass(eq=False)
class Node:
    """An element of XML: its tag, attributes, text, children and place.  It knows which of its attributes and children were asked for."""

    tag: str
    attributes: dict[str, str]
    span: Span
    children: "list[Node]" = field(default_factory=list)
    text: str = ""
    _asked: set[str] = field(default_factory=set)

    def all(self, tag: str) -> "list[Node]":
        """The children of a tag, in the file's order."""
        self._asked.add(f"<{tag}")
        return [child for child in self.children if child.tag == tag]

    def find(self, tag: str) -> "Node | None":
        """The only child of a tag, None if there is none; ModelError where there are more."""
        found = self.all(tag)
        if len(found) > 1:
            found[1].refuse(f"a second <{tag}> of one <{self.tag}>", "leave one of them")
        return found[0] if found else None

    def need(self, tag: str) -> "Node":
        """The only child of a tag; ModelError where there is none."""
        return self.find(tag) or self.refuse(f"has no <{tag}>", "add one")

    def get(self, name: str) -> str | None:
        """An attribute, None if it is not there."""
        self._asked.add(name)
        return self.attributes.get(name)

    def name(self, attribute: str = "name") -> str:
        """An attribute that has to be there."""
        return self.get(attribute) or self.refuse(f"has no {attribute}", "give it one")

    def numbers(self, text: str | None, count: int, default: tuple[float, ...] = ()) -> tuple[float, ...]:
        """The numbers of an attribute or a text of this element, ``default`` if there is none; ModelError unless there are ``count``."""
        words = (text or "").split()
        if not words and default:
            return default
        if len(words) != count or not all(is_number(word) and abs(float(word)) <= LARGEST for word in words):
            self.refuse(f"has '{(text or '')[:60]}' where {count} numbers stand", "write plain decimal numbers")
        return tuple(float(word) for word in words)

    def number(self, name: str, default: float | None = None) -> float:
        """The number in an attribute."""
        return self.numbers(self.get(name), 1, () if default is None else (default,))[0]

    def problem(self, message: str, hint: str = "") -> Problem:
        """A problem at this element."""
        name = self.attributes.get("name")
        element = f"<{self.tag}>" if name is None else printable(f"{self.tag} '{name[:60]}'")
        return Problem(span=self.span, element=element, message=printable(message), hint=hint)

    def refuse(self, message: str, hint: str = "") -> NoReturn:
        """Raise the ModelError of one problem at this element."""
        raise ModelError([self.problem(message, hint)])

    def left_out(self) -> Counter[str]:
        """Tags and attributes below this element that nobody asked for, by how often."""
        return Counter(self._unasked())

    def _unasked(self) -> Iterator[str]:
        for name in self.attributes:
            if name not in self._asked and name != "name" and not name.startswith("xmlns"):
                yield f"{self.tag} {name}"
        for child in self.children:
            if f"<{child.tag}" in self._asked:
                yield from child._unasked()
            else:
                yield child.tag


def read_xml(path: Path) -> Node:
    """The root of an XML file.  Raises ModelError where it is none, has a document type, or is beyond the bounds of this module."""
    text, file = read_text(path), str(path)
    parser = expat.ParserCreate("utf-8")
    stack: list[Node] = []
    roots: list[Node] = []
    count = 0

    def fail(message: str, hint: str = "") -> NoReturn:
        span = Span(file=file, line=parser.CurrentLineNumber, column=parser.CurrentColumnNumber + 1)
        raise ModelError([Problem(span, "file", message, hint)])

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > _ELEMENTS or len(stack) >= _DEPTH:
            fail(f"the file has more than {_ELEMENTS} elements, or {_DEPTH} within each other")
        span = Span(file=file, line=parser.CurrentLineNumber, column=parser.CurrentColumnNumber + 1)
        node = Node(tag, attributes, span)
        (stack[-1].children if stack else roots).append(node)
        stack.append(node)

    def end(_tag: str) -> None:
        stack.pop()

    def add(data: str) -> None:
        stack[-1].text += data

    def refuse(*_: object) -> None:
        fail("document types and entities are not read", "expand them")

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = begin, end, add
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    parser.buffer_text = True
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        words = f"is no XML: {expat.ErrorString(error.code)}"
        raise ModelError([Problem(Span(file=file, line=error.lineno, column=error.offset + 1), "file", words)]) from None
    return roots[0]
