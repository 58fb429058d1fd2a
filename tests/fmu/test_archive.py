"""The files of FMUs: FMPy validates and simulates them, and their sources compile alone."""

from __future__ import annotations

import html
import io
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.c_export import plan_export
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import _frozen_for_export, generate
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.export.fmu.description import Unit, describe_unit, write_description
from cutjoint.model.read import read_model, read_model_text
from cutjoint.package.locations import without_mark
from cutjoint.run.scenes import find_scene
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.hash_seeds import outputs

from .slaves import fmu_of, names_in, packed, write

PRESS = str(MODELS / "press.yaml")
CASES = [(name, scene, v) for name, scene in (("press", None), ("four_bar", None), ("iltis", "simul1")) for v in (2, 3)]
VALID = [
    ("press", None, None), ("press", None, "dormand-prince"), ("four_bar", None, None), ("driven", "free", None), ("iltis", "simul1", None)
]
MORE = [*((name, None) for name in ("slider_crank", "six_bar", "flyball", "delta", "excavator", "stewart")), ("axle", "bump")]
VALID += [(*named, None) for named in MORE]
CASES += [(*named, 2 + i % 2) for i, named in enumerate(MORE)]
HEAVY = [case for case in CASES if case[0] != "press"]

versions = pytest.mark.parametrize("version", [2, 3])


@pytest.mark.parametrize(("name", "scene", "integrator"), with_heavy(VALID, *VALID[4:]))
@versions
def test_fmpy_finds_nothing_wrong(version: int, name: str, scene: str | None, integrator: str | None, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(write(fmu_of(name, version, scene, integrator), tmp_path, sources=True, binary=False))) == []


def test_a_comment_more_in_the_model_file_changes_the_banners_alone() -> None:
    """Token and binaries stay: a host takes the FMU for the same, and nothing is compiled again."""
    text, made = (MODELS / "four_bar.yaml").read_text(), []
    for written in (text, f"{text}# a comment\n"):
        model = read_model_text(written, "four_bar.yaml")
        made.append(make_fmu(model, find_scene(model, None), version=3))
    one, other = made
    assert one.sources != other.sources
    assert {n: without_mark(s) for n, s in one.sources.items()} == {n: without_mark(s) for n, s in other.sources.items()}
    assert one.subject.token == other.subject.token


