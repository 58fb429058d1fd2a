"""A small sweep as an earlier call left it, the damage that disks, users and other programs do to it, and what must come of that."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from click.testing import CliRunner, Result

from cutjoint.cli import main
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.kernel import Kernel
from cutjoint.sweeps.parts import Parts
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.run import make_manifest
from cutjoint.sweeps.table import Layout
from cutjoint.sweeps.work import Chunk, Rows, Work

from .studies import study

#: The number of runs, the seeds of the sweep and of another one, and the changes of the common study.
RUNS, SEED, ANOTHER = 64, 3, 9
_ASKED: Mapping[str, Any] = {"end": 0.02, "trajectories": None, "objectives": {"top": {"maximum": "slider.x"}}}

#: The ends of an earlier call's chunks, and of another's.
CUTS, OTHER_CUTS = (10, 20, 30, 40, 48), (4, 16, 24, 40, 52)

OUT = "out.parquet"
PARTS, ASIDE = f"{OUT}.parts", f"{OUT}.aside"


def write_study(folder: Path, seed: int = SEED) -> Path:
    """The study of the sweep."""
    return study(folder, **_ASKED, design={"sobol": RUNS, "seed": seed})


@cache
def _kernels() -> tuple[Kernel, ...]:
    """The library of the study, whatever its seed."""
    with TemporaryDirectory() as name:
        return build_kernels(read_study(write_study(Path(name))))


@cache
def files(cuts: tuple[int, ...] = CUTS, seed: int = SEED) -> Mapping[str, bytes]:
    """Files of an earlier call whose chunks ended at these runs, by name."""
    with TemporaryDirectory() as name:
        asked = read_study(write_study(Path(name), seed))
        work = Work(kernels=_kernels(), has_scenes=False, objectives=asked.objectives, trajectories=(), every=1)
        parts = Parts(Path(name) / OUT, Layout(study=asked, manifest=make_manifest(asked, _kernels())), print)
        for first, last in zip((0, *cuts), cuts, strict=False):
            parts.write(work.perform(Chunk(first=first, values=np.ascontiguousarray(asked.values[first:last]))))
        parts.close()
        return {path.name: path.read_bytes() for path in sorted(parts.folder.glob("*.*")) if path.name != ".lock"}


@cache
def whole() -> bytes:
    """The table of a call that nothing disturbs."""
    with TemporaryDirectory() as name:
        write_study(Path(name))
        assert call(Path(name)).exit_code == 0
        return (Path(name) / OUT).read_bytes()


def begin(folder: Path) -> Path:
    """Write the study and what an earlier call left; the folder of parts."""
    write_study(folder)
    parts = folder / PARTS
    parts.mkdir()
    for name, content in files().items():
        (parts / name).write_bytes(content)
    return parts


def call(folder: Path, meanwhile: Callable[[int], None] = lambda number: None) -> Result:
    """The command on the study; ``meanwhile`` is called after each part that is written, with their number."""
    written, write = 0, Parts.write

    def counted(parts: Parts, rows: Rows) -> None:
        nonlocal written
        write(parts, rows)
        written += 1
        meanwhile(written)

    with patch("cutjoint.sweeps.run.build_kernels", lambda _: _kernels()), patch.object(Parts, "write", counted):
        return CliRunner().invoke(main, ["sweep", str(folder / "study.yaml"), "--out", str(folder / OUT), "--threads", "1"])


@dataclass
class Harm:
    """Damage to the folder of parts, by random numbers; ``users`` has all contents that must not be lost by that."""

    parts: Path
    rng: random.Random
    users: list[bytes] = field(default_factory=list)

    def do(self, damage: str) -> None:
        """Do it; nothing where there is nothing to do it to."""
        DAMAGES[damage](self)

    def pick(self) -> Path | None:
        """A part that is there."""
        found = [path for path in sorted(self.parts.glob("0*.parquet")) if path.is_file()]
        return self.rng.choice(found) if found else None

    def write(self, path: Path, content: bytes) -> None:
        """Put a file somewhere, in place of what is there."""
        if path.is_dir():
            return
        self.remove(path)
        path.write_bytes(content)
        self.users.append(content)

    def remove(self, path: Path) -> None:
        """Take a file away, with what it had."""
        if path.is_file() and (content := path.read_bytes()) in self.users:
            self.users.remove(content)
        path.unlink(missing_ok=True)


def name_of(first: int, last: int) -> str:
    """The name of a part."""
    return f"{first:012d}-{last:012d}.parquet"


def _flip(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1 :]


def _change(harm: Harm, change: Callable[[bytes], bytes]) -> None:
    if (path := harm.pick()) is not None and (content := path.read_bytes()):
        harm.write(path, change(content))


def _rename(harm: Harm, name: str) -> None:
    if (path := harm.pick()) is not None and not (harm.parts / name).exists():
        content = path.read_bytes()
        harm.users += [] if content in harm.users else [content]
        path.rename(harm.parts / name)


def _swap(harm: Harm) -> None:
    one, other = harm.pick(), harm.pick()
    if one is not None and other is not None and one != other:
        contents = one.read_bytes(), other.read_bytes()
        harm.write(one, contents[1])
        harm.write(other, contents[0])


def _add(harm: Harm, cuts: tuple[int, ...], seed: int) -> None:
    name, content = harm.rng.choice([item for item in files(cuts, seed).items() if item[0] != "manifest.json"])
    harm.write(harm.parts / name, content)


def _rewrite(harm: Harm) -> None:
    """Other numbers by a program that keeps columns and metadata."""
    if (path := harm.pick()) is None:
        return
    try:
        table = pq.read_table(pa.BufferReader(path.read_bytes()))
    except (pa.ArrowException, OSError):
        return
    moved = pa.array([1.0 + (x or 0.0) for x in table["top"].to_pylist()])
    buffer = pa.BufferOutputStream()
    pq.write_table(table.set_column(table.schema.get_field_index("top"), table.schema.field("top"), moved), buffer)
    harm.write(path, buffer.getvalue().to_pybytes())


def _make_folder(harm: Harm) -> None:
    path = harm.pick() or harm.parts / name_of(0, 10)
    if not path.is_dir():
        harm.remove(path)
        path.mkdir()
        harm.write(path / "notes.txt", b"of a user, %d" % harm.rng.randrange(10**9))


def _make_link(harm: Harm) -> None:
    if (path := harm.pick()) is not None:
        harm.remove(path)
        path.symlink_to("nowhere")


def _odd_name(harm: Harm) -> None:
    names = ("a-b.parquet", "7.parquet", "x.parquet", "1-2-3.parquet", "-.parquet", "notes.txt", "000000000000-000000000010.parquet.bak",
             ".000000000000-000000000010.parquet.old", f"{10**30}-{10**31}.parquet", "000000000000-000000000010 (copy).parquet",
             "٠٠٠٠٠٠٠٠٠٠٠٠-٠٠٠٠٠٠٠٠٠٠١٠.parquet")  # fmt: skip
    content = harm.rng.choice([*files().values(), b"", b"mine %d" % harm.rng.randrange(10**9)])
    harm.write(harm.parts / harm.rng.choice(names), content)


def _lose(harm: Harm) -> None:
    if (path := harm.pick()) is not None:
        harm.remove(path)


def _lose_all(harm: Harm) -> None:
    for path in harm.parts.glob("0*.parquet"):
        if path.is_file():
            harm.remove(path)


def _change_manifest(harm: Harm) -> None:
    """In a place of it; where it is still a manifest, the other one is refused."""
    path = harm.parts / "manifest.json"
    content = path.read_bytes() if path.is_file() else b""
    if content:
        at = harm.rng.randrange(len(content) - 1)  # without the line's end it says the same
        harm.write(path, harm.rng.choice([_flip(content, at), content[:at], content + b"}", b"\xff\xfe" + content]))


def _replace_manifest(harm: Harm) -> None:
    of_another = json.dumps({"format": 1, "runs": RUNS, "key": "0" * 64}).encode()
    harm.write(harm.parts / "manifest.json", harm.rng.choice([b"", b"[]", b"{}", b"null", b'"x"', b"[" * 100_000, of_another]))


def _manifest_folder(harm: Harm) -> None:
    path = harm.parts / "manifest.json"
    if not path.is_dir():
        harm.remove(path)
        path.mkdir()
        harm.write(path / "notes.txt", b"of a user, %d" % harm.rng.randrange(10**9))


def _lose_manifest(harm: Harm) -> None:
    path = harm.parts / "manifest.json"
    if path.is_file():
        harm.remove(path)


def _another_manifest(harm: Harm) -> None:
    harm.write(harm.parts / "manifest.json", files(CUTS, ANOTHER)["manifest.json"])


def _unfinished(harm: Harm) -> None:
    """Leave files of a call that was killed while it wrote: no user's."""
    (harm.parts / f".{name_of(0, 10)}.0123456789ab").write_bytes(b"half")
    if not (harm.parts / "whole.partial").exists():
        (harm.parts / "whole.partial").write_bytes(b"half")


