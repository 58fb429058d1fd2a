#!/usr/bin/env bash
# SciPy 1.17.1 (PyPI), `minimize(method="COBYQA")` with a `NonlinearConstraint`, here six numbers with a bounded sum.
#
# Seen: the constraint is computed some ten times as often as the objective, nearly always at a place where both are known already: the
# merit function of the trust region asks for it again at the places of the model.  `maxfev` counts evaluations of the objective alone.
# A constraint that takes a simulation multiplies the time of an optimisation, unless it remembers more than its last place.
#
# Output:
#   objective 32 times at 32 places, constraint 415 times at 33 places
#   again and again
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
seen=$("$place/venv/bin/python" - <<'PYTHON'
import numpy as np
from scipy.optimize import NonlinearConstraint, minimize

asked = {"objective": [], "constraint": []}


def objective(x):
    asked["objective"].append(x.tobytes())
    return float(((x - 1) ** 2).sum())


def constraint(x):
    asked["constraint"].append(x.tobytes())
    return np.array([x.sum() - 2, -x[0]])


minimize(objective, np.zeros(6), method="COBYQA", bounds=[(-3, 3)] * 6, options={"maxfev": 60},
         constraints=NonlinearConstraint(constraint, -np.inf, -0.01))
print(", ".join(f"{name} {len(places)} times at {len(set(places))} places" for name, places in asked.items()))
often, new = len(asked["constraint"]) / len(asked["objective"]), len(set(asked["constraint"]) - set(asked["objective"]))
print("again and again" if often > 5 and new < 4 else "otherwise")
PYTHON
)
echo "$seen"
# the counts themselves follow from rounding
test "$(tail -n 1 <<<"$seen")" = "again and again"
