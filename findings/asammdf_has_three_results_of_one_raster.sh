#!/usr/bin/env bash
# asammdf 8.8.28 (PyPI): a wheel's speed as a bus has it, an integer with a linear conversion of 0.1 to m/s, at 0, 0.5 and 1 s; raster 0.25 s.
#
# Seen: three ways to the same raster give three results.  `resample` holds the last value between samples, so that the signal comes late,
# while it interpolates a channel of the same values in floating point.  `to_dataframe` interpolates both.  `get` with the raster holds too,
# and its times have another if the raster divides the duration: four points, not five, are spread over the second, 1/3 s apart.
# With `configure(integer_interpolation=2)` `resample` interpolates; the times of `get` stay, and its values are cut to whole integers.
#
# Output:
#   resample, integer: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.0 1.0 1.0 2.0
#   resample, float: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.5 1.0 1.5 2.0
#   to_dataframe, integer: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.5 1.0 1.5 2.0
#   get, integer: 0.000 0.333 0.667 1.000 s: 0.0 0.0 1.0 2.0
#   get, integer, interpolation 2: 0.000 0.333 0.667 1.000 s: 0.0 0.6 1.3 2.0
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet asammdf==8.8.28
seen=$("$place/venv/bin/python" - <<'PYTHON'
import numpy as np
from asammdf import MDF, Signal

EVERY = 0.25


def show(case, times, values) -> None:
    print(f"{case}: {' '.join(f'{t:.3f}' for t in times)} s: {' '.join(f'{v:.1f}' for v in values)}")


t = np.array([0, 0.5, 1])
measured = MDF()
measured.append([
    Signal(np.array([0, 10, 20], dtype="i2"), t, name="integer", unit="m/s", conversion={"a": 0.1, "b": 0}),
    Signal(np.array([0.0, 1, 2]), t, name="float", unit="m/s"),
])
resampled = measured.resample(EVERY)
for name in ("integer", "float"):
    found = resampled.get(name)
    show(f"resample, {name}", found.timestamps, found.samples)
table = measured.to_dataframe(channels=["integer"], raster=EVERY)
show("to_dataframe, integer", table.index, table["integer"])
found = measured.get("integer", raster=EVERY)
show("get, integer", found.timestamps, found.samples)
measured.configure(integer_interpolation=2)
found = measured.get("integer", raster=EVERY)
show("get, integer, interpolation 2", found.timestamps, found.samples)
PYTHON
)
echo "$seen"
expected="resample, integer: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.0 1.0 1.0 2.0
resample, float: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.5 1.0 1.5 2.0
to_dataframe, integer: 0.000 0.250 0.500 0.750 1.000 s: 0.0 0.5 1.0 1.5 2.0
get, integer: 0.000 0.333 0.667 1.000 s: 0.0 0.0 1.0 2.0
get, integer, interpolation 2: 0.000 0.333 0.667 1.000 s: 0.0 0.6 1.3 2.0"
[ "$seen" = "$expected" ]
