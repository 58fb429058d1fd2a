"""Files in OpenCRG: the heights of a road along its reference line, with the file's options and modifiers."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import atan2, cos, isnan, nan, sin
from typing import Any, Never

import numpy as np
from numpy.typing import NDArray

from cutjoint.methods import join_or
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.model.text import UNSIGNED, is_number

_Array = NDArray[np.float64]
#: The formats of the data: bytes of a number of binary ones, characters of one of text.
_BINARY, _TEXT = {"KRBI": ">f4", "KDBI": ">f8"}, {"LRFI": 10, "LDFI": 20}
#: The options that change a road, with their defaults, and how those begin that are of checks, messages and searches.
_OPTIONS = {
    "border_mode_u": 2.0, "border_mode_v": 2.0, "border_offset_u": 0.0, "border_offset_v": 0.0, "border_smooth_ubeg": 0.0,
    "border_smooth_uend": 0.0, "refline_continuation": 0.0,
}  # fmt: skip
_BORDERS = ("border_mode_u", "border_mode_v", "border_offset_u", "border_offset_v")
_NEUTRAL = ("check_", "refline_search_", "warn_", "log_")
_SCALES = ("scale_z_grid", "scale_slope", "scale_banking", "scale_length", "scale_width", "scale_curvature")
_SHIFTS = ("refline_offset_x", "refline_offset_y", "refline_offset_z", "refline_offset_phi", "refline_rotcenter_x", "refline_rotcenter_y")
_POINT = (
    *(f"refpoint_{axis}{part}" for axis in "uv" for part in ("", "_fraction", "_offset")),
    *(f"refpoint_{target}" for target in ("x", "y", "z", "phi")),
)
_SETTING = re.compile(rf"([a-z_]\w*)\s*=\s*([-+]?{UNSIGNED})(?:\s.*)?", re.IGNORECASE | re.ASCII)
_SAME = 1e-8  #: the share of its length by which a line may deviate from that of x; for a road of 10 km, 0.1 mm
#: The largest number of a header and of the data; the least distance of cross sections and of long ones, m.
_LARGEST, _LEAST = 1e9, 1e-6
_CLOSE = 1e-4  #: the largest distance between the ends of a closed line, m, as the format's ``check_tol`` has it


@dataclass(frozen=True)
class _Strip:
    """Places x, y, heights and banking of cross sections (n,), ``step`` apart, and on it heights (n, m) at places ``v``, m."""

    step: float
    v: _Array
    x: _Array
    y: _Array
    z: _Array
    banking: _Array
    grid: _Array

    def at(self, u: float, v: float) -> tuple[float, float, float, float]:
        """Position, heading and height at a distance along the line and a distance to its left; beyond the edges the height stays."""
        k = int(np.clip(np.floor(u / self.step), 0, len(self.x) - 2))
        cosine, sine, length, skew, spread = cross_sections(self.x, self.y)[k]
        t = u / self.step - k
        if not 0 <= t <= 1:
            skew, spread, length = 0.0, 0.0, self.step
            k, t = (k, t) if t < 0 else (k + 1, t - 1)
        along = t * (length + spread * v) + skew * v
        across = [np.interp(v, self.v, row) for row in self.heights()]
        x, y = float(self.x[k] + along * cosine - v * sine), float(self.y[k] + along * sine + v * cosine)
        return x, y, atan2(sine, cosine), float(np.interp(u, self.step * np.arange(len(self.x)), across))

    def heights(self) -> _Array:
        """All heights, (n, m)."""
        return self.grid + self.z[:, None] + self.banking[:, None] * self.v

    def moved(self, rotation: float, about: tuple[float, float], to: tuple[float, float, float]) -> "_Strip":
        """The strip rotated about a place, which is then displaced and raised."""
        x, y = self.x - about[0], self.y - about[1]
        c, s = cos(rotation), sin(rotation)
        return replace(self, x=to[0] + c * x - s * y, y=to[1] + s * x + c * y, z=self.z + to[2])


@dataclass
class OpenCrg:
    """A file in OpenCRG with a straight reference line, for an ``element``: its heights along x and y.
    ``settings`` are the keywords of the blocks, with their lines, ``channels`` name, unit and line of the data's columns."""

    text: str
    file: str
    element: str
    settings: dict[str, dict[str, tuple[float, int]]] = field(default_factory=dict)
    channels: list[tuple[str, str, int]] = field(default_factory=list)
    line_u: dict[str, float] = field(default_factory=dict)
    form: str = ""

    def surface(self, bilinear: bool) -> dict[str, Any]:
        """The entries of a road's surface: a table of heights over x and y, or cross sections along a line.
        Raises ModelError: the file is none, or a part of it is not heeded; the message names it."""
        data = self._data(self._header())
        if not (np.isnan(data) | (np.abs(data) <= _LARGEST)).all():
            self._fail("the data has numbers that are not finite, or very large", "the file is damaged")
        places = {name.removeprefix("reference line "): column for column, (name, _, _) in enumerate(self.channels)}
        line = {part: data[:, places[part]] if part in places else None for part in ("phi", "slope", "banking")}
        columns, v = self._sections()
        u, z = self._along(len(data)), data[:, columns]
        if len(u) < 2:
            self._fail("the file has less than two cross sections", "a road needs two or more")
        self._check_settings()
        strip = self._moved(self._scaled(self._strip(u, v, z, line)), u[0])
        options = {key: self._value("ROAD_CRG_OPTS", key, value) for key, value in _OPTIONS.items()}
        is_along_x = np.ptp(strip.y) <= _SAME * np.ptp(strip.x) and strip.x[-1] > strip.x[0]
        if is_along_x and options == _OPTIONS and np.ptp(np.diff(strip.v)) <= _SAME * np.ptp(strip.v):
            x, y = strip.x[0] + strip.step * np.arange(len(strip.x)), strip.y[0] + strip.v
            return {"table": {"x": tuple(x.tolist()), "y": tuple(y.tolist()), "value": _rows(strip.heights())}}
        if not bilinear:
            changed = next((key for key, value in _OPTIONS.items() if options[key] != value), "")
            what = "uneven places across" if is_along_x else "a line that is not along x"
            what = f"{changed} = {options[changed]:g}" if changed else what
            number = self.settings["ROAD_CRG_OPTS"][changed][1] if changed else 1
            self._fail(f"the file has {what}", "write interpolation: linear, as the format has it", number)
        lists = {"x": strip.x, "y": strip.y, "z": strip.z, "banking": strip.banking, "across": strip.v}
        return {
            "sections": {**{key: tuple(values.tolist()) for key, values in lists.items()}, "value": _rows(strip.grid)},
            "step": strip.step, "closed": self._closed(strip) if options["refline_continuation"] else (0.0, 0.0),
            **{name: (options[f"border_{key}"], options[f"border_{other}"]) for name, key, other in (
                ("border", "mode_u", "mode_v"), ("offset", "offset_u", "offset_v"), ("smooth", "smooth_ubeg", "smooth_uend"))},
        }  # fmt: skip

    # Header

    def _header(self) -> int:
        """Read the blocks; the place in the text where the data begins."""
        block, at, number = "", 0, 0
        while at < len(self.text):
            end = self.text.find("\n", at)
            end = len(self.text) if end < 0 else end
            row, at, number = self.text[at:end].rstrip("\r"), end + 1, number + 1
            if row.startswith("$$$$"):  # with numbers of columns between, too
                return at
            if row.startswith("$"):
                block = "" if block and row[1:2] in ("", " ", "!") else row[1:].split("!")[0].strip().upper()
                self.settings.setdefault(block, {})
            elif block and not row.startswith("*"):
                self._read(block, row.split("!")[0].strip(), number)
        self._fail("the file has no line of $ between its header and its data", "name a file in OpenCRG")

    def _read(self, block: str, row: str, number: int) -> None:
        if block == "ROAD_CRG_FILE":
            self._fail("the data is in another file ($ROAD_CRG_FILE)", "name that file", number)
        if block.startswith("ROAD_CRG") and block != "ROAD_CRG_MPRO":
            found = self.settings[block]
            if (match := _SETTING.fullmatch(row)) is not None:
                if not abs(value := float(match[2])) <= _LARGEST:
                    self._fail(f"{match[1]} = {match[2][:30]} is very large", "no road is", number)
                found[match[1].lower()] = value, number
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
                numbers = [float(part) if is_number(part) else nan for part in parts[2:4]]
                self.line_u = dict(zip(("start", "step"), numbers, strict=False))
                if not all(abs(value) <= _LARGEST for value in numbers):
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
            while len(rows) and np.isnan(rows[-1]).all():  # padding of the last block
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
        return np.array([list(self._numbers(record, size)) for record in records]).reshape(len(lines) // each, width)

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
                if not is_number(match[2]) or abs(float(match[2])) > _LARGEST:
                    self._fail(f"'{name}' has no place", "write long section 1, or long section at v = 0.5", number)
                found.append((float(match[2]), column))
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
        self._require_apart("long_section_v_increment", step)
        first = -step * last / 2 if isnan(right) else right
        return [column for _, column in found], np.array([first + step * i for i in range(last + 1)], dtype=np.float64)

    def _along(self, count: int) -> _Array:
        start = self._value("ROAD_CRG", "reference_line_start_u", self.line_u.get("start", 0.0))
        known = self.settings.get("ROAD_CRG", {})
        step = self._value("ROAD_CRG", "reference_line_increment", self.line_u.get("step", 0.01))
        if "reference_line_increment" not in known and "reference_line_end_u" in known and count > 1:
            step = (known["reference_line_end_u"][0] - start) / (count - 1)
        self._require_apart("reference_line_increment", step)
        return np.array([start + step * i for i in range(count)], dtype=np.float64)

    def _require_apart(self, key: str, step: float) -> None:
        if step < _LEAST:
            number = self.settings.get("ROAD_CRG", {}).get(key, (0.0, 1))[1]
            self._fail(f"{key} is {step:g}", f"write {_LEAST:g} or more", number)

    def _filled(self, z: _Array) -> _Array:
        """Heights in place of those that are missing: of each cross section's last ones, and where modifiers say so the same ones."""
        if not np.isnan(z).any():
            return z
        mode, offset = self._modifier("grid_nan_mode", 2.0), self._modifier("grid_nan_offset", 0.0)
        if mode not in (1, 2):
            self._refuse("ROAD_CRG_MODS", "grid_nan_mode", "write 1 or 2: a road has a height everywhere")
        if mode == 1:
            return np.where(np.isnan(z), offset, z)
        filled = z.copy()
        for row in filled:
            known = np.flatnonzero(~np.isnan(row))
            if not known.size or known[-1] - known[0] + 1 > known.size:
                message = "heights are missing in a cross section, not at its sides alone"
                self._fail(message, "fill them in: programs differ in how they do that")
            row[: known[0]] = row[known[0]] + offset
            row[known[-1] + 1 :] = row[known[-1]] + offset
        return filled

    # Place

    def _modifier(self, key: str, default: float) -> float:
        return self._value("ROAD_CRG_MODS", key, default)

    def _check_settings(self) -> None:
        """Refuse options and modifiers that are not heeded."""
        modifiers = self.settings.get("ROAD_CRG_MODS", {})
        for key in modifiers:
            if key not in (*_SCALES, *_SHIFTS, *_POINT, "grid_nan_mode", "grid_nan_offset"):
                self._refuse("ROAD_CRG_MODS", key)
        for key in ("scale_length", "scale_width"):
            if self._modifier(key, 1.0) <= 0:
                self._refuse("ROAD_CRG_MODS", key, "write a number above zero")
        for key in self.settings.get("ROAD_CRG_OPTS", {}):
            if key not in _OPTIONS and not key.startswith(_NEUTRAL):
                self._refuse("ROAD_CRG_OPTS", key)
        wanted = {"border_mode_u": (1, 2, 3, 4), "border_mode_v": (1, 2, 3, 4), "refline_continuation": (0, 1)}
        for key, values in wanted.items():
            if self._value("ROAD_CRG_OPTS", key, values[1]) not in values:
                self._refuse("ROAD_CRG_OPTS", key, f"write {join_or([str(value) for value in values])}: a road has a height everywhere")

    def _strip(self, u: _Array, v: _Array, z: _Array, line: Mapping[str, _Array | None]) -> _Strip:
        """The road without modifiers but those that fill in heights, which come after the grid's scale."""
        for name, channel in line.items():
            if channel is not None and np.isnan(channel[name != "banking" :]).any():
                self._fail(f"'reference line {name}' is missing in a cross section", "fill it in")
        step = float(u[1] - u[0])
        start = {name: self._value("ROAD_CRG", f"reference_line_start_{name}", 0.0) for name in ("x", "y", "z", "phi", "s", "b")}
        ends = {name: self.settings.get("ROAD_CRG", {}).get(f"reference_line_end_{name}") for name in "xyz"}
        headings = np.full(len(u) - 1, start["phi"]) if line["phi"] is None else line["phi"][1:]
        grades = np.full(len(u) - 1, start["s"]) if line["slope"] is None else line["slope"][1:]
        rises = {"x": np.cos(headings), "y": np.sin(headings), "z": grades}
        places = {name: start[name] + np.concatenate([[0.0], np.cumsum(step * rise)]) for name, rise in rises.items()}
        is_closed = {"x": line["phi"] is not None and None not in (ends["x"], ends["y"]), "z": line["slope"] is not None}
        for name, end in ends.items():  # the mismatch of a channel at the end is distributed over all cross sections
            if end is not None and is_closed["z" if name == "z" else "x"]:
                places[name] = places[name] + np.linspace(0, 1, len(u)) * (end[0] - places[name][-1])
        banks = np.full(len(u), start["b"]) if line["banking"] is None else line["banking"]
        return _Strip(step=step, v=v, banking=banks, grid=self._filled(z * self._modifier("scale_z_grid", 1.0)), **places)

    def _scaled(self, strip: _Strip) -> _Strip:
        slope, banking, length, width, curvature = (self._modifier(key, 1.0) for key in _SCALES[1:])
        x, y = (places[0] + length * (places - places[0]) for places in (strip.x, strip.y))
        if curvature != 1:
            headings = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
            headings = headings[0] + curvature * (headings - headings[0])
            extensions = strip.step * length * np.array([np.cos(headings), np.sin(headings)])
            x, y = (places[0] + np.concatenate([[0.0], np.cumsum(distance)]) for places, distance in zip((x, y), extensions, strict=True))
        z = strip.z[0] + slope * length * (strip.z - strip.z[0])
        return replace(strip, step=strip.step * length, v=strip.v * width, x=x, y=y, z=z, banking=strip.banking * banking)

    def _moved(self, strip: _Strip, begin: float) -> _Strip:
        """The road where modifiers have it, whose line begins at a value of u; without modifiers that is at the origin, along x."""
        modifiers = self.settings.get("ROAD_CRG_MODS", {"refpoint_phi": (0.0, 0)})
        if not any(key in _POINT for key in modifiers):
            about = self._modifier("refline_rotcenter_x", strip.x[0]), self._modifier("refline_rotcenter_y", strip.y[0])
            dx, dy, dz, rotation = (self._modifier(key, 0.0) for key in _SHIFTS[:4])
            return strip.moved(rotation, about, (about[0] + dx, about[1] + dy, dz))
        ends = {"u": (begin, begin + strip.step * (len(strip.x) - 1)), "v": (strip.v[0], strip.v[-1])}
        point = []
        for axis, (first, last) in ends.items():
            share = modifiers.get(f"refpoint_{axis}_fraction")
            place = self._modifier(f"refpoint_{axis}", begin if axis == "u" else 0.0)
            place = place if share is None else first + share[0] * (last - first)
            point.append(float(place) + self._modifier(f"refpoint_{axis}_offset", 0.0))
        x, y, heading, height = strip.at(point[0] - begin, point[1])
        inside = all(first <= place <= last for place, (first, last) in zip(point, ends.values(), strict=True))
        options = {key: self._value("ROAD_CRG_OPTS", key, value) for key, value in _OPTIONS.items()}
        if not inside and any(options[key] != _OPTIONS[key] for key in _BORDERS):
            self._fail(f"the reference point is beyond the road's edges, at u = {point[0]:g}, v = {point[1]:g}", "choose one on the road")
        for key, distance, end in (("ubeg", point[0] - ends["u"][0], 0), ("uend", ends["u"][1] - point[0], -1)):
            if (reach := options[f"border_smooth_{key}"]) > (inner := max(distance, 0.0)):
                height = float(strip.z[end]) + inner / reach * (height - float(strip.z[end]))
        wanted = {name: self._modifier(f"refpoint_{name}", 0.0) for name in ("x", "y", "z", "phi")}
        return strip.moved(wanted["phi"] - heading, (x, y), (wanted["x"], wanted["y"], wanted["z"] - height))

    def _closed(self, strip: _Strip) -> tuple[float, float]:
        """The beginning of a line that closes, and its length, in steps: its ends are extended to meet, or each by half the distance."""
        begin, end = (np.array(ends) for ends in zip(*((places[0], places[-1]) for places in (strip.x, strip.y)), strict=True))
        first, last = cross_sections(strip.x, strip.y)[[0, -1], :2]
        gap, along = begin - end, float(first @ last)
        across = float(first[0] * last[1] - first[1] * last[0])
        extensions = np.array([last @ gap, first @ gap]) / 2
        if abs(across) > _SAME:
            meet = np.array([last[0] * gap[1] - last[1] * gap[0], first[0] * gap[1] - first[1] * gap[0]]) / across
            extensions = np.array([-meet[0], meet[1]]) if meet[0] <= _CLOSE and meet[1] >= -_CLOSE else extensions
        if along < 0.5 or (extensions < -_CLOSE).any():
            self._refuse("ROAD_CRG_OPTS", "refline_continuation", "leave it out: the line's ends do not meet")
        return -float(extensions[0]) / strip.step, len(strip.x) - 1 + float(extensions.sum()) / strip.step

    def _refuse(self, block: str, key: str, hint: str = "leave it out, or apply it and save the road so") -> Never:
        value, number = self.settings.get(block, {}).get(key, (0.0, 1))
        self._fail(f"{key} = {value:g} is not heeded", hint, number)

    def _fail(self, message: str, hint: str, number: int = 1) -> Never:
        raise ModelError([Problem(span=Span(file=self.file, line=number, column=1), element=self.element, message=message, hint=hint)])


def cross_sections(x: _Array, y: _Array) -> _Array:
    """For each place (n,) of a line the piece to the next (n, 5); the last has the last heading.
    The columns are cosine and sine of its heading, its length, the forward offset of the cross section at its begin per metre to the left,
    and the change of that until its end."""
    dx, dy = np.diff(x), np.diff(y)
    length = np.hypot(dx, dy)
    c, s = dx / length, dy / length
    along, across = (np.zeros((2, len(x) - 1)) for _ in range(2))  # of the chord at both ends of a piece, in the piece's axes
    along[:] = 1.0
    for end, here in ((0, slice(1, None)), (1, slice(None, -1))):
        cx, cy = x[2:] - x[:-2], y[2:] - y[:-2]
        along[end, here], across[end, here] = cx * c[here] + cy * s[here], cy * c[here] - cx * s[here]
    skew = -across / along
    pieces = np.column_stack([c, s, length, skew[0], skew[1] - skew[0]])
    return np.concatenate([pieces, [[c[-1], s[-1], length[-1], 0.0, 0.0]]])


def _rows(heights: _Array) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, heights.tolist()))


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
