"""The cache of prepared runs: a second run of a scene derives nothing, and imports no module that derives.

The key covers everything that determines a run: the text of the model and the name of its file, which messages have, the request, the
sources of the compiler and the runtime, the versions of the packages that it imports, the C++ compiler, its flags and the processor that
they mean.  Only the files that the model file names are not in it: their digests stand with the run.  The cache has plain data (JSON), and
a simulator by its name in the cache.
"""

import codecs
import json
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cutjoint.methods import DEFAULT_PRECISION, IMPLEMENTATIONS, Implementation, find_additions
from cutjoint.model.targets import split_target
from cutjoint.package.errors import CutjointError, ToolchainError
from cutjoint.package.locations import code_folders
from cutjoint.run.record import RunFile, Settings
from cutjoint.run.settings import Options
from cutjoint.run.simulator_run import Compilation, SimulatorRun, Start
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.cache import cache_folder, is_sound, read_record, write_record
from cutjoint.toolchain.compiler import find_compiler, must_interpret, resolve
from cutjoint.toolchain.drivers import Kind
from cutjoint.toolchain.origins import LARGEST, code_digest, digests_of, versions

if TYPE_CHECKING:
    from cutjoint.model.records import Plot

_Read = TypeVar("_Read")


@dataclass(frozen=True, kw_only=True)
class Request:
    """The options of `cutjoint simulate` but for parameters; None for values of the scene.
    ``tunable`` are patterns of the names of numbers that become parameters, ``functions`` is a C++ file with functions of the model."""

    model: Path
    scene: str | None = None
    method: str | None = None
    closure: str | None = None
    tunable: tuple[str, ...] = ()
    implementation: str = Implementation.GENERATED
    precision: str = DEFAULT_PRECISION
    loops: str | None = None
    functions: Path | None = None
    options: Options = field(default_factory=Options)


@dataclass(frozen=True, kw_only=True)
class PreparedRun:
    """A compiled model's run, and the facts that reports need.

    ``counts`` are the model's by name, ``places`` has where each joint stands in the model file.  ``dependent_parts`` are the parts of
    the run file that depend on tunable parameters (`changing_parts`); if there are none, parameters are changed in the run file alone.
    ``files`` are the digests of the files that the model file names.  ``inputs`` are the names of the model's inputs, which can be held
    constant there too; ``units`` are those of inputs and tunable parameters, ``plots`` the pictures that the scene names, ``display`` their
    units.
    """

    model: str
    counts: tuple[tuple[str, str], ...]
    places: Mapping[str, str]
    compilation: Compilation
    dependent_parts: tuple[str, ...]
    inputs: tuple[str, ...]
    units: Mapping[str, str]
    run: SimulatorRun
    files: Mapping[str, str]
    plots: "tuple[Plot, ...]" = ()
    display: tuple[str, ...] = ()

    def accepts(self, parameters: Mapping[str, float], targets: Mapping[str, float]) -> bool:
        """Return whether parameters can be changed, inputs set to constants and errors of outputs asked for without the model."""
        units = {**self.run.units, **self.units}
        errors = ((split_target(name)[1], error) for name, error in targets.items())
        if any(_has_other_unit(value, units.get(name, "")) for name, value in (*parameters.items(), *errors)):
            return False
        changed = parameters.keys() - ({} if "inputs" in self.dependent_parts else set(self.inputs))
        return not changed or (not self.dependent_parts and changed <= self.run.run_file.parameters.keys())


def _has_other_unit(value: float, unit: str) -> bool:
    if type(value) is float:
        return False
    from cutjoint.model.expressions.units import fault_of_dimension  # of values that were written with a unit alone: it reads units by pint

    return bool(fault_of_dimension(value, unit))


def find_cached_run(request: Request, parameters: Mapping[str, float]) -> PreparedRun | None:
    """The cached run for this request and the present files, with parameters (SI units) changed; None if there is none."""
    prepared = find_cached(request, "runs", _from_json)
    if prepared is None or not prepared.accepts(parameters, request.options.targets) or not is_sound(prepared.run.simulator):
        return None
    return replace(prepared, run=prepared.run.with_parameters(parameters))


