#!/usr/bin/env bash
# SciPy 1.17.1 `cont2discrete`, which `sample_system` of python-control 0.10.2 calls (both PyPI): an inverted pendulum, states x and x'.
#
# Seen: the states of the discrete model are those of the continuous one for a zero-order hold alone.  For `foh` the input is subtracted
# from them, although C and the names of the states (`copy_names=True`) stay; D alone tells.  A linear quadratic regulator for this model,
# well damped there, makes the pendulum with a held input unstable when it is fed with x and x'.  For `tustin` they are combined: a start
# at x = 1 is an output of 1.43.  Transfer functions are right; feedback of states and initial states are not those of the plant.
#
# Output:
#   zoh: states x, v; C 1.00 0.00; x(0) 1.00; largest pole as designed 0.21, with the states of the pendulum 0.21
#   foh: states x, v; C 1.00 0.00; x(0) 1.00; largest pole as designed 0.15, with the states of the pendulum 1.13
#   tustin: states x, v; C 1.43 0.14; x(0) 1.43; largest pole as designed 0.17, with the states of the pendulum 0.27
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet control==0.10.2 scipy==1.17.1
seen=$("$place/venv/bin/python" - <<'PYTHON'
import control
import numpy as np
from scipy.linalg import expm

EVERY = 0.2
A, B, C = np.array([[0.0, 1.0], [30.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
plant = control.ss(A, B, C, 0, states=["x", "v"])
held = expm(np.block([[A, B], [np.zeros((1, 3))]]) * EVERY)[:2]
for method in ("zoh", "foh", "tustin"):
    model = control.sample_system(plant, EVERY, method, copy_names=True)
    gain, _, poles = control.dlqr(model, np.diag([1e3, 1.0]), [[0.1]])
    begin = control.initial_response(model, [0, EVERY], [1, 0]).outputs[0]
    met = np.linalg.eigvals(held[:, :2] - held[:, 2:] @ gain)
    print(f"{method}: states {', '.join(model.state_labels)}; C {' '.join(f'{c:.2f}' for c in model.C[0])}; x(0) {begin:.2f}; "
          f"largest pole as designed {abs(poles).max():.2f}, with the states of the pendulum {abs(met).max():.2f}")
PYTHON
)
echo "$seen"
expected="zoh: states x, v; C 1.00 0.00; x(0) 1.00; largest pole as designed 0.21, with the states of the pendulum 0.21
foh: states x, v; C 1.00 0.00; x(0) 1.00; largest pole as designed 0.15, with the states of the pendulum 1.13
tustin: states x, v; C 1.43 0.14; x(0) 1.43; largest pole as designed 0.17, with the states of the pendulum 0.27"
[ "$seen" = "$expected" ]
