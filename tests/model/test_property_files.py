"""Property files of tyres: units, keys, kinds, sides, and what is reported of files that are wrong."""

from __future__ import annotations

import math
import random
import re
from pathlib import Path

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.files.property_file import read_properties
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import library_folder
from tests.fuzz.tyres import DATA, MODEL

TYRE = (DATA / "mf62.tir").read_text()


def values(text: str) -> dict[str, float]:
    return dict(read_properties(text, "t.tir", "instance 'w'").values)


def notes(folder: Path, text: str, model: str = MODEL) -> list[str]:
    """Problems, else notes, of a model with a tyre's file."""
    (folder / "tyre.tir").write_text(text, encoding="utf-8")
    try:
        return list(read_model_text(model, "m.yaml", folder=folder).notes)
    except ModelError as error:
        return str(error).splitlines()


def test_numbers_come_in_si() -> None:
    """By the words of the section UNITS; coefficients have none."""
    units = "[UNITS]\nFORCE = 'kN'\nLENGTH = 'mm'\nANGLE = 'deg'\nMASS = 'gram'\nTIME = 'second'\nPRESSURE = 'bar'\n"
    keys = "FNOMIN = 4\nUNLOADED_RADIUS = 317 $ mm\nVERTICAL_STIFFNESS = 0.2\nVERTICAL_DAMPING = 5D-5\nIYY = 1e9 ! g mm2\n"
    found = values(f"{units}[TYRE]\n{keys}NOMPRES = 2.2\nALPMAX = 90\nPDX1 = 1.2\nLONGVL = 16000\nTYRESIDE = 'RIGHT'\nNAME = 'x y'\n")
    assert found == pytest.approx({
        "FNOMIN": 4000, "UNLOADED_RADIUS": 0.317, "VERTICAL_STIFFNESS": 2e5, "VERTICAL_DAMPING": 50, "IYY": 1, "NOMPRES": 2.2e5,
        "ALPMAX": 1.5707963267948966, "PDX1": 1.2, "LONGVL": 16, "TYRESIDE": -1,
    })  # fmt: skip


def test_older_files_have_their_kind() -> None:
    assert values("[MODEL]\nPROPERTY_FILE_FORMAT = 'PAC2002'\nPCX1 = 1")["FITTYP"] == 6
    assert "FITTYP" not in values("[MODEL]\nPROPERTY_FILE_FORMAT = 'USER'\nPCX1 = 1")


def test_sections_of_tables_and_texts_of_other_encodings_are_passed_over(tmp_path: Path) -> None:
    assert values("$ a\n[SHAPE]\n{radial width}\n1.0 0.0\n[LONGITUDINAL]\nPCX1=1.6\r\n") == {"PCX1": 1.6}
    (tmp_path / "tyre.tir").write_bytes(TYRE.encode() + b"$ gr\xf6\xdfe\n")
    assert read_model_text(MODEL, "m.yaml", folder=tmp_path).bodies


def test_each_key_that_is_wrong_is_reported_with_its_line(tmp_path: Path) -> None:
    number = next(i for i, line in enumerate(TYRE.splitlines(), start=1) if line.startswith("PCX1"))
    without = "".join(line for line in TYRE.splitlines(keepends=True) if not line.startswith("PCX1"))
    assert notes(tmp_path, without) == [
        "m.yaml:8:13: instance 'w': with and properties lack PCX1; the submodel 'wheel' needs all its parameters"
    ]  # fmt: skip
    wrong = re.sub(r"(?m)^PCX1\s*=.*$", "PCX1 = many", TYRE)
    assert notes(tmp_path, wrong) == [
        f"tyre.tir:{number}:1: instance 'w': PCX1: 'many' is no number; write a decimal number, a text in quotes"
    ]  # fmt: skip
    lines = len(TYRE.splitlines())
    assert notes(tmp_path, f"{TYRE}\nPCX1 = 2\nhello\n") == [
        f"tyre.tir:{lines + 2}:1: instance 'w': 'PCX1' is given twice, first in line {number}; keep one of them",
        f"tyre.tir:{lines + 3}:1: instance 'w': this is no KEY = value; comments begin with $ or !",
    ]
    assert notes(tmp_path, TYRE.replace("'kg'", "'stone'"))[0].endswith("instance 'w': unknown unit 'stone' of MASS; did you mean 'tonne'?")
    assert notes(tmp_path, f"{TYRE}\nQXYZ9 = 0.4\n")[0].endswith(f"Q_RB2 (line 77), QXYZ9 (line {lines + 2})")


