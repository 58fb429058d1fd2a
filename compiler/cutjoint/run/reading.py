"""Models from files; those that take long to read are kept in the cache."""

from __future__ import annotations

import codecs
import json
import pickle
from base64 import b64decode, b64encode
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

from cutjoint.package.errors import CutjointError, ToolchainError
from cutjoint.package.locations import AnyPath, code_folders
from cutjoint.toolchain.cache import cache_folder, read_record, write_record
from cutjoint.toolchain.origins import LARGEST, code_digest, digests_of, versions

if TYPE_CHECKING:
    from cutjoint.model.records import Model

#: Reading that takes longer (s of CPU) is worth a file in the cache.
_LONG = 0.5


def read_model(path: AnyPath, *, tunable: Sequence[str] = (), functions: AnyPath | None = None) -> Model:
    """Read and check a model file, or a URDF, SDF or MJCF file; numbers of the result are SI.

    Args:
        tunable: patterns; constants whose names match become parameters.
        functions: C++ file with the functions that the model declares.

    Raises:
        ModelError: the file has problems, of which the error lists all, those of loops included; or the code of a function is not in
            the C++ file.
    """
    from cutjoint.importing.formats import is_foreign
    from cutjoint.topology import reading

    file = Path(path)
    if functions is not None or is_foreign(path) or not file.is_file():  # a pipe is read once
        return reading.read_model(path, tunable=tunable, functions=functions)
    with suppress(OSError, CutjointError, PackageNotFoundError, ValueError):  # of the file or of the cache: it is read below
        with file.open("rb") as stream:
            place = _place(stream.read(LARGEST).removeprefix(codecs.BOM_UTF8), path, tunable)
        record = read_record(place)
        if record is not None and record["by"] == _by() and digests_of(record["files"]) == record["files"]:
            kept: Model = pickle.loads(b64decode(record["model"]))
            return kept
    begin = process_time()
    model = reading.read_model(path, tunable=tunable)
    if process_time() - begin > _LONG:
        with suppress(PackageNotFoundError, ToolchainError, pickle.PickleError, AttributeError, TypeError):  # it is read again
            data = pickle.dumps(model)
            if pickle.loads(data) == model:  # SymPy evaluates what was left unevaluated
                record = {"by": _by(), "files": file_digests(model), "model": b64encode(data).decode()}
                write_record(_place(model.text.encode(), path, tunable), record)
    return model


def file_digests(model: Model) -> dict[str, str]:
    """The digests of the files that a model names, but for the package's own, as `digests_of` finds them."""
    from cutjoint.model.files.referenced import SHIPPED

    return {name: sha256(text.encode()).hexdigest() for name, text in model.files.items() if not name.startswith(SHIPPED)}


def _place(content: bytes, path: AnyPath, tunable: Sequence[str]) -> Path:
    about = [sha256(content).hexdigest(), str(path), *tunable]
    return cache_folder() / "models" / f"{sha256(json.dumps(about).encode()).hexdigest()[:32]}.json"


def _by() -> list[str]:
    return [code_digest(code_folders()), *versions()]
