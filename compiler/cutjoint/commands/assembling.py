"""`cutjoint simulate` with loops as functions; imported only where a scene or the caller asks for it."""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.analysis.assembled import assemble_loops
from cutjoint.commands import options
from cutjoint.commands.preparing import FinishedRun, Play, prepare_and_play
from cutjoint.compile.prepared import PreparedRun, Request
from cutjoint.methods import Loops
from cutjoint.model.records import Model, Scene
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_loops


def assemble_and_play(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], play: Play
) -> tuple[PreparedRun, Trajectory, FinishedRun]:  # fmt: skip
    """Compile a model with its loops as functions, and play the run; where it leaves their range and cannot go on, again with the loops'
    equations if the scene has ``on_violation: restart``."""
    with options.progress_bar(f"closing loops of {request.model.name}"):
        outcome = assemble_loops(model, scene)
    for note in (*outcome.done, *outcome.left):
        options.err.print(str(note), markup=False)
    prepared, run = prepare_and_play(request, model, scene, method, parameters, play)
    if run.failure is not None and run.failure.guards and scene.on_violation == "restart":
        options.err.print(f"{run.failure}; again with the loops' equations", markup=False)
        scene = with_loops(scene, Loops.EXACT)
        prepared, run = prepare_and_play(request, model, scene, method, parameters, play)
    return prepared, run, FinishedRun(model, scene, method, parameters)
