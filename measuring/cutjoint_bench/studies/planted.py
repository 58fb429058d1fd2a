"""Faults that are planted one by one, and the first test that sees each: what a quick selection of tests may not leave out.

    python -m cutjoint_bench.studies.planted [NAMES...] [--jobs 2] [--all] [--every] [--list] [--out docs/evidence/measured]

Each fault of `FAULTS` is a slip that changes results or safety and raises no error by itself.  It is planted into a worktree of the
present commit, and the tests that should see it run there, those without a compiler first, until one fails or the CPU time is up.
A test counts only if it passes without the fault; one that does not is left out, and the others go on.  ``--every`` goes on to the end
and lists all tests that see a fault.  CPU times are those of tests; drivers are compiled before, each once, into a cache of the study's
own, and the Python of a worktree has the packages of the Python that runs the study, but an installation of its own.
Results of faults that ran before stay in planted.json; planted.txt is the same as a table.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any

from cutjoint.run.result_files import write_whole
from cutjoint_bench.studies.checkout import ROOT
from cutjoint_bench.studies.planted_faults import FAULTS, Fault
from cutjoint_bench.studies.provenance import provenance

#: CPU time (s) of the tests of a fault at most, and how long (s) a test may stand still on an idle machine.
LIMIT, _STUCK = 240.0, 1800.0
#: Passes over the tests of a fault: without a compiler, then with one.
_PASSES = ("not heavy and not cpp", "not heavy and cpp")
#: What compiles the drivers that interpret programs, for a pass with a compiler.
_DRIVERS = """
from cutjoint.toolchain.build import build_interpreter
from cutjoint.toolchain.drivers import DRIVERS
for driver in DRIVERS:
    build_interpreter(driver)
"""
#: More tests than this that fail without the fault too say that the tree is broken.
_UNSOUND = 5


@dataclass(frozen=True, kw_only=True)
class Checkout:
    """A worktree of the present commit with its Python, and the cache that the study's tests share."""

    folder: Path
    cache: Path
    python: str = sys.executable

    @property
    def environment(self) -> dict[str, str]:
        """The variables of tests: modules come from here, not from the tree whose Python runs."""
        paths = os.pathsep.join(str(self.folder / part) for part in ("compiler", "measuring"))
        flags = os.environ.get("CUTJOINT_FLAGS", "-O1")  # as tests have them
        return {**os.environ, "PYTHONPATH": paths, "CUTJOINT_CACHE": str(self.cache), "CUTJOINT_FLAGS": flags}

    def require_own_modules(self) -> None:
        """Raises RuntimeError: Python finds the modules of another tree here."""
        code = "import cutjoint, cutjoint_bench; print(cutjoint.__file__, cutjoint_bench.__file__, sep='\\n')"
        command = [self.python, "-c", code]
        found = subprocess.run(command, cwd=self.folder, env=self.environment, check=True, stdout=subprocess.PIPE, text=True).stdout
        if not all(Path(line).is_relative_to(self.folder) for line in found.splitlines()):
            raise RuntimeError(f"Python in {self.folder} finds {found.split()}")

    @contextmanager
    def planted(self, fault: Fault) -> Iterator[None]:
        """The fault in its file, which is as it was afterwards. Raises RuntimeError: its text does not stand there once."""
        file = self.folder / fault.file
        text = file.read_text(encoding="utf-8")
        if text.count(fault.old) != 1:
            raise RuntimeError(f"{fault.name}: its text stands {text.count(fault.old)} times in {fault.file}")
        _write_source(file, text.replace(fault.old, fault.new))
        try:
            yield
        finally:
            _write_source(file, text)

    def run_tests(self, tests: Sequence[str], selected: str, left: float, more: Sequence[str]) -> Outcome:
        """Run tests until their CPU time (s) is up. Raises RuntimeError: pytest does not know them."""
        words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", selected, *more, *tests]
        status, text, seconds, in_time = self._run(words, left)
        if status == 4:
            raise RuntimeError(f"{' '.join(words)}: {text[-2000:]}")
        seen = re.findall(r"^(?:FAILED|ERROR) (\S+?(?:\[.*?\])?)(?: - .*)?$", text, re.MULTILINE)
        return Outcome(list(dict.fromkeys(seen)), seconds, in_time)

    def build_drivers(self) -> float:
        """Build the drivers that interpret programs as the worktree has them; returns their CPU time (s)."""
        return self._run(["-c", _DRIVERS], float("inf"))[2]

    def _run(self, words: Sequence[str], left: float) -> tuple[int, str, float, bool]:
        """Status and output of Python, its CPU time (s) and whether it ended in time."""
        with (self.folder.parent / f"{self.folder.name}.log").open("w+b") as log:
            process = subprocess.Popen(
                [self.python, *words], cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                start_new_session=True,
            )  # fmt: skip
            seconds, in_time = _wait(process, left)
            log.seek(0)
            return process.returncode, log.read().decode("utf-8", "replace"), seconds, in_time