def test_files_of_other_kinds_are_refused(tmp_path: Path) -> None:
    other = re.sub(r"(?m)^FITTYP\s*=.*$", "FITTYP = 52", TYRE)
    line = next(i for i, text in enumerate(TYRE.splitlines(), start=1) if text.startswith("FITTYP"))
    assert notes(tmp_path, other)[0] == (
        f"tyre.tir:{line}:1: instance 'w': FITTYP is 52, and the submodel 'wheel' is made for 60, 61 or 62; use another submodel,"
        " or another file"
    )
    assert notes(tmp_path, TYRE, MODEL.replace("properties: tyre.tir", "properties: tyre.txt")) == [
        "m.yaml:8:95: instance 'w': the file 'tyre.txt' has no properties of a tyre; name a .tir file, or write {KEY: number}"
    ]


@pytest.mark.parametrize(("wheel", "data", "kind"), [
    *(("wheel_mf52", "mf52.tir", f"FITTYP = {kind}") for kind in (6, 21, 52)), ("wheel_mf52", "mf52.tir", ""),
    *(("wheel_mf62", "mf62.tir", f"FITTYP = {kind}") for kind in (60, 61, 62)),
])  # fmt: skip
def test_each_kind_of_file_has_its_submodel(wheel: str, data: str, kind: str, tmp_path: Path) -> None:
    """Files of PAC2002 need not say it; another submodel refuses the file."""
    text = re.sub(r"(?m)^FITTYP\s*=.*\n", f"{kind}\n", (DATA / data).read_text())
    more = ", MASS: 20, IXX: 0.6, IYY: 1" if wheel == "wheel_mf52" else ""
    model = MODEL.replace("z: 0.3}", f"z: 0.3{more}}}")
    (tmp_path / "tyre.tir").write_text(text)
    read = read_model_text(model.replace("wheel_mf62", wheel), "m.yaml", folder=tmp_path)
    number = kind.rpartition(" ")[2] or "6"
    assert read.choices["w"].startswith(f"FITTYP {number}, TYRESIDE 1, tan_alpha 0, ")
    other = {"wheel_mf52": "wheel_mf62", "wheel_mf62": "wheel_mf52"}[wheel]
    assert any(f"FITTYP is {number}, and the submodel" in line for line in notes(tmp_path, text, model.replace("wheel_mf62", other)))


def test_values_beside_a_file_go_before_it(tmp_path: Path) -> None:
    (tmp_path / "tyre.tir").write_text(TYRE)
    given = read_model_text(MODEL.replace("z: 0.3}", "z: 0.3, MASS: 77}"), "m.yaml", folder=tmp_path)
    assert next(body for body in given.bodies if body.name == "w.rolling.wheel").mass == 77


def test_files_that_are_broken_are_read_or_refused() -> None:
    """Bytes changed at random: never another error."""
    rng, refused = random.Random(1), 0
    for _ in range(300):
        characters = list(TYRE)
        for _ in range(rng.randrange(1, 20)):
            characters[rng.randrange(len(characters))] = chr(rng.choice((*range(9, 127), 0, 0xFFFD, 0x2028)))
        try:
            read_properties("".join(characters), "t.tir", "instance 'w'")
        except ModelError:
            refused += 1
    assert refused > 0


def test_the_tyre_of_the_library_is_what_its_comment_says(tmp_path: Path) -> None:
    """N/degree across, N for all slip along and the trail at 4 kN, by hand; the submodel takes all of its keys."""
    found = values((library_folder() / "road_tyre.tir").read_text(encoding="utf-8"))
    load = found["FNOMIN"]
    across = -found["PKY1"] * load * math.sin(found["PKY4"] * math.atan(1 / found["PKY2"]))
    assert math.radians(across) == pytest.approx(1126, abs=1)
    assert (load * found["PKX1"], found["PDY1"], found["PDX1"]) == (88000, 1.0, 1.1)
    assert found["UNLOADED_RADIUS"] * found["QDZ1"] == pytest.approx(0.035, abs=5e-4)
    (note,) = notes(tmp_path, "", MODEL.replace("tyre.tir", "library/road_tyre.tir"))
    assert "the tyre gains 3.5 %" in note
    assert notes(tmp_path, "", MODEL.replace("tyre.tir", "library/rode_tyre.tir")) == [
        "m.yaml:8:95: instance 'w': the library has no tyre 'rode_tyre.tir'; did you mean 'road_tyre.tir'?"
    ]


