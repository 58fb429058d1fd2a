"""Words of earlier versions in model and study files: they mean the same, and the new ones are reported."""

from __future__ import annotations

import re
from collections.abc import Iterable

import pytest

from cutjoint.model.document import renamed
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Scene
from cutjoint.sweeps.reading import read_study
from tests.conftest import MODELS

MODEL = """\
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
bodies: {bob: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
outputs: [bob.x]
scenes:
  swing:
    end: 1
    tolerance: 1 mm
    numerics: {tolerance: 1.0e-5, methods: {recursive: {tolerance: 1.0e-7}}}
"""
NEW = MODEL.replace("    tolerance", "    accuracy").replace("{tolerance", "{solver_tolerance")


def the_scene(text: str) -> tuple[Scene, tuple[str, ...]]:
    model = read_model_text(text, "arm.yaml")
    return model.scenes["swing"], model.notes


def test_the_tolerance_of_a_scene_is_its_accuracy_and_that_of_numerics_the_solver_s() -> None:
    (old, notes), (new, none) = the_scene(MODEL), the_scene(NEW)
    assert (old.accuracy, old.numerics.tolerance, old.numerics.of_method("recursive").tolerance) == (1e-3, 1e-5, 1e-7)
    assert old.numerics == new.numerics
    assert old.accuracy == new.accuracy
    assert none == ()
    assert notes == (
        "arm.yaml:10:5: 'tolerance' is now 'accuracy'", "arm.yaml:11:16: 'tolerance' is now 'solver_tolerance'",
        "arm.yaml:11:57: 'tolerance' is now 'solver_tolerance'",
    )  # fmt: skip


