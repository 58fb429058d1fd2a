"""Roads of scenes: their profiles, surfaces and patches of friction; heights of files in OpenCRG."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isnan, nan
from typing import Any, Never

import numpy as np
from numpy.typing import NDArray

from cutjoint.methods import join_or
from cutjoint.model import document
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import HeightTable, Patch, Road, RoadSegment, RoughSurface, SegmentKind, Span
from cutjoint.model.scope import Element
from cutjoint.model.source import Path
from cutjoint.model.text import UNSIGNED
from cutjoint.model.units import LENGTH, NONE, Quantity


def read_road(where: Element, road: document.Road) -> Road:
    """The road of a scene."""
    tracks = {}
    for side in ("left", "right"):
        name = "profile" if road.profile is not None else side
        segments = getattr(road, name) or ()
        tracks[side] = tuple(_segment(where, part, ("road", name, i)) for i, part in enumerate(segments))
    return Road(
        contact=road.contact, start=where.number(road.start, LENGTH, ("road", "start")), **tracks, surface=_surface(where, road.surface),
        patches=tuple(_patch(where, patch, ("road", "friction", i)) for i, patch in enumerate(road.friction)),
    )  # fmt: skip


def _surface(where: Element, surface: document.Heights | document.Rough | None) -> HeightTable | RoughSurface | None:
    keys: Path = ("road", "surface")
    if surface is None:
        return None
    span = where.scope.source.value_span((*where.path, *keys))
    if isinstance(surface, document.Rough):
        width = where.positive(where.number(surface.width, LENGTH, (*keys, "width")), (*keys, "width"))
        return RoughSurface(grade=surface.iso8608, seed=surface.seed, width=width, span=span)
    keys = (*keys, "table")
    if missing := [name for name in ("x", "y", "value") if name not in surface.table]:
        where.fail(f"the table of heights has no {join_or(missing)}", "it needs x, y and value: a row of a file for each place", keys)
        return None
    first, second = (name for name in surface.table if name != "value")
    places = {name: _even(where, name, surface.table[name], (*keys, name)) for name in (first, second)}
    counts, rows = {name: len(surface.table[name]) for name in places}, surface.table["value"]
    heights = tuple(_lengths(where, row, (*keys, "value", i)) if isinstance(row, tuple) else () for i, row in enumerate(rows))
    if len(rows) != counts[first] or any(len(row) != counts[second] for row in heights):
        message = f"the table has {counts[first]} of {first} and {counts[second]} of {second}, and needs as many rows of as many heights"
        where.fail(message, f"give a list of heights for each {first}: value: [[...], [...]]", (*keys, "value"))
        return None
    (x, dx), (y, dy) = places["x"], places["y"]
    if not x or not y:
        return None
    across = heights if first == "x" else tuple(zip(*heights, strict=True))
    return HeightTable(start=(x[0], y[0]), step=(dx, dy), heights=across, bilinear=surface.interpolation == "linear", span=span)


def _lengths(where: Element, numbers: tuple[Any, ...], keys: Path) -> tuple[float, ...]:
    """Numbers of a list in m; the unit of a file's column, which all its numbers have, is checked once."""
    if all(isinstance(x, (int, float)) and (not isinstance(x, Quantity) or x.dimension == LENGTH) for x in numbers):
        return tuple(map(float, numbers))
    found = []
    for i, number in enumerate(numbers):
        if isinstance(number, tuple):
            where.fail("a list stands where a number should", "give one height for each place", (*keys, i))
            return (nan,) * len(numbers)
        found.append(where.number(number, LENGTH, (*keys, i)))
        if isinstance(number, Quantity) and isnan(found[-1]):
            return (nan,) * len(numbers)
    return tuple(found)


