"""A page in which a simulation runs: the generated code as a module of WebAssembly, and the inputs as keys and sliders."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from shlex import quote
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AliasChoices, BaseModel, Field, FiniteFloat, NonNegativeInt, PositiveInt, ValidationError

from cutjoint.compile.c_export import Standalone, freeze_start_parameters, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.elements.interaction import Wheel
from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.methods import DEFAULT_METHOD
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.quantities import bodies_of
from cutjoint.model.records import Binding, Force, HeightTable, Model, Output, Parameter, RoughSurface, Scene
from cutjoint.model.text import escaped
from cutjoint.package.errors import RunError
from cutjoint.run.inputs import constant_inputs, require_unit
from cutjoint.run.road_field import BAND, LENGTH, ROUGHNESS, STEP, CurvedField, rough_field, surface_of
from cutjoint.run.roads import profile_pieces
from cutjoint.run.run_file import Evaluator, parameter_values
from cutjoint.stepping.load import open_standalone
from cutjoint.stepping.simulation import Simulation
from cutjoint.toolchain.wasm import require_zig
from cutjoint.view.page import Drive
from cutjoint.view.records import Array
from cutjoint.view.sizes import find_sizes, named_visuals

#: The roles of a car's inputs, by words in their names.
_ROLES: Mapping[str, re.Pattern[str]] = {
    "steer": re.compile(r"steer|rack"), "throttle": re.compile(r"throttle|accel|gas|drive|engine"), "brake": re.compile(r"brak"),
}  # fmt: skip

#: The keys for a car's roles and for further inputs in order, by codes of the UI Events standard: decrease and increase.
_CAR_KEYS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "steer": (("ArrowLeft", "KeyA"), ("ArrowRight", "KeyD")), "throttle": ((), ("ArrowUp", "KeyW")), "brake": ((), ("ArrowDown", "KeyS")),
}  # fmt: skip
_PAIRS = (("ArrowLeft", "ArrowRight"), ("ArrowDown", "ArrowUp"), ("KeyA", "KeyD"), ("KeyS", "KeyW"), ("KeyJ", "KeyL"), ("KeyK", "KeyI"))

#: The reach of an input from its value at rest: of lengths as a share of the mechanism's extent, of moments of its weight at one metre, of
#: forces its weight, else in SI units.
_OF_EXTENT, _OF_MOMENT = 0.1, 0.1
_REACH = {"rad": 0.5, "m/s": 10.0, "rad/s": 10.0}
#: Moments that drive a wheel of a car, and that brake it, as a share of the weight at one metre.
_MOMENTS = {"throttle": 0.03, "brake": 0.1}

#: Samples of the record per second, and the smallest number of wheels of a car.
_ROWS, _WHEELS = 60.0, 3

#: The outputs that each wheel has in a page.
_OF_WHEELS = ("Fx", "Fy", "Fz", "road_friction")


@dataclass(frozen=True, kw_only=True)
class LaidRoad:
    """A road that a page lays without compiling: ``lines`` in the order of x, each by its start, height and slope.
    Its waves are of a ``roughness`` (m^3), as `road_field.rough_field` has them."""

    lines: Sequence[tuple[float, float, float]] = ((-1.0, 0.0, 0.0),)
    roughness: float = 0.0
    width: float = 16.0
    band: tuple[float, float] = BAND
    step: float = STEP
    length: int = LENGTH
    level: float = 0.0

    def heights(self, seed: int) -> tuple[Array, Array]:
        """The grid's first place along x and y, the distances of places (4,), and heights (along x, along y), m; empty without waves."""
        if not self.roughness:
            return np.zeros(4), np.zeros((0, 0))
        field = rough_field(self.roughness, seed, self.width, band=self.band, step=self.step, length=self.length, level=self.level)
        return np.array([*field.start, *field.step]), np.ascontiguousarray(field.heights)


def _steps() -> Sequence[tuple[float, float, float]]:
    """Plates of 3, 5 and 8 cm alternately, each 20 m long, with a short ramp up and a longer one down."""
    lines = [(-1.0, 0.0, 0.0)]
    for i in range(127):
        x, rise = 25.0 + 20 * i, (0.03, 0.05, 0.08)[i % 3]
        lines += [(x, 0.0, rise / 0.25), (x + 0.25, rise, 0.0), (x + 4, rise, -rise / 2), (x + 6, 0.0, 0.0)]
    return tuple(lines)


