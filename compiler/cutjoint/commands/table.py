"""The table of options: the command line, docs/reference/command-line.md and the checks of values follow from it."""

from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, cast

import click

from cutjoint.commands.options import reports_errors
from cutjoint.methods import (
    AUTO,
    CLOSURES,
    DEFAULT_INTEGRATOR,
    DEFAULT_PRECISION,
    INTEGRATORS,
    METHODS,
    PRECISIONS,
    SOLVERS,
    Events,
    Implementation,
    Loops,
    join_and,
    join_or,
    linearised_methods,
    names_of,
)
from cutjoint.model.ranges import LENGTHS, PLACES, RANGES, TIMES, WHOLE, fault_of, fault_of_setting
from cutjoint.model.text import is_number, is_whole
from cutjoint.package.extensions import EXPORTERS, ExtensionPoint
from cutjoint.package.locations import OUTPUTS
from cutjoint.run.outputs import ENDINGS, is_stream

Row = Callable[[Callable[..., Any]], Callable[..., Any]]

#: Formats of `cutjoint export` that belong to no one simulator.
FMU, URDF, MJCF = "fmu", "urdf", "mjcf"

#: A bound that is not shown to readers.
_FAR = 1e100


#: Settings that may be in m or rad, with their articles.
_WORDS = {"accuracy": "an accuracy", "tolerance": "a tolerance"}
#: Endings of files of a known format; other endings of a table or document, such as .txt, say nothing.
_FORMATS = frozenset((
    ".arrow", ".csv", ".feather", ".glb", ".h5", ".hdf5", ".html", ".json", ".mat", ".mf4", ".nc", ".npy", ".npz", ".ods", ".parquet",
    ".pdf", ".pkl", ".png", ".xls", ".xlsx", ".yaml", ".yml",
))
_READ = click.Path(exists=True, dir_okay=False, path_type=Path)
_FOLDER = click.Path(file_okay=False, path_type=Path)
_RULES = click.Choice(list(INTEGRATORS))
_FIRST_SCENE = click.option("--scene", metavar="NAME", help="Scene of the model file. Default: the first.")


