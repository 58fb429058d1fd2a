"""Files that a model file names, put into its data: tables and points (CSV), roads (OpenCRG), submodels (YAML), and properties of tyres.

Later steps see one document.  Values keep the places that they have in their own files.  A file is below the folder of the model file,
links followed, or it is one of the package's ``library``.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cutjoint.model.document.checks import element_of
from cutjoint.model.document.source import MAX_EXPANDED, Source, parse_yaml, read_text
from cutjoint.model.document.source import Path as Keys
from cutjoint.model.errors import ModelError, Problem, Problems, nearest
from cutjoint.model.expressions.units import LENGTH
from cutjoint.model.files.csv_table import Column, Csv, as_lists, read_csv
from cutjoint.model.files.opencrg import OpenCrg
from cutjoint.model.files.property_file import read_properties
from cutjoint.model.names import name_problem
from cutjoint.model.records import Span
from cutjoint.package.locations import library_folder

LIBRARY, SHIPPED = "library/", "<library>/"  #: the prefix of the package's submodels, and that of their files in messages
_NAMING = ("file", "include", "properties")  #: the keys that name files
MAX_FILES = 200  #: files that a model may name


def with_files(source: Source, folder: Path | None, problems: Problems) -> tuple[Source, dict[str, str], set[Keys]]:
    """The document with the contents of its files, their texts by the names in places, and the elements whose files could not be read.
    ``folder`` is that of the model file, None of a text without one. Problems are noted."""
    if not any(keys[-1] in _NAMING for keys in source.keys):
        return source, {}, set()
    files = _Files(problems)
    whole = files.filled(source, _Place(folder, folder, str(Path(source.file).parent / "x")[:-1], ()))
    return whole, files.texts, files.lost


@dataclass(frozen=True)
class _Place:
    """A ``folder`` below ``root`` for names to lead from, its name in messages, and the files ``around`` that include each other."""

    folder: Path | None
    root: Path | None
    prefix: str
    around: tuple[Path, ...]


@dataclass(frozen=True)
class _Name:
    """A file's name in the document, with its place and the element that it belongs to."""

    text: str
    span: Span
    element: str


class _Fault(Exception):  # noqa: N818 -- carries a message to the place that has the name
    """A message about a file, and its hint."""


@dataclass(frozen=True)
class _Inner:
    """A submodel's file as messages call it, and the place from which it names files."""

    file: str
    place: _Place


