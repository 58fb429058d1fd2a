"""modelDescription.xml and buildDescription.xml.

Units of variables are as FMI has them: exponents of the base units, the radian among these, and degrees to display.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from cutjoint.emit.source import environment
from cutjoint.export.fmu.variables import Interface
from cutjoint.model.expressions.units import measure
from cutjoint.package.locations import __version__

#: The purposes of an FMU, by the names of `cutjoint export --kind`: co-simulation, model exchange.
KINDS: Mapping[str, tuple[bool, bool]] = {"cs": (True, False), "me": (False, True), "both": (True, True)}
#: The names in FMI 3 of the abilities of co-simulation that stops at events.
_STOPS = ("hasEventMode", "mightReturnEarlyFromDoStep", "providesIntermediateUpdate", "canReturnEarlyAfterIntermediateUpdate")
#: The tags of the structure in FMI 2, whose references count from 1, and 3: of outputs, derivatives and unknowns of the start.
_GROUPS = {2: ("Outputs", "Derivatives", "InitialUnknowns"), 3: ("Output", "ContinuousStateDerivative", "InitialUnknown")}
#: As FMI names and orders them; the radian comes last.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_FACTOR = re.compile(r"(?P<sign>/?)\s*(?P<name>[A-Za-z]+|1)(?:(?:\^|\*\*)(?P<power>-?[0-9]+))?")
_RADIANS = ("rad", "radian", "radians")
#: Names of angles that an exponent of the radian stands for.
_ANGLES = (*_RADIANS, "mrad", "deg", "degree", "degrees")


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The subject of the descriptions.

    It has the names of the model and the scene, the end of its run and the distance of its rows (s), the token and the files of the code,
    one of `KINDS`, whether co-simulation has event mode, early return and intermediate updates, and its steps in words, "" without
    co-simulation.
    """

    name: str
    scene: str
    end: float
    output_step: float
    token: str
    sources: Sequence[str]
    kind: str
    stops_at_events: bool
    steps: str


def write_description(subject: Subject, interface: Interface, version: int) -> str:
    """modelDescription.xml for FMI ``version``, 2 or 3."""
    variables, (simulates, exchanges) = interface.variables, KINDS[subject.kind]
    units = {unit.name: unit for v in variables if (unit := describe_unit(v.unit)) is not None}
    words = (f"Model {subject.name}", f"scene {subject.scene}", subject.steps)
    return environment().get_template("fmu/modelDescription.xml.jinja").render(
        fmi=version, s=subject, interface=interface, variables=variables, units=units.values(), describe_unit=describe_unit,
        described=", ".join(filter(None, words)), simulates=simulates, exchanges=exchanges, version=__version__,
        structure=list(_structure(interface, version)), stops=dict.fromkeys(_STOPS if subject.stops_at_events else (), "true"),
    )  # fmt: skip


def write_build_description(subject: Subject) -> str:
    """sources/buildDescription.xml of FMI 3."""
    return environment().get_template("fmu/buildDescription.xml.jinja").render(s=subject)


def _structure(interface: Interface, version: int) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Outputs, derivatives and unknowns of the start, by their tags, each with its dependencies."""
    numbered, first = list(enumerate(interface.variables)), int(version == 2)
    found = [(i, v) for i, v in numbered if v.causality == "output"]
    derived = [(i, v) for i, v in numbered if v.derives is not None]
    states = [(i, v) for i, v in numbered if i in {v.derives for _, v in derived}]
    for tag, group in zip(_GROUPS[version], (found, derived, (*found, *states, *derived)), strict=True):
        known = ((i, v.dependencies if tag == _GROUPS[version][2] else v.following) for i, v in group)
        yield tag, [(i + first, " ".join(str(d + first) for d in others)) for i, others in known]


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit: exponents of the base units, if whole, and its factor; with radians also the unit to display and its factor."""

    name: str
    exponents: Mapping[str, int]
    factor: float
    display: tuple[str, float] | None

    @property
    def display_of_angle(self) -> str | None:
        """The unit to display an angle or its rate in; None for others."""
        return self.display[0] if self.display and set(self.exponents) <= {"rad", "s"} else None


def describe_unit(name: str) -> Unit | None:
    """The unit of that name, in one spelling; None for plain numbers."""
    if name in ("", "1"):
        return None
    name = re.sub(r"\s*([*/])\s*", r"\1", name.replace("**", "^").replace("Nms", "N*m*s").replace("Nm", "N*m")).replace(" ", "*")
    found, turns = measure(1.0, name), _power_of(name, _ANGLES)
    dimension = found.dimension
    powers = dict(zip(BASE_UNITS, (*dimension.exponents, Fraction(turns)), strict=True))
    whole = all(power.denominator == 1 for power in powers.values())
    shown = _power_of(name, _RADIANS)
    display = (re.sub(r"\brad\b", "deg", name), math.degrees(1.0) ** shown) if shown else None
    exponents = {base: int(power) for base, power in powers.items() if power} if whole else {}
    return Unit(name=name, exponents=exponents, factor=found.value, display=display)


def _power_of(name: str, angles: Sequence[str]) -> int:
    found = (m for m in _FACTOR.finditer(name) if m["name"] in angles)
    return sum(int(m["power"] or 1) * (-1 if m["sign"] else 1) for m in found)
