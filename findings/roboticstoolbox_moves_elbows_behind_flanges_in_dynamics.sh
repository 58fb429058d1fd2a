#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0 (PyPI), dynamics of a URDF: two links of 1 kg at their ends, 1 m long; the elbow with and without a flange.
#
# Seen: a link without mass on a fixed joint between shoulder and elbow changes the inertia matrix, at the shoulder from 5 to 2 kg m^2: what
# hangs on the elbow moves as if the fixed joint had no length.  `inertia` has this from `rne`; `fkine` has the elbow in its place.  A mass
# of the flange itself counts in its place.  No error or warning comes.
#
# Output:
#   without flange: elbow at x = 1.000 m, inertia matrix 5.000 2.000; 2.000 1.000 kg m^2
#   with flange: elbow at x = 1.000 m, inertia matrix 2.000 1.000; 1.000 1.000 kg m^2
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet roboticstoolbox-python==1.5.0 spatialmath-python==1.1.18 numpy==2.4.6
cd "$place"
seen=$("$place/venv/bin/python" - <<'PYTHON'
from pathlib import Path

from roboticstoolbox import Robot
from roboticstoolbox.models.URDF.URDFRobot import URDF_read


def link(name: str) -> str:
    zero = " ".join(f'{part}="0"' for part in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return f'<link name="{name}"><inertial><origin xyz="1 0 0"/><mass value="1"/><inertia {zero}/></inertial></link>'


def joint(name: str, parent: str, child: str, at: float, kind: str = "continuous") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at} 0 0"/><axis xyz="0 0 1"/>'
    return f'<joint name="{name}" type="{kind}">{ends}</joint>'


SHOULDER = '<link name="base"/>' + link("upper") + joint("shoulder", "base", "upper", 0)
CASES = {
    "without flange": joint("elbow", "upper", "fore", 1),
    "with flange": '<link name="flange"/>' + joint("weld", "upper", "flange", 1, "fixed") + joint("elbow", "flange", "fore", 0),
}
for case, elbow in CASES.items():
    Path("arm.urdf").write_text(f'<robot name="arm">{SHOULDER}{link("fore")}{elbow}</robot>')
    links, name, _ = URDF_read(str(Path("arm.urdf").resolve()))
    arm = Robot(links, name=name)
    matrix = "; ".join(" ".join(f"{part:.3f}" for part in row) for row in arm.inertia([0, 0]))
    print(f"{case}: elbow at x = {arm.fkine([0, 0], end='fore').t[0]:.3f} m, inertia matrix {matrix} kg m^2")
PYTHON
)
echo "$seen"
expected="without flange: elbow at x = 1.000 m, inertia matrix 5.000 2.000; 2.000 1.000 kg m^2
with flange: elbow at x = 1.000 m, inertia matrix 2.000 1.000; 1.000 1.000 kg m^2"
[ "$seen" = "$expected" ]
