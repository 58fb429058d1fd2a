#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0 (PyPI), `URDF_read`: <dynamics damping="2" friction="0.5"/> of a hinge.
#
# Seen: the reader takes `friction`, which URDF defines as the Coulomb friction of the joint in N*m, for viscous damping in N*m*s, and loses
# `damping`.  A joint with damping alone has no friction at all, one with friction alone has more of it the faster it turns.  No error or
# warning comes.
#
# Output:
#   damping 2, friction 0.5: viscous 0.5, Coulomb 0.0 0.0; torques at 1, 2 and 4 rad/s -0.5 -1.0 -2.0
#   damping 2: viscous 0.0, Coulomb 0.0 0.0; torques at 1, 2 and 4 rad/s 0.0 0.0 0.0
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

TEXT = """<robot name="door">
  <link name="frame"/><link name="leaf"/>
  <joint name="hinge" type="continuous"><parent link="frame"/><child link="leaf"/><axis xyz="0 0 1"/><dynamics {}/></joint>
</robot>"""
for said, words in (("damping 2, friction 0.5", 'damping="2" friction="0.5"'), ("damping 2", 'damping="2"')):
    Path("door.urdf").write_text(TEXT.format(words))
    links, name, _ = URDF_read(str(Path("door.urdf").resolve()))
    (leaf,) = (link for link in Robot(links, name=name).links if link.isjoint)
    torques = " ".join(str(float(leaf.friction(rate)) + 0.0) for rate in (1, 2, 4))
    print(f"{said}: viscous {float(leaf.B)}, Coulomb {leaf.Tc[0]} {leaf.Tc[1]}; torques at 1, 2 and 4 rad/s {torques}")
PYTHON
)
echo "$seen"
expected="damping 2, friction 0.5: viscous 0.5, Coulomb 0.0 0.0; torques at 1, 2 and 4 rad/s -0.5 -1.0 -2.0
damping 2: viscous 0.0, Coulomb 0.0 0.0; torques at 1, 2 and 4 rad/s 0.0 0.0 0.0"
[ "$seen" = "$expected" ]
