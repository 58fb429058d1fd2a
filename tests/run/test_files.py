"""Promises of docs/reference/files.md, a section for each line; `test_batch_files.py` has the batches."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from errno import ENOSPC
from functools import cache
from pathlib import Path
from textwrap import dedent
from typing import BinaryIO

import pytest
from click.testing import Result

from cutjoint.run import result_files
from cutjoint.run.outputs import OutputError, partial_of, reason_of, require_apart, units_of
from cutjoint.run.record import RunFile
from cutjoint.run.result_files import TableFile, write_files, write_whole
from cutjoint.run.results import read_table
from cutjoint.run.run_file import make_run_file
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, start
from cutjoint.topology.reading import read_model
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.run.program import PATIENCE, call, files, has_content, launch, run, small_disk, wait_for
from tests.runtime.test_last_row import DRIVEN

pytestmark = needs_cpp

#: An end before the model's law loses its value, and steps so short that the run takes minutes.
WHOLE, ENDLESS = ("--end", "0.3"), ("--end", "0.3", "--dt", "1e-9")

@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with a model whose run fails at 0.355 s."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "driven.yaml").write_text(DRIVEN, encoding="utf-8")
    return tmp_path


def simulate(*more: object) -> Result:
    return call("simulate", "driven.yaml", *more)


# The model and other inputs


OUTPUTS = (
    ("simulate", "--out"), ("simulate", "--out", "x.csv", "--steps"), ("explain", "--out"), ("modes", "--out"), ("realtime", "--out"),
)  # fmt: skip


@pytest.mark.parametrize("way", ["name", "link", "hard link", "roundabout"])
@pytest.mark.parametrize("command", OUTPUTS, ids=" ".join)
def test_no_output_is_the_model(command: tuple[str, ...], way: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")  # nothing can be compiled
    other = {"explain": "other", "modes": "other.json"}.get(command[0], "other.csv")
    name = {"name": "driven.yaml", "roundabout": "../" + folder.name + "/driven.yaml"}.get(way, other)
    if way == "link":
        os.symlink("driven.yaml", other)
    elif way == "hard link":
        os.link("driven.yaml", other)
    done = call(command[0], "driven.yaml", *command[1:], name)
    if "link" in way:
        assert (done.exit_code, done.output) == (1, f"{command[-1]} {name}: that is the model; write the results elsewhere\n")
    else:
        assert done.exit_code == 2
        assert "no such kind of file" in " ".join(done.output.split())
    assert (folder / "driven.yaml").read_text(encoding="utf-8") == DRIVEN


@pytest.mark.parametrize("name", ["run.units.json", "run.partial.csv", "run.partial.txt", "run.partial.units.json"])
def test_nothing_beside_an_output_is_the_model(name: str, folder: Path) -> None:
    (folder / "driven.yaml").rename(name)
    done = call("simulate", name, "--out", "run.csv")
    assert done.exit_code == 1
    assert done.output.startswith("--out run.csv: the ")
    assert f"would go to {folder.resolve() / name}, which is the model" in done.output
    assert (folder / name).read_text(encoding="utf-8") == DRIVEN


@pytest.mark.parametrize(("command", "other", "read"), [
    (("explain", "driven.yaml", "--out"), "other", "part.yaml"), (("simulate", "driven.yaml", "--out"), "other.csv", "part.yaml"),
    (("fit", "fit.yaml", "--out"), "other.json", "part.yaml"), (("fit", "fit.yaml", "--out"), "other.json", "measured.csv"),
    (("fit", "fit.yaml", "--design"), "other.csv", "measured.csv"),
    (("fit", "fit.yaml", "--model"), "other.yaml", "driven.yaml"), (("fit", "fit.yaml", "--model"), "other.yaml", "measured.csv"),
])  # fmt: skip
def test_no_output_is_a_file_that_an_input_names(
    command: tuple[str, ...], other: str, read: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A submodel's file, or the model or the data of a fit."""
    monkeypatch.setenv("PATH", "")  # nothing can be compiled
    Path("part.yaml").write_text("cutjoint: 1\nconnectors: []\nparameters: []\n", encoding="utf-8")
    Path("driven.yaml").write_text(DRIVEN + "submodels: {part: {include: part.yaml}}\n", encoding="utf-8")
    Path("measured.csv").write_text("t,output.position\n0.1,0\n0.2,0\n", encoding="utf-8")
    Path("fit.yaml").write_text(dedent("""
        cutjoint_fit: 1
        model: driven.yaml
        parameters: {load: {from: 0, to: 2}}
        experiments: {run: {data: measured.csv, from: 0, signals: {rail.position: {deviation: 1}}}}
    """), encoding="utf-8")  # fmt: skip
    os.link(read, other)
    before = Path(read).read_bytes()
    done = call(*command, other)
    words = f"{command[-1]} {other}: that is {read}, which the command reads; write the results elsewhere"
    assert (done.exit_code, " ".join(done.output.split())) == (1, words)
    assert Path(read).read_bytes() == before


