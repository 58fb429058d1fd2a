"""Files that a model names, damaged: a model that has their numbers, or problems with their places; no other file is read."""

from __future__ import annotations

import csv
import io
import json
import os
import random
import re
import time
from math import isclose
from pathlib import Path
from tempfile import TemporaryDirectory

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.compile import pipeline
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.units import measure
from cutjoint.model.read import read_model
from cutjoint.model.records import Model
from cutjoint.program.blocks import ConstantError
from cutjoint.run.scenes import find_scene
from cutjoint.topology.spanning_tree import TopologyError

from .pipeline import SLOWEST

#: A row of slides in submodels within each other, with a table beside the inner one, points, and outputs by expressions.
FILES = {
    "rows.yaml": """\
cutjoint: 1
name: rows
gravity: [0, 0, -9.81]
points: {file: points.csv}
bodies: {base: {mass: 3, centre_of_mass: A}}
joints: {fall: {kind: free, bodies: [ground, base], at: A}}
submodels: {row: {include: parts/row.yaml}}
instances:
  a: {use: row, connect: {base: base}, with: {reach: 1}}
  b: {use: row, connect: {base: base}, with: {reach: 2}, mirror: x}
outputs: [a.turn.angle, {lean: {value: base.roll + 2*base.az, unit: deg}}, {far: {value: base.x - a.end.last.x, unit: mm}}]
scenes: {run: {end: 1}}
""",
    "parts/row.yaml": """\
cutjoint: 1
connectors: [base]
parameters: [reach]
points: {A: [0.1, 0.2, 0.3]}
bodies: {first: {mass: 2, centre_of_mass: [reach, 0.5, -0.2], inertia: [2, 3, 4]}}
joints: {turn: {kind: revolute, bodies: [base, first], at: A, axis: [1, 2, 3]}}
submodels: {tail: {include: tail.yaml}}
instances: {end: {use: tail, connect: {base: first}, with: {far: 2*reach}, mirror: y}}
outputs: [{slip: end.slide.displacement_rate}]
""",
    "parts/tail.yaml": """\
cutjoint: 1
connectors: [base]
parameters: [far]
bodies: {last: {mass: 1, centre_of_mass: [far, 0.1, 0.2], inertia: [1, 1, 1]}}
joints: {slide: {kind: prismatic, bodies: [base, last], at: [far, 0, 0.1], axis: [2, 1, 1]}}
forces: {drag: {kind: joint_force, joint: slide, law: {table: {file: data/drag.csv}, interpolation: linear}}}
outputs: [{push: {value: drag.force, unit: kN}}]
""",
    "parts/data/drag.csv": "# made\nrate [mm/s], value [kN]\n-1000, 2\n250.5, 0.5\n1e3, -2\n",
    "points.csv": "name, x [mm], y, z\nA, 100, 0.2, 0.3\nB, 0, 0, -1\n",
}
#: Escapes of YAML, some of which name no character.
ESCAPES = (
    '"\\ud800"', '"\\udfff\\ud800"', '"\\U00110000"', '"\\UFFFFFFFF"', '"\\0"',
    '"\\x1b"', '"\\e[31m"', '"\\u202e"', '"\\N"', '"\\uFFFE"', "\u00b2",
)  # fmt: skip
#: Stands in a file outside of the model's folder.
SECRET = "4711.815"
#: Names that lead elsewhere, and what must not be taken for a number, a name, a unit or an expression.
NAMES = (
    "../secret.csv", "link.csv", "parts/../../secret.csv", "/etc/passwd", "library/double_wishbone", "library/../x", "parts", "rows.yaml",
    "row.yaml", "tail.yaml", "nothing.csv", "", "a\\b.csv", "x" * 300 + ".csv", "\u202e.csv", "con.csv", "data/drag.csv", "*.csv",
    "loop.csv", "pipe.csv", "x" * 5000 + ".csv",
)  # fmt: skip
CELLS = (
    "nan", "inf", "", "1_000", "0x10", "1e999", "1,5", "--1", "١", "1 2", '"1"', "=1+1", "1;2", "-0", "1e-320", "#", "\t", "1\r", "\ufeff1",
    "9" * 400,
)  # fmt: skip
UNITS = ("[]", "[mm", "mm]", "[[m]]", "[furlong]", "[degC]", "[m]", "[1]", "[s]", "[N/m^99]", "[" + "m" * 100 + "]", "[\x00]", "[e^x]")
EXPRESSIONS = (
    "base.", ".x", "a.end.last.vz", "push", "lean", "1/0", "sqrt(-1)", "a.b.c.d", "__import__('os')", "base.x**99", "x" * 3000, "[1]",
    "{a: 1}", "~", "0*base.ax", "a.slip", "exp(1000*base.x)", "ground.x", "a", "a.turn", "max(base.x, 1 m)", "3 mm",
)  # fmt: skip


