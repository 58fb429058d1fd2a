"""The errors that users catch: one class of all, a class for each stage, and the built-in classes that they have been."""

from __future__ import annotations

import pickle
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import click
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.commands.options import reports_errors
from cutjoint.run.results import FailureReport
from cutjoint.tasks.states import NoEquilibriumError
from tests.conftest import MODELS

#: The built-in class of each error that is reported to users, besides Exception.
BUILT_IN: dict[str, type[Exception] | None] = {
    "ConstantError": ArithmeticError, "CutjointError": None, "EquationsError": None, "FailedBatchError": RuntimeError,
    "FailedRealTimeError": RuntimeError, "FailedRunError": RuntimeError, "GuideError": ValueError, "IncompleteError": RuntimeError,
    "MissingLibraryError": RuntimeError, "MissingPackageError": RuntimeError, "MissingToolsError": RuntimeError, "ModelError": None,
    "NetworkError": ValueError, "NoEquilibriumError": RuntimeError,
    "NoInertiaError": ValueError, "OutputError": ValueError, "RunError": ValueError, "SimulationError": None,
    "SimulatorError": RuntimeError, "ToolchainError": RuntimeError, "TopologyError": None,
}  # fmt: skip

#: The classes of one stage each, directly beneath the class of all.
STAGES = {
    "EquationsError", "IncompleteError", "MissingLibraryError", "MissingPackageError", "ModelError", "OutputError", "RunError",
    "SimulationError", "SimulatorError", "ToolchainError",
}  # fmt: skip

#: Errors that become another error, with its place in the user's file, before anybody is reported.
CONVERTED = {
    "AsymmetryError", "ExpressionError", "GlbError", "NoEmbeddingError", "NoMassError", "NoPivotError", "NotReachedError",
    "OverflowedConstantError", "QuantityError", "SingularError", "StepsError", "UnitError",
}  # fmt: skip

#: Signals between functions that are no errors.
SIGNALS = {"BuildPending"}


def error_classes() -> dict[str, type[Exception]]:
    """Every class of exceptions in the product by its name, but for those of one module's own."""
    modules = [import_module(found.name) for found in walk_packages(cutjoint.__path__, "cutjoint.")]
    classes = [c for module in modules for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]
    return {c.__name__: c for c in classes if issubclass(c, Exception) and not c.__name__.startswith("_")}


def exported() -> dict[str, type[Exception]]:
    found = {name: getattr(cutjoint, name) for name in cutjoint.__all__}
    return {name: c for name, c in found.items() if isinstance(c, type) and issubclass(c, Exception)}


def test_every_error_has_the_one_class_or_becomes_one_that_has() -> None:
    others = {name for name, c in error_classes().items() if not issubclass(c, cutjoint.CutjointError)}
    assert others == CONVERTED | SIGNALS


def test_every_error_is_caught_by_an_exported_class_of_its_stage() -> None:
    reported = [c for c in error_classes().values() if issubclass(c, cutjoint.CutjointError) and c is not cutjoint.CutjointError]
    stages = {name: c for name, c in exported().items() if c.__bases__[0] is cutjoint.CutjointError}
    assert stages.keys() == STAGES
    assert [c for c in reported if not issubclass(c, tuple(stages.values()))] == []


def test_errors_keep_their_built_in_classes() -> None:
    errors = exported()
    assert errors.keys() == BUILT_IN.keys()
    for name, built_in in BUILT_IN.items():
        assert issubclass(errors[name], cutjoint.CutjointError)
        assert [c for c in (ArithmeticError, RuntimeError, ValueError) if issubclass(errors[name], c)] == ([built_in] if built_in else [])


def test_the_one_class_catches_what_each_stage_raises(tmp_path: Path) -> None:
    loose = (
        "cutjoint: 1\nname: loose\ngravity: [0, 0, -9.81]\nbodies:\n  a: {massless: true}\n"
        "joints:\n  hinge: {kind: revolute, bodies: [ground, a], at: [0, 0, 0], axis: [0, 1, 0]}\n"
        "scenes:\n  still: {end: 1, output_step: 1, outputs: [hinge.angle]}\n"
    )
    with pytest.raises(cutjoint.CutjointError, match="unknown field 'massles'") as error:
        cutjoint.read_model_text(loose.replace("massless", "massles"), "loose.yaml")
    assert type(error.value) is cutjoint.ModelError
    (tmp_path / "loose.yaml").write_text(loose)
    with pytest.raises(cutjoint.CutjointError, match="nothing resists the motion of body 'a'") as error:
        cutjoint.compile_model(tmp_path / "loose.yaml")
    assert type(error.value) is cutjoint.NoInertiaError
    with pytest.raises(cutjoint.CutjointError, match="no scene 'walk'") as error:
        cutjoint.compile_model(MODELS / "press.yaml", scene="walk")
    assert type(error.value) is cutjoint.RunError


@pytest.mark.parametrize("base", [cutjoint.CutjointError, cutjoint.SimulationError, cutjoint.EquationsError])
def test_a_command_tells_of_an_error_that_it_has_never_heard_of(base: type[Exception]) -> None:
    """Commands keep no list of classes."""
    new = type("NewError", (base,), {"__init__": lambda self, text: Exception.__init__(self, text), "__str__": lambda self: self.args[0]})

    @click.command()
    @reports_errors
    def command() -> None:
        raise new("arm.yaml:3:5: body 'arm': it is bent; straighten it")

    done = CliRunner().invoke(command)
    assert (done.exit_code, done.output) == (1, "arm.yaml:3:5: body 'arm': it is bent; straighten it\n")


def test_an_error_of_python_is_no_message_of_a_command() -> None:
    @click.command()
    @reports_errors
    def command() -> None:
        raise ValueError("a fault of the product")

    assert isinstance(CliRunner().invoke(command).exception, ValueError)


def test_an_equilibrium_that_is_not_found_comes_back_from_another_process() -> None:
    report = FailureReport(time=0.0, step=3, message="the search does not converge", element="hinge.angle", residual=2.0, advice="look")
    error = pickle.loads(pickle.dumps(NoEquilibriumError("arm.yaml: no equilibrium", report)))
    assert (str(error), error.report) == ("arm.yaml: no equilibrium", report)