@needs_cpp
@pytest.mark.parametrize(("name", "scene", "version"), with_heavy(CASES, *HEAVY))
def test_fmpy_has_the_table_of_the_command_line_bit_by_bit(name: str, scene: str | None, version: int, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model = read_model(MODELS / f"{name}.yaml")
    fmu = fmu_of(name, version, scene, "trapezoidal")
    held = {v.name: v.start for v in fmu.interface.inputs}
    how = {"integrator": "trapezoidal", "events": "crossed", "error": False, "inputs": held}
    known = cutjoint.simulate(MODELS / f"{name}.yaml", scene=scene, **how)
    file = write(fmu, tmp_path)
    table = fmpy.simulate_fmu(str(file), stop_time=known.t[-1], output_interval=find_scene(model, scene).output_step)
    assert len(table) == len(known.t)
    for column in known.columns:
        assert np.array_equal(table[column], known[column]), column


@needs_cpp
@pytest.mark.parametrize("version", with_heavy([2, 3], 2))
def test_fmpy_compiles_the_sources(version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fmpy = pytest.importorskip("fmpy")
    monkeypatch.setenv("CXXFLAGS", "-std=c++20")  # which FMI 2 cannot say in its description
    fmu = fmu_of("press", version)
    file = write(fmu, tmp_path, sources=True, binary=False)
    place = Path(fmpy.extract(str(file), unzipdir=str(tmp_path / "open")))
    __import__("fmpy.build").build.build_platform_binary(place, configuration="Debug")
    built, known = (fmpy.simulate_fmu(str(f), output_interval=0.01) for f in (place, write(fmu, tmp_path)))
    for column in known.dtype.names:
        assert abs(built[column][0] - known[column][0]) <= 1e-12 * np.abs(known[column]).max(), column  # one evaluation
    for column in known.dtype.names:  # other flags join other products and sums, in 2 s of a crank that turns
        assert np.abs(built[column] - known[column]).max() <= 1e-9 * np.abs(known[column]).max(), column


@needs_cpp
@versions
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize("kind", ["cs", "me", "both"])
def test_the_layer_compiles_without_warnings_and_takes_a_prefix(version: int, compiler: str, kind: str, tmp_path: Path) -> None:
    fmu = fmu_of("driven", version, "free", kind=kind)
    for name, text in fmu.sources.items():
        (tmp_path / name).write_text(text)
    layer, made = tmp_path / f"fmi{version}.cpp", tmp_path / "layer.o"
    warnings = ["-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([compiler, *warnings, f"-DFMI{version}_FUNCTION_PREFIX=driven_", "-c", layer, "-o", made], check=True)
    symbols = subprocess.run(["nm", "-g", "--defined-only", made], capture_output=True, text=True, check=True).stdout.split()[2::3]
    assert f"driven_fmi{version}DoStep" in symbols
    assert all(symbol.startswith(f"driven_fmi{version}") for symbol in symbols)


@needs_cpp
@versions
def test_a_binary_shows_the_standards_functions_alone_and_needs_the_c_library_alone(version: int) -> None:
    made = fmu_of("press", version).build()
    shown = subprocess.run(["nm", "-D", "-g", "--defined-only", made], capture_output=True, text=True, check=True).stdout.split()[2::3]
    assert shown
    assert all(symbol.startswith(f"fmi{version}") for symbol in shown)
    needed = subprocess.run(["objdump", "-p", made], capture_output=True, text=True, check=True).stdout
    libraries = {line.split()[1].partition(".")[0] for line in needed.splitlines() if "NEEDED" in line}
    assert libraries <= {"libm", "libc", "libmvec"}


SEEDED = """
import hashlib
from tests.fmu.slaves import fmu_of, packed
for version in (2, 3):
    print(hashlib.sha256(packed(fmu_of("driven", version, "free", kind="both"), sources=True, binary=False)).hexdigest())
"""


def test_an_archive_follows_from_the_model_alone() -> None:
    assert len(set(outputs(SEEDED, "0", "1"))) == 1


def test_no_header_of_the_standard_is_in_an_archive() -> None:
    assert names_in(packed(fmu_of("press", 3), sources=True, binary=False)) == [
        "modelDescription.xml", "documentation/index.html", "documentation/licenses/license.txt",
        "sources/press.h", "sources/press.cpp", "sources/fmi3.cpp", "sources/buildDescription.xml",
    ]  # fmt: skip


@versions
def test_the_page_shows_all_variables(version: int) -> None:
    fmu = fmu_of("iltis", version, "simul1")
    archive = zipfile.ZipFile(io.BytesIO(packed(fmu, sources=True, binary=False)))
    page = archive.read("documentation/index.html").decode()
    assert all(f"<td>{html.escape(v.name)}</td>" in page for v in fmu.interface.variables)


def test_units_have_exponents_of_base_units() -> None:
    assert describe_unit("1") is None
    assert describe_unit("N*s/m") == Unit(name="N*s/m", exponents={"kg": 1, "s": -1}, factor=1.0, display=None)
    assert describe_unit("deg/s") == Unit(name="deg/s", exponents={"s": -1, "rad": 1}, factor=np.pi / 180, display=None)
    assert describe_unit("kN") == Unit(name="kN", exponents={"kg": 1, "m": 1, "s": -2}, factor=1000.0, display=None)
    for names in ({"N*m", "Nm", "N m", "N * m"}, {"N*m*s", "Nms"}, {"kg*m^2", "kg m**2"}, {"N*m/A", "Nm / A"}):
        assert len({str(describe_unit(name)) for name in names}) == 1
    stiffness = describe_unit("N*m/rad")
    assert stiffness is not None
    assert stiffness.exponents == {"kg": 1, "m": 2, "s": -2, "rad": -1}
    assert stiffness.display == ("N*m/deg", pytest.approx(np.pi / 180, rel=1e-15))


def export(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["export", PRESS, *(str(a) for a in arguments)])


def test_the_command_writes_an_fmu(tmp_path: Path) -> None:
    out = tmp_path / "press.fmu"
    result = export("--to", "fmu", "--fmi", 3, "--sources", "--out", out)
    assert result.exit_code == 0, result.output
    assert " ".join(result.output.split()) == (
        f"FMI 3 co-simulation by dormand-prince, steps of at most 0.01 s, tolerance 1e-07; 0 inputs, 4 outputs in {out}"
    )
    assert out.read_bytes() == packed(fmu_of("press", 3), sources=True, binary=False)


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("--to", "fmu", "--set", "stiffness=1", "--out", "x.fmu"), 2, "--set does not apply to --to fmu"),
        (("--to", "fmu", "--output", "slider.x", "--out", "x.fmu"), 2, "--output does not apply to --to fmu"),
        (("--to", "mujoco", "--fmi", "2", "--out", "x"), 2, "--fmi is for --to fmu, not for --to mujoco"),
        (("--to", "mujoco", "--sources", "--out", "x"), 2, "--sources is for --to fmu, not for --to mujoco"),
        (("--to", "fmu", "--out", "x"), 1, "--out x: an FMU is one file whose name ends in .fmu"),
    ],
)
def test_what_an_fmu_has_not_is_refused(arguments: tuple[str, ...], status: int, words: str) -> None:
    result = export(*arguments)
    assert result.exit_code == status
    assert words in " ".join(result.output.split())


THROWN = """
cutjoint: 1
name: thrown
gravity: [0, 0, -9.81]
parameters:
  v: {value: 2, unit: m/s, binding: param}
  fill: {value: 1, binding: param}
  both: {value: 3, binding: param}
bodies: {ball: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, ball], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {drag: {kind: joint_force, joint: rail, law: -both*rate}}
states: {level: {start: fill, rate: -level}}
outputs: [ball.z, level.value]
scenes: {throw: {end: 1, output_step: 0.1, rates: {rail.displacement_rate: v + both}}}
"""


def test_parameters_of_the_start_alone_are_no_parameters_of_exported_code(tmp_path: Path) -> None:
    """Setting one would change nothing, as the start is numbers there; the description and the header say which these are."""
    model = read_model_text(THROWN, "thrown.yaml")
    scene = model.scenes["throw"]
    for version in (2, 3):
        fmu = make_fmu(model, scene, version=version)
        assert [v.name for v in fmu.interface.parameters] == ["both"]
        described = html.unescape(write_description(fmu.subject, fmu.interface, version))
        assert "without 'v' and 'fill': only the start depends on them" in described
    options = CompileOptions(out=tmp_path)
    delivery = plan_export(_frozen_for_export(generate(model, scene, scene.outputs), model, scene, options), options)
    assert delivery is not None
    assert "#define THROWN_PARAMETERS 1" in delivery.files["thrown.h"]
    assert "Parameters that only the start reads are not included: v, fill." in delivery.files["thrown.h"]
    assert delivery.standalone is not None
    assert delivery.standalone.run_file.rates["rail.displacement_rate"] == 5.0
