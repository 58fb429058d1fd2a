"""`cutjoint simulate --view`, which reads the model again: a cached run knows its program alone; imported only where it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.commands.preparing import read_request
from cutjoint.methods import AUTO
from cutjoint.prepared import Request
from cutjoint.run.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.view.views import require_poses, require_view, show_run, write_view


def require_replay(request: Request, view: Path, batch: Path | None) -> None:
    """Check that what is asked for can be shown.

    Raises:
        ModelError, RunError, OutputError: the model is wrong, a batch or a method has no poses, or the file is of no kind.
    """
    require_view(view, "--view")
    if batch is not None:
        raise RunError("--view: a batch has many runs; simulate the one to be seen alone")
    _, _, method = read_request(request)
    if method == AUTO:
        raise RunError("--view: method auto may run a reduced model; name the method with --method")
    require_poses(method)


def write_replay(request: Request, view: Path, parameters: Mapping[str, float], run: Trajectory) -> Path:
    """Write the run as a page or a glTF file.

    Raises:
        ModelError, OutputError: the model has been changed meanwhile, or the file cannot be written.
    """
    model, scene, _ = read_request(request)
    end = request.options.end
    return write_view(view, show_run(model, scene if end is None else replace(scene, end=end), parameters, run))