_HILLS = LaidRoad(roughness=0.8, width=480.0, band=(0.0039, 0.016), step=2.0, length=256, level=12.0)

#: The roads of pages, by name.
ROADS: Mapping[str, LaidRoad] = {
    "flat": LaidRoad(), "hills": _HILLS, "hills with steps": replace(_HILLS, lines=_steps()), "steps": LaidRoad(lines=_steps()),
    **{f"ISO 8608 {grade}": LaidRoad(roughness=roughness) for grade, roughness in ROUGHNESS.items()},
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Ends:
    """An option about an input or parameter: its ``name``, and its values at the full push to either side, None if not given."""

    name: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, kw_only=True)
class Replay:
    """The table of a drive: ``rows`` (rows, 1 + outputs) with the time first, and the ``units`` of columns by name."""

    units: Mapping[str, str]
    rows: Array


def make_drive(
    model: Model, scene: Scene, parameters: Mapping[str, float], *, method: str = DEFAULT_METHOD, dt: float | None = None,
    roles: Mapping[str, Ends] | None = None, ranges: Sequence[Ends] = (), more: Sequence[str] = (),
) -> Drive:  # fmt: skip
    """The simulation of a scene for a page, with ``parameters`` (SI units) changed and steps of ``dt`` (s), by default the scene's.

    ``roles`` have the input or parameter of "steer", "throttle" and "brake", ``ranges`` the ends of others.  Ends follow from units, weight
    and extent where nothing says them.  A replay has ``more`` words of its command.

    Raises:
        RunError: a name is none of an input or a parameter, or of one of the start alone, or a unit is another.
        MissingToolsError: there is no compiler for WebAssembly.
        others: as of `pipeline.generate`, `make_standalone` and `Standalone.build_module`.
    """
    model = freeze_start_parameters(model, scene)
    for name in parameters:
        if name in model.frozen:
            raise RunError(f"{model.span.file}: '{name}' changes the start only, which is fixed in a page; change it in the file")
    rests = {p.name: p.value for p in input_parameters(model)}
    values = {**parameter_values(model, parameters), **rests, **constant_inputs(model, parameters)}
    numbers = Evaluator(model, parameter_values(model, parameters))
    masses = {body.name: numbers(body.mass) for body in model.bodies}
    wheels = list(_wheels(model))
    is_car = len(wheels) >= _WHEELS
    weight = 9.81 * sum(masses.values())
    axes = _Axes(
        model=model, values=values, weight=weight, extent=find_sizes(model, scene, numbers).extent,
        roles={**(_find_roles(model) if is_car else {}), **(roles or {})}, ranges={each.name: each for each in ranges},
    ).find()  # fmt: skip
    require_zig()
    standalone = simulated(model, scene, method)
    step, elements, equations = standalone.settings.step if dt is None else dt, bodies_of(model), standalone.parts.stepped
    facts = {
        "dt": step, "every": max(1, round(max(1 / _ROWS, scene.output_step) / step)), "car": is_car, "axes": axes,
        "body": max(masses, key=lambda name: masses[name], default=""), "initialValues": {k: float(x) for k, x in parameters.items()},
        "replay": " ".join(["cutjoint drive", quote(Path(model.span.file).name), "--scene", quote(scene.name), *map(quote, more)]),
        "of": {o.column: list(elements.get(o.element, ())) for o in equations.outputs},
        "ground": _ground(scene) if equations.roads else None, "wheels": [_wheel(*wheel, numbers, equations.outputs) for wheel in wheels],
        "roads": {name: vars(road) for name, road in ROADS.items()} if standalone.lays_roads else {},
    }  # fmt: skip
    return Drive(module=standalone.build_module(), facts=facts)


def simulated(model: Model, scene: Scene, method: str) -> Standalone:
    """The folder of a scene whose outputs have those of wheels too, with a road that may have a surface."""
    more = [
        Output(element=wheel.name, quantity=quantity, span=wheel.span)
        for wheel, _ in _wheels(model) for quantity in _OF_WHEELS if quantity in wheel.element.quantities
    ]  # fmt: skip
    known = {output.column for output in scene.outputs}
    outputs = (*scene.outputs, *(output for output in more if output.column not in known))
    if scene.road.contact == "point" and scene.road.surface is None:
        level = HeightTable(start=(0.0, 0.0), step=(1.0, 1.0), heights=((0.0, 0.0),) * 2, bilinear=False, span=scene.span)
        scene = replace(scene, road=replace(scene.road, surface=level))
    standalone = make_standalone(generate(model, scene, outputs, method=method, poses=True), equal_steps=True)
    equations = standalone.parts.stepped  # wheels may meet other roads as points, not as rigid discs, which meet an envelope
    return replace(standalone, lays_roads=bool(equations.roads) and equations.scene.road.contact == "point")