CHOSEN = """
cutjoint: 1
name: two
gravity: [0, 0, -9.81]
parameters: {on: 1, quick: {value: 0.5, binding: input}}
bodies: {hull: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {free: {kind: free, bodies: [ground, hull], at: [0, 0, 0]}}
submodels:
  fin:
    connectors: [hull]
    parameters: [area, mode]
    defaults: {soft: 0, stiff: 10*area}
    choices: [mode, soft]
    warns: {soft: "a spring: steps of {2/stiff} s at most", mode: "another one"}
    forces: {drag: {kind: load, body: hull, at: [0, 0, 0], force: ["-area*vx*mode - soft*x*stiff", 0, 0]}}
instances:
  left: {use: fin, connect: {hull: hull}, with: {area: 2, mode: 0}}
  right: {use: fin, connect: {hull: hull}, with: {area: 3, mode: 0}}
  top: {use: fin, connect: {hull: hull}, with: {area: 4, mode: quick, soft: on}}
scenes: {run: {end: 1}}
"""


def test_choices_and_warnings_of_submodels_are_reported() -> None:
    """By the values of the instances; equal ones stand together, a value that changes with time is none."""
    model = read_model_text(CHOSEN, "m.yaml")
    assert model.choices == {"left, right": "mode 0, soft 0", "top": "mode varies, soft 1"}
    assert model.notes == (
        "m.yaml:19:3: soft of 'fin' is on: a spring: steps of 0.05 s at most", "m.yaml:19:3: mode of 'fin' is on: another one"
    )  # fmt: skip
    wrong = CHOSEN.replace("choices: [mode, soft]", "choices: [mood, soft]").replace("warns: {soft:", "warns: {sift:")
    with pytest.raises(ModelError) as caught:
        read_model_text(wrong, "m.yaml")
    assert str(caught.value).splitlines() == [
        "m.yaml:13:15: submodel 'fin': choices: unknown parameter 'mood'; did you mean 'mode'?",
        "m.yaml:14:13: submodel 'fin': warns: unknown parameter 'sift'; did you mean 'soft'?",
    ]


OLD = (DATA / "mf52.tir").read_text()
ON_OLD = MODEL.replace("wheel_mf62", "wheel_mf52")
MASSES = ON_OLD.replace("z: 0.3}", "z: 0.3, MASS: 20, IXX: 0.6, IYY: 1}")


def test_masses_that_a_file_leaves_out_are_the_instances(tmp_path: Path) -> None:
    assert notes(tmp_path, OLD, ON_OLD) == [
        "m.yaml:8:13: instance 'w': with and properties lack MASS, IXX, IYY; "
        "the file leaves them to you: write MASS: ..., IXX: ..., IYY: ... into with"
    ]
    lacking = notes(tmp_path, re.sub(r"(?m)^IYY\s*=.*$", "", TYRE))[0]
    assert lacking.endswith("lack IYY; the file leaves them to you: write IYY: ... into with")


@pytest.mark.parametrize("absent", ["", r"\1 =", r"\1 = $ nothing"])
def test_coefficients_that_a_file_lacks_or_leaves_blank_are_those_of_the_format(absent: str, tmp_path: Path) -> None:
    """The model is that of a file that says their defaults."""
    keys = ("LONGVL", "PEX4", "PHY3", "RHX1", "QEZ5", "SSZ4", "QSY1", "DREFF")
    defaults = dict.fromkeys(keys, 0.0) | {"LONGVL": 16.7}
    lacking, whole = (re.sub(rf"(?m)^({'|'.join(keys)})(\s*=).*$", by, OLD) for by in (absent, r"\1\2 DEFAULT"))
    for key, value in defaults.items():
        whole = re.sub(rf"(?m)^({key}\s*=).*$", rf"\1 {value}", whole)
    said = next(note for note in notes(tmp_path, lacking, MASSES) if "lacks" in note)
    assert said == (
        "tyre.tir: lacks coefficients, which have the format's defaults in 'wheel': "
        "0 for PEX4, PHY3, RHX1, QSY1, QEZ5, SSZ4, DREFF, and 16.7 for LONGVL"
    )
    models = []
    for text in (lacking, whole):
        (tmp_path / "tyre.tir").write_text(text)
        models.append(read_model_text(MASSES, "m.yaml", folder=tmp_path))
    assert [signal.value for signal in models[0].signals] == [signal.value for signal in models[1].signals]


def test_a_file_of_another_kind_has_no_other_faults(tmp_path: Path) -> None:
    """FITTYP 5: what its numbers would make of formulas that are not its own is no matter."""
    old = re.sub(r"(?m)^(PKY2|PTX1|PCX1)(\s*=).*$", r"\1\2 0", re.sub(r"(?m)^FITTYP\s*=.*$", "FITTYP = 5", OLD))
    (line,) = notes(tmp_path, re.sub(r"(?m)^PDX1\s*=.*$", "", old), ON_OLD)
    assert line.endswith("FITTYP is 5, and the submodel 'wheel' is made for 6, 21 or 52; use another submodel, or another file")
