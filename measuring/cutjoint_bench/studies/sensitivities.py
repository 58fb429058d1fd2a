"""The price of derivatives in runs: forward sensitivities of 1, 8 and 16 seeds, and the adjoint of an objective.

`python -m cutjoint_bench.studies.sensitivities`: the Iltis of simul1 by RK4 over 400 steps of 1 ms, masses and stiffnesses tunable, one
sample at the end; the least CPU time of several runs.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import click
from rich.console import Console
from rich.table import Table

from cutjoint.methods import Loops
from cutjoint.model.read import read_model
from cutjoint.run.scenes import find_scene, with_loops
from cutjoint.stepping.load import load_scene
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.provenance import provenance

STEPS, DT, OUTPUT, TUNABLE, REPEATED = 400, 1e-3, "chassis.z", ("*mass*", "*stiffness*"), 9


def least(run: Callable[[], object], reset: Callable[[], object], repeated: int = REPEATED) -> float:
    """The least CPU seconds of a run."""
    found = []
    for _ in range(repeated):
        reset()
        begun = process_time()
        run()
        found.append(process_time() - begun)
    return min(found)


def ratios(loops: Loops) -> dict[str, float]:
    """Milliseconds of a run, and runs that each kind of derivatives takes."""
    model = read_model(MODELS / "iltis.yaml", tunable=TUNABLE)
    sim = load_scene(model, with_loops(find_scene(model, "simul1"), loops), integrator="rk4", adjoint=True)
    names = [*sim.parameters]

    def start() -> object:
        return sim.reset(dt=DT)

    plain = least(lambda: sim.advance(STEPS * DT), start)
    found = {"ms": 1e3 * plain}
    for seeds in (1, 8, 16):
        by = names[:seeds]
        found[f"{len(by)} seeds"] = least(
            lambda by=by: sim.forward_sensitivities(STEPS, [OUTPUT], by, every=STEPS), start) / plain  # type: ignore[misc]
    found["adjoint"] = least(lambda: sim.adjoint_sensitivities(STEPS, [OUTPUT], names, "end", every=STEPS), start, 3) / plain
    return found


@click.command(help=__doc__)
def command() -> None:
    """Print a row for each way to close loops."""
    click.echo(str(provenance(())))
    table = Table("loops", "run, ms", "1 seed", "8 seeds", "16 seeds", "adjoint", box=None)
    for loops in Loops:
        table.add_row(loops, *(f"{value:.1f}" for value in ratios(loops).values()))
    Console().print(table)


if __name__ == "__main__":
    command()