@pytest.mark.parametrize(("old", "new"), [("sdirk4", "radau5"), ("sdirk4-fixed", "radau5-fixed")])
def test_integrators_of_earlier_versions_are_those_that_took_their_places(old: str, new: str) -> None:
    scene, notes = the_scene(NEW.replace("{solver", f"{{integrator: {old}, solver", 1))
    assert scene.numerics.integrator == new
    assert notes == (f"arm.yaml:11:28: '{old}' is now '{new}'",)
    assert the_scene(NEW.replace("{solver", f"{{integrator: {new}, solver", 1)) == (scene, ())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (MODEL.replace("1 mm", "1 mm\n    accuracy: 1"), "10:5: file: 'tolerance' is the earlier word for 'accuracy', which is given too"),
        (MODEL.replace("1 mm", "-1 mm"), "10:16: scene 'swing': accuracy must be greater than zero"),
        (MODEL.replace("tolerance: 1.0e-5", "tolerance: [1]"), "11:27: scene 'swing': numerics.solver_tolerance needs a number"),
        (NEW.replace("solver_tolerance: 1.0e-5", "solver_toleranc: 1.0e-5"), "unknown field 'solver_toleranc'; did you mean"),
    ],
)  # fmt: skip
def test_what_is_wrong_has_its_place(text: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(text, "arm.yaml")
    assert message in str(error.value)


def test_a_study_says_it_too(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "study.yaml"
    file.write_text(
        f"cutjoint_study: 1\nmodel: {MODELS / 'press.yaml'}\ntolerance: 1e-8\nparameters: {{stiffness: [1000, 2000]}}\n"
        "objectives: {peak: {maximum: slider.x}}\n"
    )
    study = read_study(file)
    assert study.model.notes == (f"{file}:3:1: 'tolerance' is now 'solver_tolerance'",)
    (scene,) = study.scenes
    assert scene.numerics.of_method("recursive").tolerance == 1e-8


def test_the_body_of_a_reaction_is_whose_axes_also_in_submodels_of_submodels() -> None:
    text = MODEL.replace("    tolerance", "    accuracy").replace("{tolerance", "{solver_tolerance") + (
        "reactions: {hold: {joint: pin, body: bob}}\nmarkers: {end: {body: bob, at: [1, 0, 0]}}\n"
        "submodels:\n  pair:\n    connectors: [arm]\n    submodels:\n      part:\n        connectors: [arm]\n"
        "        bodies: {tip: {mass: 1, centre_of_mass: [2, 0, 0]}}\n"
        "        joints: {eye: {kind: revolute, bodies: [arm, tip], at: [1, 0, 0], axis: y}}\n"
        "        reactions: {bears: {joint: eye, body: arm, direction: z}}\n"
        "    instances: {one: {use: part, connect: {arm: arm}}}\n"
        "instances: {two: {use: pair, connect: {arm: bob}}}\n"
    )
    other = text.replace("pin, body:", "pin, axes_of:").replace("eye, body:", "eye, axes_of:")
    old, new = (read_model_text(each, "arm.yaml") for each in (text, other))
    assert [(r.name, r.body) for r in old.reactions] == [("hold", "bob"), ("two.one.bears", "bob")]
    assert [(r.body, r.direction) for r in old.reactions] == [(r.body, r.direction) for r in new.reactions]
    assert old.notes == ("arm.yaml:12:32: 'body' is now 'axes_of'", "arm.yaml:22:41: 'body' is now 'axes_of'")
    assert new.notes == ()


#: A file with every field and word of earlier versions.
EVERY = """\
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
bodies: {bob: {mass: 1, centre_of_mass: [1, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
reactions: {hold: {joint: pin, body: bob}}
forces:
  wheel:
    kind: tyre
    body: bob
    centre: [1, 0, 0]
    axis: [0, 1, 0]
    radius: 0.3
    stiffness: 1.0e+5
    calspan: {A0: 4000, A1: 10, A2: 6000, A3: 1.7, A4: 4000, B1: -0.00008, B3: 1.0, B4: 0, SN: 0.85, AF1: 0, AF2: 0}
    ground_height: 0
    ground_slope: 0
    ground_bank: 0
outputs: [bob.x]
scenes:
  one: {end: 1, tolerance: 1 mm, numerics: {tolerance: 1.0e-5, loops: compiled, integrator: sdirk4}}
  two: {end: 1, numerics: {methods: {recursive: {tolerance: 1.0e-7}}, integrator: sdirk4-fixed}}
"""


def changes(notes: Iterable[str]) -> set[tuple[str, str]]:
    return {(old, new) for note in notes for old, new in re.findall("'([^']+)' is now '([^']+)'", note)}


def listed(table: renamed.Renamed) -> set[tuple[str, str]]:
    pairs = [{path[-1]: new} if isinstance(new, str) else new for path, new in table.items()]
    return {pair for each in pairs for pair in each.items()}


def test_files_with_every_earlier_field_are_read(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """As the same files in the words of this version."""
    text = EVERY.replace("tolerance: 1 mm", "accuracy: 1 mm").replace("tolerance: 1.0", "solver_tolerance: 1.0")
    for old, new in (("ground_", "terrain_"), ("pin, body", "pin, axes_of"), ("sdirk4", "radau5"), ("compiled", "embedded")):
        text = text.replace(old, new)
    model, other = read_model_text(EVERY, "arm.yaml"), read_model_text(text, "arm.yaml")
    assert changes(model.notes) == listed(renamed.MODEL)
    assert other.notes == ()
    assert [(s.accuracy, s.numerics) for s in model.scenes.values()] == [(s.accuracy, s.numerics) for s in other.scenes.values()]
    assert [r.body for r in model.reactions] == [r.body for r in other.reactions]
    for integrator in renamed.FORMER_INTEGRATORS:
        (tmp_path / "study.yaml").write_text(
            f"cutjoint_study: 1\nmodel: {MODELS / 'press.yaml'}\nopen: [slider.mass]\ntolerance: 1e-8\nintegrator: {integrator}\n"
            "parameters: {slider.mass: [1, 2]}\nobjectives: {peak: {maximum: slider.x}}\n"
        )
        found = changes(read_study(tmp_path / "study.yaml").model.notes)
        assert found == {pair for pair in listed(renamed.STUDY) if pair[0] not in renamed.FORMER_INTEGRATORS or pair[0] == integrator}
