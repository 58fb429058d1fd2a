"""FMUs that misbehave in one of their calls: the run names the FMU and the call, keeps its rows, and leaves nothing behind."""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.conftest import ROOT

from .press import require_reported, run
from .signals import require_none_left

_EXAMPLES = ROOT / "examples"
_CALLS = (
    "Instantiate", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "SetReal", "GetReal", "DoStep", "Terminate",
    "FreeInstance",
)  # fmt: skip
_REPEATED = ("SetReal", "GetReal", "DoStep")
#: Deeds by name, in C.
_DEEDS = {
    "exit": "exit(0);", "quit": "_exit(3);", "abort": "abort();", "trap": "*(volatile int*)0 = 1;", "loop": "for (;;) pause();",
    "busy": "for (volatile int i = 0;; ++i);", "deep": "deep(1);", "kill": "kill(0, SIGKILL);",
    "close": "for (int i = 0; i < 99; ++i) close(i);",
    "codes": r'puts("\033[31m\033]0;owned\007"); fflush(stdout); tell("\033[31mred\033]0;owned\007"); return fmi2Error;',
    "flood": "for (int i = 0; i < 2000000; ++i) puts(\"flood\"); fflush(stdout);", "huge": "tell(huge()); return fmi2Error;",
    "child": "if (fork() == 0) { pause(); _exit(0); } return fmi2Error;", "throw": "raise(SIGTERM);",
    "warning": "warns = 1;", "discard": "return fmi2Discard;", "error": "return fmi2Error;", "fatal": "return fmi2Fatal;",
    "pending": "return fmi2Pending;", "unknown": "return 77;", "nan": "is_nan = 1;",
}  # fmt: skip
_HARMLESS = {"flood", "warning"}
#: Deeds that end or stop the process in which they are done, and their share.
_ENDING, _ENDED = ("exit", "quit", "abort", "trap", "loop", "busy", "deep", "kill"), 0.8
_HEADER = r"""
#define _GNU_SOURCE
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "fmi2Functions.h"
static const fmi2CallbackFunctions* callbacks;
static int is_nan, warns;
static fmi2Status done(void) { int warned = warns; warns = 0; return warned ? fmi2Warning : fmi2OK; }
static void tell(const char* text) {
  if (callbacks && callbacks->logger) callbacks->logger(callbacks->componentEnvironment, "x", fmi2Error, "x", text);
}
static const char* huge(void) { char* text = malloc(20000001); memset(text, 'x', 20000000); text[20000000] = 0; return text; }
static int deep(volatile int n) { volatile char room[10000]; room[0] = n; return deep(n + 1) + room[0]; }
static int misbehave(const char* call) {
  static int count;
  const char* asked = getenv("MISBEHAVE");
  char name[99], deed[99];
  int number;
  if (!asked || sscanf(asked, "%98s %d %98s", name, &number, deed) != 3 || strcmp(name, call) || ++count != number) return 0;
  DEEDS
  return 0;
}
"""


@cache
def _fmu() -> bytes:
    """The pole's controller, each call of which may misbehave as the environment says."""
    with TemporaryDirectory() as name:
        folder = Path(shutil.copytree(_EXAMPLES / "pole_controller", Path(name) / "controller"))
        source = folder / "sources" / "pole_controller.c"
        deeds = "\n".join(f'  if (!strcmp(deed, "{deed}")) {{ {text} }}' for deed, text in _DEEDS.items())
        text = source.read_text(encoding="utf-8").replace('#include "fmi2Functions.h"', _HEADER.replace("DEEDS", deeds))
        for call in _CALLS:
            answer = {"Instantiate": "return NULL", "FreeInstance": "return"}.get(call, "return (fmi2Status)status")
            before = "callbacks = functions; " if call == "Instantiate" else ""
            first = f'{before}int status = misbehave("{call}"); if (status) {answer};'
            text, found = re.subn(rf"(fmi2{call}\([^)]*\) {{)", rf"\1 {first}", text)
            assert found == 1, call
        text = text.replace("return fmi2OK;", "return done();")  # a call that warns has done its work
        text = text.replace("= ((Controller*)c)->value[references[i]];", "= is_nan ? NAN : ((Controller*)c)->value[references[i]];")
        source.write_text(text, encoding="utf-8")
        subprocess.run([sys.executable, folder / "build.py", Path(name) / "bad.fmu"], check=True, capture_output=True)
        return (Path(name) / "bad.fmu").read_bytes()


