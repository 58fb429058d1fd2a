"""A model as an FMU: its files, the functions of FMI 3 that it exports or refuses, and the archive."""

import io
import os
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from cutjoint.compile.c_export import Standalone, describe_frozen, freeze_start_parameters, make_standalone
from cutjoint.compile.derivation import derive
from cutjoint.compile.pipeline import generate
from cutjoint.emit.source import Page
from cutjoint.export.fmu.description import KINDS, Subject, write_build_description, write_description
from cutjoint.export.fmu.variables import Interface, make_interface
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import DEFAULT_METHOD, METHODS, join_or
from cutjoint.model.expressions.functions import SUPPLIED_FILE
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import licence, without_mark
from cutjoint.run.scenes import method_of, with_default_closure
from cutjoint.toolchain.build import build_files
from cutjoint.toolchain.platforms import PLATFORMS, name_here
from cutjoint.topology.records import Topology

#: Flags for binaries, unless $CUTJOINT_FLAGS says otherwise: for any processor of the platform.
FMU_FLAGS = tuple(os.environ.get("CUTJOINT_FLAGS", "-O3").split())

#: For which processors a binary for x86-64 has code: all, those with AVX2 and FMA alone, or both, of which the processor chooses.
TARGETS = ("baseline", "avx2", "both")

#: The folders of binaries by platform, in FMI 2 and 3.
FOLDERS: Mapping[str, Mapping[int, str]] = {
    "linux-x86_64": {2: "linux64", 3: "x86_64-linux"},
    "windows-x86_64": {2: "win64", 3: "x86_64-windows"},
    "linux-aarch64": {2: "aarch64-linux", 3: "aarch64-linux"},
}

#: The time of all entries of an archive, the earliest one that it can have.
_NO_TIME = (1980, 1, 1, 0, 0, 0)
_REFERENCES = "const fmi3ValueReference*, size_t"
_KNOWN = f", {_REFERENCES}, {_REFERENCES}, const fmi3Float64*, size_t, fmi3Float64*, size_t"
Function = tuple[str, str, str]
#: Functions that no FMU has: names without the prefix, C++ arguments after the instance, and the missing ability.
MISSING: tuple[Function, ...] = (
    ("GetNumberOfVariableDependencies", ", fmi3ValueReference, size_t*", "dependencies that change"),
    ("GetVariableDependencies", ", fmi3ValueReference, size_t*, fmi3ValueReference*, size_t*, int*, size_t", "dependencies that change"),
    ("EnterConfigurationMode", "", "configuration mode"),
    ("ExitConfigurationMode", "", "configuration mode"),
    ("GetIntervalDecimal", f", {_REFERENCES}, fmi3Float64*, int*", "clocks"),
    ("GetIntervalFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*, int*", "clocks"),
    ("GetShiftDecimal", f", {_REFERENCES}, fmi3Float64*", "clocks"),
    ("GetShiftFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*", "clocks"),
    ("SetIntervalDecimal", f", {_REFERENCES}, const fmi3Float64*", "clocks"),
    ("SetIntervalFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*", "clocks"),
    ("SetShiftDecimal", f", {_REFERENCES}, const fmi3Float64*", "clocks"),
    ("SetShiftFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*", "clocks"),
    ("EvaluateDiscreteStates", "", "discrete states"),
    ("GetOutputDerivatives", f", {_REFERENCES}, const fmi3Int32*, fmi3Float64*, size_t", "derivatives of outputs"),
    ("GetAdjointDerivative", _KNOWN, "adjoint derivatives"),
    ("ActivateModelPartition", ", fmi3ValueReference, fmi3Float64", "model partitions"),
)
#: Functions that only FMUs for co-simulation with event mode have.
OF_STEPS: tuple[Function, ...] = (("EnterStepMode", "", "event mode"),)
#: Functions that these and FMUs for model exchange have.
OF_EVENTS: tuple[Function, ...] = (
    ("EnterEventMode", "", "event mode"),
    ("UpdateDiscreteStates", ", fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Float64*", "event mode"),
)
#: Functions that only FMUs for model exchange have.
OF_EXCHANGE: tuple[Function, ...] = (
    ("GetDirectionalDerivative", _KNOWN, "directional derivatives"),
    ("EnterContinuousTimeMode", "", "model exchange"),
    ("CompletedIntegratorStep", ", fmi3Boolean, fmi3Boolean*, fmi3Boolean*", "model exchange"),
    ("SetTime", ", fmi3Float64", "model exchange"),
    ("SetContinuousStates", ", const fmi3Float64*, size_t", "model exchange"),
    ("GetContinuousStateDerivatives", ", fmi3Float64*, size_t", "model exchange"),
    ("GetEventIndicators", ", fmi3Float64*, size_t", "model exchange"),
    ("GetContinuousStates", ", fmi3Float64*, size_t", "model exchange"),
    ("GetNominalsOfContinuousStates", ", fmi3Float64*, size_t", "model exchange"),
    ("GetNumberOfEventIndicators", ", size_t*", "model exchange"),
    ("GetNumberOfContinuousStates", ", size_t*", "model exchange"),
)


