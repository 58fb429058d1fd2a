"""Additions of other packages: by entry points, and named where the package is not installed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from cutjoint.cli import main
from cutjoint.commands.export import command
from cutjoint.compile import prepared
from cutjoint.compile.prepared import Request
from cutjoint.methods import IMPLEMENTATIONS, INTEGRATORS, PRECISIONS, SOLVERS, Implementation
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package import extensions
from cutjoint.package.extensions import COMMANDS, EXPORTERS, ExtensionPoint, MissingPackageError
from cutjoint.run.additions import Export, Exporter
from cutjoint.toolchain.drivers import Kind
from cutjoint_bench import driver
from cutjoint_bench.generic import backend
from tests.conftest import MODELS, needs_cpp

FOUR_BAR = MODELS / "four_bar.yaml"

DOORS = (COMMANDS, EXPORTERS, IMPLEMENTATIONS, SOLVERS.added, INTEGRATORS.added, PRECISIONS.added)
KNOWN = [(door, name) for door in DOORS for name in door.packages]


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def install(monkeypatch: pytest.MonkeyPatch, *points: EntryPoint) -> None:
    """Make these the only entry points that are installed."""
    monkeypatch.setattr(extensions, "_entry_points", lambda: EntryPoints(points))


@pytest.mark.parametrize(("door", "name"), KNOWN, ids=[name for _, name in KNOWN])
def test_every_known_addition_is_there_or_its_package_is_named(
    door: ExtensionPoint[Any], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert door.load(name).name == name
    install(monkeypatch)
    assert name in door.names()
    with pytest.raises(MissingPackageError) as missing:
        door.load(name)
    assert str(missing.value) == f"{name} is {door.what} of the package cutjoint-bench, which is not installed; pip install cutjoint-bench"


def test_a_command_of_a_package_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    result = call("bench", FOUR_BAR)
    assert result.exit_code == 2
    assert "Error: bench is a command of the package cutjoint-bench, which is not installed; pip install cutjoint-bench" in result.output


def test_other_packages_add_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, EntryPoint(name="bench", value="cutjoint_bench.command:command", group="cutjoint.commands"))
    assert "  bench " in call("--help").output
    assert call("bench", "--help").output.startswith("Usage: main bench [OPTIONS] MODELS...")


@pytest.mark.parametrize("peer", EXPORTERS.packages)
def test_an_export_of_a_package_that_is_not_installed(peer: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch)
    result = call("export", FOUR_BAR, "--to", peer, "--out", tmp_path / "out")
    assert (result.exit_code, result.output) == (
        1, f"{peer} is an export of the package cutjoint-bench, which is not installed; pip install cutjoint-bench\n"
    )  # fmt: skip
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("how", "what"), [(("--precision", "quad"), "a number type"), (("--method", "classical", "--solver", "klu"), "a linear solver")]
)
def test_a_driver_that_is_not_installed(
    how: tuple[str, ...], what: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:  # fmt: skip
    install(monkeypatch)
    result = call("simulate", FOUR_BAR, *how, "--out", tmp_path / "out.csv")
    message = f"{how[-1]} is {what} of the package cutjoint-bench, which is not installed; pip install cutjoint-bench"
    assert (result.exit_code, result.output.strip()) == (1, message)


@pytest.mark.parametrize("how", [(), ("--precision", "single")], ids=" ".join)
def test_an_implementation_that_is_not_installed(how: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch)
    result = call("simulate", FOUR_BAR, "--implementation", "generic", *how, "--out", tmp_path / "out.csv")
    assert (result.exit_code, result.output.strip()) == (
        1, "generic is an implementation of the package cutjoint-bench, which is not installed; pip install cutjoint-bench"
    )  # fmt: skip
    assert not (tmp_path / "out.csv").exists()


def test_implementations_of_other_packages_have_their_place_in_the_catalogue() -> None:
    assert set(IMPLEMENTATIONS.names()) == {x.value for x in Implementation if x.is_generic}


def test_a_backend_is_imported_without_what_compiles() -> None:
    """A cached run needs its code's digest."""
    code = "import sys; import cutjoint_bench.generic.backend; print('sympy' in sys.modules, 'cutjoint.compile' in sys.modules)"
    heavy = outputs_of(code)
    assert heavy == "False False\n"


@needs_cpp
def test_a_cached_run_follows_from_the_code_of_its_backend(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    places: dict[str, set[Path]] = {"generic": set(), "generated": set()}
    for text in ("one", "other"):
        (tmp_path / text).mkdir()
        (tmp_path / text / "code.hpp").write_text(text, encoding="utf-8")
        monkeypatch.setattr(backend, "BACKEND", replace(backend.BACKEND, code=(tmp_path / text,)))
        for how, found in places.items():
            found.add(prepared._cache_path(Request(model=FOUR_BAR, implementation=how), b""))
    assert {how: len(found) for how, found in places.items()} == {"generic": 2, "generated": 1}


@pytest.mark.parametrize(("name", "kind"), [("KLU", Kind(additions=("klu",))), ("QUAD", Kind(precision="quad"))])
def test_drivers_follow_from_the_files_of_their_additions(name: str, kind: Kind, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys = {kind.key}
    for text in ("one", "other"):
        (tmp_path / text).mkdir()
        (tmp_path / text / "lagrangian.hpp").write_text(text, encoding="utf-8")
        monkeypatch.setattr(driver, name, replace(getattr(driver, name), folder=tmp_path / text))
        keys.add(kind.key)
    assert len(keys) == 3
    assert Kind().key == ("double",)


def outputs_of(script: str) -> str:
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout


def _list_bodies(model: Model, scene: Scene, parameters: Mapping[str, float], outputs: object) -> Export:
    names = " ".join(body.name for body in model.bodies)
    return Export(files={"bodies.txt": f"{scene.name} {dict(parameters)}: {names}"}, differences=("Nothing moves.",))


def _none(model: Model, outputs: object) -> tuple[Output, ...]:
    return ()


BODIES = Exporter(name="mujoco", export=_list_bodies, known_outputs=_none)


def test_other_packages_add_exports(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One of a known name too, so that a package may have its own."""
    install(monkeypatch, EntryPoint(name="mujoco", value="tests.test_extensions:BODIES", group="cutjoint.exporters"))
    result = CliRunner().invoke(command, [str(FOUR_BAR), "--to", "mujoco", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "Nothing moves." in result.output
    assert (tmp_path / "bodies.txt").read_text() == "swing {}: crank_0.bar crank_1.bar crank_2.bar coupler_1.bar coupler_2.bar"