@dataclass(frozen=True)
class Outcome:
    """The tests that failed, their CPU time (s), and whether they came to their end."""

    seen: Sequence[str]
    seconds: float
    in_time: bool


def _wait(process: subprocess.Popen[bytes], left: float) -> tuple[float, bool]:
    """The CPU time (s) of a process and all that it started, and whether it ended before that was up; else it is killed."""
    begun, in_time, used = time.monotonic(), True, 0.0
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return usage.ru_utime + usage.ru_stime if in_time else used, in_time
        used = max(used, cpu_seconds(process.pid))
        if in_time and (used > left or time.monotonic() - begun > _STUCK):
            in_time = False
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        time.sleep(0.2)


def _write_source(file: Path, text: str) -> None:
    """A file whose bytecode is gone: Python tells sources apart by size and by seconds alone, and a fault often changes neither."""
    file.write_text(text, encoding="utf-8")
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
        compiled.unlink()


def cpu_seconds(root: int) -> float:
    """The CPU time (s) of a running process, its descendants, and those of them that have ended."""
    parents, ticks = dict[int, int](), dict[int, int]()
    for place in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = place.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            number = int(place.parent.name)
            parents[number], ticks[number] = int(fields[1]), sum(map(int, fields[11:15]))
    own, found = [root], 0
    for number in own:
        found += ticks.get(number, 0)
        own += [child for child, parent in parents.items() if parent == number]
    return found / os.sysconf("SC_CLK_TCK")


def examine(checkout: Checkout, fault: Fault, *, every: bool) -> dict[str, Any]:
    """Plant a fault and find the first test that sees it, or all; the CPU time is that of the tests with the fault."""
    seen, unsound, seconds, in_time, built = list[str](), list[str](), 0.0, True, 0.0
    stop = () if every else ("-x",)
    for selected in _PASSES:
        if selected == _PASSES[1] and (checkout.folder / "runtime").is_dir():
            built = checkout.build_drivers()
            with checkout.planted(fault):
                built += checkout.build_drivers()
        while in_time and len(unsound) <= _UNSOUND:
            with checkout.planted(fault):
                left_out = [word for test in (*seen, *unsound) for word in ("--deselect", test)]
                outcome = checkout.run_tests(fault.tests, selected, LIMIT - seconds, (*stop, *left_out))
            seconds, in_time = seconds + outcome.seconds, outcome.in_time
            wrong = _failing_anyway(checkout, outcome.seen, selected)
            unsound += wrong
            seen += [test for test in outcome.seen if test not in wrong]
            if every or seen or not wrong:
                break
        if seen and not every:
            break
    return {
        "fault": fault.name, "about": fault.about, "file": fault.file, "seen_by": seen, "cpu_seconds": round(seconds, 1),
        "drivers_seconds": round(built, 1), "in_time": in_time, **({"fail_without": unsound} if unsound else {}),
    }  # fmt: skip


def _failing_anyway(checkout: Checkout, tests: Sequence[str], selected: str) -> list[str]:
    """The tests that fail without a fault too."""
    whole = [test for test in tests if "::" in test or (checkout.folder / test).exists()]
    return list(checkout.run_tests(whole, selected, LIMIT, ()).seen) if whole else []


@contextmanager
def checkouts(number: int) -> Iterator[list[Checkout]]:
    """Worktrees of the present commit in a temporary folder, which are gone afterwards."""
    with TemporaryDirectory(prefix="planted-") as place:
        top = Path(place).resolve()
        folders = [top / f"tree{i}" for i in range(number)]
        made = [Checkout(folder=each, cache=top / "cache", python=str(each / ".venv" / "bin" / "python")) for each in folders]
        try:
            for one in made:
                _git("worktree", "add", "--quiet", "--detach", str(one.folder), "HEAD")
                _make_python(one.folder / ".venv")
                one.require_own_modules()
            yield made
        finally:
            for one in made:
                subprocess.run(["git", "-C", str(ROOT), "worktree", "remove", "--force", str(one.folder)], check=False)