def _even(where: Element, name: str, numbers: tuple[Any, ...], keys: Path) -> tuple[tuple[float, ...], float]:
    """Places that rise by equal steps, and their step, m; none where they do not."""
    places = _lengths(where, numbers, keys)
    if len(places) < 2:
        where.fail(f"the table of heights has {len(places)} of {name}", "a surface needs two places or more along x and along y", keys)
        return (), nan
    if any(map(isnan, places)):
        return (), nan
    step = (places[-1] - places[0]) / (len(places) - 1)
    for i, place in enumerate(places):
        if i and place <= places[i - 1]:
            where.fail(f"the table's {name} does not rise", "sort the table", (*keys, i))
            return (), nan
        if abs(place - places[0] - i * step) > 1e-6 * step:
            message = f"the table's {name} has steps that are not equal: {place:g} m is not {places[0] + i * step:g} m"
            where.fail(message, "take heights on an even grid, as by interpolation between those that are measured", (*keys, i))
            return (), nan
    return places, step


def _patch(where: Element, patch: document.Patch, keys: Path) -> Patch:
    ends = {name: tuple(_lengths(where, getattr(patch, name), (*keys, name))) for name in ("x", "y")}
    for name, (begin, end) in ends.items():
        if end <= begin:
            where.fail(f"the patch ends along {name} where it begins, or before", f"write {name}: [smaller, larger]", (*keys, name))
    friction = where.positive(where.number(patch.value, NONE, (*keys, "value")), (*keys, "value"))
    edge = where.positive(where.number(patch.edge, LENGTH, (*keys, "edge")), (*keys, "edge"))
    span = where.scope.source.value_span((*where.path, *keys))
    return Patch(x=(ends["x"][0], ends["x"][1]), y=(ends["y"][0], ends["y"][1]), friction=friction, edge=edge, span=span)


_SEGMENTS: Mapping[type[Any], tuple[SegmentKind, str, str]] = {
    document.Flat: (SegmentKind.FLAT, "flat", ""),
    document.Ramp: (SegmentKind.RAMP, "ramp", "rise"),
    document.Step: (SegmentKind.STEP, "", "step"),
    document.Cosine: (SegmentKind.COSINE, "cosine", "amplitude"),
}


def _segment(where: Element, part: Any, keys: Path) -> RoadSegment:
    kind, length_key, rise_key = _SEGMENTS[type(part)]
    length = where.number(getattr(part, length_key), LENGTH, (*keys, length_key)) if length_key else 0.0
    rise = where.number(getattr(part, rise_key), LENGTH, (*keys, rise_key)) if rise_key else 0.0
    if length_key:
        where.positive(length, (*keys, length_key))
    return RoadSegment(kind=kind, length=length, rise=rise, span=where.scope.source.value_span((*where.path, *keys)))


# OpenCRG

_Array = NDArray[np.float64]
#: The formats of the data: bytes of a number of binary ones, characters of one of text.
_BINARY, _TEXT = {"KRBI": ">f4", "KDBI": ">f8"}, {"LRFI": 10, "LDFI": 20}
#: The options that change a road, with the values that are heeded; others are of checks, messages and searches.
_OPTIONS = {
    "border_mode_u": 2.0, "border_mode_v": 2.0, "border_offset_u": 0.0, "border_offset_v": 0.0, "border_smooth_ubeg": 0.0,
    "border_smooth_uend": 0.0, "refline_continuation": 0.0,
}  # fmt: skip
_SCALES = ("scale_z_grid", "scale_slope", "scale_banking", "scale_length", "scale_width", "scale_curvature")
_SHIFTS = ("refline_offset_x", "refline_offset_y", "refline_offset_z")
_POINT = (
    *(f"refpoint_{axis}{part}" for axis in "uv" for part in ("", "_fraction", "_offset")),
    *(f"refpoint_{target}" for target in ("x", "y", "z", "phi")),
)
_SETTING = re.compile(rf"([a-z_]\w*)\s*=\s*([-+]?{UNSIGNED})(?:\s.*)?", re.IGNORECASE | re.ASCII)
#: Headings, rad, and slopes that are the same; a road of 10 km is off by 0.1 mm.
_SAME = 1e-8