def _wheels(model: Model) -> Iterator[tuple[Force, Wheel]]:
    return ((force, visual) for force in model.forces for _, visual in named_visuals(force) if isinstance(visual, Wheel))


def _wheel(wheel: Force, visual: Wheel, numbers: Evaluator, outputs: Sequence[Output]) -> dict[str, Any]:
    """The position of a wheel in the design position, m, and the indices of its outputs."""
    of = {o.quantity: i for i, o in enumerate(outputs) if o.element == wheel.name}
    at = [numbers(x) for x in visual.at.of(wheel)]
    return {"name": wheel.name, "at": at, "of": {q: of[q] for q in _OF_WHEELS if q in of}}


def _ground(scene: Scene) -> dict[str, Any]:
    """The scene's own road as a page draws it: pieces of both sides, heights, and patches with another friction."""
    road = scene.road
    sides = {side: [list(vars(p).values()) for p in profile_pieces(getattr(road, side), road.start)] for side in ("left", "right")}
    surface, rough = surface_of(road), road.surface
    patches = [[*patch.x, *patch.y, patch.friction] for patch in road.patches]
    if isinstance(rough, RoughSurface):
        waves = vars(LaidRoad(roughness=ROUGHNESS[rough.grade], width=rough.width))
        return {**sides, "waves": waves, "seed": rough.seed, "patches": patches}
    field = surface.field if surface else None
    field = field.drawn() if isinstance(field, CurvedField) else field
    return {**sides, "field": field.described() if field else None, "patches": patches}


def replay_drive(model: Model, scene: Scene, path: Path, *, method: str = DEFAULT_METHOD) -> Replay:
    """Take the steps of a drive that a page has saved (JSON) once more, by code for this machine that has the same bits.

    Raises:
        RunError: the file is no drive, or one of another model, scene or version.
        SimulationError: the drive ended with this fault.
        ToolchainError: the C++ compiler failed.
    """
    model = freeze_start_parameters(model, scene)
    standalone = simulated(model, scene, method)
    drive = _read_drive(path)
    if drive.mark != standalone.mark:
        of = escaped(f"'{drive.model}', {drive.scene}")
        raise RunError(f"--replay {path}: a drive of {of}, in another version; drive the page of this one")
    moves = {p.name: p for p in (*input_parameters(model), *tunable_parameters(model))}
    for name in (*drive.initial_values, *(name for _, name, _ in drive.events)):
        if name not in moves:
            raise RunError(f"--replay {path}: {_unknown(model, escaped(name), moves)}")
    if drive.road and (drive.road not in ROADS or not standalone.lays_roads):
        raise RunError(f"--replay {path}: no road '{escaped(drive.road)}'; it has: {', '.join(ROADS)}")
    sim = open_standalone(standalone, standalone.build_matching_library(), standalone.files, lanes=None)
    if drive.road:
        lines, (grid, heights) = np.array(ROADS[drive.road].lines), ROADS[drive.road].heights(drive.seed)
        sim.library.set_road(lines.ctypes.data, len(lines), grid.ctypes.data, heights.ctypes.data, *heights.shape)
    for name, value in drive.initial_values.items():
        _set_value(sim, name, value)
    sim.reset(dt=drive.dt)
    events, rows = iter([*drive.events, (inf, "", 0.0)]), [[sim.time, *sim.outputs.array]]
    at, name, value = next(events)
    for step in range(drive.steps):
        while at <= step:
            _set_value(sim, name, value)
            at, name, value = next(events)
        sim.step()
        if (step + 1) % drive.every == 0:
            rows.append([sim.time, *sim.outputs.array])
    units = {"t": "s", **{c.name: c.unit for c in standalone.parts.stepped.columns}}
    return Replay(units=units, rows=np.array(rows))


def _set_value(sim: Simulation, name: str, value: float) -> None:
    if name in sim.inputs:
        sim.set_input(name, value)
    else:
        sim.parameters[name] = value


