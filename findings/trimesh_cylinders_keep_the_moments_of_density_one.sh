#!/usr/bin/env bash
# trimesh 5.2.0 (PyPI), moments of inertia of its primitives; then of the cylinder, 246.6 kg of steel, by three ways.
#
# Seen: once `density` is set, the mass follows it, and of a box and a capsule `moment_inertia` too.  That of a cylinder and of a sphere
# stays that of density 1, 7850 times too small beside the mass; so do `principal_inertia_components`, which follow from it.  The same
# cylinder has the right moment in `moment_inertia_frame`, in a scene, and once it is a mesh.  No error or warning comes.
#
# Output:
#   box: mass 7850 times, moment 7850 times
#   capsule: mass 7850 times, moment 7850 times
#   cylinder: mass 7850 times, moment 1 times
#   sphere: mass 7850 times, moment 1 times
#   mesh of the cylinder: mass 7850 times, moment 7850 times
#   cylinder of 246.6 kg: moment_inertia 0.0027, moment_inertia_frame 21.2, scene 21.2 kg m^2
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1
seen=$("$place/venv/bin/python" - <<'PYTHON'
import numpy as np
import trimesh
from trimesh import primitives

DENSITY = 7850
HEIGHT, RADIUS = 1.0, 0.1
cylinder = primitives.Cylinder(radius=RADIUS, height=HEIGHT, sections=256)
MADE = {
    "box": primitives.Box(extents=[2 * RADIUS, 2 * RADIUS, HEIGHT]),
    "capsule": primitives.Capsule(radius=RADIUS, height=HEIGHT),
    "cylinder": cylinder,
    "sphere": primitives.Sphere(radius=RADIUS),
    "mesh of the cylinder": cylinder.to_mesh(),
}
for name, solid in MADE.items():
    mass, moment = solid.mass, solid.moment_inertia[0, 0]
    solid.density = DENSITY
    print(f"{name}: mass {solid.mass / mass:.0f} times, moment {solid.moment_inertia[0, 0] / moment:.0f} times")
asked = {
    "moment_inertia": cylinder.moment_inertia,
    "moment_inertia_frame": cylinder.moment_inertia_frame(np.eye(4)),
    "scene": trimesh.Scene([cylinder]).moment_inertia,
}
print(f"cylinder of {cylinder.mass:.1f} kg:", ", ".join(f"{name} {moment[0, 0]:.3g}" for name, moment in asked.items()), "kg m^2")
PYTHON
)
echo "$seen"
expected="box: mass 7850 times, moment 7850 times
capsule: mass 7850 times, moment 7850 times
cylinder: mass 7850 times, moment 1 times
sphere: mass 7850 times, moment 1 times
mesh of the cylinder: mass 7850 times, moment 7850 times
cylinder of 246.6 kg: moment_inertia 0.0027, moment_inertia_frame 21.2, scene 21.2 kg m^2"
[ "$seen" = "$expected" ]
