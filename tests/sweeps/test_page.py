"""The page of a sweep: what it shows, filters and chooses, in a browser without a window."""

from __future__ import annotations

import csv
from itertools import pairwise, product
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.sweeps.page import choose_runs, make_page, pareto_front
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.records import Objective
from cutjoint.sweeps.run import Sweep, sweep
from tests.conftest import needs_cpp
from tests.view.browser import Page
from tests.view.pages import PICTURES, require_silence

from .studies import study

pytestmark = needs_cpp

_OBJECTIVES = {
    "top": {"maximum": "slider.x", "goal": "larger"}, "speed": {"rms": "slider.vx"}, "load": {"percentile": "abs(spring.force)", "at": 95},
}  # fmt: skip


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Sweep]:
    """A study of 256 runs, and its table."""
    folder = tmp_path_factory.mktemp("page")
    path = study(folder, objectives=_OBJECTIVES, design={"sobol": 256}, trajectories=None)
    return path, sweep(path, folder / "out.parquet")


@pytest.fixture
def page(done: tuple[Path, Sweep], browser: Page, tmp_path: Path) -> Page:
    file = tmp_path / "page.html"
    file.write_text(make_page(read_study(done[0]), done[1], "cutjoint sweep study.yaml"), encoding="utf-8")
    browser.open(file, size=(1400, 980))
    return browser


def _dominated(one: int, runs: range, x: np.ndarray, y: np.ndarray) -> bool:
    """True if some run is better in one of x (larger) and y (smaller), and not worse in the other."""
    return any(x[r] >= x[one] and y[r] <= y[one] and (x[r] > x[one] or y[r] < y[one]) for r in runs)


def _listed(page: Page, id: str) -> list[int]:
    """The runs of a list."""
    found: list[int] = page.run(f"[...document.querySelectorAll('#{id} tbody tr')].map((r) => +r.firstChild.textContent)")
    return found


def test_the_page_shows_the_table(page: Page, done: tuple[Path, Sweep]) -> None:
    table = done[1]
    assert page.run("sweep.kept().length") == 256
    runs = range(256)
    expected = [r for r in runs if not _dominated(r, runs, table["top"], table["speed"])]
    assert sorted(page.run("sweep.front()")) == expected
    order = list(map(int, np.argsort(table["top"])))
    assert _listed(page, "worst") == order[:6]
    assert _listed(page, "best") == order[:-7:-1]
    assert page.run("sweep.marked()") == [order[-1], order[0]]
    assert page.run("document.getElementById('over-time').hidden")
    assert "256 runs" in page.run("document.getElementById('subtitle').textContent")
    page.picture(PICTURES / "sweep.png")
    require_silence(page)


def test_names_of_axes_stand_side_by_side_where_there_are_many(page: Page) -> None:
    """As close as 16 columns at 1280 pixels."""
    page.run("(() => { const wide = document.getElementById('wide'), n = document.querySelectorAll('.axis').length;"
             " wide.style.minWidth = '0'; wide.style.width = `${110 * (n - 1) + 140}px`; })()")  # fmt: skip
    name = "'front_left_spring_stiffness_objective_number'.replaceAll('_', '_\\u200b')"
    page.run("dispatchEvent(new Event('resize'))")
    page.run(f"document.querySelectorAll('.axis b').forEach((b) => b.textContent = {name})")
    ends = page.run("[...document.querySelectorAll('.axis b')].map((b) => { const r = document.createRange(); r.selectNodeContents(b);"
                    " const { left, right } = r.getBoundingClientRect(); return [left, right]; })")  # fmt: skip
    assert len(ends) > 3
    assert all(one[1] < other[0] for one, other in pairwise(ends)), ends


