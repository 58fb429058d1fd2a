"""YAML text -> plain data with the place of every value; nothing but data can result.

Sequences become tuples, mappings become dicts in the file's order. Numbers follow the YAML 1.2 core schema: ``1e3`` is a number, ``010`` is
ten, ``yes`` and dates are text.
"""

import math
import pathlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import yaml

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.model.text import UNSIGNED, printable
from cutjoint.package.locations import require_input

#: Keys and indices from the root of the document to a value.
Path: TypeAlias = tuple[str | int, ...]
MAX_BYTES = 4_000_000
MAX_NODES = 100_000  #: nodes as written
MAX_EXPANDED = 200_000  #: values after aliases and merge keys are expanded
MAX_DEPTH = 40
_TAG = "tag:yaml.org,2002:"
_NULL = "\0"  #: what the escape "\\0" has
_SURROGATE = re.compile(r"[\ud800-\udfff]")  #: half of a character, as the escape "\\ud800" has it; no encoding can write it
_FLOAT = rf"[-+]?{UNSIGNED}|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"


def field_name(keys: Path) -> str:
    """A field as a user would name it, such as "numerics.dt"."""
    return ".".join(key for key in keys if isinstance(key, str))


@dataclass(frozen=True)
class Source:
    """The data of a YAML text and the place of each value (``values``) and of each mapping key (``keys``)."""

    file: str
    data: Any = None
    values: dict[Path, Span] = field(default_factory=dict)
    keys: dict[Path, Span] = field(default_factory=dict)

    def part(self, path: Path) -> Any:
        """The data at ``path``."""
        data = self.data
        for key in path:
            data = data[key]
        return data

    def value_span(self, path: Path) -> Span:
        """The place of the value at ``path``, or of the nearest value around it."""
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Span(file=self.file, line=1, column=1))

    def key_span(self, path: Path) -> Span:
        """The place of the key of the value at ``path``; of the value itself for an item of a sequence."""
        return self.keys.get(path) or self.value_span(path)


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader with YAML 1.2 scalars and bounds on depth and number of nodes."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012
    depth = 0
    nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self.depth += 1
        self.nodes += 1
        if self.depth > MAX_DEPTH or self.nodes > MAX_NODES:
            deep = self.depth > MAX_DEPTH
            bound = f"nested deeper than {MAX_DEPTH} levels" if deep else f"longer than {MAX_NODES} values"
            raise yaml.composer.ComposerError(None, None, f"the file is {bound}", self.get_mark())
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def compose_scalar_node(self, anchor: dict[Any, yaml.Node]) -> yaml.ScalarNode:
        node = super().compose_scalar_node(anchor)
        if (not node.value.isascii() and _SURROGATE.search(node.value)) or _NULL in node.value:
            what = "stands for no character" if _NULL in node.value else "is half of a character"
            raise yaml.composer.ComposerError(None, None, f"an escape {what}", node.start_mark)
        return node


for _name, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("int", r"[-+]?[0-9]+", "-+0123456789"),
    ("float", _FLOAT, "-+0123456789."),
    ("merge", r"<<", "<"),
):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(rf"^(?:{_pattern})$"), list(_first))


