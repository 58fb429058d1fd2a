"""Damaged roads in OpenCRG: each becomes a surface of finite heights, or is refused with the place in its file."""

from __future__ import annotations

import json
import random
import re

import numpy as np

from cutjoint.model.errors import ModelError
from cutjoint.model.files.opencrg import OpenCrg

_HEADER = """$CT
a road
$
$ROAD_CRG                                                    ! the line
reference_line_start_u   = 10.0
reference_line_increment = 0.5
long_section_v_right     = -0.75
long_section_v_left      = 0.75
reference_line_start_z   = 3.0
$
$ROAD_CRG_OPTS
border_mode_u = 2
$
$ROAD_CRG_MODS
scale_length = 1.5
refpoint_v_fraction = 0.75
refpoint_phi = 0
$
$KD_DEFINITION
#:LDFI
U:reference line u,m,10.0,0.5
D:reference line phi,rad
D:reference line slope,m/m
D:long section 1,m
D:long section 2,m
D:long section 3,m
$
$$$$10$$$$20$$$$30
"""
_NUMBERS = ("0", "-1", "1e999", "-1e308", "1e-320", "1e9", "nan", "inf", "", "1_0", "0x1", "\u00b2", "9" * 400, "1e8", "-0.0", "2", "1d0")
_LINES = (
    "$", "$$$$", "$ROAD_CRG_FILE", "$ROAD_CRG_MODS", "$ROAD_CRG", "#:KRBI", "#:LRFI", "#:KDBI", "U:", "D:", "D:long section 2,m",
    "D:long section at v = 1,m", "D:long section \u00b2,m", "border_mode_v = 4", "refline_continuation = 1", "reference_line_end_u = 0",
    "reference_line_end_x = 1e9", "long_section_v_increment = 0", "scale_curvature = 1e9", "refpoint_u = -1e9", "border_smooth_ubeg = 1e9",
    "*", "!",
)  # fmt: skip


def make(rng: random.Random) -> str:
    """The text of a file, as JSON."""
    rows = np.random.default_rng(rng.randrange(1000)).normal(0, 0.02, (rng.choice((0, 1, 2, 5)), 5))
    lines = _HEADER.splitlines() + ["".join(f"{x:20.6f}" for x in part) for row in rows for part in (row[:4], row[4:])]
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        at = rng.randrange(len(lines))
        match rng.randrange(6):
            case 0:
                del lines[at]
                lines = lines or [""]
            case 1:
                lines.insert(at, rng.choice(_LINES))
            case 2:
                lines.insert(at, lines[rng.randrange(len(lines))])
            case 3:
                lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
            case _:
                numbered = [i for i, line in enumerate(lines) if re.search(r"\d", line)]
                at = rng.choice(numbered or [at])
                found = list(re.finditer(r"[-+.\d]+", lines[at])) or [re.compile("").match(lines[at])]
                place = rng.choice([each for each in found if each])
                lines[at] = lines[at][: place.start()] + rng.choice(_NUMBERS) + lines[at][place.end() :]
    return json.dumps({"text": "\n".join(lines), "bilinear": rng.random() < 0.8})


def check(text: str) -> tuple[str, ...]:
    """The reason why a file was refused; fails where a number is not finite."""
    case = json.loads(text)
    try:
        with np.errstate(all="raise", under="ignore"):
            surface = OpenCrg(case["text"], "road.crg", "scene 's'").surface(case["bilinear"])
    except ModelError as error:
        reported = str(error).splitlines()
        assert all(re.match(r"road\.crg:\d+:1: scene 's': ", line) and line.isprintable() for line in reported), reported
        return tuple(reported)
    for values in surface.get("table", surface.get("sections")).values():
        assert np.isfinite(np.array(values)).all()
    return ()
