"""The table of options: the command line, docs/reference/command-line.md and the checks of values follow from it."""

from __future__ import annotations

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
    DEFAULT_METHOD,
    DEFAULT_PRECISION,
    INTEGRATORS,
    METHODS,
    PRECISIONS,
    SOLVERS,
    Events,
    Formulation,
    Implementation,
    Loops,
    join_and,
    names_of,
)
from cutjoint.model.ranges import LENGTHS, PLACES, RANGES, TIMES, WHOLE, fault_of, fault_of_setting
from cutjoint.model.text import is_number, is_whole
from cutjoint.package.extensions import EXPORTERS, Door

Row = Callable[[Callable[..., Any]], Callable[..., Any]]

#: Formats of `cutjoint export` that are no program for another simulator, but are read by many.
FMU, URDF, MJCF = "fmu", "urdf", "mjcf"

#: A bound of a range that is as good as none for a reader.
_FAR = 1e100


#: Settings that may be in m or rad, in words.
_WORDS = {"accuracy": "an accuracy", "tolerance": "a tolerance"}


class Setting(click.FloatRange):
    """The value of a setting, in its range: plain decimal numbers, no infinity, no nan, no underscores, no digits of other scripts.

    Times and lengths may have a unit, as in 1ms and 50mm, and so may an accuracy or another length or angle, as in 1mm or 0.1deg.
    """

    def __init__(self, setting: str, *, positive: bool = False) -> None:
        bounds = {**RANGES[setting], **({"above": 0.0} if positive else {})}
        least, most = bounds.get("above", bounds.get("least", -_FAR)), bounds.get("most", _FAR)
        super().__init__(min=_bound(least), min_open="above" in bounds, max=_bound(most))
        self.name = "integer" if setting in WHOLE else "time" if setting in TIMES else "length" if setting in LENGTHS else "float"
        self._setting, self._positive = setting, positive

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, as click has it."""
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
        from cutjoint.model.units import ANGLE, LENGTH, TIME, UnitError, described, read_measure

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
    """A bound of a range as readers see it, whole numbers without a point."""
    return None if abs(value) >= _FAR else int(value) if value == int(value) else value


def command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """A command of that name, with an option of the table for each parameter of its function; errors of the user's making end in their
    message and exit status 1."""

    def made(function: Callable[..., None]) -> click.Command:
        wrapped = reports_errors(function)
        for parameter in reversed(signature(function).parameters):
            wrapped = (OPTIONS.get(f"{name}.{parameter}") or OPTIONS[parameter])(wrapped)
        return click.command(name)(wrapped)

    return made


def _one_of(switch: str, *name: str, names: Callable[[], Iterable[str]], **more: Any) -> Row:
    """An option with a choice of ``names`` that are found where a command has it."""
    return lambda function: click.option(switch, *name, type=click.Choice(list(names())), **more)(function)


def _of(module: str, names: str) -> Callable[[], Iterable[str]]:
    """The names in a module that is imported when they are asked for: a cached run needs none that derives or compiles."""
    return lambda: cast(Iterable[str], getattr(import_module(module), names))


def _packages(added: Door[Any]) -> str:
    """The packages of known additions, as the end of a sentence."""
    packages = {package: [name for name, of in added.packages.items() if of == package] for package in added.packages.values()}
    return "".join(f"; {join_and(names)} come with {package}" for package, names in packages.items())


def _contents(function: Callable[..., Any]) -> Callable[..., Any]:
    words = {"sources": "An FMU of C++ alone.", "binary": "An FMU with binaries alone.", "both": "An FMU with both, which is the default."}
    for content in reversed(words):
        function = click.option(f"--{content}", "content", flag_value=content, help=words[content])(function)
    return function


def _page(what: str) -> Row:
    """The option for a file with a view of ``what``."""
    return click.option("--view", type=_FILE, help=f"Page (.html) {what}, or its animation as glTF (.glb).")


_FILE = click.Path(dir_okay=False, path_type=Path)
_READ = click.Path(exists=True, dir_okay=False, path_type=Path)
_FOLDER = click.Path(file_okay=False, path_type=Path)

_STEPS, _RULES = (_of("cutjoint.emit.steps", names) for names in ("STEPS", "INTEGRATORS_OF_CORE"))

_FIRST_SCENE = click.option("--scene", metavar="NAME", help="Scene of the model file; the first otherwise.")


def _recursive() -> tuple[str, ...]:
    """Methods with relative coordinates."""
    return names_of(METHODS, lambda m: m.formulation is not Formulation.NATURAL)


#: A row an option, by the parameter of the command's function; ``command.parameter`` is that of one command.
OPTIONS: Mapping[str, Row] = {
    "model": click.argument("model", type=_READ),
    "study": click.argument("study", type=_READ),
    "file": click.argument("file", type=_READ),
    "base": click.option("--base", type=click.Choice(["fixed", "free"]), default="fixed", show_default=True, help="Whether a URDF's first "
        "link stands on the ground or moves freely; SDF and MJCF say it themselves."),
    "import.name": click.option("--model", "name", metavar="NAME", default="", help="One of the models of an SDF; all otherwise."),
    "import.folder": click.option("--folder", type=click.Path(exists=True, file_okay=False, path_type=Path), help="Folder below which the "
        "FILE may name others, and from which paths of pictures lead; FILE's own otherwise."),
    "scene": click.option("--scene", metavar="NAME", help="Scene of the model file; may be left out if there is only one."),
    **dict.fromkeys(("check.scene", "equilibrium.scene", "explain.scene", "view.scene"), _FIRST_SCENE),
    "modes.scene": click.option("--scene", metavar="NAME", help="Scene of the model file; the first otherwise. With --at it may be left "
        "out if there is only one."),
    "method": click.option("--method", type=click.Choice(list(METHODS)), default=DEFAULT_METHOD, show_default=True, help="Formulation."),
    "simulate.method": _one_of("--method", names=lambda: [AUTO, *METHODS], help="Formulation, or auto to pick one that keeps the "
        "accuracy; by default the scene's, else recursive."),
    "batch.method": _one_of("--method", names=lambda: names_of(METHODS, lambda m: m.batch),
        help="Formulation; by default the scene's, else recursive."),
    "couple.method": _one_of("--method", names=_STEPS, help="Formulation; by default the scene's, else recursive."),
    "export.method": _one_of("--method", names=_STEPS, help="Formulation of an FMU's steps; recursive otherwise."),
    "accuracy": click.option("--accuracy", type=Setting("accuracy"), help="Largest error of places and angles, m and rad, or as "
        "in 0.1mm, from which steps follow; the scene's otherwise, else 1e-4."),
    "tolerance": click.option("--solver-tolerance", "tolerance", type=Setting("tolerance"), help="Of a step of dormand-prince, dop853, "
        "and radau5 relative and absolute, else of the iteration in a step; the scene's otherwise."),
    "implementation": click.option("--implementation", type=click.Choice([AUTO, *(x.value for x in Implementation)]), default=AUTO,
        show_default=True, envvar="CUTJOINT_IMPLEMENTATION", help="Code made for the model; the same program interpreted, for which "
        "nothing is compiled; or a generic simulator of cutjoint-bench, whose equations are written by hand. auto is generated, but on "
        "a terminal interpreted where compiling takes more than 2 s, until compiled code is there. $CUTJOINT_IMPLEMENTATION says it "
        "for all runs."),
    "solver": _one_of("--solver", names=SOLVERS.names, help="Linear solver of the Lagrangian methods, by default emitted, of the generic "
        f"twin a library's{_packages(SOLVERS.added)}."),
    "integrator": click.option("--integrator", type=click.Choice(list(INTEGRATORS)), help="rk4, "
        "dormand-prince and dop853 take the method recursive, radau5, radau5-fixed and generalised-alpha recursive-newton; by default the "
        "scene's, else trapezoidal where dt is given, and otherwise the method's own with steps that follow from the accuracy."),
    "batch.integrator": click.option("--integrator", type=click.Choice(names_of(INTEGRATORS, lambda i: i.batch)), help="Equal steps of all "
        "runs side by side, where the scene has another rule, or none and no step."),
    "couple.integrator": _one_of("--integrator", names=_RULES, help="Rule of the steps; by default the scene's, else that of simulate."),
    "gradient.integrator": _one_of("--integrator", names=_RULES, help="Rule of the steps; otherwise the scene's, else that of simulate."),
    "compile.integrator": _one_of("--integrator", names=_RULES, help="Rule of the steps; otherwise the scene's, else trapezoidal."),
    "export.integrator": _one_of("--integrator", names=_RULES, help="Rule of an FMU's steps; otherwise what simulate takes."),
    "events": click.option("--events", type=click.Choice([x.value for x in Events]), help="Whether steps of recursive and recursive-newton "
        "end where forces change their formulas; the scene's otherwise, else crossed by trapezoidal and generalised-alpha, located by the "
        "others."),
    **dict.fromkeys(("batch.events", "couple.events"), click.option("--events", type=click.Choice([Events.CROSSED.value]),
        help="Steps do not end where forces change their formulas, where the scene has them located.")),
    "precision": _one_of("--precision", names=PRECISIONS.names, default=DEFAULT_PRECISION, show_default=True,
        help=f"Number type{_packages(PRECISIONS.added)}."),
    "closure": click.option("--closure", type=click.Choice(list(CLOSURES)), help="How the recursive method holds its cut joints; the "
        "scene's otherwise."),
    "loops": click.option("--loops", type=click.Choice([x.value for x in Loops]), help="Close loops of one degree of freedom "
        "by their equations, or by functions of one coordinate that are made when compiling, which the methods recursive and "
        "recursive-newton have; the scene's otherwise, else exact."),
    "dt": click.option("--dt", type=Setting("dt"), help="Step, as in 1ms; the scene's otherwise."),
    "end": click.option("--end", type=Setting("end", positive=True), help="End time, as in 10s; the scene's otherwise."),
    "at": click.option("--at", type=Setting("at"), help="Linearise about the scene's motion at that time; otherwise about the static "
        "equilibrium."),
    "iterations": click.option("--iterations", type=Setting("iterations"), help="Of each step of the method recursive, no less and no "
        "more, so that all steps cost the same."),
    "opened": click.option("--open", "opened", metavar="PATTERN", multiple=True, help="Make parameters of the numbers of MODEL whose names "
        "match, such as '*.stiffness' or 'front.hub.*'; * stands for any text. --set and tables of cutjoint batch change them without "
        "recompiling."),
    "functions": click.option("--functions", type=_READ, help="C++ file with the code of the functions that MODEL declares."),
    "hosted": click.option("--host-functions", "hosted", is_flag=True, help="Leave the code of the functions that MODEL declares to hosts, "
        "which give each simulation pointers to them."),
    "changes": click.option("--set", "changes", metavar="NAME=VALUE", multiple=True, help="Change a parameter, or hold an input constant, "
        "without recompiling: in SI units, or with a unit as in 10mm."),
    "links": click.option("--link-mass", "links", metavar="BODY=KG", multiple=True, help="Make a massless body a slender rod; * in BODY "
        "stands for any text."),
    "reduced": click.option("--reduced", is_flag=True, help="What the exact and guarded passes leave of MODEL."),
    "approximate": click.option("--approximate", is_flag=True, help="Try passes too that change the motion a little."),
    "linearise": click.option("--linearise", is_flag=True, help="Add derivatives at a state to the C interface: A, B, C, D and directional "
        "ones."),
    "adjoint": click.option("--adjoint", is_flag=True, help="Add derivatives of objectives of whole runs, from their end on, to the C "
        "interface; with those at a state."),
    "poses": click.option("--poses", is_flag=True, help="Add the poses of all bodies, markers and wheels' contacts to the C interface, or "
        "to an FMU's variables."),
    "pushed": click.option("--push", "pushed", metavar="NAME", multiple=True, help="Add inputs of a force and a torque, in global axes, "
        "on a body at its centre of mass, or at a marker: NAME.push.fx to NAME.push.tz."),
    "grounded": click.option("--ground", "grounded", metavar="NAME", multiple=True, help="Add inputs of the ground under a wheel: "
        "NAME.ground_height, ground_slope, ground_bank and friction; * in NAME stands for any text, '*' for all wheels."),
    "peer": _one_of("--to", "peer", names=lambda: [*EXPORTERS.names(), FMU, URDF, MJCF], required=True, help="The other simulator, for "
        "which cutjoint-bench is needed, an FMU for those that import one, or a URDF or MJCF file."),
    "asked": click.option("--output", "asked", metavar="ELEMENT.QUANTITY", multiple=True, help="A column of the table; by default those of "
        "the scene that are motions of bodies and markers."),
    "gradient.asked": click.option("--output", "asked", metavar="ELEMENT.QUANTITY", multiple=True, help="An output of the scene; all "
        "otherwise."),
    "by": click.option("--by", metavar="NAME", multiple=True, help="A parameter, an input, which is shifted all the time, or a state "
        "at the beginning; all parameters and inputs otherwise."),
    "objective": click.option("--objective", type=click.Choice(["end", "integral", "mean", "rms", "largest", "smallest", "start", "rest",
        "event", "modes"]), default="end", show_default=True, help="What the table has of each output over the rows; start, rest: where "
        "the scene begins, by the start that is found, or in its pose at rest; event: where a force, guide or drive first changes "
        "its formula, with the time of that; modes: no outputs, but eigenvalues of the motion near the beginning."),
    "from_rest": click.option("--from-rest", is_flag=True, help="Let the pose at rest where the scene begins change with the numbers."),
    "check": click.option("--check", is_flag=True, help="Compare with differences of runs, four for each number."),
    "fmi": click.option("--fmi", type=click.Choice(["2", "3"]), help="Version of an FMU's standard; 2 otherwise."),
    "kind": _one_of("--kind", names=_of("cutjoint.export.fmu.description", "KINDS"), help="What an FMU is for: co-simulation (the "
        "default), model exchange, or both."),
    "content": _contents,
    "platforms": _one_of("--platform", "platforms", names=_of("cutjoint.toolchain.platforms", "PLATFORMS"), multiple=True,
        help="A platform of an FMU's binaries, by Debian's cross-compilers; several may be given, by default this machine's."),
    "target": _one_of("--target", names=_of("cutjoint.export.fmu.archive", "TARGETS"), help="x86-64 processors of an FMU's binaries: all "
        "(baseline), those with AVX2 and FMA (avx2), or both, chosen at load."),
    "compile.target": click.option("--target", type=click.Choice(["native", "wasm"]), default="native", show_default=True, help="A "
        "simulator for this machine, or a module of WebAssembly with its calls in JavaScript."),
    "reproducible": click.option("--reproducible", is_flag=True, help="A folder whose results are the same bits on all processors and in "
        "modules of WebAssembly: with a mathematical library of its own, and no product and sum in one operation."),
    "cases": click.argument("cases", type=_READ),
    "fmus": click.argument("fmus", metavar="FMU...", type=_READ, nargs=-1, required=True),
    "threads": click.option("--threads", type=Setting("threads"), help="As many as processors otherwise."),
    "sweep.threads": click.option("--threads", type=Setting("threads"), help="Of this machine; as many as processors otherwise."),
    "priority": click.option("--priority", type=Setting("priority"), help="Real-time priority of the steps (SCHED_FIFO), for which the "
        "user needs a right; that of other programs otherwise."),
    "processor": click.option("--processor", type=Setting("processor"), help="Number of the processor that steps run on; any otherwise."),
    "connections": click.option("--connect", "connections", metavar="PORT=NAME", multiple=True, help="An input or output of an FMU, and "
        "the output or input of the model, or of another FMU as FILE:PORT, that it belongs to, where names differ."),
    "communication": click.option("--communication-step", "communication", type=Setting("dt"), help="Time between exchanges of values; "
        "that of the FMU's default experiment otherwise."),
    "limit": click.option("--call-limit", "limit", type=Setting("dt"), help="Time that a call of the FMU may take; 60 s otherwise."),
    "scheduler": click.option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster, such as tcp://10.0.0.1:8786; this machine's "
        "processors otherwise."),
    "out": click.option("--out", type=_FILE, required=True, help="CSV file; units go beside it."),
    "compile.out": click.option("--out", type=_FOLDER, required=True, help="Folder for the C++ and the simulator."),
    "import.out": click.option("--out", type=_FILE, help="Model file; FILE's name with .yaml behind it, in the present folder, otherwise."),
    "explain.out": click.option("--out", type=_FILE, help="Markdown file; standard output otherwise."),
    "export.out": click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for the program, or the file."),
    "modes.out": click.option("--out", type=_FILE, help="JSON file for all numbers."),
    "realtime.out": click.option("--out", type=_FILE, help="CSV file for the time of each step."),
    "schema.out": click.option("--out", type=_FILE, help="JSON file; standard output otherwise."),
    "sweep.out": click.option("--out", type=_FILE, help="Parquet file; STUDY's name with .parquet, in the present folder, otherwise."),
    "view.out": click.option("--out", type=_FILE, help="Page (.html) or glTF file (.glb); MODEL's name with .html, in the present folder, "
        "otherwise."),
    "drive.scene": _FIRST_SCENE,
    "drive.method": _one_of("--method", default=DEFAULT_METHOD, show_default=True, names=_recursive, help="Formulation."),
    "gradient.method": _one_of("--method", names=_recursive, help="Formulation; by default the scene's, else recursive."),
    "drive.out": click.option("--out", type=_FILE, help="Page (.html); MODEL's name with .html, in the present folder, otherwise."),
    "drive.steer": click.option("--steer", metavar="NAME=LEFT,RIGHT", help="The input or parameter that steers, and its values at full "
        "left and right; by its name otherwise."),
    "drive.replay": click.option("--replay", type=_READ, help="A drive that the page has saved (JSON): its table (CSV), by code for this "
        "machine."),
    "throttle": click.option("--throttle", metavar="NAME=FULL", help="The input or parameter that drives, and its value at full throttle."),
    "brake": click.option("--brake", metavar="NAME=FULL", help="The input or parameter that brakes, and its value at full brake."),
    "ranges": click.option("--range", "ranges", metavar="NAME=LOW,HIGH", multiple=True, help="The ends of another input or parameter."),
    "live": click.option("--live", metavar="PORT", type=Setting("live"), help="Follow a running host instead: a page at "
        "http://localhost:PORT/ shows the poses that come as datagrams at UDP port PORT."),
    "shared": click.option("--shared", is_flag=True, help="Let other machines send poses and see the page."),
    "kinematics.out": click.option("--out", type=_FILE, help="CSV file of all sweeps, in SI units; units go beside it."),
    "inverse.scene": click.option("--scene", metavar="NAME", help="Scene that prescribes the motion by its drives; may be left "
        "out if there is only one."),
    "inverse.out": click.option("--out", type=_FILE, help="CSV file of the forces over the time; units go beside it."),
    "drives": click.option("--drives", metavar="JOINTS", help="The joints that drive, as FIRST,SECOND; those that the scene "
        "moves otherwise."),
    "axle": click.option("--axle", metavar="NAME", help="The axle, by the words that its wheels' names share, such as front, or the left "
        "and the right body that carries a wheel, as LEFT,RIGHT; may be left out if there is only one."),
    "travel": click.option("--travel", type=Setting("travel"), default=0.05, show_default=True, help="Travel of the wheels' centres up "
        "and down, m, or as in 40mm."),
    "turn": click.option("--turn", type=Setting("turn"), help="Travel of the steering joint to either side, as in 10mm or "
        "20deg; 20 mm or 0.5 rad otherwise."),
    "points": click.option("--points", type=Setting("points"), default=21, show_default=True, help="Rows of each sweep."),
    "steer": click.option("--steer", metavar="JOINT", help="The joint that steers, a slide or a hinge; the axle's only one with a guide "
        "otherwise."),
    "radius": click.option("--radius", type=Setting("radius"), help="Of the wheels under load, m, or as in 300mm; the height of "
        "their centres above z = 0 otherwise, at most that of a tyre."),
    "share": click.option("--share", type=Setting("share"), default=1.0, show_default=True, help="The axle's share of the braking and "
        "driving forces in anti_brake and anti_drive."),
    "compliance": click.option("--compliance", metavar="SCENE", help="What forces on the wheels change by bushings and springs, at the "
        "static equilibrium of a scene, in place of the sweeps."),
    "steps": click.option("--steps", type=_FILE, help="CSV file for iterations and residuals of each step."),
    "error": click.option("--error/--no-error", default=True, help="Whether other runs show how wrong this one is: of those that have "
        "converged, one in 200 at most is off by more than three times as much. Without, steps have one tolerance."),
    "verbose": click.option("--verbose", is_flag=True, help="What was derived, compiled and stepped too: counts, operations, evaluations, "
        "residuals, energy."),
    "kinematics.plots": click.option("--plots", type=_FOLDER, help="Folder for a plot of each sweep."),
    "plots": click.option("--plots", type=_FOLDER, help="Folder for plots of the run: those that the scene names, else one for each unit."),
    "beside": click.option("--beside", type=_READ, multiple=True, help="Table of another run, whose columns of the same names are drawn in "
        "the plots too."),
    "simulate.view": _page("that replays the run in a browser"),
    "check.view": _page("that moves in each direction that the loops leave free"),
    "couple.view": _page("of the run"),
    "equilibrium.view": _page("that goes from the design position to the equilibrium"),
    "modes.view": _page("that moves in each mode"),
    "reduce.view": _page("that shows in the topology what was changed"),
    "sweep.view": click.option("--view", type=_FILE, help="Page (.html) of the results: filters, Pareto fronts, the best and the "
        "worst runs side by side; with --replay that of the run (.html or .glb)."),
    "over": click.option("--over", type=_READ, help="Page of another run, of this or another model, which the page of --view then has as a "
        "ghost."),
    "replay": click.option("--replay", type=Setting("replay"), help="Write the page of this run instead, to see it in the viewer."),
    "replays": click.option("--replays", type=Setting("replays"), default=3, show_default=True, help="Of each objective so many of the "
        "best and of the worst runs, and of those that failed, have their pages in a folder beside --view, one click away."),
    "of_studies": click.option("--study", "of_studies", is_flag=True, help="Of study files of cutjoint sweep, instead of model files."),
    "comparison": click.option("--comparison", is_flag=True, help=f"With linear solvers of other packages{_packages(SOLVERS.added)}."),
    "drivers": _one_of("--driver", "drivers", names=_of("cutjoint.toolchain.drivers", "DRIVERS"), multiple=True, help="Some of the "
        "drivers; all otherwise."),
}  # fmt: skip
