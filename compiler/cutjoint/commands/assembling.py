"""`cutjoint simulate --loops compiled`, which replaces loops by functions; imported only where it is asked for."""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.commands import options
from cutjoint.commands.preparing import FinishedRun, Play, prepare_and_play
from cutjoint.compile.prepared import PreparedRun, Request
from cutjoint.methods import DEFAULT_METHOD, Implementation
from cutjoint.model.records import Model, Scene
from cutjoint.reduce.assembled import assemble_loops
from cutjoint.run.errors import RunError
from cutjoint.run.results import Trajectory


def assemble_and_play(
    request: Request, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], play: Play
) -> tuple[PreparedRun, Trajectory, FinishedRun]:  # fmt: skip
    """Compile a model with its loops as functions, and play the run; where it leaves their range, again with the loops' equations if the
    scene has ``on_violation: restart``.

    Raises:
        RunError: the method or the implementation has no such loops.
    """
    if method != DEFAULT_METHOD or request.implementation == Implementation.GENERIC:
        raise RunError(f"--loops compiled: only generated and interpreted code of the method {DEFAULT_METHOD} has it; use --loops exact")
    with options.progress_bar(f"closing loops of {request.model.name}"):
        outcome = assemble_loops(model, scene)
    for note in (*outcome.done, *outcome.left):
        options.err.print(f"{note.span}: '{note.element}' {note.words}", markup=False)
    prepared, run = prepare_and_play(request, outcome.model, scene, method, parameters, play)
    if run.failure is None or not run.failure.guards or scene.on_violation != "restart":
        return prepared, run, FinishedRun(outcome.model, scene, method, parameters)
    options.err.print(f"{run.failure}; again with the loops' equations", markup=False)
    prepared, run = prepare_and_play(request, model, scene, method, parameters, play)
    return prepared, run, FinishedRun(model, scene, method, parameters)
