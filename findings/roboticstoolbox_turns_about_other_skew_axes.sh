#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0 (PyPI), `URDF_read`: a door whose hinge has an axis with more than one component that is not 0.
#
# Seen: such an axis u is not the one about which the joint turns, nor does the link stand in its pose at 0 rad: the reader turns the frame
# of the joint by one radian about u and takes the z axis of that.  A rounding error of 1e-9 suffices, as axes have that CAD systems write.
# The direction of a slide is as wrong.  No error or warning comes.
#
# Output:
#   axis 0 0 1: turns about 0.000 0.000 1.000; at 0 rad the leaf stands at 0.000 rad
#   axis 0 1e-9 1: turns about 0.000 0.000 1.000; at 0 rad the leaf stands at 1.000 rad
#   axis 0 0.6 0.8: turns about 0.505 0.221 0.835; at 0 rad the leaf stands at 1.000 rad
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet roboticstoolbox-python==1.5.0 spatialmath-python==1.1.18 numpy==2.4.6
cd "$place"
seen=$("$place/venv/bin/python" - <<'PYTHON'
from pathlib import Path

import numpy as np
from roboticstoolbox import Robot
from roboticstoolbox.models.URDF.URDFRobot import URDF_read

TEXT = """<robot name="door">
  <link name="frame"/><link name="leaf"/>
  <joint name="hinge" type="continuous"><parent link="frame"/><child link="leaf"/><axis xyz="{}"/></joint>
</robot>"""
for axis in ("0 0 1", "0 1e-9 1", "0 0.6 0.8"):
    Path("door.urdf").write_text(TEXT.format(axis))
    links, name, _ = URDF_read(str(Path("door.urdf").resolve()))
    door = Robot(links, name=name)
    turned = door.fkine([0], end="leaf").R
    found = " ".join(f"{part:.3f}" for part in door.jacob0([0], end="leaf")[3:, 0])
    angle = np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))
    print(f"axis {axis}: turns about {found}; at 0 rad the leaf stands at {angle:.3f} rad")
PYTHON
)
echo "$seen"
expected="axis 0 0 1: turns about 0.000 0.000 1.000; at 0 rad the leaf stands at 0.000 rad
axis 0 1e-9 1: turns about 0.000 0.000 1.000; at 0 rad the leaf stands at 1.000 rad
axis 0 0.6 0.8: turns about 0.505 0.221 0.835; at 0 rad the leaf stands at 1.000 rad"
[ "$seen" = "$expected" ]
