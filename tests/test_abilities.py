"""What no method, generic solver, peer or tool of this machine can do is refused before anything is derived or compiled."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ClassVar

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.elements.force import Force as ForceElement
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Force, PointSpring
from cutjoint.topology.reading import read_model
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.generic import artifact
from cutjoint_bench.generic.artifact import compile_generic
from cutjoint_bench.generic.mechanism import _KINDS
from cutjoint_bench.mechanics_alone import KNOWN
from tests.conftest import MODELS
from tests.model.test_docs import EVERY_FORCE

PENDULUM = MODELS / "pendulum.yaml"


def _no_work(*given: object, **more: object) -> None:
    raise AssertionError("this is work")


@dataclass(frozen=True)
class _Odd(LineForce):
    """An interaction that nobody else knows."""


@dataclass(frozen=True, kw_only=True)
class _OddForce(PointSpring):
    element: ClassVar[ForceElement] = replace(PointSpring.element, kind="odd", interaction=_Odd(**vars(PointSpring.element.interaction)))


def test_one_table_has_the_interactions_of_the_generic_solver_and_of_peers() -> None:
    assert set(_KINDS) == set(KNOWN)


def _odd_force() -> Force:
    spring = next(force for force in EVERY_FORCE if isinstance(force, PointSpring))
    return _OddForce(**{field.name: getattr(spring, field.name) for field in fields(spring)})


_UNKNOWN = [*(force for force in EVERY_FORCE if type(force.interaction) not in KNOWN), _odd_force()]


@pytest.mark.parametrize("force", _UNKNOWN, ids=lambda force: force.element.kind)
def test_kinds_of_forces_that_others_do_not_know(force: Force, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(artifact, "generate", _no_work)
    monkeypatch.setattr("cutjoint_bench.export.mechanism.find_start", _no_work)
    model = read_model(PENDULUM)
    odd, scene = replace(model, forces=(force,)), next(iter(model.scenes.values()))
    for call in (lambda: compile_generic(odd, scene), lambda: build_mechanism(odd, scene, {})):
        with pytest.raises(ModelError, match=f"'{force.name}': only cutjoint has"):
            call()


@pytest.mark.parametrize("words", [("drive",), ("compile", "--target", "wasm")], ids=lambda words: words[0])
def test_zig_is_looked_for_before_work(words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.toolchain.wasm.find_zig", lambda: None)
    monkeypatch.setattr("cutjoint.view.drive.generate", _no_work)
    monkeypatch.setattr("cutjoint.commands.compile.generate", _no_work)
    out = tmp_path / ("page.html" if words[0] == "drive" else "out")
    result = CliRunner().invoke(main, [*words, str(PENDULUM), "--out", str(out)])
    assert (result.exit_code, "missing: ziglang" in result.output, out.exists()) == (1, True, False)


@pytest.mark.parametrize("more", [("--method", "augmented", "--integrator", "radau5"), ("--integrator", "generalised-alpha")], ids=" ".join)
def test_integrators_of_other_methods_are_refused_before_work(more: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.commands.preparing.compile_scene", _no_work)
    result = CliRunner().invoke(main, ["simulate", str(PENDULUM), *more])
    assert result.exit_code == 1, result.output
    assert "is for the method recursive-newton, not for" in result.output