def find_cached(request: Request, kind: str, read: Callable[[Any], _Read]) -> _Read | None:
    """What ``read`` makes of the cached record of a kind for this request and the present files; None if there is none."""
    if not _can_be_read_again(request):
        return None
    try:
        with request.model.open("rb") as stream:
            content = stream.read(LARGEST).removeprefix(codecs.BOM_UTF8)
        record = read_record(_cache_path(request, content, kind))
        return None if record is None or digests_of(record["files"]) != record["files"] else read(record)
    except (OSError, CutjointError, PackageNotFoundError, ValueError):
        return None  # errors are reported when the run is prepared anew


def cache_run(request: Request, text: str, prepared: PreparedRun) -> None:
    """Cache a run prepared from the text of a model, with the parameters of that text; a cache that cannot be written is no error."""
    put_into_cache(request, text, "runs", _as_json(prepared))


def put_into_cache(request: Request, text: str, kind: str, record: Mapping[str, Any]) -> None:
    """Cache a record of a kind, which follows from the text of a model and has the digests of its files."""
    if request.functions is not None and not _can_be_read_again(request):
        return
    with suppress(PackageNotFoundError, ToolchainError):  # installed without versions, or a cache that cannot be written
        write_record(_cache_path(request, text.encode(), kind), record)


def _can_be_read_again(request: Request) -> bool:
    """Return whether the files that a request names can be read again; pipes cannot."""
    return request.model.is_file() and (request.functions is None or request.functions.is_file())


def _cache_path(request: Request, content: bytes, kind: str = "runs") -> Path:
    code = None if request.functions is None else [*digests_of([str(request.functions)]).values()]
    requested = {**asdict(request), "model": str(request.model), "functions": code}
    by, additions = request.implementation, find_additions(request.options.solver)
    extensions = [code_digest(IMPLEMENTATIONS.load(by).code)] if by in IMPLEMENTATIONS.packages else []
    extensions += Kind(precision=request.precision, additions=additions).key
    about = [sha256(content).hexdigest(), requested, *build_provenance(), *extensions]
    return cache_folder() / kind / f"{sha256(json.dumps(about).encode()).hexdigest()[:32]}.json"


def build_provenance() -> tuple[Any, ...]:
    """The origin of cached runs besides the model: sources, versions, the C++ compiler, its flags and the processor that they mean.
    Raises ToolchainError: a tool is missing, and the package has no simulator that does without; PackageNotFoundError: a package is
    installed without its version."""
    by = () if must_interpret() else ((compiler := find_compiler()).command, compiler.key, resolve(FLAGS))
    return code_digest(code_folders()), versions(), *by


def _as_json(prepared: PreparedRun) -> dict[str, Any]:
    found = replace(prepared.compilation, generate_seconds=0.0, compile_seconds=0.0)
    run = replace(prepared.run, continuation=None, by_method=None)  # derived again when needed
    prepared = replace(prepared, compilation=found, run=run)
    return {**asdict(prepared), "run": {**asdict(prepared.run), "simulator": prepared.run.simulator.parent.name}}


def place_in_cache(name: str, product: str) -> Path:
    """The place of a simulator or library of a name in the cache."""
    if not all(re.fullmatch(r"[\w.-]+", each) for each in (name, product)) or ".." in (name, product):
        raise ValueError("a simulator has a name in the cache, not a path")
    return cache_folder() / name / product


def _plot(data: Mapping[str, Any]) -> "Plot":
    from cutjoint.model.records import Plot

    return Plot(**{**data, "y": tuple(data["y"])})


def _from_json(data: Mapping[str, Any]) -> PreparedRun:
    run, compilation = data["run"], data["compilation"]
    return PreparedRun(
        model=data["model"], counts=tuple((name, value) for name, value in data["counts"]), places=data["places"],
        compilation=Compilation(**{**compilation, "flags": tuple(compilation["flags"]), "start": Start(**compilation["start"])}),
        dependent_parts=tuple(data["dependent_parts"]), inputs=tuple(data["inputs"]), units=data["units"], files=data["files"],
        plots=tuple(_plot(plot) for plot in data["plots"]), display=tuple(data["display"]),
        run=SimulatorRun(**{
            **run, "simulator": place_in_cache(run["simulator"], "simulator"), "run_file": RunFile.of(run["run_file"]),
            "others": [Settings.of(other) for other in run["others"]],
        }),
    )  # fmt: skip