@dataclass
class _Files:
    problems: Problems
    texts: dict[str, str] = field(default_factory=dict)
    lost: set[Keys] = field(default_factory=set)
    _tables: dict[Path, Csv] = field(default_factory=dict)
    _parts: dict[Path, Source] = field(default_factory=dict)
    _values: int = 0

    def filled(self, source: Source, place: _Place) -> Source:
        """The source with the contents of its files in place of their names."""
        source = replace(source, values=dict(source.values), keys=dict(source.keys))
        for keys in [keys for keys in source.keys if keys[-1] in _NAMING]:
            text, span = source.part(keys), source.value_span(keys)
            label = element_of(keys[:-1] if keys[-2:-1] == ("points",) else keys)[0]
            name = _Name(text, span, label) if isinstance(text, str) else None
            try:
                match keys:
                    case (*_, "submodels", str(), "include") if _is_in_submodels(keys[:-3]):
                        source = self._with_submodel(source, keys[:-1], _require_text(name), place)
                    case (*_, "table", "file"):
                        source = self._with_table(source, keys[:-1], _require_text(name), place)
                    case (*_, "points", "file") if _is_in_submodels(keys[:-2]) and name and name_problem(name.text):
                        source = self._with_points(source, keys[:-1], name, place)
                    case (*_, "instances", str(), "properties") if _is_in_submodels(keys[:-3]) and name:
                        source = self._with_properties(source, keys, name, place)
            except (_Fault, ModelError) as error:
                self.lost.add(() if place.around or keys[-2:-1] == ("points",) else keys[: element_of(keys)[1]])
                if isinstance(error, _Fault):
                    self.problems.add(span, label, *map(str, error.args))
                for problem in getattr(error, "problems", ()):
                    self.problems.add(problem.span, problem.element, problem.message, problem.hint)
        return source

    # Submodels

    def _with_submodel(self, source: Source, keys: Keys, name: _Name, place: _Place) -> Source:
        if len(source.part(keys)) > 1:
            raise _Fault("'include' stands for the whole submodel", "remove what stands beside it, or write the submodel here")
        path, inner = self._find_submodel(name, place)
        if path in place.around:
            names = " -> ".join(each.name for each in (*place.around[place.around.index(path) :], path))
            raise _Fault(f"the file '{name.text}' includes itself: {names}", "remove one of these includes")
        if path not in self._parts:
            self._open(path, inner.file)
            self._parts[path] = _without_version(parse_yaml(self.texts[inner.file], inner.file), name)
        part = self.filled(self._parts[path], replace(inner.place, around=(*place.around, path)))
        return self._spliced(source, keys, part.data, part)

    def _find_submodel(self, name: _Name, place: _Place) -> tuple[Path, _Inner]:
        """The path of a submodel's file, its name in messages, and the place from which it names files."""
        if name.text.startswith(LIBRARY) and not name.text.endswith((".yaml", ".yml")):
            wanted, known = name.text.removeprefix(LIBRARY), library()
            if wanted not in known:
                raise _Fault(f"the library has no submodel '{wanted}'", nearest(wanted, known, "it has"))
            shipped = library_folder()
            return shipped / f"{wanted}.yaml", _Inner(f"{SHIPPED}{wanted}.yaml", _Place(shipped, shipped, SHIPPED, ()))
        if not name.text.endswith((".yaml", ".yml")):
            raise _Fault(f"the file '{name.text}' is no submodel", "name a .yaml file, or write library/NAME for one of the package")
        path, shown = self._find(name, place)
        folder, _, _ = name.text.rpartition("/")
        assert place.folder is not None
        return path, _Inner(shown, _Place(place.folder / folder, place.root, shown.removesuffix(name.text.split("/")[-1]), ()))

    # Tables

    def _with_table(self, source: Source, keys: Keys, name: _Name, place: _Place) -> Source:
        if name.text.lower().endswith(".crg") and keys[-3:-1] == ("road", "surface"):
            return self._with_opencrg(source, keys, name, place)
        table = self._table(name, place)
        requested = {key: column for key, column in source.part(keys).items() if key != "file"}
        columns: dict[str, Column] = {}
        for key, column in requested.items():
            if not isinstance(column, str):
                raise _Fault(f"'{key}' is the name of a column of '{name.text}'", "remove the list, or the file")
            columns[key] = self._column(table, column, source.value_span((*keys, key)), name)
        columns = columns or {column.name: column for column in table.columns}
        data, places = as_lists(columns, name.element, is_law=keys[-3:-1] != ("road", "surface"))
        return self._spliced(source, keys, data, Source(table.file, data, *places))

    def _with_opencrg(self, source: Source, keys: Keys, name: _Name, place: _Place) -> Source:
        if len(source.part(keys)) > 1:
            raise _Fault(f"the columns of '{name.text}' have names of their own", "name the file alone")
        path, shown = self._find(name, place)
        if shown not in self.texts:
            self._open(path, shown, encoding="latin-1")
        around = source.part(keys[:-1])
        surface = OpenCrg(self.texts[shown], shown, name.element).surface(around.get("interpolation") == "linear")
        start = Span(file=shown, line=1, column=1)
        values: dict[Keys, Span] = {(key,): start for key in surface}
        for key, lists in surface.items():
            values |= {(key, part): start for part in lists} if isinstance(lists, dict) else {}
        others = {key: value for key, value in around.items() if key != "table"}
        return self._spliced(source, keys[:-1], {**surface, **others}, Source(shown, {}, values, dict.fromkeys(values, start)))

    def _column(self, table: Csv, name: str, span: Span, of: _Name) -> Column:
        for column in table.columns:
            if column.name == name:
                return column
        message = f"the file '{of.text}' has no column '{name}'"
        raise ModelError([Problem(span, of.element, message, nearest(name, table.names, "columns"))])

    def _with_points(self, source: Source, keys: Keys, name: _Name, place: _Place) -> Source:
        table = self._table(name, place, texts=("name",))
        missing = [column for column in ("name", "x", "y", "z") if column not in table.names]
        if missing or len(table.names) > 4:
            span = Span(file=table.file, line=table.columns[0].span.line, column=1)
            message = f"a table of points has the columns name, x, y and z, not {', '.join(table.names)}"
            raise ModelError([Problem(span, name.element, message, "write for example: name, x [mm], y [mm], z [mm]")])
        names, *axes = (next(c for c in table.columns if c.name == wanted) for wanted in ("name", "x", "y", "z"))
        self._check_points(source, keys, names, axes)
        own = {key: value for key, value in source.part(keys).items() if key != "file"}
        points: dict[str, Any] = {}
        places: tuple[dict[Keys, Span], dict[Keys, Span]] = ({}, {})
        for row, point in enumerate(names.cells):
            points[point.text] = tuple(axis.values[row] for axis in axes)
            places[0][point.text,] = places[1][point.text,] = point.span
            places[0].update({(point.text, i): axis.cells[row].span for i, axis in enumerate(axes)})
        return self._spliced(source, keys, {**points, **own}, Source(table.file, {}, *places))

    def _check_points(self, source: Source, keys: Keys, names: Column, axes: list[Column]) -> None:
        own, found = source.part(keys), dict[str, Span]()
        problems = [
            Problem(axis.span, f"column '{axis.name}'", f"needs m, got {axis.dimension}", "write x [mm]")
            for axis in axes if axis.dimension not in (None, LENGTH)
        ]  # fmt: skip
        for cell in names.cells:
            fault = name_problem(cell.text) or ("the name 'file' is taken by the file", "rename the point") * (cell.text == "file")
            first = found.get(cell.text) or (source.key_span((*keys, cell.text)) if cell.text in own else None)
            if fault:
                problems.append(Problem(span=cell.span, element="point", message=fault[0], hint=fault[1]))
            elif first is not None:
                message = f"duplicate name '{cell.text}', first defined at {first.seen_from(cell.span)}"
                problems.append(Problem(span=cell.span, element=f"point '{cell.text}'", message=message, hint="rename one of them"))
            found.setdefault(cell.text, cell.span)
        if problems:
            raise ModelError(problems)

    def _table(self, name: _Name, place: _Place, texts: tuple[str, ...] = ()) -> Csv:
        if not name.text.endswith(".csv"):
            raise _Fault(f"the file '{name.text}' is no table", "name a file with comma-separated values, such as damper.csv")
        path, shown = self._find(name, place)
        if path not in self._tables:
            self._open(path, shown)
            self._tables[path] = read_csv(self.texts[shown], shown, name.element, texts)
        return self._tables[path]

    # Properties

    def _with_properties(self, source: Source, keys: Keys, name: _Name, place: _Place) -> Source:
        if not name.text.lower().endswith(".tir"):
            raise _Fault(f"the file '{name.text}' has no properties of a tyre", "name a .tir file, or write {KEY: number}")
        path, shown = self._find_properties(name, place)
        if shown not in self.texts:
            self._open(path, shown, encoding="latin-1")
        found = read_properties(self.texts[shown], shown, name.element)
        names: dict[Keys, Span] = {(key,): place for key, (place, _) in found.places.items()}
        values: dict[Keys, Span] = {(key,): place for key, (_, place) in found.places.items()}
        return self._spliced(source, keys, dict(found.values), Source(shown, {}, values, names))

    def _find_properties(self, name: _Name, place: _Place) -> tuple[Path, str]:
        if not name.text.startswith(LIBRARY):
            return self._find(name, place)
        wanted, known = name.text.removeprefix(LIBRARY), sorted(path.name for path in library_folder().glob("*.tir"))
        if wanted not in known:
            raise _Fault(f"the library has no tyre '{wanted}'", nearest(wanted, known, "it has"))
        return library_folder() / wanted, SHIPPED + wanted

    # Files

    def _find(self, name: _Name, place: _Place) -> tuple[Path, str]:
        """The path of a file below the folder of the model file, and its name in messages."""
        parts = name.text.split("/")
        if any(part in ("", ".", "..") for part in parts) or "\\" in name.text or ":" in name.text or not name.text.isprintable():
            message = f"the file '{name.text}' is not below the folder of the model file"
            raise _Fault(message, "write its path from there, such as data/damper.csv")
        if place.folder is None:
            message = f"the file '{name.text}' cannot be found: a model that is given as text has no folder"
            raise _Fault(message, "save the model as a file and read that")
        try:
            path = place.folder.joinpath(*parts).resolve(strict=True)
        except (OSError, RuntimeError, ValueError):
            folder = place.folder.resolve().name or "the folder"
            raise _Fault(f"there is no file '{name.text}'", f"put it into {folder}, beside the file that names it") from None
        if place.root is None or not path.is_relative_to(place.root.resolve()):
            raise _Fault(f"the file '{name.text}' is a link that leaves the folder of the model file", "put the file itself there")
        if not path.is_file():
            raise _Fault(f"'{name.text}' is no file", "name another")
        return path, place.prefix + name.text

    def _open(self, path: Path, shown: str, encoding: str = "utf-8") -> None:
        if len(self.texts) >= MAX_FILES:
            raise _Fault(f"the model names more than {MAX_FILES} files", "use fewer")
        try:
            self.texts[shown] = read_text(path, encoding)
        except ModelError as error:
            raise ModelError([replace(problem, span=replace(problem.span, file=shown)) for problem in error.problems]) from None

    def _spliced(self, source: Source, keys: Keys, data: Any, part: Source) -> Source:
        """The source with ``data`` at ``keys``, the places of which are those of ``part``."""
        self._values += len(part.values)
        if self._values > MAX_EXPANDED:
            raise _Fault(f"files bring more than {MAX_EXPANDED} values into the model", "include fewer, or smaller ones")
        source.values.update({(*keys, *path): span for path, span in part.values.items() if path})
        source.keys.update({(*keys, *path): span for path, span in part.keys.items()})
        return replace(source, data=_with(source.data, keys, data))


