"""Damage to a cache: the next run mends it, or says what is wrong, and its table is the right one.

A cache that others can write is refused before anything of it runs.
"""

from __future__ import annotations

import json
import os
import random
import re
import shlex
import shutil
import subprocess
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from filelock import FileLock

from cutjoint.compile.prepared import build_provenance
from cutjoint.toolchain.build import cache_folder

from .press import MODEL, press, require_reported, run

_DAMAGES = ("empty", "cut", "flip", "append", "remove", "mode", "folder", "unreadable_text", "dangling")
#: The parts of a path to a cached file that others can write or own: the file itself, its folder, the cache, the folder that has it.
_PARTS = ("file", "folder", "cache", "parent")
_WAYS = ("by everybody", "by a group", "of another", "planted")
_OTHER = 65534
_CALL = ("simulate", MODEL, "--out", "run.csv")
#: Compiled fast rather than made fast.
FLAGS = {"CUTJOINTFLAGS": "-O0"}


def make(rng: random.Random) -> str:
    """Damage to a cache, as JSON: the file (a number that is taken modulo how many there are), kind, and place in it; or the part of
    its path that others can write, how they do, and whether what the message says is done about it.

    Libraries are built anew in minutes, so that most damage is to the rest.
    """
    template()
    if os.geteuid() == 0 and rng.random() < 0.8:
        return json.dumps({"file": rng.randrange(1000), "part": rng.choice(_PARTS), "way": rng.choice(_WAYS), "cured": rng.random() < 0.3})
    libraries = rng.random() < 0.05
    return json.dumps({"file": rng.randrange(1000), "damage": rng.choice(_DAMAGES), "at": rng.random(), "libraries": libraries})


@cache
def template() -> tuple[Path, bytes]:
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
    return sha256(json.dumps(build_provenance()).encode()).hexdigest()[:16]


def _run(folder: Path, private: Path) -> bytes:
    """The table of the press with a private cache."""
    done = _call(folder, private)
    assert done.returncode == 0, done.stderr[-600:]
    assert "please report" not in done.stderr
    return (folder / "run.csv").read_bytes()


def _call(folder: Path, private: Path) -> subprocess.CompletedProcess[str]:
    (folder / MODEL).write_text(press(), encoding="utf-8")
    done = run(_CALL, folder, {"CUTJOINT_CACHE": str(private), **FLAGS})
    require_reported(done)
    return done


def check(text: str) -> tuple[str, ...]:
    """Nothing; fails where the run after the damage, or the one after that, does not give the right table."""
    case = json.loads(text)
    if "way" in case:
        return _check_others(case)
    kept, wanted = template()
    with TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(kept, folder / "cache")
        files = [p for p in sorted((folder / "cache").rglob("*")) if p.is_file() and (p.suffix == ".a") == case["libraries"]]
        files = [p for p in files if p.suffix != ".lock"]
        if not files:
            return ("no driver in the cache: that of the installation is used",)
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


def _check_others(case: dict[str, Any]) -> tuple[str, ...]:
    """The reason why a cache that others can write is refused; fails where it is used."""
    kept, wanted = template()
    with TemporaryDirectory() as name:
        folder = Path(name)
        private = folder / "above" / "cache"
        shutil.copytree(kept, private)
        files = [p for p in sorted(private.rglob("*")) if p.is_file() and p.suffix not in (".lock", ".a")]
        simulators = sorted(private.glob("*/simulator"))
        file = simulators[0] if case["way"] == "planted" else files[case["file"] % len(files)]
        part = {"file": file, "folder": file.parent, "cache": private, "parent": private.parent}[case["part"]]
        _open_to_others(part, case["way"], file, folder / "ran")
        done = _call(folder, private)
        assert not (folder / "ran").exists(), "what another user planted has run"
        if done.returncode == 0:
            assert case["part"] in ("file", "folder"), f"{case['part']} is used {case['way']}"
            assert case["way"] != "planted", "what another user planted is taken for damage"
            assert (folder / "run.csv").read_bytes() == wanted
            return ()  # a run does not need all files
        assert f"is not safe: {part} " in done.stderr.replace("\n", " "), done.stderr[-600:]
        if case["cured"] and (said := re.search(r"; (chmod .*?) if nobody", done.stderr)):
            subprocess.run(shlex.split(said[1]), check=True)
            assert _run(folder, private) == wanted
        return (done.stderr.rsplit(" is not safe: ", 1)[-1].split(";")[0],)


def _open_to_others(part: Path, way: str, file: Path, ran: Path) -> None:
    """Let another user write a part of a path, or put a program of the right digest there that says that it ``ran``."""
    if way == "planted":
        file.write_text(f"#!/bin/sh\ntouch {shlex.quote(str(ran))}\n", encoding="utf-8")
        file.with_name("simulator.sha256").write_text(f"{sha256(file.read_bytes()).hexdigest()} program\n", encoding="ascii")
    if way in ("of another", "planted"):
        os.lchown(part, _OTHER, _OTHER)
    elif way == "by a group":
        os.chown(part, -1, _OTHER)
    part.chmod(part.stat().st_mode | {"by everybody": 0o022, "by a group": 0o020}.get(way, 0))
