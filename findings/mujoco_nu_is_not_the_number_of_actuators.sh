#!/usr/bin/env bash
# mujoco-core 4.0.1 (PyPI), a model with an `orientation` actuator on a ball joint before a `motor` on a slide.
#
# Seen: the model has two actuators (`nactuator` 2), but `nu` is 4: it counts controls, of which the orientation has three.  A loop over
# `range(model.nu)` does not visit actuators.  Arrays called `actuator_...` have two lengths: `actuator_trnid`, `actuator_gainprm` and
# `actuator_forcerange` have a row for each actuator; `actuator_ctrlrange` and `actuator_gear` have four.  The motor is actuator 1, its gear
# stands in row 3; row 1 of `actuator_gear` belongs to the orientation.  `actuator_ctrladr` and `actuator_outadr` lead from an actuator to its
# rows.
#
# Output:
#   nactuator 2, nu 4, nout 4
#   rows: trnid 2, gainprm 2, ctrlrange 4, gear 4, forcerange 2
#   motor: actuator 1, control 3, output 3
#   gear[1] 1.0, gear[3] 7.0
#   force 7.0 by ctrl[3]
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet mujoco-core==4.0.1
seen=$("$place/venv/bin/python" - <<'PYTHON'
import mujoco

TEXT = """<mujoco>
  <worldbody>
    <body><joint name="ball" type="ball"/><geom size="0.1"/></body>
    <body pos="1 0 0"><joint name="slide" type="slide"/><geom size="0.1"/></body>
  </worldbody>
  <actuator><orientation name="aim" joint="ball" kp="3"/><motor name="motor" joint="slide" gear="7"/></actuator>
</mujoco>"""
model = mujoco.MjModel.from_xml_string(TEXT)
data = mujoco.MjData(model)
print(f"nactuator {model.nactuator}, nu {model.nu}, nout {model.nout}")
rows = (f"{name} {len(getattr(model, f'actuator_{name}'))}" for name in ("trnid", "gainprm", "ctrlrange", "gear", "forcerange"))
print("rows:", ", ".join(rows))
motor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, "motor")
control, output = model.actuator_ctrladr[motor], model.actuator_outadr[motor]
print(f"motor: actuator {motor}, control {control}, output {output}")
print(f"gear[1] {model.actuator_gear[1, 0]}, gear[3] {model.actuator_gear[3, 0]}")
data.ctrl[3] = 1
mujoco.mj_forward(model, data)
print(f"force {data.qfrc_actuator[-1]} by ctrl[3]")
PYTHON
)
echo "$seen"
expected="nactuator 2, nu 4, nout 4
rows: trnid 2, gainprm 2, ctrlrange 4, gear 4, forcerange 2
motor: actuator 1, control 3, output 3
gear[1] 1.0, gear[3] 7.0
force 7.0 by ctrl[3]"
[ "$seen" = "$expected" ]