def read_text(path: pathlib.Path, encoding: str = "utf-8") -> str:
    """The text of a file, in UTF-8 or else in ``encoding``.  Raises ModelError when it cannot be read, is too large or in none of them."""
    start = Span(file=str(path), line=1, column=1)
    require_input(path)
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise _error(start, f"cannot be read: {error.strerror}") from None
    if len(content) > MAX_BYTES:
        raise _error(start, f"the file is larger than {MAX_BYTES} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            return content.decode(encoding)
        line = content.count(b"\n", 0, error.start) + 1
        raise _error(Span(file=str(path), line=line, column=1), "the file is not UTF-8 text") from None


def parse_yaml(text: str, file: str, starts: str = "a model starts with 'cutjoint: 1'") -> Source:
    """Read ``text`` as one YAML document; ``file`` is the name that places in it carry, ``starts`` the advice on an empty one.
    Raises ModelError for text that is not YAML, for tags, duplicate keys, recursive aliases, numbers that are not finite, and for
    documents beyond the bounds of this module."""
    if len(text) > MAX_BYTES:
        raise _error(Span(file=file, line=1, column=1), f"the file is larger than {MAX_BYTES} bytes")
    node = _compose(text, file)
    if node is None:
        raise _error(Span(file=file, line=1, column=1), "the file is empty", starts)
    converter = _Converter(file)
    data = converter.convert(node, ())
    if converter.problems:
        raise ModelError(converter.problems)
    return Source(file, data, converter.values, converter.keys)


def _error(span: Span, message: str, hint: str = "") -> ModelError:
    return ModelError([Problem(span=span, element="file", message=printable(message), hint=hint)])


def _compose(text: str, file: str) -> yaml.Node | None:
    try:
        loader = _Loader(text)
        return loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        hint = "indent with spaces" if "'\\t'" in (error.problem or "") else ""
        raise _error(Span(file=file, line=line, column=column), error.problem or "this is not YAML", hint) from None
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        span = Span(file=file, line=before.count("\n") + 1, column=len(before) - before.rfind("\n"))
        raise _error(span, "a control character is not allowed in YAML") from None
    except (ValueError, OverflowError):  # of an escape such as "\\U00110000"
        mark = loader.get_mark()
        raise _error(Span(file=file, line=mark.line + 1, column=mark.column + 1), "an escape names no character") from None


class _Converter:
    """Turns composed nodes into data and records their places."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.values: dict[Path, Span] = {}
        self.keys: dict[Path, Span] = {}
        self.problems: list[Problem] = []
        self._open: set[int] = set()
        self._flattened: dict[int, dict[str, Any]] = {}
        self._merged = 0

    def span(self, node: yaml.Node) -> Span:
        return Span(file=self.file, line=node.start_mark.line + 1, column=node.start_mark.column + 1)

    def fail(self, node: yaml.Node, message: str, hint: str = "") -> None:
        self.problems.append(Problem(span=self.span(node), element="file", message=printable(message), hint=hint))

    def convert(self, node: yaml.Node, path: Path) -> Any:
        if len(self.values) >= MAX_EXPANDED:
            raise _error(self.span(node), f"aliases expand the file to more than {MAX_EXPANDED} values")
        if id(node) in self._open:
            raise _error(self.span(node), "an alias stands inside the value it names", "remove the recursive alias")
        if len(path) > MAX_DEPTH:
            raise _error(self.span(node), f"aliases nest the file deeper than {MAX_DEPTH} levels")
        self.values[path] = self.span(node)
        self._open.add(id(node))
        value = self._value(node, path)
        self._open.discard(id(node))
        return value

    def _value(self, node: yaml.Node, path: Path) -> Any:
        kind = node.tag.removeprefix(_TAG)
        if isinstance(node, yaml.MappingNode) and kind == "map":
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode) and kind == "seq":
            return tuple(self.convert(item, (*path, index)) for index, item in enumerate(node.value))
        if isinstance(node, yaml.ScalarNode) and kind in _SCALARS:
            return self._scalar(node, kind)
        self.fail(node, f"the tag '{node.tag}' is not allowed", "a model file holds plain data only")
        return None

    def _scalar(self, node: yaml.ScalarNode, kind: str) -> Any:
        try:
            return _SCALARS[kind](node.value)
        except ValueError:
            shown = node.value if len(node.value) <= 30 else node.value[:27] + "..."
            self.fail(node, f"'{shown}' is not a finite number")
            return None

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        merged, written = self._entries(node)
        data: dict[str, Any] = {}
        for name, (key, value) in {**merged, **written}.items():
            inner = (*path, name)
            self.keys[inner] = self.span(key)
            data[name] = self.convert(value, inner)
        return data

    def _entries(self, node: yaml.MappingNode) -> tuple[dict[str, Any], dict[str, Any]]:
        """The entries that merge keys bring, and the mapping's own: (key node, value node) by name."""
        merged: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        written: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        for key, value in node.value:
            if key.tag == _TAG + "merge":
                for source in self._merge_sources(value):
                    entries = self._flat(source)
                    self._count_merged(key, len(entries) + len(merged))
                    merged = {**entries, **merged}
            elif not isinstance(key, yaml.ScalarNode):
                self.fail(key, "a key must be a name, not a list or a mapping")
            elif key.value in written:
                first = written[key.value][0].start_mark.line + 1
                self.fail(key, f"duplicate key '{key.value}', first defined at line {first}", "keep one of them")
            else:
                written[key.value] = (key, value)
        return merged, written

    def _count_merged(self, key: yaml.Node, entries: int) -> None:
        self._merged += 1 + entries
        if self._merged > MAX_EXPANDED:
            hint = "merge fewer or smaller mappings"
            raise _error(self.span(key), f"merge keys bring more than {MAX_EXPANDED} entries into the file's mappings", hint)

    def _flat(self, node: yaml.MappingNode) -> dict[str, Any]:
        """All entries of a mapping that is merged into another."""
        if id(node) in self._open:
            raise _error(self.span(node), "an alias stands inside the value it names", "remove the recursive alias")
        if id(node) not in self._flattened:
            if len(self._open) > 2 * MAX_DEPTH:
                message = f"merge keys lead over more than {2 * MAX_DEPTH} mappings, each of which merges the next"
                raise _error(self.span(node), message, "write the entries into fewer mappings")
            self._open.add(id(node))
            merged, written = self._entries(node)
            self._open.discard(id(node))
            self._flattened[id(node)] = {**merged, **written}
        return self._flattened[id(node)]

    def _merge_sources(self, value: yaml.Node) -> Iterator[yaml.MappingNode]:
        for source in value.value if isinstance(value, yaml.SequenceNode) else [value]:
            if isinstance(source, yaml.MappingNode):
                yield source
            else:
                self.fail(source, "'<<' needs a mapping", "write for example '<<: *name'")


def _integer(text: str) -> int:
    if len(text) > 20:
        raise ValueError
    return int(text)


def _float(text: str) -> float:
    value = float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    if not math.isfinite(value):
        raise ValueError
    return value


_SCALARS: dict[str, Callable[[str], Any]] = {
    "str": str, "int": _integer, "float": _float, "bool": lambda text: text.lower() == "true", "null": lambda text: None,
}  # fmt: skip
