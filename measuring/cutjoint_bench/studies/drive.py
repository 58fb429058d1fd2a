"""Steps of the modules of `cutjoint drive` in V8, by Node.js: `make driving`.

Modules go in turns, each for some steps.  The tenth of such slices that is fastest tells a busy machine's other work apart, the median does
not.  A start is by processor time.  The driven Iltis has some throttle and turns its steering wheel.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.methods import DEFAULT_METHOD, Loops
from cutjoint.model.read import read_model
from cutjoint.package.locations import templates_folder
from cutjoint.run.scenes import find_case, with_loops
from cutjoint.view.drive import simulated
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.provenance import provenance

#: Models, scenes and loops.
CASES = (
    ("iltis_driven", "by_hand", Loops.EXACT), ("iltis", "simul1", Loops.EXACT), ("iltis", "simul1", Loops.EMBEDDED),
    ("press", "turn", Loops.EXACT), ("slider_crank", "turn", Loops.EXACT), ("slider_crank", "turn", Loops.EMBEDDED),
)  # fmt: skip
#: Slices, and steps of each.
SLICES, STEPS = 200, 40


def main() -> None:
    """Print the table."""
    console, table = Console(), Table("model, scene", "loops", "module kB", "start s", "us a step", "median", "times real time")
    console.print(provenance())
    with TemporaryDirectory() as folder:
        files = [Path(folder) / f"{i}.wasm" for i in range(len(CASES))]
        for (name, scene, loops), file in zip(CASES, files, strict=True):
            model, found = find_case(read_model(MODELS / f"{name}.yaml"), scene)
            file.write_bytes(simulated(model, with_loops(found, loops), DEFAULT_METHOD).build_module())
        sizes = [len(file.read_bytes()) for file in files]
        host = templates_folder() / "wasm" / "module.js"
        call = ["node", *map(str, (Path(__file__).with_suffix(".js"), host, SLICES, STEPS, *files))]
        runs = json.loads(subprocess.run(call, check=True, capture_output=True, text=True).stdout)
    for (name, scene, loops), size, run in zip(CASES, sizes, runs, strict=True):
        best, middle = np.quantile(run["seconds"], [0.1, 0.5])
        figures = (f"{size / 1e3:.0f}", f"{run['start']:.3f}", f"{1e6 * best:.1f}", f"{1e6 * middle:.1f}", f"{run['dt'] / best:.0f}")
        table.add_row(f"{name}, {scene}", loops, *figures)
    console.print(table)


if __name__ == "__main__":
    main()
