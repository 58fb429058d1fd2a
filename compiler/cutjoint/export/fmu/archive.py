"""A model as an FMU: its files, and the archive of them."""

from __future__ import annotations

import io
import os
import platform
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from cutjoint.emit.source import Page
from cutjoint.export.fmu.description import Subject, write_build_description, write_description
from cutjoint.export.fmu.functions import MISSING
from cutjoint.export.fmu.variables import Interface, make_interface
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import generate
from cutjoint.run.errors import RunError
from cutjoint.standalone import Standalone, make_standalone
from cutjoint.toolchain.build import build_files

#: How binaries are optimised, unless $CUTJOINT_FLAGS says otherwise: for any processor of the platform.
FMU_FLAGS = tuple(os.environ.get("CUTJOINT_FLAGS", "-O3").split())

#: The folders of binaries by machine, in FMI 2 and 3.
_PLATFORMS: Mapping[tuple[str, str], Mapping[int, str]] = {
    ("Linux", "x86_64"): {2: "linux64", 3: "x86_64-linux"},
    ("Linux", "aarch64"): {2: "aarch64-linux", 3: "aarch64-linux"},
}

#: The time of all entries of an archive, the earliest one that it can have.
_NO_TIME = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class Fmu:
    """An FMU by FMI ``version``: the folder of the model, what describes it, its variables, the layer over the folder's C interface, the
    project that builds both, and the licence."""

    version: int
    standalone: Standalone
    subject: Subject
    interface: Interface
    layer: str
    project: str
    license: str

    @property
    def sources(self) -> dict[str, str]:
        """The C++ of the FMU by name."""
        code = {name: self.standalone.files[name] for name in _code_of(self.standalone)}
        return {**code, f"fmi{self.version}.cpp": self.layer}

    def build(self, flags: Sequence[str] = FMU_FLAGS) -> Path:
        """The binary; errors as of `toolchain.build.build_files`."""
        model = {f"model/{name}": text for name, text in self.standalone.files.items()}
        files = {**model, f"fmi{self.version}.cpp": self.layer, "CMakeLists.txt": self.project}
        return build_files(self.standalone.name, files, f"{self.standalone.name}.so", self.standalone.digest, flags)

    def pack(self, *, sources: bool, binary: bool) -> bytes:
        """The archive, with the sources, a binary for this machine, or both.

        Raises:
            RunError: there is no name for binaries of this machine.
            ToolchainError: a tool is missing, or the compiler refused the code.
        """
        subject = replace(self.subject, sources=tuple(n for n in self.sources if n.endswith(".cpp")) if sources else ())
        files = {
            "modelDescription.xml": write_description(subject, self.interface, self.version).encode(),
            "documentation/licenses/license.txt": self.license.encode(),
        }
        if sources:
            files |= {f"sources/{name}": text.encode() for name, text in self.sources.items()}
            if self.version == 3:
                files["sources/buildDescription.xml"] = write_build_description(subject).encode()
        if binary:
            files[f"binaries/{_folder_of_binaries(self.version)}/{self.standalone.name}.so"] = self.build().read_bytes()
        return _pack(files)


def make_fmu(model: Model, scene: Scene, *, version: int, integrator: str | None = None) -> Fmu:
    """The co-simulation FMU of a model in a scene by FMI ``version``, 2 or 3; errors as of `pipeline.generate` and `make_standalone`."""
    equations, program, source = generate(model, scene, scene.outputs)
    standalone = make_standalone(equations, program, source, integrator=integrator)
    interface = make_interface(equations.mechanism, standalone.run_file)
    page, view = Page.of(equations, "recursive"), _view(standalone, interface, version)
    token = _token([*standalone.files.values(), repr(interface), page.render(f"fmu/fmi{version}.cpp.jinja", **view, token="")])
    subject = Subject(
        name=model.name, scene=scene.name, end=scene.end, output_step=scene.output_step, token=token, sources=()
    )  # fmt: skip
    return Fmu(
        version=version, standalone=standalone, subject=subject, interface=interface,
        layer=page.render(f"fmu/fmi{version}.cpp.jinja", **view, token=token),
        project=page.render("fmu/CMakeLists.txt.jinja", **view), license=page.render("fmu/license.txt.jinja", **view),
    )  # fmt: skip


def _view(standalone: Standalone, interface: Interface, version: int) -> dict[str, object]:
    """What the templates are given."""
    header = next(name for name in _code_of(standalone) if name.endswith(".h"))
    name, steps = standalone.name, standalone.steps
    return {
        "p": name, "P": name.upper(), "header": header.removesuffix(".h"), "fmi": version, "missing": MISSING,
        "adaptive": steps.adaptive, "iterated": steps.is_iterated, "starts": interface.starts,
        "mark": sha256(f"{standalone.digest} {standalone.integrator} {interface!r}".encode()).hexdigest()[:16],
        **{kind: [repr(v.start) for v in getattr(interface, kind)] for kind in ("parameters", "settings", "inputs")},
    }  # fmt: skip


def _code_of(standalone: Standalone) -> list[str]:
    """The header and the C++ file of the model."""
    return [name for name in standalone.files if name.endswith((".cpp", ".h"))]


def _token(parts: Sequence[str]) -> str:
    """A GUID that follows from texts."""
    digits = sha256("\0".join(parts).encode()).hexdigest()
    return "{" + "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32])) + "}"


def _folder_of_binaries(version: int) -> str:
    machine = (platform.system(), platform.machine())
    if machine not in _PLATFORMS:
        raise RunError(f"FMUs have no binaries for {' '.join(machine)}; export with --sources")
    return _PLATFORMS[machine][version]


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
