#!/usr/bin/env bash
# Pint 0.25.3 (PyPI), the default registry: the text "Nm", by which the field writes a newton metre.
#
# Seen: "Nm" is `number_meter`, a count of yarn, 1000 m/kg, and takes prefixes: "kNm" is 1e6 m/kg, "Nms" is 1000 m/kg too (a plural).  No
# error comes, so that a torque of 5 "Nm" is 5000 of something else; only a check of dimensions tells.  "N*m" and "N m" are torques, and
# "Nmm" is unknown.
#
# Output:
#   Nm 1000.0 meter / kilogram
#   kNm 1000000.0 meter / kilogram
#   Nms 1000.0 meter / kilogram
#   N*m 1.0 kilogram * meter ** 2 / second ** 2
#   N m 1.0 kilogram * meter ** 2 / second ** 2
#   Nmm UndefinedUnitError
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet pint==0.25.3
seen=$("$place/venv/bin/python" - <<'PYTHON'
import pint

registry = pint.UnitRegistry()
for text in ("Nm", "kNm", "Nms", "N*m", "N m", "Nmm"):
    try:
        print(text, registry(text).to_base_units())
    except pint.UndefinedUnitError as error:
        print(text, type(error).__name__)
PYTHON
)
echo "$seen"
expected="Nm 1000.0 meter / kilogram
kNm 1000000.0 meter / kilogram
Nms 1000.0 meter / kilogram
N*m 1.0 kilogram * meter ** 2 / second ** 2
N m 1.0 kilogram * meter ** 2 / second ** 2
Nmm UndefinedUnitError"
[ "$seen" = "$expected" ]
