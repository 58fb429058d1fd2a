"""All faults of one element come at once, and a part of the wrong shape is one fault: nothing follows from it elsewhere."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cutjoint.model.document.source import parse_yaml
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.read import read_model_text

from .pendulum import PENDULUM, problems

_FRAME = """
cutjoint: 1
name: m
gravity: [0, 0, 0]
{sections}
scenes: {{run: {{end: 1}}}}
"""
_SOUND = {
    "bodies": "rod: {mass: 1, centre_of_mass: [0, 0, 0]}",
    "joints": "hinge: {kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: y}",
}
#: A wrong element of a section, and what all is wrong with it; each has an unknown field, and most a part of the wrong shape.
_WRONG: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "body": ("bodies", "{mas: 1, mass: [2], centre_of_mass: [0, 0, zz], inertia: [1, 1, 9]}",
             ("'mas'", "mass needs", "'zz'", "principal moment")),
    "joint": (
        "joints", "{kind: revolute, bodys: [a], bodies: [rodd, hinge], at: [0, 0, q], axis: 3, limits: {lower: 1, upper: 0, stifness: 3}}",
        ("'bodys'", "unknown body 'rodd'; did you mean 'rod'?", "unknown body 'hinge'", "'q'", "axis needs", "'stiffness' is missing",
         "lower is not below upper", "'stifness'"),
    ),
    "joint force": ("forces", "{kind: joint_force, joint: hing, coordinat: angle}",
                    ("unknown joint 'hing'", "'law' is missing", "'coordinat'")),
    "spring": (
        "forces",
        "{kind: point_spring, bodies: [ground, rodd], from: [0], too: Q, to: Q, law: {stiffness: kk, damping: 1 kg, free_length: 1}}",
        ("unknown body 'rodd'", "from needs", "'too'", "unknown point 'Q'", "'kk'", "damping needs N*s/m"),
    ),
    "bushing": (
        "forces", "{kind: bushing, bodies: [ground, rodd], at: O, stiffness: [1, 2], damping: [1, 1, 1, 1, 1, x], xx: 3}",
        ("unknown body 'rodd'", "unknown point 'O'", "stiffness needs six", "unknown symbol 'x'", "'xx'"),
    ),
    "load": ("forces", "{kind: load, body: rodd, at: [0, 0, 0], force: [1, 2, q], torqe: 1, axes: local}",
             ("unknown body 'rodd'", "'q'", "'torqe'", "'global' or 'body'")),
    "axial force": ("forces", "{kind: axial_force, bodies: [ground, rodd], pont: 1, axis: [0, 0, 0]}",
                    ("unknown body 'rodd'", "'origin' is missing", "'point' is missing", "'law' is missing", "'pont'", "axis has no")),
    "contact": (
        "forces",
        "{kind: contact, bodies: [ground, rodd], at: [0, 0, q], normal: w, centre: [0, 0, 0], radius: -1, forc: 1, force: [1, 2]}",
        ("unknown body 'rodd'", "'q'", "normal needs", "radius must be greater than zero", "'forc'", "force needs three"),
    ),
    "wheel": (
        "forces", "{kind: wheel, body: rodd, centre: 3, axis: [0, 0, 0], radius: 0, force: [0, 0, dd], momnt: 1}",
        ("unknown body 'rodd'", "centre needs", "axis has no direction", "radius must be greater than zero", "'dd'", "'momnt'"),
    ),
    "friction": ("forces", "{kind: joint_friction, joint: hing, coefficient: -1, radius: q, statc: 2, preload: [1]}",
                 ("unknown joint 'hing'", "coefficient must not be negative", "'q'", "'statc'", "preload needs")),
    "gear": ("gears", "{joints: [hing], ratio: rr, ratoi: 3}", ("joints", "'rr'", "'ratoi'")),
    "state": ("states", "{strt: 1, rate: hing.angle, nominal: -1}",
              ("'strt'", "'start' is missing", "unknown element 'hing'", "nominal must be")),
    "controller": (
        "controllers", "{every: -1 ms, ofset: 2, signals: {u: hing.angle}, memory: {m: {start: q, nex: u}}}",
        ("every must be", "'ofset'", "unknown element 'hing'", "'q'", "'next' is missing", "'nex'"),
    ),
    "reaction": ("reactions", "{joint: hing, axes_off: ground, axes_of: rodd, direction: 3}",
                 ("unknown joint 'hing'", "'axes_off'", "unknown body 'rodd'", "direction needs")),
    "marker": ("markers", "{body: rodd, at: [1], att: 2}", ("unknown body 'rodd'", "at needs", "'att'")),
}  # fmt: skip


@pytest.mark.parametrize("kind", _WRONG)
def test_all_faults_of_one_element(kind: str) -> None:
    section, text, expected = _WRONG[kind]
    sections = {**_SOUND, section: f"{_SOUND[section]}, bad: {text}" if section in _SOUND else f"bad: {text}"}
    found = problems(_FRAME.format(sections="\n".join(f"{name}: {{{part}}}" for name, part in sections.items())))
    assert all(any(words in line for line in found) for words in expected), found
    others = [line for line in found if not any(words in line for words in expected)]
    assert [line for line in others if "no joint connects it" not in line] == []


EVERY_KIND = Path(__file__).with_name("every_kind.yaml")
_UNFIT = ({"qq": 1}, [], True, None, 7.5, [[1]])
_MISSING = object()
_SECTIONS = ("bodies", "joints", "gears", "forces", "reactions", "markers", "states", "signals", "controllers")


def test_a_part_of_the_wrong_shape_is_one_fault() -> None:
    """Of an element of each kind, its parts are taken away or exchanged: all that is said is said of that element, in words of the file."""
    data = json.loads(json.dumps(parse_yaml(EVERY_KIND.read_text(encoding="utf-8"), "m.yaml").data))
    places = [(section, name, *path) for section in _SECTIONS for name in data[section] for path in _paths(data[section][name], 3)]
    rng, tried = random.Random(4), 0
    for place in rng.sample(places, 24):
        unfit = rng.choice((*_UNFIT, _MISSING))
        said = _problems(json.dumps(_exchanged(data, place, unfit)))
        tried += bool(said)
        assert not [each for each in said if each.element.rpartition(" ")[2] != f"'{place[1]}'"], (place, unfit, said)
        assert not [each for each in said if "'?'" in str(each)], (place, unfit, said)
    assert tried > 10


def test_a_body_that_has_a_fault_is_offered_once() -> None:
    text = PENDULUM.replace("mass: arm_mass", "mass: []", 1).replace("bodies: [ground, arm]", "bodies: [ground, leg]", 1)
    assert any("unknown body 'leg'; bodies here: arm, ground" in str(each) for each in _problems(text))


def _problems(text: str) -> tuple[Problem, ...]:
    try:
        read_model_text(text, "m.json")
    except ModelError as error:
        return tuple(error.problems)
    return ()


def _paths(part: Any, depth: int) -> Iterator[tuple[str | int, ...]]:
    items = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    for key, inner in items if depth else ():
        yield (key,)
        yield from ((key, *path) for path in _paths(inner, depth - 1))


def _exchanged(data: Any, place: tuple[str | int, ...], value: Any) -> Any:
    key, *rest = place
    if isinstance(data, list):
        assert isinstance(key, int)
        inner = _exchanged(data[key], tuple(rest), value) if rest else value
        return [*data[:key], *([] if inner is _MISSING else [inner]), *data[key + 1 :]]
    inner = _exchanged(data[key], tuple(rest), value) if rest else value
    return {name: inner if name == key else part for name, part in data.items() if name != key or inner is not _MISSING}


def test_no_text_of_a_file_passes_for_what_was_lost() -> None:
    """Parts of the wrong shape have a stand-in that checks skip, which no file can write itself."""
    for text in ('"?"', '"arm?"', '"\\0"', '"arm\\0"'):
        with pytest.raises(ModelError):
            read_model_text(PENDULUM.replace("mass: arm_mass", f"mass: {text}", 1), "m.yaml")
