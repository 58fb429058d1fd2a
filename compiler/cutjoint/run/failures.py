"""Runs that do not reach their end: what is said of them, and the errors that hand over what there is of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cutjoint.run.results import Batch, FailureReport, Trajectory


class IncompleteError(RuntimeError):
    """What was asked for did not come to its end; the errors below have what there is of it."""

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message, result)  # both, so that the error can be sent to another process

    def __str__(self) -> str:
        return str(self.args[0])


class FailedRunError(IncompleteError):
    """A run that failed."""

    @property
    def trajectory(self) -> Trajectory:
        """The run as far as it came, with its failure."""
        trajectory: Trajectory = self.args[1]
        return trajectory


class FailedBatchError(IncompleteError):
    """A batch some of whose runs failed."""

    @property
    def batch(self) -> Batch:
        """All runs of the batch, each with its failure or None."""
        batch: Batch = self.args[1]
        return batch


def describe_failure(failure: FailureReport, scene: str, places: Mapping[str, str], model: Path) -> str:
    """What failed, with the place of its joint in the model file."""
    where = places.get(failure.element.rpartition(".")[0], str(model))
    return f"{where}: scene '{scene}': {failure}"


def describe_rest(table: Path | None) -> str:
    """Where the rows of a run are that failed."""
    return f"the rows up to then are in {table}" if table else "no file has rows of it"


def describe_failures(batch: Batch) -> list[str]:
    """The first runs of a batch that failed, a line each."""
    failed = [(i, failure) for i, failure in enumerate(batch.failures, 1) if failure is not None]
    return [f"run {i}: {failure}" for i, failure in failed[:5]]


def count_failures(batch: Batch) -> str:
    """How many runs of a batch failed; "" if none did."""
    failed = sum(failure is not None for failure in batch.failures)
    return f"{failed} of {len(batch.cases)} runs failed" if failed else ""
