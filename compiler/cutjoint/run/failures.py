"""Runs that do not reach their end: their descriptions, and the errors that hand over their partial results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cutjoint.package.errors import CutjointError, plural
from cutjoint.run.results import Batch, FailureReport, Trajectory
from cutjoint.run.scenes import Compiled, load_model

if TYPE_CHECKING:
    from cutjoint.model.records import Scene
    from cutjoint.topology.records import Topology

#: Messages of an impossible start, and the section of the scene that may cause it.
_IMPOSSIBLE = {"the loop cannot close from the given coordinates": "positions", "the given speeds contradict the loops": "rates"}


class IncompleteError(CutjointError, RuntimeError):
    """A task that did not reach its end; each subclass has the partial results."""

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message, result)  # both arguments, so that the error can be pickled

    def __str__(self) -> str:
        return str(self.args[0])


class FailedRunError(IncompleteError):
    """A run that failed."""

    @property
    def trajectory(self) -> Trajectory:
        """The run up to its failure."""
        trajectory: Trajectory = self.args[1]
        return trajectory


class FailedBatchError(IncompleteError):
    """A batch some of whose runs failed."""

    @property
    def batch(self) -> Batch:
        """All runs of the batch, each with its failure or None."""
        batch: Batch = self.args[1]
        return batch


def places_of(topology: Topology, scene: Scene) -> dict[str, str]:
    """The places of bodies, joints and gears in the model file, and of the scene's initial values for each loop.

    A loop's place, by its cut joint, is the scene's first entry of one of its joints, else a guide.
    """
    spans = dict(topology.model.constraint_spans)
    for loop in topology.loops:
        around = {topology.joint_of[body].joint.name: topology.joint_of[body].joint for body in loop.bodies}
        for section in ("positions", "rates"):
            entered = {key.removeprefix(f"{section}."): span for key, span in scene.entries.items() if key.startswith(f"{section}.")}
            entries = (span for coordinate, span in entered.items() if coordinate.rpartition(".")[0] in around)
            guides = (joint.span for joint in around.values() if joint.guide is not None)
            if span := next(entries, next(guides, None)):
                spans[_entry(section, loop.cut)] = span
    return {name: str(span) for name, span in spans.items()}


def _entry(section: str, cut: str) -> str:
    return f"{section} for {cut}"


def is_impossible(failure: FailureReport) -> bool:
    """Return whether the failure means that no consistent start has the given values."""
    return failure.message in _IMPOSSIBLE


def describe_failure(
    failure: FailureReport, scene: str, places: Mapping[str, str], model: Path | Compiled, changed: Mapping[str, float]
) -> str:  # fmt: skip
    """A failure in words, with ``changed`` parameters and the place in the model file of its joint or of the scene's entry that caused it.
    """
    joint = failure.element.rpartition(".")[0]
    place = places.get(joint, str(model) if isinstance(model, Path) else model.model.span.file)
    if not is_impossible(failure):
        return f"{place}: scene '{scene}': {failure}"
    section = _IMPOSSIBLE[failure.message]
    where = places.get(_entry(section, joint), place)
    values = f" with {', '.join(f'{name} = {value:g}' for name, value in changed.items())}" if changed else ""
    unit = "m or rad" if section == "positions" else "m/s or rad/s"
    left = f"{failure.residual:.3g} {unit} are left at '{failure.element}' ({place}), which closes it"
    return f"{where}: scene '{scene}': {failure.message}{values}: {left}; {_nearest(model, scene, changed, section)}{failure.advice}"


def _nearest(source: Path | Compiled, name: str, changed: Mapping[str, float], section: str) -> str:
    """What the nearest start with closed loops has in place of a scene's positions or rates, as the start of a remedy."""
    from cutjoint.run.run_file import describe_nearest, parameter_values  # imported here because runs that begin do not need it

    try:
        model, scene = load_model(source, name, tuple(changed)) if isinstance(source, Path) else load_model(source)
        words = describe_nearest(model, scene, parameter_values(model, changed), section)
    except CutjointError:
        return ""
    return f"the nearest {'pose' if section == 'positions' else 'motion'} has {words}; " if words else ""


def describe_rest(table: Path | None) -> str:
    """Where the samples of a failed run are, as a sentence."""
    return f"the rows up to then are in {table}" if table else "no results were written"


def describe_failures(batch: Batch) -> list[str]:
    """The first runs of a batch that failed, a line each."""
    failed = [(i, failure) for i, failure in enumerate(batch.failures, 1) if failure is not None]
    return [f"run {i}: {failure}" for i, failure in failed[:5]]


def count_failures(batch: Batch) -> str:
    """The number of failed runs of a batch, in words; "" if none failed."""
    failed = sum(failure is not None for failure in batch.failures)
    return f"{failed} of {plural(len(batch.cases), 'run')} failed" if failed else ""
