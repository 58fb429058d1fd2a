#!/usr/bin/env bash
# rod 0.5.0 (PyPI), a reader of SDF: chains of three links and two ball joints.  SDF 1.10 asks for neither `mass` nor `inertia`: they are
# 1 kg and 1 kg m^2 where they are left out.
#
# Seen: if one link has an `inertial` without `inertia`, or without `mass`, the model has no link at all, those without fault among them,
# while its joints stay.  A link without any `inertial` is read.  No error or warning comes, so that a sum of masses is 0.
#
# Output:
#   inertia of all links: 3 links, 2 joints, 6 kg
#   mass alone of link b: 0 links, 2 joints, 0 kg
#   inertia alone of link b: 0 links, 2 joints, 0 kg
#   link b without inertial: 3 links, 2 joints, 4 kg
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet rod==0.5.0 mashumaro==3.23 xmltodict==1.0.4 numpy==2.4.6 scipy==1.17.1
cd "$place"
seen=$("$place/venv/bin/python" - <<'PYTHON'
from pathlib import Path

import rod

WHOLE = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
CASES = {
    "inertia of all links": f"<inertial><mass>2</mass>{WHOLE}</inertial>",
    "mass alone of link b": "<inertial><mass>2</mass></inertial>",
    "inertia alone of link b": f"<inertial>{WHOLE}</inertial>",
    "link b without inertial": "",
}
for case, inertial in CASES.items():
    links = "".join(f'<link name="{name}">{CASES["inertia of all links"] if name != "b" else inertial}</link>' for name in "abc")
    joints = "".join(f'<joint name="{a}{b}" type="ball"><parent>{a}</parent><child>{b}</child></joint>' for a, b in ("ab", "bc"))
    Path("chain.sdf").write_text(f'<sdf version="1.10"><model name="chain">{links}{joints}</model></sdf>')
    chain = rod.Sdf.load("chain.sdf").model
    found, mass = chain.links(), sum(link.inertial.mass for link in chain.links() if link.inertial)
    print(f"{case}: {len(found)} links, {len(chain.joints())} joints, {mass:g} kg")
PYTHON
)
echo "$seen"
expected="inertia of all links: 3 links, 2 joints, 6 kg
mass alone of link b: 0 links, 2 joints, 0 kg
inertia alone of link b: 0 links, 2 joints, 0 kg
link b without inertial: 3 links, 2 joints, 4 kg"
[ "$seen" = "$expected" ]
