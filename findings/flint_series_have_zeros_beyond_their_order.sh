#!/usr/bin/env bash
# python-flint 0.9.0 (PyPI), power series of balls (`arb_series`), which enclose what they stand for.
#
# Seen: a coefficient beyond the order to which a series is known comes back as the exact number 0, not as an unknown one and not as an
# error.  sin(x^2)/x^2 with `ctx.cap` 6 is 1 + O(x^4), since a division by x^2 loses two orders; its coefficient 4 is -1/6, and `q[4]` is 0
# with radius 0.  A bound that is computed from such coefficients is no bound.  The attribute `prec` tells how many coefficients count.
#
# Output:
#   1.00000000000000 + O(x^4)
#   coefficient 4: 0, exact True, contains -1/6 False
#   prec 4 of cap 6
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet python-flint==0.9.0
seen=$("$place/venv/bin/python" - <<'PYTHON'
from flint import arb, arb_series, ctx, fmpq

ctx.cap = 6
x = arb_series([0, 1])
q = (x * x).sin() / (x * x)
print(q)
print(f"coefficient 4: {q[4]}, exact {q[4].is_exact()}, contains -1/6 {q[4].contains(arb(fmpq(-1, 6)))}")
print(f"prec {q.prec} of cap {ctx.cap}")
PYTHON
)
echo "$seen"
expected="1.00000000000000 + O(x^4)
coefficient 4: 0, exact True, contains -1/6 False
prec 4 of cap 6"
[ "$seen" = "$expected" ]