def test_no_second_model_of_a_fit_is_a_model_that_it_reads(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fitted models of one study are numbered."""
    monkeypatch.setenv("PATH", "")  # nothing can be compiled
    Path("other-2.yaml").write_text(DRIVEN, encoding="utf-8")
    Path("measured.csv").write_text("t,output.position\n0.1,0\n0.2,0\n", encoding="utf-8")
    Path("fit.yaml").write_text(dedent("""
        cutjoint_fit: 1
        parameters: {block.mass: {}}
        experiments:
          one: {model: driven.yaml, data: measured.csv, signals: {block.y: {column: output.position}}}
          two: {model: other-2.yaml, data: measured.csv, signals: {block.y: {column: output.position}}}
    """), encoding="utf-8")  # fmt: skip
    done = call("fit", "fit.yaml", "--model", "other.yaml")
    words = "--model other-2.yaml: that is the model other-2.yaml; write the results elsewhere"
    assert (done.exit_code, " ".join(done.output.split())) == (1, words)


def test_no_output_is_the_table_of_a_batch(folder: Path) -> None:
    Path("cases.csv").write_text("load\n1\n", encoding="utf-8")
    os.symlink("cases.csv", "other.csv")
    for name in ("cases.csv", "other.csv"):
        done = call("batch", "driven.yaml", "cases.csv", "--out", name)
        assert (done.exit_code, done.output) == (1, f"--out {name}: that is the table of parameters; write the results elsewhere\n")


def test_no_picture_is_the_model(folder: Path) -> None:
    Path("plots").mkdir()
    os.symlink("../driven.yaml", "plots/position.png")
    done = simulate("--out", "run.csv", "--plots", "plots")
    assert done.exit_code == 1
    assert done.output == "--plots plots: the pictures would go to plots/position.png, which is the model; write the results elsewhere\n"


@pytest.mark.parametrize("command", [("compile",), ("export", "--to", "mujoco")], ids=lambda c: c[0])
def test_no_file_of_a_folder_is_the_model(command: tuple[str, ...], folder: Path) -> None:
    done = call(command[0], "driven.yaml", *command[1:], "--out", "made")
    assert done.exit_code == 0, done.output
    source = next(p for p in sorted(Path("made").iterdir()) if p.suffix == ".cpp")
    source.unlink()
    os.symlink("../driven.yaml", source)
    done = call(command[0], "driven.yaml", *command[1:], "--out", "made")
    assert (done.exit_code, done.output.strip()) == (1, f"--out made: file {source}: that is the model; write the results elsewhere")
    assert (folder / "driven.yaml").read_text(encoding="utf-8") == DRIVEN


def test_compiled_files_replace_earlier_ones_as_a_whole(folder: Path) -> None:
    assert call("compile", "driven.yaml", "--out", "made").exit_code == 0
    before = {path: path.read_bytes() for path in sorted(Path("made").iterdir())}
    for path in before:
        path.write_bytes(b"an earlier one")
        os.link(path, folder / path.name)
    assert call("compile", "driven.yaml", "--out", "made").exit_code == 0
    assert {path: path.read_bytes() for path in sorted(Path("made").iterdir())} == before
    assert all((folder / path.name).read_bytes() == b"an earlier one" for path in before)
    assert os.access(next(Path("made").glob("*_simulator")), os.X_OK)


# Two outputs


@pytest.mark.parametrize(
    ("out", "steps", "plots", "words"),
    [
        ("x.csv", "x.csv", None, "--steps x.csv: that is --out x.csv too"),
        ("x.csv", "./a/../x.csv", None, "--steps a/../x.csv: that is --out x.csv too"),
        ("x.csv", "x.partial.csv", None, "--steps x.partial.csv: the rows of an unfinished table of --out x.csv go there"),
        ("x.partial.csv", "x.csv", None, "--out x.partial.csv: the rows of an unfinished table of --steps x.csv go there"),
        ("x", "x.csv", None, "--steps x.csv: the units of --out x go there"),
        ("x", "x/y.csv", None, "--steps x/y.csv: one of this and --out x is a folder of the other"),
        ("x", None, "x", "--plots x: --out x is a file there"),
        ("x", None, "x/y", "--plots x/y: --out x is a file there"),
    ],
)
def test_no_two_outputs_are_one_file(out: str, steps: str | None, plots: str | None, words: str, folder: Path) -> None:
    (folder / "a").mkdir()
    more = [*(() if steps is None else ("--steps", steps)), *(() if plots is None else ("--plots", plots))]
    done = simulate("--out", out, *more)
    assert done.exit_code == 1
    assert done.output.startswith(words)
    assert done.output.count("\n") == 1
    assert files(folder) == ["a"]


def test_a_link_among_the_pictures_is_none_of_the_outputs(folder: Path) -> None:
    (folder / "x").mkdir()
    os.symlink("x/force.png", "run.csv")
    done = simulate("--out", "run.csv", "--plots", "x")
    assert (done.exit_code, done.output) == (
        1, "--plots x: --out run.csv lies among the pictures; write the two to different places\n"
    )  # fmt: skip


def test_links_are_one_file_too(folder: Path) -> None:
    Path("x.csv").write_text("", encoding="utf-8")
    os.link("x.csv", "hard.csv")
    os.symlink("not_there.csv", "one.csv")
    os.symlink("not_there.csv", "two.csv")
    for out, steps in (("x.csv", "hard.csv"), ("one.csv", "two.csv")):
        with pytest.raises(OutputError, match=rf"^--steps {steps}: that is --out {out} too; write the two to different files$"):
            require_apart({}, tables={"--out": Path(out), "--steps": Path(steps)})


def test_names_that_differ_have_units_of_their_own() -> None:
    beside = [of(Path(name)) for name in ("run.k1", "run.k2", "run.csv", "k1.csv") for of in (units_of, partial_of, reason_of)]
    assert len(set(beside)) == len(beside)
    assert units_of(Path("a/run.k1")) == Path("a/run.k1.units.json")


# Whole or not at all, and an earlier file survives


def test_a_run_that_fails_leaves_an_earlier_table_and_says_where_its_rows_are(folder: Path) -> None:
    assert simulate(*WHOLE, "--out", "run.csv", "--steps", "steps.csv").exit_code == 0
    assert files(folder) == ["run.csv", "run.error.json", "run.units.json", "steps.csv"]
    before = [(folder / name).read_bytes() for name in files(folder)]
    failed = simulate("--out", "run.csv", "--steps", "steps.csv")
    assert failed.exit_code == 1
    assert "the rows up to then are in run.partial.csv" in failed.output
    assert [(folder / name).read_bytes() for name in ("run.csv", "run.error.json", "run.units.json", "steps.csv")] == before
    t, _ = read_table(folder / "run.partial.csv")
    assert t == pytest.approx([0, 0.1, 0.2, 0.3, 0.35])
    assert read_table(folder / "steps.partial.csv")[0].size == 35
    for reason in ("run.partial.txt", "steps.partial.txt"):
        assert (folder / reason).read_text(encoding="utf-8").startswith("the law of 'end' (driven.yaml:13) has no finite value")
    assert (folder / "run.partial.units.json").read_bytes() == (folder / "run.units.json").read_bytes()
    assert simulate(*WHOLE, "--out", "run.csv", "--steps", "steps.csv").exit_code == 0
    assert files(folder) == ["run.csv", "run.error.json", "run.units.json", "steps.csv"]  # nothing stale


@cache
def any_run_file() -> RunFile:
    model = read_model(MODELS / "press.yaml")
    return make_run_file(model, model.scenes["turn"], {}, task="simulate")


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], SimulatorRun]:
    """A run whose simulator is a program in Python."""

    def write(text: str) -> SimulatorRun:
        path = tmp_path / "simulator"
        head = "import json, os, sys, time\nrun = json.load(open(sys.argv[1]))\nout = os.fdopen(run['out']['descriptor'], 'w')\n"
        head += "rows = os.fdopen(run['out_rows']['descriptor'], 'wb')\n"
        path.write_text(f"#!{sys.executable}\n{head}{dedent(text)}", encoding="utf-8")
        path.chmod(0o755)
        return SimulatorRun(simulator=path, run_file=any_run_file(), description=None, units={"a.x": "m"})

    return write


def test_a_damaged_simulator_leaves_an_earlier_table(script: Callable[[str], SimulatorRun], folder: Path) -> None:
    Path("keep.csv").write_text("t,a.x\n0,1\n", encoding="utf-8")
    ready = script("")
    for content in (b"", b"#!/bin/sh\nexit 3\n", b"#!/bin/sh\nkill -9 $$\n"):
        ready.simulator.write_bytes(content)
        with pytest.raises(SimulatorError):
            start(ready, out=Path("keep.csv"))
        assert Path("keep.csv").read_text(encoding="utf-8") == "t,a.x\n0,1\n"
        assert [name for name in files(folder) if name != "simulator"] == ["keep.csv"]


def test_a_table_that_is_cut_in_a_number_is_never_whole(script: Callable[[str], SimulatorRun], folder: Path) -> None:
    ready = script("""
        out.write("t,a.x\\n0,1\\n1,-1.1925\\n2,-1.1")
        out.close()
        rows.write(bytes(16 * 3 + 12))
        rows.close()
        print(json.dumps({"status": "done", "rows": 4}))
    """)
    with pytest.raises(OutputError, match="4 rows were written and 3 are there") as error:
        start(ready, out=Path("run.csv"))
    assert error.value.__notes__ == ["the rows up to then are in run.partial.csv"]
    assert Path("run.partial.csv").read_text(encoding="utf-8") == "t,a.x\n0,1\n1,-1.1925\n"
    assert not Path("run.csv").exists()


def test_a_document_is_whole_or_as_it_was(folder: Path) -> None:
    Path("s.json").write_text("before", encoding="utf-8")
    status, messages = run("schema", "--out", "s.json", limit=1000)
    assert (status, messages) == (1, "cannot write s.json: File too large\n")
    assert (files(folder), Path("s.json").read_text(encoding="utf-8")) == (["s.json"], "before")
    assert call("schema", "--out", "not/there/s.json").exit_code == 0
    assert Path("not/there/s.json").read_text(encoding="utf-8") == call("schema").output


def test_permissions_stay(folder: Path) -> None:
    Path("s.json").write_text("before", encoding="utf-8")
    Path("s.json").chmod(0o640)
    write_whole(Path("s.json"), "after")
    assert Path("s.json").stat().st_mode & 0o777 == 0o640
    table = TableFile(Path("s.json"))
    table.file.write(b"t\n")
    table.finish()
    assert (Path("s.json").stat().st_mode & 0o777, Path("s.json").read_text(encoding="utf-8")) == (0o640, "t\n")


# Errors of writing


def test_a_full_disk_is_noticed_wherever_it_is_full(folder: Path) -> None:
    """A limit on the size of files, at many places of the table, its last bytes among them, and of the table of steps."""
    (folder / "driven.yaml").write_text(DRIVEN.replace("output_step: 0.1", "output_step: 0.001"), encoding="utf-8")
    arguments = ("simulate", "driven.yaml", *WHOLE, "--dt", "1e-3", "--out", "run.csv", "--steps", "steps.csv")
    assert call(*arguments).exit_code == 0
    table, steps = (Path(name).read_bytes() for name in ("run.csv", "steps.csv"))
    for limit in (100, len(steps) // 2, len(steps) - 1, len(table) // 2, len(table) - 3, len(table) - 1):
        status, messages = run(*arguments, limit=limit)
        assert (status, messages.count(": File too large")) == (1, 1)
        assert any(f"cannot write {what}" in messages for what in (("the run file in",) if limit == 100 else ("run.csv", "steps.csv")))
        for path, content in {Path("run.csv"): table, Path("steps.csv"): steps}.items():
            assert path.read_bytes() == content
            left = partial_of(path)
            assert not left.exists() or (content.startswith(left.read_bytes()) and left.read_bytes().endswith(b"\n"))


def test_a_file_system_that_is_full(folder: Path) -> None:
    with small_disk(folder / "disk") as disk:
        places = ("--out", disk / "run.csv", "--steps", disk / "s.csv")
        status, messages = run("simulate", "driven.yaml", "--end", "0.3", "--dt", "1e-5", *places)
        assert status == 1
        assert f"cannot write {disk / 's.csv'}: No space left on device" in messages
        content = (disk / "s.partial.csv").read_text(encoding="utf-8")
        assert content.endswith("\n")
        assert {line.count(",") for line in content.splitlines()} == {3}


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "driven.yaml", *WHOLE, "--out", "/dev/full"),
        ("simulate", "driven.yaml", *WHOLE, "--out", "x", "--steps", "/dev/full"),
        ("realtime", "driven.yaml", "--end", "0.1", "--out", "/dev/full"), ("explain", "driven.yaml", "--out", "/dev/full"),
        ("schema", "--out", "/dev/full"),
    ],
    ids=lambda a: a[0],
)  # fmt: skip
def test_a_full_device_is_noticed(arguments: tuple[str, ...], folder: Path) -> None:
    done = call(*arguments)
    assert done.exit_code == 1
    assert "cannot write /dev/full: No space left on device\n" in done.output
    assert not Path("x").exists()


# Links


def test_a_link_stays_and_its_file_is_replaced(folder: Path) -> None:
    (folder / "data").mkdir()
    os.symlink("data/run.csv", "latest.csv")
    for _ in range(2):
        assert simulate(*WHOLE, "--out", "latest.csv").exit_code == 0
        assert os.readlink("latest.csv") == "data/run.csv"
        assert files(folder / "data") == ["run.csv", "run.error.json", "run.units.json"]
    assert "data/run.partial.csv" in simulate("--out", "latest.csv").output
    os.symlink("data/schema.json", "latest.json")
    assert call("schema", "--out", "latest.json").exit_code == 0
    assert os.readlink("latest.json") == "data/schema.json"
    assert json.loads(Path("data/schema.json").read_text(encoding="utf-8"))


def test_a_link_in_place_of_a_partial_table_is_not_followed(folder: Path) -> None:
    Path("other.txt").write_text("mine", encoding="utf-8")
    os.symlink("other.txt", "run.partial.csv")
    done = simulate(*WHOLE, "--out", "run.csv")
    assert (done.exit_code, Path("other.txt").read_text(encoding="utf-8")) == (1, "mine")
    assert "cannot write run.csv: " in done.output


# Devices and pipes


def test_a_device_takes_a_table_and_stays(folder: Path) -> None:
    before = os.listdir("/dev")
    done = simulate(*WHOLE, "--out", "/dev/null", "--steps", "/dev/null")
    assert done.exit_code == 0, done.output
    assert os.listdir("/dev") == before
    assert "results: /dev/null, 4 outputs, 4 rows" in done.output
    assert Path("/dev/null").is_char_device()
    assert files(folder) == []


@pytest.mark.parametrize("place", ["/dev/stdout", "link"])
def test_standard_output_takes_the_table_alone(place: str, folder: Path) -> None:
    os.symlink("/dev/stdout", "link")
    assert simulate(*WHOLE, "--out", "run.csv").exit_code == 0
    with Path("redirected.csv").open("w+", encoding="utf-8") as redirected:
        for target in (subprocess.PIPE, redirected):
            with launch("simulate", "driven.yaml", *WHOLE, "--out", place, stdout=target) as process:
                output, messages = process.communicate(timeout=PATIENCE)
            assert process.returncode == 0
            assert (output or Path("redirected.csv").read_text(encoding="utf-8")) == Path("run.csv").read_text(encoding="utf-8")
            assert "4 outputs, 4 rows" in messages


def test_a_pipe_waits_for_its_reader_and_says_so(folder: Path) -> None:
    os.mkfifo("pipe")
    with launch("simulate", "driven.yaml", *WHOLE, "--out", "pipe") as process:
        assert process.stderr is not None
        assert "pipe: waiting for a reader of this pipe\n" in iter(process.stderr.readline, "")
        rows = Path("pipe").read_text(encoding="utf-8").splitlines()
        output, _ = process.communicate(timeout=PATIENCE)
    assert (process.returncode, len(rows)) == (0, 5)
    assert "4 outputs, 4 rows" in output  # read from a copy
    assert Path("pipe").is_fifo()


def test_a_reader_that_goes_away_ends_the_run(folder: Path) -> None:
    os.mkfifo("pipe")

    def read_a_little() -> None:
        with Path("pipe").open("rb") as pipe:
            pipe.read(1)

    reader = threading.Thread(target=read_a_little)
    reader.start()
    status, messages = run("simulate", "driven.yaml", *ENDLESS, "--out", "run.csv", "--steps", "pipe")
    reader.join()
    assert status == 1
    assert "cannot write pipe: Broken pipe\n" in messages


# Signals


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_says_when_it_came_and_where_the_rows_are(number: int, status: int, folder: Path) -> None:
    Path("run.csv").write_text("before", encoding="utf-8")
    with launch("simulate", "driven.yaml", *ENDLESS, "--out", "run.csv", "--steps", "steps.csv") as process:
        wait_for(lambda: has_content(Path("steps.partial.csv")))
        process.send_signal(number)
        _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == status
    reported, where = messages.splitlines()[-2:]
    assert reported.startswith("interrupted at t = ")
    assert where == "the rows up to then are in run.partial.csv"
    assert Path("run.partial.txt").read_text(encoding="utf-8") == f"{reported}\n"
    t, steps = read_table(Path("run.partial.csv"))[0], read_table(Path("steps.partial.csv"))[0]
    assert t[0] == 0
    assert t[-1] == steps[-1] == pytest.approx(steps.size * 1e-9)
    assert f"{t[-1]:.6g}" in reported
    assert Path("run.partial.units.json").exists()
    assert Path("run.csv").read_text(encoding="utf-8") == "before"


def runs_simulator(process: subprocess.Popen[str]) -> bool:
    """Return whether a command, each of its threads, has a simulator that has started its steps, which take time of a processor."""
    for children in Path(f"/proc/{process.pid}/task").glob("*/children"):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
            for number in children.read_text(encoding="utf-8").split():
                ticks = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[11]
                if "/dev/fd/" in Path(f"/proc/{number}/cmdline").read_text(encoding="utf-8") and int(ticks) > 50:
                    return True
    return False


@pytest.mark.parametrize("batch", [False, True])
def test_a_row_of_many_steps_ends_by_a_signal(batch: bool, folder: Path) -> None:
    """The runs of a batch, each of which has a simulator, too."""
    text = (ROOT / "models" / "press.yaml").read_text(encoding="utf-8")
    text = text.replace("end: 2, output_step: 10 ms", "end: 1e6, output_step: 1e6 s")
    Path("press.yaml").write_text(text, encoding="utf-8")
    Path("cases.csv").write_text("stiffness\n1000\n2000\n", encoding="utf-8")
    many = ("--batch", "cases.csv") if batch else ()
    with launch("simulate", "press.yaml", "--out", "run.csv", *many) as process:
        wait_for(lambda: runs_simulator(process))
        process.send_signal(signal.SIGTERM)
        _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    assert ("interrupted\n" if batch else "interrupted at t = 0 s") in messages
    assert not Path("run.csv").exists()


def test_a_simulator_does_not_outlive_a_killed_parent(folder: Path) -> None:
    """It holds the lock of its table; what it has written is whole, and nothing of it stays in the folder of temporary files."""
    temporary = folder / "temporary"
    temporary.mkdir()
    places, env = ("--out", "run.csv", "--steps", "steps.csv"), {**os.environ, "TMPDIR": str(temporary)}
    with launch("simulate", "driven.yaml", *ENDLESS, *places, env=env) as process:
        wait_for(lambda: has_content(Path("steps.partial.csv")))
        process.kill()
    with Path("run.partial.csv").open("rb") as table:
        wait_for(lambda: can_lock(table.fileno()))
    t, steps = read_table(Path("run.partial.csv"))[0], read_table(Path("steps.partial.csv"))[0]
    assert t[-1] == steps[-1]
    assert list(temporary.iterdir()) == []


def can_lock(number: int) -> bool:
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def test_one_run_at_a_time_writes_a_table(folder: Path) -> None:
    table = TableFile(Path("run.csv"))
    done = simulate(*WHOLE, "--out", "run.csv")
    assert done.exit_code == 1
    assert done.output.endswith("run.partial.csv: another run writes this file; wait for it, or write elsewhere\n")
    table.leave("")
    assert simulate(*WHOLE, "--out", "run.csv").exit_code == 0


@pytest.mark.parametrize("failing", range(3))
def test_files_of_a_folder_are_written_all_or_none(failing: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full at any of them leaves an earlier folder as it was."""
    names = ("a.h", "a.cpp", "a_simulator")
    write_files(tmp_path, dict.fromkeys(names, "earlier"))
    calls: list[int] = []

    def write(file: BinaryIO, data: bytes) -> None:
        calls.append(file.write(data[:3]))
        if len(calls) > failing:
            raise OSError(ENOSPC, "No space left on device")
        file.write(data[3:])

    monkeypatch.setattr(result_files, "write_all", write)
    with pytest.raises(OutputError, match="No space left on device"):
        write_files(tmp_path, dict.fromkeys(names, "new"))
    assert {p.name: p.read_text(encoding="utf-8") for p in tmp_path.iterdir()} == dict.fromkeys(names, "earlier")


def test_permissions_of_files_of_a_folder(tmp_path: Path) -> None:
    write_files(tmp_path, {"a.h": "1", "program": b"2"}, {"program": 0o750})
    (tmp_path / "a.h").chmod(0o640)
    write_files(tmp_path, {"a.h": "3", "program": b"4"}, {"program": 0o750})
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("a.h", "program")] == [0o640, 0o750]