@dataclass
class OpenCrg:
    """A file in OpenCRG with a straight reference line, for an ``element``: its heights along x and y.

    ``settings`` are the keywords of the blocks, with their lines, ``channels`` name, unit and line of the data's columns.
    """

    text: str
    file: str
    element: str
    settings: dict[str, dict[str, tuple[float, int]]] = field(default_factory=dict)
    channels: list[tuple[str, str, int]] = field(default_factory=list)
    line_u: dict[str, float] = field(default_factory=dict)
    form: str = ""

    def lists(self) -> dict[str, tuple[Any, ...]]:
        """The places ``x`` and ``y`` and as ``value`` the heights over y for each x, m.

        Raises:
            ModelError: the file is none, or a part of it is not heeded; the message names it.
        """
        data = self._data(self._header())
        places = {name.removeprefix("reference line "): column for column, (name, _, _) in enumerate(self.channels)}
        line = {part: data[:, places[part]] if part in places else None for part in ("phi", "slope", "banking")}
        columns, v = self._sections()
        u, z = self._along(len(data)), data[:, columns]
        if len(u) < 2:
            self._fail("the file has less than two cross sections", "a road needs two or more")
        return self._placed(u, v, self._filled(z), line)

    # Header

    def _header(self) -> int:
        """Read the blocks; the place in the text where the data begins."""
        block, at, number = "", 0, 0
        while at < len(self.text):
            end = self.text.find("\n", at)
            end = len(self.text) if end < 0 else end
            row, at, number = self.text[at:end].rstrip("\r"), end + 1, number + 1
            if re.fullmatch(r"\${4,}\s*", row):
                return at
            if row.startswith("$"):
                block = "" if block and row[1:2] in ("", " ", "!") else row[1:].split("!")[0].strip().upper()
                self.settings.setdefault(block, {})
            elif block and not row.startswith("*"):
                self._read(block, row.split("!")[0].strip(), number)
        self._fail("the file has no line of $ between its header and its data", "name a file in OpenCRG")

    def _read(self, block: str, row: str, number: int) -> None:
        """A row of a block."""
        if block == "ROAD_CRG_FILE":
            self._fail("the data is in another file ($ROAD_CRG_FILE)", "name that file", number)
        if block.startswith("ROAD_CRG") and block != "ROAD_CRG_MPRO":
            found = self.settings[block]
            if (match := _SETTING.fullmatch(row)) is not None:
                found[match[1].lower()] = float(match[2]), number
            elif row:
                self._fail(f"'{row}' is no keyword with a number", "write for example reference_line_increment = 0.01", number)
        elif block == "KD_DEFINITION":
            kind, _, rest = row.partition(":")
            parts = [part.strip() for part in rest.split(",")]
            if kind == "#":
                self.form = rest.strip().upper()
            elif kind in ("D", "d"):
                self.channels.append((parts[0].lower(), parts[1] if len(parts) > 1 else "", number))
            elif kind in ("U", "u") and parts[0].lower() == "reference line u":
                try:
                    self.line_u = dict(zip(("start", "step"), map(float, parts[2:4]), strict=False))
                except ValueError:
                    self._fail(f"'{row}' has no start and increment", "write for example U:reference line u,m,0,0.01", number)

    def _value(self, block: str, key: str, default: float) -> float:
        return self.settings.get(block, {}).get(key, (default, 0))[0]

    # Data

    def _data(self, begin: int) -> _Array:
        """The records, (records, channels)."""
        width = len(self.channels)
        if self.form in _BINARY:
            content = original(self.text)[len(original(self.text[:begin])) :]
            size = np.dtype(_BINARY[self.form]).itemsize
            numbers = np.frombuffer(content[: len(content) // size * size], dtype=_BINARY[self.form]).astype(np.float64)
            rows = numbers[: len(numbers) // max(width, 1) * width].reshape(-1, max(width, 1))
            while len(rows) and np.isnan(rows[-1]).all():  # what fills the last block
                rows = rows[:-1]
            return rows
        if self.form not in _TEXT:
            self._fail(f"the format of the data is '{self.form}'", f"it is {join_or([*_TEXT, *_BINARY])}")
        size = _TEXT[self.form]
        lines = [row for row in self.text[begin:].split("\n") if row.strip()]
        each = -(-width // (80 // size)) if width else 1
        if len(lines) % each:
            self._fail("the last cross section is not whole", "the file has been cut off")
        records = ("".join(row.rstrip("\r").ljust(80)[:80] for row in lines[i : i + each]) for i in range(0, len(lines), each))
        return np.array([list(self._numbers(record, size)) for record in records])

    def _numbers(self, record: str, size: int) -> Iterator[float]:
        for i in range(len(self.channels)):
            cell = record[i * size : (i + 1) * size].strip()
            try:
                yield nan if not cell or "*" in cell else float(cell.replace("D", "E").replace("d", "e"))
            except ValueError:
                self._fail(f"'{cell}' is no number of the data", "the file is damaged")

    def _sections(self) -> tuple[list[int], _Array]:
        """The columns of the long sections from right to left, and their places across."""
        found: list[tuple[float, int]] = []
        placed = set()
        for column, (name, unit, number) in enumerate(self.channels):
            wanted = {"reference line phi": "rad", "reference line slope": "m/m", "reference line banking": "m/m"}.get(name, "m")
            if unit != wanted and (name.startswith("long section") or wanted != "m"):
                self._fail(f"'{name}' is in '{unit}'", f"it is in {wanted}", number)
            if (match := re.fullmatch(r"long section\s+(at\s+v\s*=\s*)?(.+)", name)) is not None:
                try:
                    found.append((float(match[2]), column))
                except ValueError:
                    self._fail(f"'{name}' has no place", "write long section 1, or long section at v = 0.5", number)
                placed.add(match[1] is not None)
        found.sort()
        if len(found) < 2 or len(placed) > 1:
            self._fail("the file has not two long sections or more, by their numbers or by their places", "the data is no road")
        if placed == {True}:
            return [column for _, column in found], np.array([place for place, _ in found], dtype=np.float64)
        last = len(found) - 1
        right, left = (self._value("ROAD_CRG", f"long_section_v_{side}", nan) for side in ("right", "left"))
        step = self._value("ROAD_CRG", "long_section_v_increment", (left - right) / last)
        step = 0.01 if isnan(step) else step
        first = -step * last / 2 if isnan(right) else right
        return [column for _, column in found], np.array([first + step * i for i in range(last + 1)], dtype=np.float64)

    def _along(self, count: int) -> _Array:
        start = self._value("ROAD_CRG", "reference_line_start_u", self.line_u.get("start", 0.0))
        known = self.settings.get("ROAD_CRG", {})
        step = self._value("ROAD_CRG", "reference_line_increment", self.line_u.get("step", 0.01))
        if "reference_line_increment" not in known and "reference_line_end_u" in known and count > 1:
            step = (known["reference_line_end_u"][0] - start) / (count - 1)
        return np.array([start + step * i for i in range(count)], dtype=np.float64)

    def _filled(self, z: _Array) -> _Array:
        """Heights in place of those that are missing at the sides: of each cross section's last ones."""
        if not np.isnan(z).any():
            return z
        if self._modifier("grid_nan_mode", 2.0) != 2 or self._modifier("grid_nan_offset", 0.0) != 0:
            self._refuse("ROAD_CRG_MODS", "grid_nan_mode" if self._modifier("grid_nan_mode", 2.0) != 2 else "grid_nan_offset")
        filled = z.copy()
        for row in filled:
            known = np.flatnonzero(~np.isnan(row))
            if not known.size or known[-1] - known[0] + 1 > known.size:
                message = "heights are missing in a cross section, not at its sides alone"
                self._fail(message, "fill them in: programs differ in how they do that")
            row[: known[0]], row[known[-1] :] = row[known[0]], row[known[-1]]
        return filled

    # Place

    def _modifier(self, key: str, default: float) -> float:
        return self._value("ROAD_CRG_MODS", key, default)

    def _placed(self, u: _Array, v: _Array, z: _Array, line: Mapping[str, _Array | None]) -> dict[str, tuple[Any, ...]]:
        """The heights where options and modifiers have them; without modifiers the line begins at the origin, along x."""
        modifiers = self.settings.get("ROAD_CRG_MODS", {"refpoint_phi": (0.0, 0)})
        for key, value in _OPTIONS.items():
            if self._value("ROAD_CRG_OPTS", key, value) != value:
                self._refuse("ROAD_CRG_OPTS", key)
        for key in modifiers:
            if key not in (*_SCALES, *_SHIFTS, *_POINT, "grid_nan_mode", "grid_nan_offset"):
                self._refuse("ROAD_CRG_MODS", key)
        if line["phi"] is not None and np.ptp(line["phi"][1:]) > _SAME:
            message = f"the reference line is curved: its heading is {line['phi'][1]:g} to {line['phi'][-1]:g} rad"
            self._fail(message, "straight reference lines alone are heeded")
        steps = np.diff(u)
        grades = np.full(len(steps), self._value("ROAD_CRG", "reference_line_start_s", 0.0)) if line["slope"] is None else line["slope"][1:]
        rises = np.concatenate([[0.0], np.cumsum(grades * steps)])
        end = self.settings.get("ROAD_CRG", {}).get("reference_line_end_z") if line["slope"] is not None else None
        start = self._value("ROAD_CRG", "reference_line_start_z", 0.0)
        if end is not None:
            rises += np.linspace(0, 1, len(rises)) * (end[0] - start - rises[-1])
        banks = np.full(len(u), self._value("ROAD_CRG", "reference_line_start_b", 0.0)) if line["banking"] is None else line["banking"]
        scale = {key: self._modifier(key, 1.0) for key in _SCALES}
        u, v = u[0] + scale["scale_length"] * (u - u[0]), v * scale["scale_width"]
        rises = rises * scale["scale_slope"] * scale["scale_length"]
        heights = z * scale["scale_z_grid"] + start + rises[:, None] + scale["scale_banking"] * banks[:, None] * v
        if any(key in _POINT for key in modifiers):
            shift = self._to_point(u, v, heights, modifiers)
        else:
            heading = self._value("ROAD_CRG", "reference_line_start_phi", 0.0) if line["phi"] is None else float(line["phi"][1])
            if abs(heading) > _SAME:
                self._fail(f"the reference line's heading is {heading:g} rad, not that of x", "give the modifier refpoint_phi = 0")
            places = (self._value("ROAD_CRG", f"reference_line_start_{axis}", 0.0) for axis in "xy")
            shift = tuple(place + self._modifier(key, 0.0) for place, key in zip((*places, 0.0), _SHIFTS, strict=True))
        x, y, rows = u - u[0] + shift[0], v + shift[1], heights + shift[2]
        return {"x": tuple(x.tolist()), "y": tuple(y.tolist()), "value": tuple(map(tuple, rows.tolist()))}

    def _to_point(self, u: _Array, v: _Array, heights: _Array, modifiers: Mapping[str, tuple[float, int]]) -> tuple[float, ...]:
        """The line's begin, and what is added to heights, so that a point of the road is where modifiers have it."""
        if abs(self._modifier("refpoint_phi", 0.0)) > _SAME:
            self._refuse("ROAD_CRG_MODS", "refpoint_phi")
        point = []
        for axis, places, plain in (("u", u, u[0]), ("v", v, 0.0)):
            share = modifiers.get(f"refpoint_{axis}_fraction")
            place = self._modifier(f"refpoint_{axis}", plain) if share is None else places[0] + share[0] * (places[-1] - places[0])
            point.append(place + self._modifier(f"refpoint_{axis}_offset", 0.0))
        across = [np.interp(point[1], v, row) for row in heights]
        height = float(np.interp(point[0], u, across))
        wanted = [self._modifier(f"refpoint_{axis}", 0.0) for axis in "xyz"]
        return wanted[0] - (point[0] - u[0]), wanted[1] - point[1], wanted[2] - height

    def _refuse(self, block: str, key: str) -> Never:
        value, number = self.settings[block][key]
        known = _OPTIONS.get(key)
        hint = "leave it out, or apply it and save the road so" if known is None else f"{known:g} is heeded, which is its default"
        self._fail(f"{key} = {value:g} is not heeded", hint, number)

    def _fail(self, message: str, hint: str, number: int = 1) -> Never:
        raise ModelError([Problem(span=Span(file=self.file, line=number, column=1), element=self.element, message=message, hint=hint)])


def original(text: str) -> bytes:
    """The bytes of a file that was read as UTF-8, or else as Latin-1."""
    try:
        content = text.encode("latin-1")
        content.decode("utf-8")
    except UnicodeEncodeError:
        return text.encode("utf-8")
    except UnicodeDecodeError:
        return content
    return text.encode("utf-8")
