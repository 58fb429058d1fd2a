"""From a model file to a :class:`Model`; problems of its loops are listed with those of the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cutjoint.importing.formats import is_foreign, name_of
from cutjoint.model import read
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.functions import supply
from cutjoint.model.records import Model
from cutjoint.package.locations import AnyPath
from cutjoint.topology.search import span
from cutjoint.topology.spanning_tree import TopologyError


def read_model(path: AnyPath, *, tunable: Sequence[str] = (), functions: AnyPath | None = None) -> Model:
    """As `run.reading.read_model`, which keeps what takes long."""
    with _problems_of_loops():
        if is_foreign(path):  # places in messages about the model that it becomes are those of the file that `cutjoint import` writes
            from cutjoint.importing.document import import_file

            text, folder = import_file(Path(path)).text, Path(path).parent
            model = read.read_model_text(text, str(name_of(Path(path))), folder=folder, tunable=tunable)
        else:
            model = read.read_model(path, tunable=tunable)
    return model if functions is None else supply(model, functions)


def read_model_text(text: str, file: str, *, folder: AnyPath | None = None, tunable: Sequence[str] = ()) -> Model:
    """Read a model from a text; messages call it ``file``, and ``folder`` contains the files that it names."""
    with _problems_of_loops():
        return read.read_model_text(text, file, folder=folder, tunable=tunable)


@contextmanager
def _problems_of_loops() -> Iterator[None]:
    """Context that adds problems of loops to those of a file."""
    try:
        yield
    except ModelError as error:
        if error.model is None:
            raise
        try:
            span(error.model)
        except TopologyError as of_loops:
            raise ModelError((*error.problems, *of_loops.problems)) from None
        raise ModelError(error.problems) from None
