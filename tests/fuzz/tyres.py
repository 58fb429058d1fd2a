"""Damaged property files of tyres: they are read, or refused with the file's line and key; some are put on a wheel too."""

from __future__ import annotations

import math
import random
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

from cutjoint.model.errors import ModelError
from cutjoint.model.files.property_file import read_properties
from cutjoint.model.read import read_model_text

DATA = Path(__file__).parents[1] / "data" / "tyres"

#: One in so many files stands on a wheel.
_ON_WHEELS = 1000

MODEL = """
cutjoint: 1
name: cart
gravity: [0, 0, -9.81]
bodies: {cart: {mass: 300, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}}
joints: {lift: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0.3], axis: [0, 0, 1]}}
submodels: {wheel: {include: library/wheel_mf62}}
instances: {w: {use: wheel, connect: {carrier: cart}, with: {x: 0, y: 0, z: 0.3}, properties: tyre.tir}}
scenes: {run: {end: 1}}
"""

_NUMBERS = (
    "0", "-0.0", "1e999", "-1e308", "1e-320", "nan", "inf", "1d5", "1e", "0x1p3", "1_0", "1,5", "'1'",
    "62", "52", "21", "6", "101", "",
)  # fmt: skip
_WORDS = (
    "'kN'", "'furlong'", "'RIGHT'", "'left'", "'", "$", "!", "[UNITS]", "[", "]", "FITTYP = 61", "= =", "PCX1", "\0", "\ufeff", "\u2028",
    "{a b}",
)  # fmt: skip


@cache
def _files() -> tuple[str, ...]:
    return tuple(path.read_text() for path in sorted(DATA.glob("*.tir")))


def make(rng: random.Random) -> str:
    """A file with one damage or several."""
    lines = rng.choice(_files()).splitlines()
    for _ in range(rng.choice((1, 1, 2, 3, 8, 40))):
        at, how = rng.randrange(len(lines)), rng.randrange(7)
        key = lines[at].partition("=")[0]
        if how == 0 and len(lines) > 1:
            del lines[at]
        elif how == 1:
            lines.insert(at, lines[rng.randrange(len(lines))])
        elif how == 2:
            lines[at] = f"{key}= {rng.choice(_NUMBERS)}"
        elif how == 3:
            lines[at] = f"{key}= {rng.choice(_WORDS)}"
        elif how == 4:
            lines.insert(at, rng.choice(_WORDS))
        elif how == 5:
            characters = list(lines[at] or " ")
            characters[rng.randrange(len(characters))] = chr(rng.choice((*range(127), 0xFFFD, 0x2028, 0x3000, 0x1F600)))
            lines[at] = "".join(characters)
        else:
            lines[at:] = [lines[at][: rng.randrange(len(lines[at]) + 1)]] if rng.random() < 0.1 else [*lines[at + 1 :], lines[at]]
    return rng.choice(("\n", "\r\n", "\r") if rng.random() < 0.1 else ("\n",)).join(lines)


def check(text: str) -> tuple[str, ...]:
    """The reason why a file was refused; fails where a number is not finite, or where a message has no place."""
    reported = _reported(text)
    assert all(line.startswith(("tyre.tir:", "m.yaml:", "<library>/")) for line in reported), reported
    return reported[:1]


def _reported(text: str) -> tuple[str, ...]:
    try:
        values = read_properties(text, "tyre.tir", "instance 'w'").values
        assert all(isinstance(value, str) or math.isfinite(value) for value in dict(values).values())
        if crc32(text.encode("utf-8", "surrogatepass")) % _ON_WHEELS == 0:
            _put_on(text)
    except ModelError as error:
        return tuple(str(error).split("\n"))
    return ()


def _put_on(text: str) -> None:
    with TemporaryDirectory() as name:
        (Path(name) / "tyre.tir").write_text(text, encoding="utf-8")
        read_model_text(MODEL, "m.yaml", folder=Path(name))
