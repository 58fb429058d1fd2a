"""Packs exported C99 as an FMU in source code, for co-simulation by FMI 3.0.

    cutjoint compile models/press.yaml --language c99 --out press99
    python examples/fmu_c99.py models/press.yaml press99 press.fmu

Inputs are 0 until the host sets them; for other values at the start add NAME=VALUE.
"""

import re
import sys
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import cutjoint


def line(tag, **attributes):
    return f"    <{tag} {' '.join(f'{name}={quoteattr(str(value))}' for name, value in attributes.items() if value is not None)}/>\n"


def describe(kind, reference, name, values, start):
    unit = (values.units or {}).get(name, "")
    of_kind = {"parameter": ("parameter", "tunable"), "input": ("input", "continuous"), "output": ("output", "continuous")}
    causality, variability = of_kind[kind]
    initial = {"parameter": "exact", "output": "calculated"}.get(kind)
    return line("Float64", name=name, valueReference=reference, causality=causality, variability=variability, initial=initial, start=start,
                description=f"{kind}, {unit}" if unit else kind)  # fmt: skip


model, folder, out = map(Path, sys.argv[1:4])
given = dict(word.split("=") for word in sys.argv[4:])
(header,) = folder.glob("*.h")
text, p, P = header.read_text(encoding="utf-8"), header.stem, header.stem.upper()
if f"const float* {p}_outputs" in text:
    raise SystemExit(f"{header}: has numbers of single precision, an FMU has doubles; compile without --precision single")
digest, step = re.search(r'_DIGEST "(.*)"', text)[1], re.search(r"_STEP (.*)", text)[1]
sim = cutjoint.load(model).reset()

# The header's names of variables, by index, are those of the model with _ for what C does not allow.
known, found = {"parameter": sim.parameters, "input": sim.inputs, "output": sim.outputs}, {}
for kind, values in known.items():
    places = {re.sub(r"\W", "_", name): name for name in values}
    found[kind] = [places[name] for name in re.findall(rf"^  {P}_{kind.upper()}_(\w+) = \d+", text, re.MULTILINE)]
start = {name: float(given.pop(name, 0.0)) for name in found["input"]} | {name: sim.parameters[name] for name in found["parameter"]}
if given:
    raise SystemExit(f"no input {', '.join(given)}; there are: {', '.join(found['input']) or 'none'}")

variables = line("Float64", name="time", valueReference=0, causality="independent", variability="continuous")
reference, outputs = 1, []
for kind, names in found.items():
    for name in names:
        variables += describe(kind, reference, name, known[kind], start.get(name) if kind != "output" else None)
        outputs += [reference] * (kind == "output")
        reference += 1

description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{p}" instantiationToken="{digest}">
  <CoSimulation modelIdentifier="{p}" canHandleVariableCommunicationStepSize="true" fixedInternalStepSize="{step}"/>
  <LogCategories>
    <Category name="logStatusError"/>
  </LogCategories>
  <DefaultExperiment startTime="0" stepSize="{step}"/>
  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
{"".join(line(tag, valueReference=i) for tag in ("Output", "InitialUnknown") for i in outputs)}  </ModelStructure>
</fmiModelDescription>
"""
build = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{p}">
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">
      <SourceFile name="fmu_c99.c"/>
      <SourceFile name="{p}.c"/>
    </SourceFileSet>
    <Library name="m"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""
names = f"""#include "{p}.h"
#define MODEL(name) {p}_##name
#define CONSTANT(name) {P}_##name
#define PARAMETERS {len(found["parameter"])}
#define INPUTS {len(found["input"])}
#define OUTPUTS {len(outputs)}
#define START_INPUTS {{{", ".join(repr(start[name]) for name in found["input"])}{", " * bool(found["input"])}0.0}}
#define TOKEN "{digest}"
"""
wrapper = Path(__file__).with_name("fmu_c99.c").read_text(encoding="utf-8")
code = header.with_suffix(".c").read_text(encoding="utf-8")
sources = {"names.h": names, "fmu_c99.c": wrapper, "buildDescription.xml": build, f"{p}.h": text, f"{p}.c": code}
with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
    archive.writestr("modelDescription.xml", description)
    for name, content in sources.items():
        archive.writestr(f"sources/{name}", content)
    archive.writestr("documentation/licenses/license.txt", (folder / "LICENSE").read_text(encoding="utf-8"))
print(f"{len(found['parameter'])} parameters, {len(found['input'])} inputs, {len(outputs)} outputs in {out}")
