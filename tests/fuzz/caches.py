"""Damage to a cache: the next run mends it, or says what is wrong, and its table is the right one."""

from __future__ import annotations

import json
import random
import shutil
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from filelock import FileLock

from cutjoint.prepared import made_with
from cutjoint.toolchain.build import cache_folder

from .press import MODEL, press, require_told, run

_DAMAGES = ("empty", "cut", "flip", "append", "remove", "mode", "folder", "unreadable_text", "dangling")
_CALL = ("simulate", MODEL, "--out", "run.csv")
#: Compiled fast rather than made fast.
_FLAGS = {"CUTJOINT_FLAGS": "-O0"}


def make(rng: random.Random) -> str:
    """Which file of a cache is damaged (a number that is taken modulo how many there are), how, and where in it, as JSON.

    Libraries are built anew in minutes, so that most damage is to the rest.
    """
    _template()
    libraries = rng.random() < 0.05
    return json.dumps({"file": rng.randrange(1000), "damage": rng.choice(_DAMAGES), "at": rng.random(), "libraries": libraries})


@cache
def _template() -> tuple[Path, bytes]:
    """A cache with the press in it, made once for these sources, and the table of its run."""
    folder = cache_folder() / "fuzz"
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / "lock"):
        kept = folder / _digest()
        if not kept.exists():
            with TemporaryDirectory(dir=folder) as name:
                _run(Path(name), Path(name) / "cache")
                (Path(name) / "cache").rename(kept)
                shutil.copy2(Path(name) / "run.csv", kept.with_suffix(".csv"))
    return kept, kept.with_suffix(".csv").read_bytes()


def _digest() -> str:
    return sha256(json.dumps(made_with()).encode()).hexdigest()[:16]


def _run(folder: Path, private: Path) -> bytes:
    """The table of the press with a private cache."""
    (folder / MODEL).write_text(press(), encoding="utf-8")
    done = run(_CALL, folder, {"CUTJOINT_CACHE": str(private), **_FLAGS})
    require_told(done)
    assert done.returncode == 0, done.stderr[-600:]
    assert "please report" not in done.stderr
    return (folder / "run.csv").read_bytes()


def check(text: str) -> tuple[str, ...]:
    """Nothing; fails where the run after the damage, or the one after that, does not give the right table."""
    case = json.loads(text)
    template, wanted = _template()
    with TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(template, folder / "cache")
        files = [p for p in sorted((folder / "cache").rglob("*")) if p.is_file() and (p.suffix == ".a") == case["libraries"]]
        files = [p for p in files if p.suffix != ".lock"]
        damaged = files[case["file"] % len(files)]
        _damage(damaged, case["damage"], case["at"])
        if case["libraries"]:
            for simulator in (folder / "cache").glob("*/simulator"):
                shutil.rmtree(simulator.parent)
        for _ in range(2):
            assert _run(folder, folder / "cache") == wanted, f"another table after {case['damage']} of {damaged.name}"
    return ()


def _damage(file: Path, how: str, at: float) -> None:
    """Do to a file what disks, users and interrupted programs do; ``at`` (0 to 1) is the place in it."""
    content = file.read_bytes()
    i = int(at * len(content))
    mode = file.stat().st_mode
    if how == "mode":
        file.chmod(0o444)
        return
    file.unlink()
    if how == "folder":
        file.mkdir()
    elif how == "dangling":
        file.symlink_to("nowhere")
    elif how != "remove":
        flipped = content[:i] + bytes([content[i] ^ 0x10]) + content[i + 1 :] if content else b""
        made = {"empty": b"", "cut": content[:i], "flip": flipped, "append": content + b"\0more", "unreadable_text": b"\xff\xfe" + content}
        file.write_bytes(made[how])
        file.chmod(mode)