@dataclass(frozen=True, kw_only=True)
class Fmu:
    """An FMU by FMI ``version``: the C export, its description and variables, and the files of the ``project`` that builds it.

    ``kept`` is added to the export's C++; ``layer`` is the code over the C interface; ``page`` describes it.
    """

    version: int
    standalone: Standalone
    subject: Subject
    interface: Interface
    kept: str
    layer: str
    project: Mapping[str, str]
    license: str
    page: str
    topology: Topology

    @property
    def sources(self) -> dict[str, str]:
        """The C++ of the FMU by name."""
        files = self.standalone.files
        own = {name: files[name] + self.kept * (name.endswith(".cpp") and name != SUPPLIED_FILE) for name in _code_of(self.standalone)}
        return {**own, f"fmi{self.version}.cpp": self.layer}

    def build(self, flags: Sequence[str] = FMU_FLAGS, *, platform: str | None = None, target: str | None = None) -> Path:
        """The binary for one of `toolchain.platforms.PLATFORMS`, by default this machine's, and one of `TARGETS`.
        The default target is both, unless the flags name a processor; only x86-64 has targets.

        Raises:
            RunError: there is no name for binaries of this machine, or the processor is named by flags and by target.
            ToolchainError: a tool is missing, or the compiler refused the code.
        """
        there, name = PLATFORMS[platform or _require_platform()], self.standalone.name
        settings = [f"-D{name}_TARGET={choose_target(flags, target)}", f"-D{name}_AVX2={' '.join(there.avx2)}"] if there.avx2 else []
        model = {f"model/{name}": self.sources.get(name, text) for name, text in self.standalone.files.items()}
        files = {**model, f"fmi{self.version}.cpp": self.layer, **self.project}
        return build_files(name, files, f"{name}{there.suffix}", self.standalone.digest, flags, *settings, platform=there)

    def pack(self, *, sources: bool, binary: bool, platforms: Sequence[str] = (), target: str | None = None) -> bytes:
        """The archive: sources, and a binary for each of the ``platforms`` (default: this machine); ``target`` and errors as of `build`."""
        subject = replace(self.subject, sources=tuple(n for n in self.sources if n.endswith(".cpp")) if sources else ())
        files = {
            "modelDescription.xml": write_description(subject, self.interface, self.version).encode(),
            "documentation/index.html": self.page.encode(), "documentation/licenses/license.txt": self.license.encode(),
        }  # fmt: skip
        if sources:
            files |= {f"sources/{name}": text.encode() for name, text in self.sources.items()}
            if self.version == 3:
                files["sources/buildDescription.xml"] = write_build_description(subject).encode()
        if binary:
            for name in dict.fromkeys(platforms or [_require_platform()]):
                made = self.build(platform=name, target=target)
                files[f"binaries/{FOLDERS[name][self.version]}/{made.name}"] = made.read_bytes()
        return _pack(files)