@cache
def _good() -> list[str]:
    """The lines of the table where nothing goes wrong."""
    with TemporaryDirectory() as name:
        done = call(Path(name), {})
        assert done.returncode == 0, done.stderr[-600:]
        return (Path(name) / "run.csv").read_text(encoding="utf-8").splitlines()


#: Seconds of a call on a machine that does much else.
_PATIENT = "15"


def call(folder: Path, more: dict[str, str], limit: str = "4") -> subprocess.CompletedProcess[str]:
    (folder / "bad.fmu").write_bytes(_fmu())
    (folder / "tmp").mkdir()
    words = [
        "couple", _EXAMPLES / "cart_pole.yaml", "bad.fmu", "--out", "run.csv", "--connect", "position=cart.x", "--connect",
        "angle=pin.angle", "--connect", "force=push", "--end", "0.2", "--call-limit", limit, "--no-error",
    ]  # fmt: skip
    return run(words, folder, {"TMPDIR": str(folder / "tmp"), "CUTJOINT_FLAGS": "-O0", **more})  # compiled in half the time


def make(rng: random.Random) -> str:
    """A call of the FMU, the how many-th of that name, and what happens in it, as JSON."""
    _good()
    name = rng.choice(_CALLS)
    number = rng.choice((1, 2, 3, rng.randrange(1, 21))) if name in _REPEATED else 1
    return json.dumps({"call": name, "number": number, "deed": rng.choice(_ENDING if rng.random() < _ENDED else list(_DEEDS))})


def check(text: str, limit: str = _PATIENT) -> tuple[str, ...]:
    """The message about an FMU; fails where there is none, where rows are lost, or where something stays behind."""
    case, good = json.loads(text), _good()
    with TemporaryDirectory() as name:
        folder = Path(name)
        done = call(folder, {"MISBEHAVE": f"{case['call']} {case['number']} {case['deed']}"}, limit)
        require_reported(done)
        require_none_left(folder)
        assert not list((folder / "tmp").iterdir()), f"left: {list((folder / 'tmp').iterdir())}"
        assert "\x1b" not in done.stderr + done.stdout, "escape codes are printed"
        assert len(done.stderr) < 2000, "a long message"
        if (folder / "run.csv").exists():
            assert (folder / "run.csv").read_text(encoding="utf-8").splitlines() == good, "another table"
            reported = re.findall(r"bad\.fmu: (it cannot be terminated: .*; the table is whole)$", done.stderr, re.MULTILINE)
            assert (done.returncode, len(reported)) in ((0, 0), (1, 1)), done.stderr[-600:]
            assert reported or case["call"] not in ("Terminate", "FreeInstance") or case["deed"] not in _ENDING, "no word about its end"
            assert not reported or case["deed"] not in _HARMLESS, "a word about an end without a fault"
            return tuple(reported)
        assert case["deed"] not in _HARMLESS, done.stderr[-600:]
        assert "bad.fmu: " in done.stderr, done.stderr[-600:]
        assert re.search("cannot (be|begin)|the step from|its output|it ends the simulation", done.stderr), done.stderr[-600:]
        left = folder / "run.partial.csv"
        rows = left.read_text(encoding="utf-8").splitlines() if left.exists() else []
        assert rows == good[: len(rows)], "other rows"
        if case["call"] == "DoStep":
            assert len(rows) >= min(case["number"], len(good) - 1), f"{len(rows)} rows are kept of {case['number']} steps"
    return (done.stderr.split("bad.fmu: ", 1)[1].splitlines()[0],)