class _Saved(BaseModel, extra="forbid", strict=True):
    """A drive as a page saves it: before the step of an event an input or a parameter has another value.
    ``every`` so many steps are a row.  The ``road`` is one of `ROADS`, "" for the scene's."""

    cutjoint: Literal["drive"]
    mark: str
    model: str
    scene: str
    dt: Annotated[FiniteFloat, Field(gt=0)]
    initial_values: dict[str, FiniteFloat] = Field(validation_alias=AliasChoices("initial_values", "given"))
    road: str = ""
    seed: Annotated[NonNegativeInt, Field(lt=2**53)] = 1
    steps: NonNegativeInt
    every: PositiveInt
    events: list[tuple[NonNegativeInt, str, FiniteFloat]]


def _read_drive(path: Path) -> _Saved:
    try:
        return _Saved.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        words = f"save one in a page of cutjoint drive as 'drive (JSON)' ({escaped(where)}: {first['msg']})"
        raise RunError(f"--replay {path}: no drive; {words}") from None


def _find_roles(model: Model) -> dict[str, Ends]:
    """The roles of a car's inputs, by their names: the first that fits has each."""
    found: dict[str, Ends] = {}
    for parameter in input_parameters(model):
        role = next((role for role, pattern in _ROLES.items() if pattern.search(parameter.name.lower())), None)
        if role is not None and role not in found:
            found[role] = Ends(name=parameter.name)
    return found


@dataclass(frozen=True, kw_only=True)
class _Axes:
    """The inputs and tunable parameters of a page, and how far each moves."""

    model: Model
    values: Mapping[str, float]
    weight: float
    extent: float
    roles: Mapping[str, Ends]
    ranges: Mapping[str, Ends]

    def find(self) -> list[dict[str, Any]]:
        """A description of each for the page; those with a role come first. Raises RunError: an option names nothing that moves."""
        known = {p.name: p for p in (*input_parameters(self.model), *tunable_parameters(self.model))}
        for ends in (*self.roles.values(), *self.ranges.values()):
            if ends.name not in known:
                raise RunError(_unknown(self.model, ends.name, known))
            for value in (ends.low, ends.high):
                if value is not None:
                    require_unit(known[ends.name], value)
        by_name = {ends.name: role for role, ends in self.roles.items()}
        keys = iter([pair for pair in _PAIRS if not self.roles or pair not in _PAIRS[:4]])
        first = sorted(known, key=lambda name: list(self.roles).index(by_name[name]) if name in by_name else len(self.roles))
        return [self._axis(known[name], by_name.get(name, ""), keys) for name in first]

    def _axis(self, parameter: Parameter, role: str, keys: Iterator[tuple[str, str]]) -> dict[str, Any]:
        is_input = parameter.binding is Binding.INPUT
        pair = next(keys, None) if is_input and not role else None
        minus, plus = _CAR_KEYS[role] if role else ((), ()) if pair is None else ((pair[0],), (pair[1],))
        low, high = self._ends(parameter, role)
        return {
            "name": parameter.name, "unit": parameter.unit, "kind": "input" if is_input else "parameter", "role": role,
            "rest": float(self.values[parameter.name]), "low": low, "high": high, "minus": minus, "plus": plus,
        }  # fmt: skip

    def _ends(self, parameter: Parameter, role: str) -> tuple[float, float]:
        rest = float(self.values[parameter.name])
        said = self.ranges.get(parameter.name) or self.roles.get(role) or Ends(name="")
        reach = self._reach(parameter, role, rest)
        low = rest if role in _MOMENTS else rest + reach if role == "steer" else rest - reach  # to the left is up, about z
        high = rest - reach if role == "steer" else rest + reach
        return float(low if said.low is None else said.low), float(high if said.high is None else said.high)

    def _reach(self, parameter: Parameter, role: str, rest: float) -> float:
        unit = parameter.unit
        if role in _MOMENTS and unit == "N*m":
            return _MOMENTS[role] * self.weight
        if rest and not role:
            return abs(rest) / 2
        reach = {"m": _OF_EXTENT * self.extent, "N": self.weight, "N*m": _OF_MOMENT * self.weight, **_REACH}
        return reach.get(unit, 0.5 if role == "steer" else 1.0)


def _unknown(model: Model, name: str, known: Mapping[str, Parameter]) -> str:
    hint = nearest(name, known, "it has") or "it has none"
    return f"{model.span.file}: model '{model.name}' has no input or tunable parameter '{name}'; {hint.replace('it has:', 'it has')}"