class Setting(click.FloatRange):
    """The value of a setting in its range: a plain decimal number, without infinity, nan, underscores or digits of other scripts.

    Times and lengths may have a unit, as in 1ms and 50mm, accuracies also as in 1mm or 0.1deg.
    """

    def __init__(self, setting: str, *, positive: bool = False) -> None:
        bounds = {**RANGES[setting], **({"above": 0.0} if positive else {})}
        least, most = bounds.get("above", bounds.get("least", -_FAR)), bounds.get("most", _FAR)
        super().__init__(min=_bound(least), min_open="above" in bounds, max=_bound(most))
        self.name = "integer" if setting in WHOLE else "time" if setting in TIMES else "length" if setting in LENGTHS else "float"
        self._setting, self._positive = setting, positive

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, converted for click."""
        whole = self._setting in WHOLE
        if isinstance(value, str) and self._setting in (*TIMES, *LENGTHS, *PLACES) and not is_number(value):
            value = self._in_si(value, param, ctx)
        elif isinstance(value, str) and not (is_whole if whole else is_number)(value):
            self.fail(f"{value!r} is not a {'whole' if whole else 'plain decimal'} number.", param, ctx)
        number = (click.INT if whole else click.FLOAT).convert(value, param, ctx)
        fault = fault_of_setting(self._setting, number) or (fault_of(number, above=0.0) if self._positive else "")
        if fault:
            self.fail(fault, param, ctx)
        return number

    def _in_si(self, text: str, param: click.Parameter | None, ctx: click.Context | None) -> float:
        from cutjoint.model.expressions.units import ANGLE, LENGTH, TIME, UnitError, described, read_measure

        try:
            written = read_measure(text)
        except UnitError as error:
            self.fail(f"{error}.", param, ctx)
        if written is None:
            self.fail(f"{text!r} is not a plain decimal number.", param, ctx)
        dimensions, needs = (
            ((TIME,), "a time needs s") if self._setting in TIMES
            else ((LENGTH,), "a length needs m") if self._setting in LENGTHS
            else ((LENGTH, ANGLE), f"{_WORDS.get(self._setting, f'a {self._setting}')} needs m or rad")
        )  # fmt: skip
        if written.dimension not in dimensions:
            self.fail(f"{text!r} is in {described(written.dimension)}, and {needs}.", param, ctx)
        return written.value


def _bound(value: float) -> float | None:
    """A bound of a range as readers see it: whole numbers without a decimal point."""
    return None if abs(value) >= _FAR else int(value) if value == int(value) else value


def command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """A command with an option of the table for each parameter of its function.

    Errors that the user can correct end in their message and exit status 1.
    """

    def made(function: Callable[..., None]) -> click.Command:
        wrapped = reports_errors(function)
        for parameter in reversed(signature(function).parameters):
            wrapped = (OPTIONS.get(f"{name}.{parameter}") or OPTIONS[parameter])(wrapped)
        return click.command(name)(wrapped)

    return made


def _one_of(switch: str, *name: str, names: Callable[[], Iterable[str]], **more: Any) -> Row:
    """An option with a choice of ``names``, which are evaluated when a command has it."""
    return lambda function: click.option(switch, *name, type=click.Choice(list(names())), **more)(function)


def _of(module: str, names: str) -> Callable[[], Iterable[str]]:
    """Names in a module that is imported on demand: a cached run needs none that derives or compiles."""
    return lambda: cast(Iterable[str], getattr(import_module(module), names))


def _packages(added: ExtensionPoint[Any]) -> str:
    """The packages of known additions, as the end of a sentence."""
    packages = {package: [name for name, of in added.packages.items() if of == package] for package in added.packages.values()}
    return "".join(f"; {join_and(names)} come with {package}" for package, names in packages.items())


def _contents(function: Callable[..., Any]) -> Callable[..., Any]:
    words = {"sources": "An FMU with sources only.", "binary": "An FMU with binaries only.", "both": "An FMU with both (default)."}
    for content in reversed(words):
        function = click.option(f"--{content}", "content", flag_value=content, help=words[content])(function)
    return function


def _page(what: str) -> Row:
    """The option for a file with a view of ``what``."""
    return click.option("--view", type=_VIEW, help=f"Page (.html) {what}, or its animation as glTF (.glb).")


class _File(click.Path):
    """A file that a command writes.  Its name has one of these endings, or if "" is the first of them, none of another format;
    devices and pipes have any name."""

    def __init__(self, *endings: str) -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self._endings = endings

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, converted for click."""
        path = Path(str(super().convert(value, param, ctx)))
        if str(path) == "-":
            self.fail("- would be a file of that name; standard output is /dev/stdout", param, ctx)
        ending = path.suffix.lower()
        takes_others = self._endings[0] == "" and (ending not in _FORMATS or ending == self._endings[1])
        if path.suffix not in self._endings and not takes_others and not is_stream(path):
            self.fail(f"{path}: no such kind of file; write a name that ends in {join_or(filter(None, self._endings))}", param, ctx)
        if param is not None:
            OUTPUTS[path] = param.opts[0]
        return path


_CSV, _JSON, _MODEL = _File("", ".csv"), _File("", ".json"), _File("", ".yaml", ".yml")
_PAGE, _VIEW = _File(".html"), _File(".html", ".glb")


