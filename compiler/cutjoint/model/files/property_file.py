"""Property files of tyres (``.tir``): ``KEY = value`` in sections, in the units that the file says.

Comments begin with ``$`` or ``!``.  Texts stand in quotes.  Numbers come in SI.  Coefficients have no units.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.model.errors import ModelError, Problem, nearest
from cutjoint.model.records import Span
from cutjoint.model.text import is_number

_MAX_LINES, _MAX_REPORTED = 10_000, 20  #: lines of a file, and problems of one that are reported

#: The keywords of the section UNITS, with their sizes in SI, by what they measure.
_UNITS: Mapping[str, Mapping[str, float]] = {
    "LENGTH": {
        **dict.fromkeys(("meter", "metre", "m"), 1.0), **dict.fromkeys(("millimeter", "millimetre", "mm"), 1e-3),
        **dict.fromkeys(("centimeter", "centimetre", "cm"), 1e-2), **dict.fromkeys(("kilometer", "km"), 1e3), "inch": 0.0254,
        **dict.fromkeys(("foot", "ft"), 0.3048),
    },
    "FORCE": {
        **dict.fromkeys(("newton", "n"), 1.0), **dict.fromkeys(("kilonewton", "knewton", "kn"), 1e3),
        **dict.fromkeys(("pound_force", "lbf"), 4.4482216152605), **dict.fromkeys(("kilogram_force", "kgf"), 9.80665),
    },
    "ANGLE": {**dict.fromkeys(("radians", "radian", "rad"), 1.0), **dict.fromkeys(("degrees", "degree", "deg"), math.pi / 180)},
    "MASS": {
        **dict.fromkeys(("kg", "kilogram"), 1.0), **dict.fromkeys(("gram", "g"), 1e-3), **dict.fromkeys(("tonne", "megagram"), 1e3),
        **dict.fromkeys(("pound_mass", "lbm"), 0.45359237), "slug": 14.593902937206364,
    },
    "TIME": {
        **dict.fromkeys(("second", "sec", "s"), 1.0), **dict.fromkeys(("millisecond", "ms"), 1e-3),
        **dict.fromkeys(("minute", "min"), 60.0),
    },
    "PRESSURE": {
        **dict.fromkeys(("pascal", "pa"), 1.0), **dict.fromkeys(("kilopascal", "kpascal", "kpa"), 1e3), "bar": 1e5,
        **dict.fromkeys(("megapascal", "mpa"), 1e6), "psi": 6894.757293168361,
    },
}  # fmt: skip

#: The powers of units in the keys that have any: keys, and units with their powers.
_DIMENSIONS: Mapping[str, tuple[tuple[str, int], ...]] = {
    **dict.fromkeys(("UNLOADED_RADIUS", "WIDTH", "RIM_RADIUS", "RIM_WIDTH", "BOTTOM_OFFST"), (("LENGTH", 1),)),
    **dict.fromkeys(("LONGVL", "VXLOW"), (("LENGTH", 1), ("TIME", -1))),
    **dict.fromkeys(("FNOMIN", "FZMIN", "FZMAX"), (("FORCE", 1),)),
    **dict.fromkeys(
        ("VERTICAL_STIFFNESS", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS", "BOTTOM_STIFF"), (("FORCE", 1), ("LENGTH", -1))
    ),
    "VERTICAL_DAMPING": (("FORCE", 1), ("LENGTH", -1), ("TIME", 1)),
    "YAW_STIFFNESS": (("FORCE", 1), ("LENGTH", 1), ("ANGLE", -1)),
    **dict.fromkeys(("INFLPRES", "NOMPRES", "PRESMIN", "PRESMAX"), (("PRESSURE", 1),)),
    **dict.fromkeys(("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX"), (("ANGLE", 1),)),
    **dict.fromkeys(("MASS", "BELT_MASS"), (("MASS", 1),)),
    **dict.fromkeys(("IXX", "IYY", "IZZ", "BELT_IXX", "BELT_IYY", "BELT_IZZ"), (("MASS", 1), ("LENGTH", 2))),
    "GRAVITY": (("LENGTH", 1), ("TIME", -2)),
}  # fmt: skip

#: Keys that describe a tyre, or the range of its measurements, and change no force here.
STANDARD = frozenset(_DIMENSIONS) | frozenset((
    "FILE_TYPE", "FILE_VERSION", "FILE_FORMAT", "PROPERTY_FILE_FORMAT", "FITTYP", "TYRESIDE", "ASPECT_RATIO", "FUNCTION_NAME", "USE_MODE",
    "N_TIRE_STATES", "KPUMIN", "KPUMAX", "MC_CONTOUR_A", "MC_CONTOUR_B", "BELT_GRAVITY", "ROAD_INCREMENT", "ROAD_DIRECTION", "HMAX_LOCAL",
    "PCMZ1", "LCZ", "LGYR", "LMP",
))  # fmt: skip

#: Coefficients of the format, which are zero where a file does not have them, but for those by which forces are divided; other defaults.
_COEFFICIENT = re.compile(r"[PQRS][A-Z]{2}\d{1,2}|[BDF]REFF")
_DIVISORS = ("PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2", "PTX1", "PTY1", "PTY2")
_DEFAULTS = {"LONGVL": 16.7}
MASSES = frozenset(("MASS", "IXX", "IYY"))  #: keys of the wheel, which many files leave to who uses them

#: Texts that count as numbers: a tyre of the right side is the image of one of the left side.
_WORDS: Mapping[str, Mapping[str, int]] = {"TYRESIDE": {"LEFT": 1, "RIGHT": -1, "SYMMETRIC": 1, "UNKNOWN": 1}}
_IMPLIED = {"PAC2002": 6.0}  #: the kind of tyre that the files of a program have without saying it

_LINE = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.*?)\s*", re.ASCII)
_COMMENT = re.compile(r"[$!]")
_FREE_SECTIONS = ("SHAPE", "DEFLECTION_LOAD_CURVE", "BOTTOMING_CURVE")


def default_of(key: str) -> float | None:
    """The number that a key has in the format where a file does not say it, None if it has to."""
    return 0.0 if _COEFFICIENT.fullmatch(key) and key not in _DIVISORS else _DEFAULTS.get(key)


@dataclass(frozen=True)
class Properties:
    """Numbers by keys, in SI; ``places`` of the values and of the keys."""

    values: Mapping[str, float]
    places: Mapping[str, tuple[Span, Span]]


def read_properties(text: str, file: str, element: str) -> Properties:
    """Read a property file for an ``element``. Raises ModelError: all that is wrong with it."""
    reading = _Reading(file, element)
    reading.read(text)
    found = reading.properties()
    if reading.problems:
        raise ModelError(reading.problems[:_MAX_REPORTED])
    return found


class _Reading:
    """The steps of reading one file: ``found`` has of each key its text, with the places of key and value."""

    def __init__(self, file: str, element: str) -> None:
        self.file, self.element = file, element
        self.problems: list[Problem] = []
        self.found: dict[str, tuple[str, Span, Span]] = {}
        self.units: dict[str, float] = {}

    def _fail(self, span: Span, message: str, hint: str) -> None:
        self.problems.append(Problem(span=span, element=self.element, message=message, hint=hint))

    def read(self, text: str) -> None:
        """Note the keys of all lines."""
        section = ""
        for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), start=1):
            if number > _MAX_LINES:
                self._fail(self._span(number, 1), f"the file has more than {_MAX_LINES} lines", "leave some out")
                return
            content = _COMMENT.split(line, 1)[0].strip()
            if content.startswith("["):
                section = content.strip("[]").strip().upper()
            elif content and section not in _FREE_SECTIONS and not content.startswith(("{", "(")):
                self._entry(line, content, number, section)

    def _span(self, line: int, column: int) -> Span:
        return Span(file=self.file, line=line, column=column)

    def _entry(self, line: str, content: str, number: int, section: str) -> None:
        match = _LINE.fullmatch(content)
        if match is None:
            indent = len(line) - len(line.lstrip())
            self._fail(self._span(number, 1 + indent), "this is no KEY = value", "comments begin with $ or !")
            return
        key, value = match[1].upper(), match[2]
        places = self._span(number, 1 + line.index(match[1])), self._span(number, 1 + line.index("="))
        if section == "UNITS":
            self._unit(key, value, places[0])
        elif key in self.found:
            self._fail(places[0], f"'{key}' is given twice, first in line {self.found[key][1].line}", "keep one of them")
        else:
            self.found[key] = (value, *places)

    def _unit(self, key: str, value: str, span: Span) -> None:
        words = _UNITS.get(key, {})
        word = _unquoted(value).lower()
        if word in words:
            self.units[key] = words[word]
        elif words:
            self._fail(span, f"unknown unit '{word}' of {key}", nearest(word, list(words), "units"))

    def properties(self) -> Properties:
        """The numbers of the keys."""
        values: dict[str, float] = {}
        for key, (text, span, _) in self.found.items():
            value = self._number(key, text, span)
            if value is not None:
                values[key] = value
        places = {key: self.found[key][1:] for key in values}
        implied = self.found.get("PROPERTY_FILE_FORMAT")
        if "FITTYP" not in values and implied is not None and (kind := _IMPLIED.get(_unquoted(implied[0]).upper())):
            values["FITTYP"], places["FITTYP"] = kind, implied[1:]
        return Properties(values, places)

    def _number(self, key: str, text: str, span: Span) -> float | None:
        """The number of a key in SI, None of a text."""
        if key in _WORDS:
            return _WORDS[key].get(_unquoted(text).upper())
        if text[:1] in "'\"":  # blank too: the file does not say it
            return None
        plain = text.replace("d", "e").replace("D", "e")
        value = float(plain) if is_number(plain) else math.nan
        if not math.isfinite(value):
            self._fail(span, f"{key}: '{text}' is no number", "write a decimal number, a text in quotes")
            return None
        if key not in _DIMENSIONS:
            return value
        return value * math.prod(self.units.get(unit, 1.0) ** power for unit, power in _DIMENSIONS[key])


def _unquoted(text: str) -> str:
    return text.strip("'\"").strip()
