#!/usr/bin/env bash
# CasADi 3.8.2 (PyPI), `interpolant` through a table, here the torque of a motor over its speed.
#
# Seen: beyond the ends of the table a spline (`bspline`) is the number 0 with the derivative 0, from the next number on, while `linear`
# continues its end pieces.  A motor loses its torque in a jump, and an optimiser that begins there has no gradient.  No error comes.
#
# Output:
#   linear: -1 rad/s 50.02, 0 rad/s 50, 300 rad/s 20, 300.001 rad/s 19.9998, 301 rad/s 19.8
#   linear: slope at 301 rad/s -0.2
#   bspline: -1 rad/s 0, 0 rad/s 50, 300 rad/s 20, 300.001 rad/s 0, 301 rad/s 0
#   bspline: slope at 301 rad/s 0
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet casadi==3.8.2
seen=$("$place/venv/bin/python" - <<'PYTHON'
import casadi

SPEEDS, TORQUES = [0, 100, 200, 300], [50, 48, 40, 20]
for kind in ("linear", "bspline"):
    torque = casadi.interpolant("torque", kind, [SPEEDS], TORQUES)
    print(f"{kind}:", ", ".join(f"{at:.6g} rad/s {float(torque(at)):.6g}" for at in (-1, 0, 300, 300.001, 301)))
    speed = casadi.MX.sym("speed")
    slope = casadi.Function("slope", [speed], [casadi.jacobian(torque(speed), speed)])
    print(f"{kind}: slope at 301 rad/s {float(slope(301)):.6g}")
PYTHON
)
echo "$seen"
expected="linear: -1 rad/s 50.02, 0 rad/s 50, 300 rad/s 20, 300.001 rad/s 19.9998, 301 rad/s 19.8
linear: slope at 301 rad/s -0.2
bspline: -1 rad/s 0, 0 rad/s 50, 300 rad/s 20, 300.001 rad/s 0, 301 rad/s 0
bspline: slope at 301 rad/s 0"
[ "$seen" = "$expected" ]
