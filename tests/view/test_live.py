"""Pages that follow a running host: its poses are seen, other datagrams are reported, and nobody else may ask."""

from __future__ import annotations

import http.client
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import numpy as np
import pytest

import cutjoint
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_scene
from cutjoint.view.live import LiveView, Poses
from cutjoint.view.views import live_page
from tests.conftest import MODELS, needs_cpp
from tests.view.browser import Page
from tests.view.conftest import call
from tests.view.pages import PICTURES, projected

PRESS = MODELS / "press.yaml"
MODEL = read_model_text(PRESS.read_text(encoding="utf-8"), "press.yaml")


@contextmanager
def following(page: str = "<p>press</p>", reported: list[str] | None = None) -> Iterator[LiveView]:
    view = LiveView(MODEL, page, 0, report=(reported if reported is not None else []).append)
    thread = Thread(target=view.serve)
    thread.start()
    try:
        yield view
    finally:
        view.close()
        thread.join()


def send(view: LiveView, *datagrams: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        for datagram in datagrams:
            line.sendto(datagram, ("127.0.0.1", view.port))


@needs_cpp
def test_a_page_shows_where_the_bodies_of_a_host_are(browser: Page) -> None:
    sim = cutjoint.load(PRESS, poses=True).reset()
    with following(live_page(MODEL, find_scene(MODEL, None), {})) as view:
        browser.open(f"http://localhost:{view.port}/")
        for steps in (1, 40, 100):
            for _ in range(steps):
                sim.step()
                send(view, sim.pose_datagram())
            end = time.monotonic() + 60
            while browser.run("cutjoint.shown().time") != sim.time:
                assert time.monotonic() < end
                send(view, sim.pose_datagram())
                time.sleep(0.05)
            for body in ("crank", "rod", "slider"):
                place = sim.poses.position[sim.poses.place(body)]
                assert np.abs(browser.run(f"cutjoint.project('{body}', 0)") - projected(browser, place)).max() < 1.0
        browser.picture(PICTURES / "live.png")
        assert browser.run("document.getElementById('clock').textContent") == f"{sim.time:.2f} s"
        assert browser.complaints == []
        assert {r for r in browser.requests if r.startswith("http")} == {f"http://localhost:{view.port}/{name}" for name in ("", "poses")}


@needs_cpp
def test_what_is_none_of_its_poses_is_reported_once_and_ignored() -> None:
    whole = cutjoint.load(PRESS, poses=True).reset().pose_datagram()
    reported: list[str] = []
    poses = Poses(MODEL, reported.append)
    nan = np.float64(np.nan).tobytes()
    for wrong in (b"", b"x" * 400, whole[:-8], whole + b"\0", whole[:8] + nan + whole[16:], whole[:-8] + nan):
        for _ in range(3):
            assert not poses.receive(wrong)
    assert len(reported) == 4
    assert reported[0].startswith("a datagram is none of 'press': its digest is another")
    assert [each for each in reported if "392 bytes, not 400" in each]
    assert [each for each in reported if "401 bytes, not 400" in each]
    assert "not finite" in reported[-1]
    assert poses.receive(whole)
    number, text = poses.wait(0)
    assert number == 1
    assert np.array(json.loads(text)[1:]).shape == (3, 7)


@needs_cpp
def test_who_loses_datagrams_has_the_last_one() -> None:
    sim = cutjoint.load(PRESS, poses=True).reset()
    poses = Poses(MODEL, lambda _: None)
    for _ in range(5):
        sim.step()
        poses.receive(sim.pose_datagram())
    assert json.loads(poses.wait(2)[1])[0] == sim.time


def test_it_answers_this_machine_alone() -> None:
    with following() as view:
        for host, path, status in (("localhost", "/", 200), ("localhost", "/other", 404), ("elsewhere.example", "/", 403)):
            line = http.client.HTTPConnection("127.0.0.1", view.port)
            line.request("GET", path, headers={"Host": f"{host}:{view.port}"})
            assert line.getresponse().status == status
            line.close()
        with pytest.raises(RunError, match=f"--live {view.port}: Address already in use; name another port"):
            LiveView(MODEL, "", view.port, report=print)


def test_the_command_says_where_it_is_seen() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "cutjoint.cli", "view", str(PRESS), "--live", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as started:
        assert started.stdout is not None
        assert f"http://localhost:{port}/ follows datagrams at UDP port {port}" in started.stdout.readline()
        page = http.client.HTTPConnection("localhost", port)
        page.request("GET", "/")
        assert b"press" in page.getresponse().read()
        started.terminate()


def test_files_and_hosts_are_apart() -> None:
    assert "--live writes no file; leave out --out" in call("view", PRESS, "--live", 5005, "--out", "x.html", status=1)
    assert "--shared is of --live PORT" in call("view", PRESS, "--shared", status=1)
