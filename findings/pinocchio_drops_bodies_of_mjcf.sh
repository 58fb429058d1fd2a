#!/usr/bin/env bash
# Pinocchio 4.1.0 (PyPI: pin), `buildModelFromMJCF`, against mujoco-core 4.0.1 on the same files.
#
# Seen: of several bodies in the `worldbody` the model has only the first one in the file, with what hangs on it.  Of bodies without a name,
# which MJCF allows, beside a named parent or child it has none.  No error or warning comes: the model has fewer coordinates and less mass.
# Only a file without any named body is refused ("no body found in parsed tree").
#
# Output:
#   two arms on the world: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
#   an arm after its table: MuJoCo 1 coordinates, 10 kg; Pinocchio 0, 9 kg
#   forearm without a name: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
#   upper arm without a name: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
#   both named: MuJoCo 2 coordinates, 2 kg; Pinocchio 2, 2 kg
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet pin==4.1.0 mujoco-core==4.0.1
cd "$place"
seen=$("$place/venv/bin/python" - <<'PYTHON'
from pathlib import Path

import mujoco
import pinocchio


def body(name: str, inside: str = "") -> str:
    named = f' name="{name}"' if name else ""
    return f'<body{named}><joint axis="0 1 0"/><geom size="0.1" mass="1" pos="1 0 0"/>{inside}</body>'


CASES = {
    "two arms on the world": body("left") + body("right"),
    "an arm after its table": '<body name="table"><geom size="1" mass="9"/></body>' + body("arm"),
    "forearm without a name": body("upper", body("")),
    "upper arm without a name": body("", body("fore")),
    "both named": body("upper", body("fore")),
}
for case, bodies in CASES.items():
    Path("arm.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    theirs = mujoco.MjModel.from_xml_path("arm.xml")
    built = pinocchio.buildModelFromMJCF("arm.xml")
    model = built[0] if isinstance(built, tuple) else built
    masses = sum(inertia.mass for inertia in model.inertias)
    print(f"{case}: MuJoCo {theirs.nq} coordinates, {sum(theirs.body_mass):g} kg; Pinocchio {model.nq}, {masses:g} kg")
PYTHON
)
echo "$seen"
expected="two arms on the world: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
an arm after its table: MuJoCo 1 coordinates, 10 kg; Pinocchio 0, 9 kg
forearm without a name: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
upper arm without a name: MuJoCo 2 coordinates, 2 kg; Pinocchio 1, 1 kg
both named: MuJoCo 2 coordinates, 2 kg; Pinocchio 2, 2 kg"
[ "$seen" = "$expected" ]
