"""`cutjoint simulate --view`, which reads the model again: a cached run knows its program alone; imported only where it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.commands.preparing import Played, read_request
from cutjoint.prepared import Request
from cutjoint.run.errors import RunError
from cutjoint.run.last_steps import with_each_step
from cutjoint.run.results import Trajectory
from cutjoint.run.simulator_run import SimulatorRun
from cutjoint.view.views import require_view, show_run, write_shown


def require_replay(view: Path, batch: Path | None) -> None:
    """Check that what is asked for can be shown.

    Raises:
        RunError, OutputError: a batch is asked for, or the file is of no kind.
    """
    require_view(view, "--view")
    if batch is not None:
        raise RunError("--view: a batch has many runs; simulate the one to be seen alone")


def write_replay(
    request: Request, played: Played | None, view: Path, parameters: Mapping[str, float], plan: SimulatorRun, run: Trajectory
) -> Path:  # fmt: skip
    """Write the run of a plan as a page or a glTF file, one that failed with its last steps; a cached one was of what is asked for.

    Raises:
        ModelError, OutputError: the model has been changed meanwhile, or the file cannot be written.
        SimulatorError: the run that failed could not be taken again.
    """
    played = Played(*read_request(request), parameters) if played is None else played
    end = request.options.end
    scene = played.scene if end is None else replace(played.scene, end=end)
    steps = with_each_step(replace(plan, with_coordinates=True), run)
    return write_shown(view, show_run(played.model, scene, played.method, played.parameters, steps))
