"""The table of a sweep: Parquet, with the manifest and a digest in the file.

The bytes of a table follow from its rows and the manifest, whatever parts (`parts`) there were.  Digests stand between rows and footer,
where readers pass over them.
"""

import json
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.package.extensions import find_package
from cutjoint.run.outputs import OutputError, is_stream, resolved
from cutjoint.sweeps.records import Kind, Study
from cutjoint.sweeps.work import Rows

#: The key of the manifest in a table's metadata.
MANIFEST = b"cutjoint"

#: The largest size of a row group, in bytes and in rows; readers load the groups that they need.
_GROUP_BYTES, _GROUP_ROWS = 16_000_000, 65_536
#: The size of a digest, of the end of a file after its footer (length and mark), and of blocks for reading, bytes.
_DIGEST, _TAIL, _BLOCK = 32, 8, 1 << 20


def arrow() -> Any:
    """PyArrow. Raises RunError: it is not installed."""
    words = "tables of sweeps and of several fits need PyArrow: pip install 'cutjoint[sweep]'"
    return find_package("pyarrow", "pyarrow.parquet", otherwise=RunError(words))


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The columns of a study's table.

    Number of the run, variables, why and when it failed, objectives, trajectories (their expressions with "(t)").  Units stand in the
    metadata of the fields.
    """

    study: Study
    manifest: Mapping[str, Any]

    @cached_property
    def schema(self) -> Any:
        """The schema with the manifest."""
        pa, study = arrow(), self.study

        def field(name: str, kind: Any, unit: str = "") -> Any:
            return pa.field(name, kind, metadata={"unit": unit} if unit else None)

        variables = [field(v.name, pa.string() if v.kind is Kind.SCENE else pa.float64(), v.unit) for v in study.variables]
        objectives = [field(o.name, pa.float64(), o.unit) for o in study.objectives]
        shown = [field(f"{study.series[i].text}(t)", pa.list_(pa.float64()), study.series[i].unit) for i in study.trajectories]
        return pa.schema(
            [field("run", pa.int64()), *variables, field("failure", pa.string()), field("failure_time", pa.float64(), "s"), *objectives,
             *shown],
            metadata={MANIFEST: manifest_text(self.manifest)},
        )  # fmt: skip

    @cached_property
    def key(self) -> str:
        """The sweep's key: a digest of the manifest, from which rows follow."""
        return key_of(self.manifest)

    @property
    def label(self) -> str:
        """The label of the whole table's digest."""
        return parts_label(self.key, 0, self.study.runs)

    @property
    def row_bytes(self) -> int:
        """The approximate size of a row, bytes."""
        lengths = [-(-(int(scene.end / scene.output_step) + 2) // self.study.every) + 1 for scene in self.study.scenes]
        return 8 * (4 + len(self.study.variables) + len(self.study.objectives) + len(self.study.trajectories) * max(lengths, default=0))

    @property
    def group_rows(self) -> int:
        """The number of rows in a group."""
        return max(1, min(_GROUP_ROWS, _GROUP_BYTES // self.row_bytes))

    def table(self, rows: Rows) -> Any:
        """The rows of a chunk as a table."""
        pa, study = arrow(), self.study
        numbers = pa.array(np.arange(rows.first, rows.first + len(rows.values)))
        variables = [self._variable(v.kind, rows.values[:, i]) for i, v in enumerate(study.variables)]
        objectives = [_nullable(rows.objectives[:, j]) for j in range(len(study.objectives))]
        offsets = pa.array(np.concatenate([[0], np.cumsum(rows.lengths)]).astype(np.int32))
        shown = [pa.ListArray.from_arrays(offsets, pa.array(values)) for values in rows.trajectories]
        columns = [numbers, *variables, pa.array(rows.failures, pa.string()), _nullable(rows.times), *objectives, *shown]
        return pa.Table.from_arrays(columns, schema=self.schema)

    def _variable(self, kind: Kind, values: Any) -> Any:
        if kind is not Kind.SCENE:
            return arrow().array(values)
        return arrow().array([self.study.scenes[int(i)].name for i in values], arrow().string())


def manifest_text(manifest: Mapping[str, Any]) -> str:
    """The text of a manifest in files."""
    return json.dumps(manifest, indent=2)


def key_of(manifest: Mapping[str, Any]) -> str:
    """The digest of a manifest."""
    return sha256(manifest_text(manifest).encode()).hexdigest()


def parts_label(key: str, first: int, last: int) -> str:
    """The label of the digest of rows: a sweep's key, the number of the first run, and the one behind the last."""
    return f"{key} {first} {last}"


def _nullable(values: Any) -> Any:
    return arrow().array(values, from_pandas=True)


def is_whole(out: Path, layout: Layout) -> bool:
    """Return whether a complete table of a study exists, unchanged since it was written."""
    target = resolved(out)
    if not target.is_file():
        return False
    with suppress(OSError), target.open("rb") as file:
        return is_sealed(file, layout.label)
    return False


def require_file(out: Path) -> None:
    """Check that a table can stand at a path. Raises OutputError: it is a device, a pipe or a folder."""
    if is_stream(out) or out.is_dir():
        raise OutputError(f"{out}: the table of a sweep is a file, which is renamed when it is whole; write the name of one")


def require_room(layout: Layout, out: Path) -> None:
    """Check that a table and its parts fit on the disk. Raises RunError: they do not; it names the line of the design."""
    folder = next(parent for parent in resolved(out).parents if parent.exists())
    needed, free = 2 * layout.row_bytes * layout.study.runs, shutil.disk_usage(folder).free
    if needed > free:
        raise RunError(
            f"{layout.study.span}: design: {layout.study.runs} runs take about {needed / 1e9:.3g} GB at {folder}, which has "
            f"{free / 1e9:.3g} GB left; write fewer runs or thinner trajectories, or write elsewhere"
        )


def seal(file: BinaryIO, label: str) -> None:
    """Put the digest of a ``label`` and of all its bytes into a Parquet file that is open for reading and writing."""
    footer = _find_footer(file)
    digest = _digest(file, label, footer, footer)
    file.seek(footer)
    rest = file.read()
    file.seek(footer)
    file.write(digest + rest)


def is_sealed(file: BinaryIO, label: str) -> bool:
    """Return whether all bytes of a file are those that were sealed with that label."""
    footer = _find_footer(file)
    rows = footer - _DIGEST
    if rows < 0:
        return False
    file.seek(rows)
    return file.read(_DIGEST) == _digest(file, label, rows, footer)


def _find_footer(file: BinaryIO) -> int:
    """The offset at which a file's footer would begin; negative if there can be none."""
    size = file.seek(0, os.SEEK_END)
    if size < _TAIL:
        return -1
    file.seek(size - _TAIL)
    return size - _TAIL - int.from_bytes(file.read(4), "little")


def _digest(file: BinaryIO, label: str, rows: int, footer: int) -> bytes:
    digest = sha256(label.encode())
    file.seek(0)
    left = rows
    while left and (block := file.read(min(left, _BLOCK))):
        digest.update(block)
        left -= len(block)
    file.seek(footer)
    while block := file.read(_BLOCK):
        digest.update(block)
    return digest.digest()