def make(rng: random.Random) -> str:
    """The contents of all files by name, some of them damaged, as JSON."""
    files = dict(FILES)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        name = rng.choice(list(files))
        files[name] = _damaged(rng, name, files[name])
    return json.dumps(files)


def _damaged(rng: random.Random, name: str, text: str) -> str:
    what = rng.randrange(4)
    if what == 0:
        at, length = rng.randrange(len(text) + 1), rng.choice((0, 1, 3, 20))
        put = rng.choice(("", ",", "\n", "#", ":", "{", "}", "[", "'", "\t", "\r", "\x1b", "é", "-", text[:at], *ESCAPES))
        return text[:at] + put + text[at + length :]
    if what == 1:
        lines = text.split("\n")
        i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[i], lines[j] = lines[j], rng.choice((lines[i], lines[j]))
        return "\n".join(lines)
    if name.endswith(".csv"):
        pattern, puts = (r"\[[^\]]*\]", UNITS) if what == 2 else (r"(?<=[,\n])[^,\n]+", (*CELLS, *map(str, range(-3, 3))))
    else:
        pattern, puts = rng.choice(((r"[\w/.]+\.(?:csv|yaml)", NAMES), (r"(?<=value: )[^,}]+|(?<=slip: )[^}]+", EXPRESSIONS)))
    places = list(re.finditer(pattern, text))
    if not places:
        return text
    place = rng.choice(places)
    return text[: place.start()] + rng.choice(puts) + text[place.end() :]


def check(text: str) -> tuple[str, ...]:
    """The problems of a refused model; fails where one has no place, where another file was read, or where numbers are not the file's."""
    files = json.loads(text)
    with TemporaryDirectory() as name:
        folder = Path(name) / "inside"
        for path, content in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(content.encode("utf-8", "surrogatepass"))
        (Path(name) / "secret.csv").write_text(f"rate,value\n0,{SECRET}\n1,{SECRET}\n", encoding="utf-8")
        for link in ("link.csv", "parts/link.csv"):
            (folder / link).symlink_to(Path(name) / "secret.csv")
        (folder / "loop.csv").symlink_to("loop.csv")
        os.mkfifo(folder / "pipe.csv")
        begin = time.process_time()
        try:
            return _read(folder, files)
        finally:
            assert time.process_time() - begin < SLOWEST


def _read(folder: Path, files: dict[str, str]) -> tuple[str, ...]:
    try:
        model = read_model(folder / "rows.yaml")
        scene = model.scenes["run"] if "run" in model.scenes else find_scene(model, None)
        source = pipeline.generate(model, scene, scene.outputs)[2]
    except (ModelError, ConstantError, TopologyError, NoInertiaError) as error:
        lines = [line.replace(f"{folder}/", "") for line in str(error).splitlines()]
        known = "|".join(map(re.escape, (*FILES, "<library>/double_wishbone.yaml", *(f"parts/{name}" for name in FILES))))
        for line in lines:
            assert re.fullmatch(rf"(?:{known}):\d+:\d+: \S.*", line), f"no place or more than a line: {line!r}"
            assert line.isprintable(), repr(line)
            assert SECRET not in line, "it has read another file"
        return tuple(lines)
    assert all(SECRET not in content for content in source.files.values()), "it has read another file"
    _require_numbers(model, files)
    return ()


def _require_numbers(model: Model, files: dict[str, str]) -> None:
    """The law of the table goes through its points, as another reader has them."""
    forces = {force.name: force for force in model.forces}
    content = files["parts/data/drag.csv"]
    if "a.end.drag" not in forces or "data/drag.csv}, interpolation: linear" not in files["parts/tail.yaml"]:
        return
    lines = [line for line in content.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    head, *rows = csv.reader(io.StringIO("\n".join(lines)))
    names = [re.fullmatch(r"\s*(\w+)\s*(?:\[\s*(.*?)\s*\])?\s*", name) for name in head]
    sizes = [measure(1.0, name[2]).value if name and name[2] else 1.0 for name in names]
    columns = {name[1]: [float(row[i]) * sizes[i] for row in rows] for i, name in enumerate(names) if name}
    (law,) = forces["a.end.drag"].expressions
    of = next(name for name in columns if name != "value")
    for x, y in zip(columns[of], columns["value"], strict=True):
        assert isclose(evaluate(law, {variable(of): x}), y, rel_tol=1e-9, abs_tol=1e-9), (x, y)