def test_an_axis_filters(page: Page, done: tuple[Path, Sweep]) -> None:
    """A drag over the upper half of the first axis."""
    found = "(() => { const b = document.querySelector('.axis').getBoundingClientRect(); return [b.x + b.width / 2, b.y, b.height]; })()"
    x, top, height = page.run(found)
    low, high = top + 66 + (height - 92) / 2, top + 60
    for kind, y in (("mousePressed", low), ("mouseMoved", (low + high) / 2), ("mouseMoved", high), ("mouseReleased", high)):
        page._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
    page.settle()
    stiffness = done[1]["stiffness"]
    low_end, pixel = (stiffness.min() + stiffness.max()) / 2, (stiffness.max() - stiffness.min()) / (height - 92)
    kept = page.run("sweep.kept()")
    assert set(np.flatnonzero(stiffness >= low_end + pixel)) <= set(kept) <= set(np.flatnonzero(stiffness >= low_end - pixel))
    assert page.run("document.getElementById('left').textContent") == f"{len(kept)} of 256 pass the filters"
    page.picture(PICTURES / "sweep-filtered.png")
    saved = page.run(
        "(() => { const make = URL.createObjectURL; let saved; URL.createObjectURL = (blob) => { saved = blob; return make(blob); };"
        " document.getElementById('save').click(); URL.createObjectURL = make; return saved.text(); })()"
    )
    head, *lines = csv.reader(saved.splitlines())
    assert [int(line[0]) for line in lines] == kept
    for name in ("stiffness", "top", "speed", "load"):
        column = next(i for i, words in enumerate(head) if words.split(" [")[0] == name)
        assert [float(line[column]) for line in lines] == pytest.approx(done[1][name][kept], rel=6e-7)  # seven digits
    page.run("document.getElementById('reset').click()")
    assert page.run("sweep.kept().length") == 256


def test_marked_runs_stand_beside_one_another(page: Page, done: tuple[Path, Sweep]) -> None:
    page.click(*page.run("sweep.point(17)"))
    assert page.run("document.getElementById('number').textContent") == "Run 17"
    assert page.run("document.getElementById('command').textContent") == "cutjoint sweep study.yaml --replay 17"
    for place in (0, 1):
        page.run(f"document.querySelectorAll('#worst input')[{place}].click()")
    worst = _listed(page, "worst")[:2]
    assert page.run("sweep.marked()") == [17, *worst]
    head, *lines = page.run("[...document.querySelectorAll('#comparison tr')].map((r) => [...r.cells].map((c) => c.textContent))")
    assert head[1:] == list(map(str, [17, *worst]))
    top = next(line for line in lines if line[0].startswith("top"))
    assert [float(word) for word in top[1:]] == pytest.approx(done[1]["top"][[17, *worst]], rel=1e-3)  # four digits
    assert page.run("document.getElementById('command').textContent").splitlines()[2] == (
        f"cutjoint sweep study.yaml --replay {worst[1]} --ghost study-run-17.html"
    )
    page.run("document.querySelector('#worst input').click()")
    assert page.run("sweep.marked()") == [17, worst[1]]
    require_silence(page)


