#!/usr/bin/env bash
# SymPy 1.14.0 (PyPI), `Quaternion.from_rotation_matrix` of half turns.
#
# Seen: the quaternion of an exact half turn about any axis is 0, which is no rotation: components get their signs from differences in the
# matrix, which are 0 there.  Back as a matrix it is NaN.  In floating point the sine of pi, 1.2e-16, saves it, so that a check by numbers
# passes where exact numbers fail.  No error comes, and the docstring excepts no rotation.
#
# Output:
#   about x: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
#   about z: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
#   about x + y: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
#   about z, sine of pi in floating point: 0 + 0*i + 0*j + 1.0*k; length 1; turned back [[-1.00000000000000, 0, 0]]
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet sympy==1.14.0
seen=$("$place/venv/bin/python" - <<'PYTHON'
from math import cos, pi, sin

from sympy import Matrix, diag
from sympy.algebras.quaternion import Quaternion

CASES = {
    "about x": diag(1, -1, -1),
    "about z": diag(-1, -1, 1),
    "about x + y": Matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    "about z, sine of pi in floating point": Matrix([[cos(pi), -sin(pi), 0], [sin(pi), cos(pi), 0], [0, 0, 1]]),
}
for case, matrix in CASES.items():
    found = Quaternion.from_rotation_matrix(matrix)
    print(f"{case}: {found}; length {float(found.norm()):g}; turned back {found.to_rotation_matrix().row(0).tolist()}")
PYTHON
)
echo "$seen"
expected="about x: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
about z: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
about x + y: 0 + 0*i + 0*j + 0*k; length 0; turned back [[nan, nan, nan]]
about z, sine of pi in floating point: 0 + 0*i + 0*j + 1.0*k; length 1; turned back [[-1.00000000000000, 0, 0]]"
[ "$seen" = "$expected" ]