#: One row for each option, by the parameter of the command's function; ``command.parameter`` belongs to one command.
OPTIONS: Mapping[str, Row] = {
    "model": click.argument("model", type=_READ),
    "study": click.argument("study", type=_READ),
    "fit_study": click.argument("fit_study", metavar="STUDY", type=_READ),
    "file": click.argument("file", type=_READ),
    "base": click.option("--base", type=click.Choice(["fixed", "free"]), default="fixed", show_default=True,
        help="Whether the root link of a URDF is fixed to the ground or free. SDF and MJCF files specify it."),
    "import.name": click.option("--model", "name", metavar="NAME", default="", help="Model of an SDF file. Default: all."),
    "import.folder": click.option("--folder", type=click.Path(exists=True, file_okay=False, path_type=Path), help="Folder with "
        "the meshes and the files that FILE includes. Default: FILE's folder."),
    "scene": click.option("--scene", metavar="NAME", help="Scene of the model file. Default: the only one."),
    **dict.fromkeys(("check.scene", "drive.scene", "equilibrium.scene", "explain.scene", "view.scene"), _FIRST_SCENE),
    **dict.fromkeys(("modes.scene", "response.scene"),
        click.option("--scene", metavar="NAME", help="Scene of the model file. Default: the first; with --at the only one.")),
    "method": click.option("--method", type=click.Choice(list(METHODS)), help="Formulation. Default: the scene's, else recursive."),
    "simulate.method": _one_of("--method", names=lambda: [AUTO, *METHODS],
        help="Formulation; auto chooses one that meets the accuracy. Default: the scene's, else recursive."),
    "batch.method": _one_of("--method", names=lambda: names_of(METHODS, lambda m: m.batch),
        help="Formulation. Default: the scene's, else recursive."),
    "export.method": click.option("--method", type=click.Choice(list(METHODS)),
        help="Formulation of an FMU. Default: the scene's for co-simulation, else recursive."),
    "accuracy": click.option("--accuracy", type=Setting("accuracy"),
        help="Target error of positions (m) and angles (rad), for example 0.1mm. Default: the scene's, else 1e-4."),
    "targets": click.option("--accuracy-of", "targets", metavar="NAME=VALUE", multiple=True,
        help="Target error of an output, or of its end, minimum, maximum, mean or rms, in place of those of positions and angles: "
        "tyre.Fz=10N or 'maximum(tyre.Fz)=10N'."),
    "tolerance": click.option("--solver-tolerance", "tolerance", type=Setting("tolerance"),
        help=f"Relative and absolute tolerance of {join_and(names_of(INTEGRATORS, lambda i: i.adaptive))}; else of the iteration in a "
        "step. Default: the scene's."),
    "implementation": click.option("--implementation", type=click.Choice([AUTO, *(x.value for x in Implementation)]), default=AUTO,
        show_default=True, envvar="CUTJOINT_IMPLEMENTATION",
        help="generated: C++ for the model. interpreted: the same equations without a compiler. generic: a handwritten solver of "
        "cutjoint-bench. auto: generated; on a terminal, interpreted if compiling takes over 2 s."),
    "solver": _one_of("--solver", names=SOLVERS.names, help="Linear solver (not recursive). Default: emitted (generated); for "
        f"generic, a library's{_packages(SOLVERS.added)}."),
    "integrator": click.option("--integrator", type=_RULES,
        help=f"Integrator of the method. Default: the scene's; else {DEFAULT_INTEGRATOR} if dt is given; else an adaptive one."),
    "batch.integrator": click.option("--integrator", type=click.Choice(names_of(INTEGRATORS, lambda i: i.batch)),
        help="Integrator with equal steps for all runs, eight at a time (SIMD). Default: the scene's."),
    "compile.integrator": click.option("--integrator", type=_RULES, help=f"Integrator. Default: the scene's, else {DEFAULT_INTEGRATOR}."),
    "events": click.option("--events", type=click.Choice([x.value for x in Events]),
        help="located: steps end where a force changes its formula; crossed: steps pass over. Default: the scene's; else "
        f"crossed for {join_and(names_of(INTEGRATORS, lambda i: i.events is Events.CROSSED))}, located for others."),
    **dict.fromkeys(("batch.events", "couple.events"), click.option("--events", type=click.Choice([Events.CROSSED.value]),
        help="Steps pass over events, even if the scene says located.")),
    "precision": _one_of("--precision", names=PRECISIONS.names, default=DEFAULT_PRECISION, show_default=True,
        help=f"Number type{_packages(PRECISIONS.added)}."),
    "closure": click.option("--closure", type=click.Choice(list(CLOSURES)),
        help="How the method recursive enforces its cut joints. Default: the scene's."),
    "loops": click.option("--loops", type=click.Choice([x.value for x in Loops]),
        help="exact: loop equations. embedded: loops of one degree of freedom as explicit functions, fitted at compile time "
        "(recursive, recursive-newton). Default: the scene's, else exact."),
    "dt": click.option("--dt", type=Setting("dt"), help="Step size, for example 1ms. Default: the scene's."),
    "end": click.option("--end", type=Setting("end", positive=True), help="End time, for example 10s. Default: the scene's."),
    "at": click.option("--at", type=Setting("at"), help="Linearise about the motion at this time. Default: about the static equilibrium."),
    "iterations": click.option("--iterations", type=Setting("iterations"),
        help="Fixed number, converged or not: of iterations in each trapezoidal step of recursive, of multiplier updates in each "
        "evaluation of rk4. Default: to convergence."),
    "tunable": click.option("--tunable", "tunable", metavar="PATTERN", multiple=True,
        help="Turn constants of MODEL whose names match into parameters, for example '*.stiffness'; * stands for any text. "
        "--set and tables of cutjoint batch change them without recompiling."),
    "functions": click.option("--functions", type=_READ, help="C++ file with the functions that MODEL declares."),
    "hosted": click.option("--host-functions", "hosted", is_flag=True,
        help="Functions that MODEL declares are callbacks, which the host sets in each simulation."),
    "changes": click.option("--set", "changes", metavar="NAME=VALUE", multiple=True,
        help="Set a parameter, or an input to a constant, without recompiling: in SI units, or with a unit as in 10mm."),
    "links": click.option("--link-mass", "links", metavar="BODY=KG", multiple=True,
        help="Turn a massless body into a slender rod; * in BODY stands for any text."),
    "reduced": click.option("--reduced", is_flag=True, help="Use MODEL after the exact and guarded reduction passes."),
    "approximate": click.option("--approximate", is_flag=True, help="Include passes that change the motion slightly."),
    "linearise": click.option("--linearise", is_flag=True,
        help="Generate derivatives: A, B, C, D and directional derivatives at a state, forward sensitivities of runs."),
    "adjoint": click.option("--adjoint", is_flag=True, help="Generate adjoint sensitivities of runs; includes --linearise."),
    "poses": click.option("--poses", is_flag=True,
        help="Generate the poses of bodies, markers and wheel contacts, in C or as variables of an FMU."),
    "external_wrenches": click.option("--external-wrench", "external_wrenches", metavar="NAME", multiple=True,
        help="Add a force and a torque on a body or marker as inputs NAME.wrench.fx to NAME.wrench.tz, in global axes."),
    "terrain": click.option("--terrain", "terrain", metavar="NAME", multiple=True, help="Add inputs of the ground under a wheel: "
        "NAME.terrain_height, terrain_slope, terrain_bank and friction; '*' means all wheels."),
    "peer": _one_of("--to", "peer", names=lambda: [*EXPORTERS.names(), FMU, URDF, MJCF], required=True,
        help="Target: an FMU, a URDF or MJCF file, or a program for another simulator (needs cutjoint-bench)."),
    "requested": click.option("--output", "requested", metavar="ELEMENT.QUANTITY", multiple=True,
        help="Column of a program's table. Default: the scene's motions of bodies and markers."),
    "gradient.requested": click.option("--output", "requested", metavar="ELEMENT.QUANTITY", multiple=True,
        help="An output of the scene. Default: all."),
    "response.requested": click.option("--output", "requested", metavar="NAME", multiple=True,
        help="An output of the scene, or ELEMENT.QUANTITY. Default: the scene's outputs."),
    "inputs": click.option("--input", "inputs", metavar="NAME", multiple=True, help="An input of the model. Default: all."),
    "first": click.option("--from", "first", type=Setting("frequency", positive=True),
        help="Lowest frequency (Hz). Default: below the slowest pole."),
    "last": click.option("--to", "last", type=Setting("frequency", positive=True),
        help="Highest frequency (Hz). Default: above the fastest pole; of sampled loops half the sampling frequency."),
    "response.points": click.option("--points", type=Setting("points"), default=400, show_default=True, help="Number of frequencies."),
    "road": _one_of("--road", names=_of("cutjoint.run.road_field", "ROUGHNESS"),
        help="Class of a road by ISO 8608: print the random vibration where the inputs are heights of that road."),
    "speed": click.option("--speed", type=Setting("speed"), help="Speed on the road (m/s)."),
    "weight": _one_of("--weighting", "weight", names=_of("cutjoint.stepping.vibration", "WEIGHTINGS"), default="Wk", show_default=True,
        help="Frequency weighting of accelerations by ISO 2631-1: vertical (Wk), horizontal (Wd), back (Wc)."),
    "by": click.option("--by", metavar="NAME", multiple=True,
        help="A parameter, an input (shifted by a constant) or an initial state; repeat for several. Default: all parameters and inputs."),
    "objective": click.option("--objective",
        type=click.Choice(["end", "integral", "mean", "rms", "maximum", "minimum", "start", "equilibrium", "event", "modes"]),
        default="end", show_default=True, help="What to differentiate of each output. start, equilibrium: the initial state, the pose at "
        "rest; event: the first event and its time; modes: eigenvalues at the start."),
    "from_equilibrium": click.option("--from-equilibrium", is_flag=True,
        help="Include the change of the equilibrium in which the scene starts."),
    "assemblies": click.option("--assemblies", is_flag=True,
        help="List the ways in which the loops assemble at the scene's positions, from random starts."),
    "stability": click.option("--stability", is_flag=True, help="Print whether small disturbances grow, from the modes about the state."),
    "check": click.option("--check", is_flag=True, help="Compare with finite differences: four runs for each parameter."),
    "fmi": click.option("--fmi", type=click.Choice(["2", "3"]), help="Version of FMI. Default: 2."),
    "kind": _one_of("--kind", names=_of("cutjoint.export.fmu.description", "KINDS"),
        help="Co-simulation (cs), model exchange (me) or both. Default: cs."),
    "content": _contents,
    "platforms": _one_of("--platform", "platforms", names=_of("cutjoint.toolchain.platforms", "PLATFORMS"), multiple=True,
        help="Platform of an FMU's binary, by Debian's cross-compilers; repeat for several. Default: this machine's."),
    "target": _one_of("--target", names=_of("cutjoint.export.fmu.archive", "TARGETS"),
        help="x86-64 processors of an FMU's binaries: all (baseline), with AVX2 and FMA (avx2), or both, chosen at load time."),
    "compile.target": click.option("--target", type=click.Choice(["native", "wasm"]), default="native", show_default=True,
        help="native: a simulator for this machine. wasm: a WebAssembly module with its JavaScript calls."),
    "reproducible": click.option("--reproducible", is_flag=True,
        help="Same bits on all processors and in WebAssembly: own mathematical library, no fused multiply-add; build with CMake."),
    "language": click.option("--language", type=click.Choice(["c++", "c99"]), default="c++", show_default=True,
        help="c99: a header and a C file for controllers, with a fixed number of iterations in each step and a constant initial state."),
    "compile.iterations": click.option("--iterations", type=Setting("c99_iterations"), 
        help="C99: iterations of each step, by default 6; with rk4 multiplier updates in each evaluation, by default 2."),
    "compile.precision": click.option("--precision", type=click.Choice(["double", "single"]), default=DEFAULT_PRECISION, show_default=True,
        help="Number type of C99. single: float; README.md has its error against double over the scene."),
    "cases": click.argument("cases", type=_READ),
    "fmus": click.argument("fmus", metavar="FMU...", type=_READ, nargs=-1, required=True),
    "threads": click.option("--threads", type=Setting("threads"), help="Number of threads. Default: all processors."),
    "sweep.threads": click.option("--threads", type=Setting("threads"), help="Number of threads on this machine. Default: all processors."),
    "priority": click.option("--priority", type=Setting("priority"),
        help="Real-time priority of the steps (SCHED_FIFO); needs the right to set it. Default: none."),
    "processor": click.option("--processor", type=Setting("processor"), help="Processor to run on. Default: any."),
    "connections": click.option("--connect", "connections", metavar="PORT=NAME", multiple=True,
        help="Connect a port of an FMU with an output or input of the model, or with FILE:PORT of another FMU, where names differ."),
    "communication": click.option("--communication-step", "communication", type=Setting("dt"),
        help="Time between exchanges of values. Default: the FMU's default experiment."),
    "limit": click.option("--call-limit", "limit", type=Setting("dt"), help="Longest time that a call of the FMU may take. Default: 60 s."),
    "scheduler": click.option("--scheduler", metavar="ADDRESS",
        help="Address of a Dask scheduler, for example tcp://10.0.0.1:8786. Default: this machine's processors."),
    "out": click.option("--out", type=_CSV, required=True, help="CSV file; NAME.units.json beside it has the units."),
    "simulate.out": click.option("--out", type=_File("", *ENDINGS),
        help="Results: CSV, or by the ending .parquet, .arrow or .npy; units are written beside it. Default: no table is written."),
    "compile.out": click.option("--out", type=_FOLDER, required=True, help="Folder for the exported code and the simulator."),
    "import.out": click.option("--out", type=_MODEL, help="Model file. Default: FILE and .yaml (leg.urdf.yaml), in the current folder."),
    "explain.out": click.option("--out", type=_File("", ".md", ".txt"), help="Markdown file. Default: standard output."),
    "export.out": click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the program, or file."),
    "response.out": click.option("--out", type=_CSV, help="CSV file of gains and phases, or densities; units are written beside it."),
    "modes.out": click.option("--out", type=_JSON, help="JSON file with all coordinates of each mode."),
    "realtime.out": click.option("--out", type=_CSV, help="CSV file with the duration of each step."),
    "schema.out": click.option("--out", type=_JSON, help="JSON file. Default: standard output."),
    "fit.out": click.option("--out", type=_JSON, help="JSON file. Default: STUDY's name with .json, in the current folder."),
    "model_out": click.option("--model", "model_out", type=_MODEL, help="Model file with the fitted numbers, comments kept."),
    "fit.view": click.option("--view", type=_PAGE, help="Page (.html): data beside the model, residuals, table."),
    "fit.design": click.option("--design", type=_CSV, help="CSV file of inputs, within the limits under design, from which the parameters "
        "would follow better; fits nothing."),
    "sweep.out": click.option("--out", type=_File("", ".parquet"),
        help="Parquet file. Default: STUDY's name with .parquet, in the current folder."),
    "view.out": click.option("--out", type=_VIEW,
        help="Page (.html) or glTF file (.glb). Default: MODEL's name with .html, in the current folder."),
    "drive.method": _one_of("--method", names=linearised_methods, help="Formulation. Default: the scene's, else recursive."),
    "gradient.method": _one_of("--method", names=linearised_methods, help="Formulation. Default: the scene's, else recursive."),
    "drive.out": click.option("--out", type=_File(".html", ".csv"),
        help="Page (.html). Default: MODEL's name with .html, in the current folder."),
    "drive.steer": click.option("--steer", metavar="NAME=LEFT,RIGHT",
        help="Input or parameter that steers, with its values at full left and right. Default: found by name."),
    "drive.replay": click.option("--replay", type=_READ,
        help="JSON of a saved drive: repeat it with native code and write its table (CSV)."),
    "throttle": click.option("--throttle", metavar="NAME=FULL",
        help="Input or parameter of the throttle, with its value at full throttle."),
    "brake": click.option("--brake", metavar="NAME=FULL", help="Input or parameter of the brake, with its value at full brake."),
    "ranges": click.option("--range", "ranges", metavar="NAME=LOW,HIGH", multiple=True, help="Range of another input or parameter."),
    "live": click.option("--live", metavar="PORT", type=Setting("live"),
        help="Follow a running host: serve a page at http://localhost:PORT/ for poses sent to UDP port PORT."),
    "shared": click.option("--shared", is_flag=True, help="Accept poses from other machines and serve the page to them."),
    "kinematics.out": click.option("--out", type=_CSV, help="CSV file with all sweeps in SI units; units are written beside it."),
    "inverse.scene": click.option("--scene", metavar="NAME", help="Scene that prescribes the motion. Default: the only one."),
    "inverse.out": click.option("--out", type=_CSV, help="CSV file with the forces over time; units are written beside it."),
    "drives": click.option("--drives", metavar="JOINTS",
        help="Actuated joints, whose forces are found, as FIRST,SECOND. Default: those that the scene moves, or else drives or locks."),
    "axle": click.option("--axle", metavar="NAME",
        help="Axle: a text in the names of its wheels alone; or front or rear; or its two bodies as LEFT,RIGHT. Default: the only one."),
    "travel": click.option("--travel", type=Setting("travel"), default=0.05, show_default=True,
        help="Travel of the wheel centres up and down (m), for example 40mm."),
    "steer_travel": click.option("--steer-travel", type=Setting("steer_travel"),
        help="Travel of the steering joint to either side, for example 10mm or 20deg. Default: 20 mm or 0.5 rad."),
    "points": click.option("--points", type=Setting("points"), default=21, show_default=True, help="Points of each sweep."),
    "steer": click.option("--steer", metavar="JOINT", help="Steering joint. Default: the only one with a guide, else the slider along y."),
    "radius": click.option("--radius", type=Setting("radius"), help="Loaded radius of the wheels (m), for example 300mm. Default: the "
        "height of their centres above z = 0, at most that of the tyre."),
    "share": click.option("--share", type=Setting("share"), default=1.0, show_default=True,
        help="The axle's share of the braking or driving force (brake balance), for anti_brake and anti_drive."),
    "compliance": click.option("--compliance", metavar="SCENE",
        help="Print the compliance at the equilibrium of this scene instead of the sweeps."),
    "steps": click.option("--steps", type=_CSV, help="CSV file with iterations and residuals of each step."),
    "error": click.option("--error/--no-error", default=True, help="Estimate the error with further runs, or run once."),
    "equilibrium.verbose": click.option("--verbose", is_flag=True, help="Also print all states and signals of library elements."),
    "verbose": click.option("--verbose", is_flag=True, help="Also print details of derivation, compilation and time integration."),
    "response.plots": click.option("--plots", type=_FOLDER, help="Folder for Bode and Nyquist plots, or a plot of densities."),
    "kinematics.plots": click.option("--plots", type=_FOLDER, help="Folder for a plot of each sweep."),
    "plots": click.option("--plots", type=_FOLDER, help="Folder for plots: those that the scene names, else one for each unit."),
    "compare": click.option("--compare", type=_READ, multiple=True, help="Table of an earlier run, drawn in the same plots."),
    "display": click.option("--display", metavar="UNIT", multiple=True,
        help="Unit for plots, pages and tables, such as deg, mm or rpm, in place of the model's 'display'; result files keep theirs."),
    "simulate.view": _page("that replays the run in a browser"),
    "check.proof": click.option("--proof", type=_JSON,
        help="Prove error bounds of embedded loops, embedding them if the scene does not, and write this certificate (JSON)."),
    "check.view": _page("that moves in each degree of freedom"),
    "couple.view": _page("of the run"),
    "equilibrium.view": _page("that goes from the design position to the equilibrium"),
    "modes.view": _page("that moves in each mode"),
    "reduce.view": _page("that shows in the topology what was changed"),
    "sweep.view": click.option("--view", type=_VIEW,
        help="Page (.html) of the results: filters, Pareto fronts, best and worst runs; with --replay that of the run (.html or .glb)."),
    "ghost_page": click.option("--ghost", "ghost_page", type=_READ,
        help="Page of another run, also of another model, to show as a ghost on the page of --view."),
    "replay": click.option("--replay", type=Setting("replay"), help="Write the page of this run for the viewer."),
    "replays": click.option("--replays", type=Setting("replays"), default=3, show_default=True,
        help="Number of best, worst and failed runs of each objective that get pages beside --view."),
    "of_studies": click.option("--study", "of_studies", is_flag=True, help="Print the schema of study files."),
    "drivers": _one_of("--driver", "drivers", names=_of("cutjoint.toolchain.drivers", "DRIVERS"), multiple=True,
        help="Driver to build; repeat for several. Default: all."),
}  # fmt: skip