def _make_python(place: Path) -> None:
    """A Python with the packages and programs of this one, and a copy of its drivers: tests may build or remove drivers there."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", "--symlinks", str(place)], check=True)
    own = Path(sysconfig.get_path("purelib", vars={"base": str(place)}))
    (own / "others.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n", encoding="utf-8")
    for program in (Path(sys.prefix) / "bin").iterdir():
        target = place / "bin" / program.name
        if program.is_file() and not target.exists():
            line = f"#!{sys.prefix}/".encode()
            content = program.read_bytes()
            target.write_bytes(content.replace(line, f"#!{place}/".encode(), 1) if content.startswith(line) else content)
            target.chmod(program.stat().st_mode)
    drivers = Path(sys.prefix) / "share" / "cutjoint"
    if drivers.is_dir():
        shutil.copytree(drivers, place / "share" / "cutjoint")


def _git(*words: str) -> str:
    return subprocess.run(["git", "-C", str(ROOT), *words], check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def table_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as text: a fault, what sees it, CPU seconds."""
    lines = [("fault", "seen by", "CPU s")]
    for row in rows:
        missed = "MISSED" if row["in_time"] else "MISSED in the time"
        first, *others = row["seen_by"] or [missed]
        lines += [(row["fault"], first, f"{row['cpu_seconds']:.1f}"), *(("", test, "") for test in others)]
    widths = [max(len(line[i]) for line in lines) for i in (0, 1)]
    return "".join(f"{a:{widths[0]}}  {b:{widths[1]}}  {c:>6}".rstrip() + "\n" for a, b, c in lines)


class Results:
    """The rows of faults, written after each; those of faults that ran before stay."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, Lock()
        file = folder / "planted.json"
        known = json.loads(file.read_text(encoding="utf-8"))["faults"] if file.is_file() else []
        self._rows: dict[str, dict[str, Any]] = {row["fault"]: row for row in known}
        self._of = f"{provenance()}, commit {_git('rev-parse', '--short', 'HEAD')}"

    @property
    def rows(self) -> list[dict[str, Any]]:
        """All rows in the order of the faults."""
        return [self._rows[fault.name] for fault in FAULTS if fault.name in self._rows]

    def add(self, row: dict[str, Any]) -> None:
        """Print a row, and write all."""
        with self._lock:
            self._rows[row["fault"]] = row
            print(table_of([row]).partition("\n")[2], end="", flush=True)
            write_whole(self._folder / "planted.json", json.dumps({"of": self._of, "faults": self.rows}, indent=1) + "\n")
            write_whole(self._folder / "planted.txt", f"{self._of}\n\n{table_of(self.rows)}")


def perform(faults: Sequence[Fault], results: Results, jobs: int, *, every: bool) -> None:
    """Examine faults, some side by side, each in a worktree that no other uses meanwhile."""
    with checkouts(min(jobs, len(faults))) as made:
        idle: SimpleQueue[Checkout] = SimpleQueue()
        for one in made:
            idle.put(one)

        def work(fault: Fault) -> None:
            checkout = idle.get()
            try:
                results.add(examine(checkout, fault, every=every))
            finally:
                idle.put(checkout)

        with ThreadPoolExecutor(len(made)) as pool:
            try:
                for done in [pool.submit(work, fault) for fault in faults]:
                    done.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def main() -> None:
    """Print and write the table; the exit status is 1 where a fault is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAMES", help="faults; --list prints them")
    parser.add_argument("--all", action="store_true", help="all faults")
    parser.add_argument("--every", action="store_true", help="find all tests that see a fault, not the first alone")
    parser.add_argument("--list", action="store_true", help="print the faults, and plant none")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="faults side by side")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "evidence" / "measured", metavar="FOLDER")
    asked = parser.parse_args()
    if unknown := {*asked.names} - {fault.name for fault in FAULTS}:
        parser.error(f"there is no fault {', '.join(sorted(unknown))}")
    chosen = [fault for fault in FAULTS if asked.all or fault.name in asked.names]
    if asked.list or not chosen:
        print("".join(f"{fault.name:20}{fault.about} ({fault.file})\n" for fault in chosen or FAULTS), end="")
        return
    results = Results(asked.out.resolve())
    perform(chosen, results, max(1, asked.jobs), every=asked.every)
    print(f"\n{table_of(results.rows)}", end="")
    missed = [row["fault"] for row in results.rows if not row["seen_by"]]
    if missed:
        print(f"\n{len(missed)} MISSED: {', '.join(missed)}")
    raise SystemExit(bool(missed))


if __name__ == "__main__":
    main()