def test_the_command_writes_pages(done: tuple[Path, Sweep], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["sweep", str(done[0]), "--out", str(done[1].path), "--view", "page.html", "--replays", "0"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == make_page(read_study(done[0]), done[1], f"cutjoint sweep {done[0]}")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    replayed = CliRunner().invoke(main, ["sweep", str(done[0]), "--replay", "17"])
    assert replayed.exit_code == 0, replayed.output
    assert (tmp_path / "study-run-17.html").stat().st_size > 100_000
    beside = CliRunner().invoke(main, ["sweep", str(done[0]), "--replay", "18", "--ghost", "study-run-17.html"])
    assert beside.exit_code == 0, beside.output
    assert "study-run-17.html: press, turn, recursive, run 17 of a sweep" in (tmp_path / "study-run-18.html").read_text(encoding="utf-8")
    alone = CliRunner().invoke(main, ["sweep", str(done[0]), "--ghost", "study-run-17.html"])
    assert "--ghost study-run-17.html: it needs --replay, whose page shows it" in alone.output
    refused = CliRunner().invoke(main, ["sweep", str(done[0]), "--replay", "256"])
    assert "--replay 256: the study has no such run; its runs are 0 to 255" in refused.output


def test_the_ends_are_one_click_from_their_replays(done: tuple[Path, Sweep], browser: Page, tmp_path: Path) -> None:
    """The page of a worst run has the best one as a ghost; curves have the extremes that the table has."""
    table, folder = done[1], tmp_path / "a page"
    folder.mkdir()
    words = ["sweep", str(done[0]), "--out", str(table.path), "--view", str(folder / "50 % #1.html"), "--replays", "2"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    orders = [np.argsort(sign * table[name]) for name, sign in (("top", -1), ("speed", 1), ("load", 1))]
    ends = {int(run) for order in orders for run in (*order[:2], *order[-2:])}
    pages = {path.name for path in (folder / "50 % #1-runs").iterdir()}
    assert pages == {f"run-{run}.html" for run in ends}
    browser.open(folder / "50 % #1.html", size=(1400, 980))
    best, worst = int(orders[0][0]), int(orders[0][-1])
    hidden = "[...document.querySelectorAll('#worst tbody tr')].map((line) => line.querySelector('a').hidden)"
    assert browser.run(hidden) == [run not in ends for run in _listed(browser, "worst")]
    assert browser.run("document.getElementById('by-command').hidden")
    browser.picture(PICTURES / "sweep-replays.png")
    for run in (best, worst):
        assert max(browser.run(f"sweep.curve({run}, 'slider.x')")) == pytest.approx(table["top"][run], rel=1e-6)
    browser.run("document.querySelectorAll('#worst input')[5].click()")
    assert browser.run("document.getElementById('without').textContent") == f"without a curve: {_listed(browser, 'worst')[5]}"
    require_silence(browser)
    address = browser.run("document.querySelector('#worst a').href")
    browser.open(Path(unquote(urlsplit(address).path)), size=(1400, 980))
    of_worst, of_best = (f"turn, recursive, run {run} of a sweep" for run in (worst, best))
    assert browser.run("document.getElementById('subtitle').textContent") == of_worst
    assert browser.run("document.getElementById('over').textContent") == f"over run-{best}.html: press, {of_best}"
    browser.picture(PICTURES / "sweep-ends.png")
    require_silence(browser)


def test_runs_that_began_and_failed_have_replays(browser: Page, tmp_path: Path) -> None:
    """Runs with masses that no body has cannot begin."""
    rows = [{"slider.mass": mass, "pin.angle_rate": rate} for mass, rate in ((2, 5), (-1, 5), (2, 1e9), (-3, 5), (2, 2e9), (2, 3e9))]
    path = study(tmp_path, open=["slider.mass"], parameters=None, rates=None, design={"list": rows}, output_step=0.01, dt=0.01)
    words = ["sweep", str(path), "--out", str(tmp_path / "out.parquet"), "--view", str(tmp_path / "page.html"), "--replays", "2"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert {page.name for page in (tmp_path / "page-runs").iterdir()} == {"run-0.html", "run-2.html", "run-4.html"}
    browser.open(tmp_path / "page.html")
    links = browser.run("[...document.querySelectorAll('#failures a')].map((link) => link.hidden)")
    assert links == [True, False, True, False, True]
    require_silence(browser)


@pytest.mark.parametrize("goals", list(product(("smaller", "larger"), repeat=2)))
def test_fronts_beside_all_pairs(goals: tuple[str, str]) -> None:
    random = np.random.default_rng(7)
    values = [random.integers(0, 30, 200).astype(float) for _ in goals]
    values[0][5] = np.nan
    objectives = [Objective(name=str(i), reduction="end", series=0, goal=goal) for i, goal in enumerate(goals)]
    signed = [v if goal == "smaller" else -v for v, goal in zip(values, goals, strict=True)]
    runs = [r for r in range(200) if r != 5]
    points = {(signed[0][r], signed[1][r]) for r in runs}
    best = {p for p in points if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)}
    found = pareto_front(objectives, values)
    assert {(signed[0][r], signed[1][r]) for r in found} == best
    assert len(found) == len(best)


def test_a_page_of_many_runs_keeps_the_extremes(done: tuple[Path, Sweep]) -> None:
    read, table = read_study(done[0]), done[1]
    shown = choose_runs(read, table, 200)
    assert len(shown) == 200
    assert (np.diff(shown) > 0).all()
    for name in _OBJECTIVES:
        order = np.argsort(table[name])
        assert set(order[:20]) | set(order[-20:]) <= set(shown)
    assert set(pareto_front(read.objectives[:2], [table["top"], table["speed"]])) <= set(shown)