def make_fmu(
    model: Model, scene: Scene, *, version: int, kind: str = "cs", method: str | None = None, integrator: str | None = None,
    poses: bool = False,
) -> Fmu:
    """The FMU of a model in a scene by FMI ``version``, 2 or 3, of one of `KINDS`.  The ``method`` is by default the scene's.
    ``poses`` adds those of all bodies and markers as local variables.

    Raises:
        RunError: the method has no folders, or none with states for model exchange.
        others: as of `pipeline.generate`, `make_standalone`.
    """
    method = method or method_of(scene, (DEFAULT_METHOD,) if KINDS[kind][1] else METHODS)
    _require_method(method, kind)
    scene = with_default_closure(scene, method, integrator)
    model = freeze_start_parameters(model, scene, trims=True)
    generated = generate(model, scene, scene.outputs, method=method, poses=poses, trims=True)
    equations = generated.equations
    described = equations if isinstance(equations, RecursiveEquations) else derive(model, scene, scene.outputs)
    standalone = make_standalone(generated, integrator=integrator, linearise=KINDS[kind][1], derives_steps=False)
    interface = make_interface(described, standalone.run_file, standalone.parts.dofs, standalone.parts.poses)
    stops = version == 3 and KINDS[kind][0] and standalone.steps.finds_events and bool(described.indicators)
    page, view = Page.of(described, method), _view(standalone, interface, version, kind, stops)
    kept, layer = page.render("fmu/kept.cpp.jinja", **view), page.render(f"fmu/fmi{version}.cpp.jinja", **view, token="")
    texts = [*map(without_mark, [*standalone.files.values(), layer]), repr(interface)]
    digits = sha256("\0".join(texts).encode()).hexdigest()
    token = "{" + "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32])) + "}"  # a GUID that follows from texts
    subject = Subject(
        name=model.name, scene=scene.name, end=scene.end, output_step=scene.output_step, token=token, sources=(), kind=kind,
        stops_at_events=stops, steps=", ".join(filter(None, (
            str(standalone.settings) if KINDS[kind][0] else "", describe_frozen(model),
            "" if scene.trim is None else "its start trimmed again for other parameters",
        ))),
    )  # fmt: skip
    return Fmu(
        version=version, standalone=standalone, subject=subject, interface=interface, kept=kept,
        layer=page.render(f"fmu/fmi{version}.cpp.jinja", **view, token=token),
        project={name: page.render(f"fmu/{name}.jinja", **view) for name in ("CMakeLists.txt", "avx2.cpp", "chosen.h")},
        license=page.render("fmu/license.txt.jinja", **view) + licence(),
        page=page.render(
            "fmu/index.html.jinja", **view, scene=scene.name, steps=str(standalone.settings), variables=interface.variables,
        ),
        topology=equations.topology,
    )  # fmt: skip


def choose_target(flags: Sequence[str], target: str | None = None) -> str:
    """The one of `TARGETS` that a binary for x86-64 has with flags, unless one is named.
    Raises RunError: a target is named, and a processor by the flags."""
    named = [flag for flag in flags if flag.startswith("-m")]
    if named and target is not None:
        raise RunError(f"target: the flags name a processor, {' '.join(named)}; leave out --target, or remove them from $CUTJOINT_FLAGS")
    return target or ("baseline" if named else "both")


def _require_method(method: str, kind: str) -> None:
    if method not in METHODS:
        raise RunError(f"method: '{method}' has no FMUs; use {join_or(tuple(METHODS))}")
    if method != DEFAULT_METHOD and KINDS[kind][1]:
        raise RunError(f"method: '{method}' has FMUs for co-simulation only; leave out --kind {kind}, or use the method {DEFAULT_METHOD}")


def _view(standalone: Standalone, interface: Interface, version: int, kind: str, stops: bool) -> dict[str, object]:
    """The view for the templates; ``stops`` is whether co-simulation has event mode."""
    exchanges = KINDS[kind][1]
    header = next(name for name in _code_of(standalone) if name.endswith(".h"))
    name, steps = standalone.name, standalone.steps
    groups = ((OF_STEPS, stops), (OF_EVENTS, exchanges or stops), (OF_EXCHANGE, exchanges))
    return {
        "p": name, "P": name.upper(), "header": header.removesuffix(".h"), "fmi": version,
        "cs": KINDS[kind][0], "me": exchanges, "kinds": " and ".join(["co-simulation"] * KINDS[kind][0] + ["model exchange"] * exchanges),
        "functions": sorted({*re.findall(rf"\b{name}_(\w+)\(", standalone.files[header]), "keep", "put_back"}),
        "stops": stops, "missing": [*MISSING, *(function for group, there in groups if not there for function in group)],
        "adaptive": steps.adaptive, "iterated": steps.is_iterated and not (steps.stages or standalone.parts.system),
        "has_poses": bool(standalone.parts.poses), "starts": interface.starts, "rated": interface.rated,
        "samples": bool(standalone.parts.stepped.discrete_states),
        "mark": sha256(f"{standalone.digest} {standalone.integrator} {interface!r}".encode()).hexdigest()[:16],
        **{kind: [repr(v.start) for v in getattr(interface, kind)] for kind in ("parameters", "settings", "inputs")},
    }  # fmt: skip


def _code_of(standalone: Standalone) -> list[str]:
    return [name for name in standalone.files if name.endswith((".cpp", ".h"))]


def _require_platform() -> str:
    name = name_here()
    if name is None:
        raise RunError("FMUs have no binaries for this machine; export with --sources, or name another --platform")
    return name


def _pack(files: Mapping[str, bytes]) -> bytes:
    """A ZIP archive that follows from its files alone."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as packed:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _NO_TIME)
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            entry.create_system, entry.compress_type = 3, zipfile.ZIP_DEFLATED
            packed.writestr(entry, content)
    return archive.getvalue()