DAMAGES: Mapping[str, Callable[[Harm], None]] = {
    "flip": lambda h: _change(h, lambda c: _flip(c, h.rng.randrange(len(c)))),
    "cut": lambda h: _change(h, lambda c: c[: h.rng.randrange(len(c))]),
    "append": lambda h: _change(h, lambda c: c + b"PAR1"),
    "empty": lambda h: _change(h, lambda c: b""),
    "garbage": lambda h: _change(h, lambda c: h.rng.randbytes(h.rng.randrange(200))),
    "rename": lambda h: _rename(h, name_of(48, 48 + h.rng.randrange(1, 16))),
    "beyond": lambda h: _rename(h, name_of(RUNS, RUNS + 10)),
    "backwards": lambda h: _rename(h, name_of(20, 10)),
    "odd rename": lambda h: _rename(h, "part.parquet"),
    "swap": _swap,
    "overlap": lambda h: _add(h, OTHER_CUTS, SEED),
    "another seed": lambda h: _add(h, CUTS, ANOTHER),
    "another seed and cuts": lambda h: _add(h, OTHER_CUTS, ANOTHER),
    "rewrite": _rewrite,
    "folder": _make_folder,
    "link": _make_link,
    "odd name": _odd_name,
    "lose": _lose,
    "lose all": _lose_all,
    "unfinished": _unfinished,
    "change manifest": _change_manifest,
    "replace manifest": _replace_manifest,
    "manifest folder": _manifest_folder,
    "lose manifest": _lose_manifest,
    "another manifest": _another_manifest,
}


def require_sound(folder: Path, result: Result, users: Sequence[bytes]) -> None:
    """The table of a call is the right one, or the call says why there is none; nothing of a user is lost."""
    assert result.exception is None or isinstance(result.exception, SystemExit), repr(result.exception)
    if result.exit_code == 0:
        assert (folder / OUT).read_bytes() == whole(), "done, with another table"
    else:
        assert result.exit_code == 1, result.output
        assert result.output.strip(), "no word"
        assert not (folder / OUT).exists(), "failed, with a table"
    left = [path.read_bytes() for path in _files_of(folder)]
    ours = {*files().values(), *files(OTHER_CUTS).values()}
    for content in users:
        assert content in left or content in ours, f"lost: {content[:40]!r}; {result.output}"


def _files_of(folder: Path) -> list[Path]:
    return [Path(base) / name for base, _, names in os.walk(folder) for name in names if (Path(base) / name).is_file()]
