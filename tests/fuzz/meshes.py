"""Damaged meshes and pages: a command refuses what it cannot show, at its line, and a page says so; no script fails, runs or fetches."""

from __future__ import annotations

import base64
import json
import random
import re
from contextlib import ExitStack
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.view.ghost import GhostRun, read_page
from cutjoint.view.gltf import write_gltf
from cutjoint.view.meshes import box
from cutjoint.view.page import PlotColumn, make_page
from cutjoint.view.records import Drawing, Node, Part
from tests.edges.calling import call
from tests.view.browser import Page, opened
from tests.view.lever import MODEL, glb, obj, stl
from tests.view.pages import part_of, with_part

from .mesh_damage import HOSTILE, damaged_bytes, damaged_glb, damaged_lines


def make(rng: random.Random) -> str:
    """A file's name and content, or the changes of a page, as JSON."""
    what = rng.choice(("glb", "glb", "glb", "stl", "obj", "part", "part", "part", "text"))
    if what == "part":
        return json.dumps({"parts": dict([_damaged_part(rng)]), "sealed": rng.random() < 0.7})
    if what == "text":
        return json.dumps({"edits": [_edit(rng) for _ in range(rng.choice((1, 1, 2, 5)))]})
    content = damaged_glb(rng, glb(), grows=True) if what == "glb" else damaged_lines(rng, {"stl": stl, "obj": obj}[what]())
    return json.dumps({"name": f"part.{what}", "content": _encoded(content)})


def _damaged_part(rng: random.Random) -> tuple[str, str]:
    """One of the parts of a page: its name, and its text with damage."""
    name = rng.choice(("glb", "glb", "glb", "over-glb", "about", "table"))
    text = part_of(_page(), name)
    if name == "about":
        return name, damaged_bytes(rng, text.encode()).decode("utf-8", "replace")
    content = base64.b64decode(text)
    whole = _encoded(damaged_glb(rng, content, grows=False) if name.endswith("glb") else damaged_bytes(rng, content))
    return name, damaged_bytes(rng, whole.encode()).decode("utf-8", "replace") if rng.random() < 0.1 else whole


def _edit(rng: random.Random) -> tuple[float, int, str]:
    """Place in a page, as a share of it, number of characters that go, and the text that stands there instead."""
    put = rng.choice(("", "x", "<", '"', "\0", "\ufffd", "-->", "<!--", "<script>", "<style>", *HOSTILE))
    return rng.random(), rng.choice((0, 1, 20, 1000, 10**9)), put


def check(text: str) -> tuple[str, ...]:
    """The reason why a file was refused, or a page's own message; fails where a script did, or the command without a message."""
    case = json.loads(text)
    with TemporaryDirectory() as folder:
        return _check_mesh(Path(folder), case) if "name" in case else _check_page(Path(folder) / "earlier.html", case)


def _check_mesh(folder: Path, case: dict[str, str]) -> tuple[str, ...]:
    """A mesh is drawn, or refused at the line of the model file that names it."""
    model, page = folder / "lever.yaml", folder / "pose.html"
    model.write_text(MODEL.replace("MESH", case["name"]), encoding="utf-8")
    (folder / case["name"]).write_bytes(base64.b64decode(case["content"]))
    ended = call(["view", str(model), "--out", str(page)])
    assert not ended.error, ended.error
    assert "Warning" not in ended.said, ended.said
    assert "root:" not in ended.said, "it has read another file"
    if ended.status:
        assert re.search(r"lever\.yaml:9:\d+: body 'left\.arm': mesh 'part\.\w+' ", ended.said), ended.said
        assert not page.exists(), "refused, and a page is there"
        return (ended.said.strip().splitlines()[0],)
    said = _open(page)
    assert not said, said
    return ()


def _check_page(file: Path, case: dict[str, object]) -> tuple[str, ...]:
    """A damaged page shows what it has or says that it cannot; as an earlier page it is refused, or lies under another one."""
    page = _changed(case)
    file.write_bytes(page.encode("utf-8", "surrogateescape"))
    said = _open(file, blank=not page.startswith(_page()[: _page().index("</style>") + len("</style>")]))
    try:
        earlier = read_page(file, "--ghost")
    except RunError as error:
        return (*said, str(error).rpartition(": ")[2])
    file.with_name("both.html").write_text(_make(earlier), encoding="utf-8")
    assert not (more := _open(file.with_name("both.html"))), more
    return said


def _changed(case: dict[str, object]) -> str:
    """A page with some parts of its own and new check sums, or with edits."""
    page, parts, edits = _page(), case.get("parts", {}), case.get("edits", [])
    assert isinstance(parts, dict)
    assert isinstance(edits, list)
    for name, text in parts.items():
        page = with_part(page, name, text, is_sealed=bool(case["sealed"]))
    for at, count, put in edits:
        i = int(at * len(page))
        page = page[:i] + put + page[i + count :]
    return page


@cache
def _page() -> str:
    """A page of a run over another one."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "earlier.html"
        file.write_text(_make(None), encoding="utf-8")
        return _make(read_page(file, "--ghost"))


def _make(ghost: GhostRun | None) -> str:
    """The page of a box that turns and moves beside another, with an output of its own."""
    t = np.linspace(0.0, 1.0, 3)
    turn = np.stack([np.sin(t / 2), 0 * t, 0 * t, np.cos(t / 2)], axis=1)
    nodes = [
        Node(
            name=name, parts=(Part(mesh=box(1, 0.5, 0.5), colour=(0.8, 0.2, 0.2)),), translation=t[:, np.newaxis] * [i, 1.0, 0.0],
            rotation=turn, about={"body": name},
        )
        for i, name in enumerate(("one", "other"))
    ]  # fmt: skip
    return make_page(
        title="boxes", scene="turn", note="", bodies=["one", "other"], t=t, ghost=ghost,
        glb=write_gltf(Drawing(name="boxes", t=t, nodes=tuple(nodes), up=np.array([0.0, 0.0, 1.0]))),
        columns=[PlotColumn(name="one.x", unit="m", bodies=["one"], values=t)],
        camera={"direction": [1, 1, 1], "extent": 2.0, "floor": -1.0, "road": False, "follow": ""},
    )  # fmt: skip


def _encoded(content: bytes) -> str:
    return base64.b64encode(content).decode()


@cache
def _browser() -> Page:
    """One browser for all inputs of a process."""
    stack = ExitStack()
    Finalize(None, stack.close, exitpriority=10)
    return stack.enter_context(opened())


def _open(file: Path, *, blank: bool = False) -> tuple[str, ...]:
    """Message of a page that cannot be shown, nothing where it is shown; one that is ``blank`` may say nothing."""
    browser = _browser()
    ready = browser.try_to_open(file)
    assert not browser.errors, browser.errors[0]
    assert browser.run("window.owned ?? 'nobody'") == "nobody", "a name ran"
    asked = [r for r in browser.requests if not r.startswith((file.as_uri(), "data:", "blob:"))]
    assert not asked, asked
    if ready:
        return ()
    said = browser.run("document.getElementById('notice')?.innerText ?? ''")
    assert said or blank, "nothing is shown, and nothing is said"
    return (said,)
