"""A run that only waits for its simulator, and the way from there to a trajectory."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cutjoint.run.results import Trajectory, clear_places, read_effort, read_run_table
from cutjoint.run.simulator import Progress, call_simulator, failure_of


@dataclass(frozen=True, kw_only=True)
class ReadyRun:
    """What a simulator is told, but for where results go: plain data.

    ``simulator`` is the program, ``run_file`` what it reads, ``description`` what the generic twin reads of the model besides (None for
    generated code), ``units`` has the unit of each column by its name.
    """

    simulator: Path
    run_file: Mapping[str, Any]
    description: Mapping[str, Any] | None
    units: Mapping[str, str]

    def with_parameters(self, changes: Mapping[str, float]) -> ReadyRun:
        """The run with other values (SI units) of open parameters that nothing else in the run file follows from."""
        return replace(self, run_file={**self.run_file, "parameters": {**self.run_file["parameters"], **changes}})


def start(
    ready: ReadyRun, *, out: Path | None = None, steps: Path | None = None, tangents: Path | None = None, progress: Progress | None = None
) -> Trajectory:  # fmt: skip
    """Run a simulator to its end; ``out``, ``steps`` and ``tangents`` are the files that receive what `pipeline.simulate` says.

    Raises:
        SimulatorError: the simulator could not begin.
    """
    clear_places(out, steps, tangents)
    with TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv" if out is None else out
        places = {"out": table, "steps_out": steps, "tangents_out": tangents}
        run_file = {**ready.run_file, **{name: str(place.resolve()) for name, place in places.items() if place is not None}}
        if ready.description is not None:
            run_file["model"] = _write(ready.description, Path(folder) / "model.json")
        summary = call_simulator(ready.simulator, run_file, progress)
        t, columns = read_run_table(table, tuple(ready.units))
    if out is not None:
        out.with_suffix(".units.json").write_text(json.dumps({"t": "s", **ready.units}, indent=2) + "\n", encoding="utf-8")
    return Trajectory(
        t=t, columns=columns, units=ready.units, steps=summary.get("steps", 0), evaluations=summary.get("evaluations", 0),
        seconds=summary.get("seconds", 0.0), undetermined=tuple(summary.get("undetermined", ())), failure=failure_of(summary),
        effort=read_effort(summary),
    )  # fmt: skip


def _write(description: Mapping[str, Any], path: Path) -> str:
    path.write_text(json.dumps(description), encoding="utf-8")
    return str(path)