def library() -> list[str]:
    """The names of the package's submodels."""
    return sorted(path.stem for path in library_folder().glob("*.yaml"))


def _without_version(part: Source, name: _Name) -> Source:
    """A submodel's document without the version of the format. Raises ModelError: it is no submodel."""
    start, data = Span(file=part.file, line=1, column=1), part.data
    version = data.get("cutjoint") if isinstance(data, dict) else None
    if type(version) is not int or version != 1:
        message, hint = "this is no file of a submodel", "it starts with 'cutjoint: 1', and then has the sections of a submodel"
        raise ModelError([Problem(start, name.element, message, hint)])
    if "gravity" in data or "scenes" in data:
        message, hint = "this is a whole model, not a submodel", "leave name, gravity and scenes to the model that includes it"
        raise ModelError([Problem(start, name.element, message, hint)])
    return replace(part, data={key: value for key, value in data.items() if key != "cutjoint"})


def _is_in_submodels(keys: Keys) -> bool:
    """Return whether keys lead to the document or into a submodel, of which those within submodels are some."""
    return len(keys) % 2 == 0 and all(key == "submodels" for key in keys[::2])


def _require_text(name: _Name | None) -> _Name:
    if name is None:
        raise _Fault("needs the name of a file", "write its path from the folder of the model file")
    return name


def _with(data: Any, keys: Keys, value: Any) -> Any:
    if not keys:
        return value
    if isinstance(data, tuple):
        return tuple(_with(part, keys[1:], value) if i == keys[0] else part for i, part in enumerate(data))
    return {key: _with(part, keys[1:], value) if key == keys[0] else part for key, part in data.items()}
