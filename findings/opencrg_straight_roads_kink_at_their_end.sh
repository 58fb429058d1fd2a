#!/usr/bin/env bash
# ASAM's OpenCRG library in C, 2.0.1 in pycrg 2.2.0 (PyPI), beside PyOpenCRG 0.2.2 (PyPI): a straight road with a heading, without END_PHI.
#
# Seen: the heading of a straight reference line is REFERENCE_LINE_START_PHI alone.  Up to its end the C library has it so, but continues the
# line beyond its end with the heading 0: the road has a kink there, of 0.3 rad here, and 100 m later it is 30 m beside the straight line.
# Modifiers that turn the road to the x axis, as the default ones do, turn the kink with it.  The library's own check of the file passes, and
# at the other end the line continues straight.  PyOpenCRG continues it straight at both.  REFERENCE_LINE_END_PHI, with the same number, helps.
#
# Output:
#   default modifiers: check passes; y at u = -100, 0, 200, 300 m: 0.00, 0.00, 0.00, -29.55; PyOpenCRG 0.00, 0.00, 0.00, 0.00
#   no modifiers: check passes; y at u = -100, 0, 200, 300 m: -29.55, 0.00, 59.10, 59.10; PyOpenCRG -29.55, 0.00, 59.10, 88.66
#   END_PHI: check passes; y at u = -100, 0, 200, 300 m: -29.55, 0.00, 59.10, 88.66; PyOpenCRG -29.55, 0.00, 59.10, 88.66
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet pycrg==2.2.0 pyopencrg==0.2.2
cd "$place"
seen=$("$place/venv/bin/python" - <<'PYTHON'
from pathlib import Path

import pycrg
import pyopencrg

ROAD = """$ROAD_CRG
REFERENCE_LINE_START_U = 0
REFERENCE_LINE_END_U = 200
REFERENCE_LINE_INCREMENT = 100
REFERENCE_LINE_START_PHI = 0.3
{more}LONG_SECTION_V_RIGHT = -2
LONG_SECTION_V_LEFT = 2
LONG_SECTION_V_INCREMENT = 4
$
{blocks}$KD_DEFINITION
#:LRFI
D:long section 1,m
D:long section 2,m
$
$$$$
""" + "   0.00000   0.00000\n" * 3
PLACES = (-100, 0, 200, 300)
EMPTY = "$ROAD_CRG_MODS\n$\n"
for case, more, blocks in (
    ("default modifiers", "", ""), ("no modifiers", "", EMPTY), ("END_PHI", "REFERENCE_LINE_END_PHI = 0.3\n", EMPTY),
):
    Path("road.crg").write_text(ROAD.format(more=more, blocks=blocks))
    with pycrg.RoadSurface.open("road.crg", check=True) as road:
        asam = ", ".join(f"{round(road.uv_to_xy(u, 0)[1], 2) + 0.0:.2f}" for u in PLACES)
    peer = pyopencrg.read("road.crg", apply_mods=True)
    python = ", ".join(f"{round(peer.uv_to_xy(u, 0)[1], 2) + 0.0:.2f}" for u in PLACES)
    print(f"{case}: check passes; y at u = {', '.join(map(str, PLACES))} m: {asam}; PyOpenCRG {python}")
PYTHON
)
echo "$seen"
expected="default modifiers: check passes; y at u = -100, 0, 200, 300 m: 0.00, 0.00, 0.00, -29.55; PyOpenCRG 0.00, 0.00, 0.00, 0.00
no modifiers: check passes; y at u = -100, 0, 200, 300 m: -29.55, 0.00, 59.10, 59.10; PyOpenCRG -29.55, 0.00, 59.10, 88.66
END_PHI: check passes; y at u = -100, 0, 200, 300 m: -29.55, 0.00, 59.10, 88.66; PyOpenCRG -29.55, 0.00, 59.10, 88.66"
[ "$seen" = "$expected" ]
