"""The N-four-bar from one window to a thousand: how code, compiling and a step grow with it.

Each model is compiled in a cache of its own that has the driver already.  Seconds are of one run of this program; those of a step the least
of several runs.  Steps of 1 ms over 0.1 s, with the search for the start left out.
"""

from __future__ import annotations

import os
from math import log
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from rich.console import Console
from rich.table import Table

from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from cutjoint_bench.exact.chain import Chain, write_chain
from cutjoint_bench.studies.provenance import provenance

WINDOWS = (1, 10, 100, 1000)
RUNS = {1: 9, 10: 9, 100: 9, 1000: 2}


def measure(folder: Path, windows: int) -> dict[str, float]:
    """Figures of one chain: characters of `evaluate`, seconds of reading, generating and compiling, operations, seconds of a step."""
    path = folder / f"chain_{windows}.yaml"
    path.write_text(write_chain(Chain(windows=windows), penalty=False), encoding="utf-8")
    begin = perf_counter()
    model = read_model(path)
    read = perf_counter() - begin
    artifact = compile_scene(model, find_scene(model, None))
    runs = [simulate(artifact, dt=1e-3, end=0.1, error=False) for _ in range(RUNS.get(windows, 1))]
    return {
        "code": len(artifact.source.files["evaluate.cpp"]), "read": read, "generate": artifact.generate_seconds,
        "compile": artifact.compile_seconds, "operations": artifact.program.operations("evaluate"),
        "evaluation": min(r.seconds / r.evaluations for r in runs), "step": min(r.seconds / r.steps for r in runs),
        "evaluations": runs[0].evaluations / runs[0].steps,
    }  # fmt: skip


def main() -> None:
    """Print the table."""
    console = Console(highlight=False, width=140)
    console.print(provenance(), markup=False)
    with TemporaryDirectory() as name:
        os.environ["CUTJOINT_CACHE"] = str(Path(name) / "cache")
        measure(Path(name), 2)  # compiles the driver
        found = {n: measure(Path(name), n) for n in WINDOWS}
    table = Table(
        "N", "characters of evaluate", "read, s", "generate, s", "compile, s", "operations", "evaluation, us", "evaluations a step",
        "step, us", "exponent of an evaluation", "of a step",
    )  # fmt: skip
    last = None
    for n, f in found.items():
        grown = ["" if last is None else f"{log(f[what] / found[last][what]) / log(n / last):.2f}" for what in ("evaluation", "step")]
        table.add_row(
            str(n), f"{f['code']:.0f}", f"{f['read']:.2f}", f"{f['generate']:.2f}", f"{f['compile']:.2f}", f"{f['operations']:.0f}",
            f"{f['evaluation'] * 1e6:.3g}", f"{f['evaluations']:.2f}", f"{f['step'] * 1e6:.3g}", *grown,
        )  # fmt: skip
        last = n
    console.print(table)


if __name__ == "__main__":
    main()
