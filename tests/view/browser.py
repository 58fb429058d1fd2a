"""Chromium without a window, by the pipe of its DevTools protocol: what a page says, asks for and shows."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
#: What tests ask of a page.
HOOKS = Path(__file__).with_name("hooks.js").read_text(encoding="utf-8")
#: Seconds for a page to do what it is asked for on a busy machine.
PATIENCE = 120.0
#: Seconds in which a damaged page says that it is, if it can.
ANSWER = 3.0


class Page:
    """A page that is open.

    ``complaints`` are the console's errors and warnings, ``errors`` those of scripts, ``requests`` all addresses that it asked for.
    """

    def __init__(self, into: int, out: int) -> None:
        self._into, self._out, self._rest, self._number = into, out, b"", 0
        self.complaints: list[str] = []
        self.errors: list[str] = []
        self.requests: list[str] = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session: str | None = None
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")

    def open(self, file: Path | str, *, size: tuple[int, int] = (1280, 720), dark: bool = False) -> None:
        """Open a page, a file or an address, and wait until it is ready."""
        self._call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[scheme])
        self._go(file)
        end = time.monotonic() + PATIENCE
        while self.run("document.body?.dataset.ready ?? ''") != "yes":
            assert time.monotonic() < end, f"{file} is not ready: {self.complaints}"
            time.sleep(0.1)
        self.run(HOOKS)
        self.settle()

    def try_to_open(self, file: Path) -> bool:
        """Open a page that may be damaged, and forget what others did; whether it is ready in some seconds."""
        for noted in (self.complaints, self.errors, self.requests):
            noted.clear()
        self._go(file)
        ready, end = "", time.monotonic() + ANSWER
        while not ready and time.monotonic() < end:
            time.sleep(0.05)
            ready = self.run("document.readyState === 'complete' ? document.body?.dataset.ready ?? '' : ''")
        self.settle()
        return bool(self.run("document.body?.dataset.ready === 'yes'"))

    def _go(self, file: Path | str) -> None:
        self._call("Page.navigate", url=file if isinstance(file, str) else file.resolve().as_uri())

    def run(self, script: str) -> Any:
        """The value of a script, which may be a promise."""
        found = self._call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    def click(self, x: float, y: float) -> None:
        """Press and release the left button."""
        for kind in ("mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        self.settle()

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the left button at a place, move, and release it at another one."""
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        for kind, (x, y) in (("mousePressed", start), ("mouseMoved", middle), ("mouseMoved", end), ("mouseReleased", end)):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
            self.settle()

    def picture(self, file: Path) -> Path:
        """Write what is shown as a PNG file."""
        self.settle()
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"]))
        return file

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        self._number += 1
        session = {"sessionId": self._session} if getattr(self, "_session", None) else {}
        os.write(self._into, json.dumps({"id": self._number, "method": method, "params": params, **session}).encode() + b"\0")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            message = self._read()
            if message.get("id") == self._number:
                assert "error" not in message, message["error"]
                result: dict[str, Any] = message["result"]
                return result
            self._note(message.get("method", ""), message.get("params", {}))
        raise TimeoutError(method)

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            part = os.read(self._out, 1 << 20)
            assert part, "the browser has ended"
            self._rest += part
        line, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        return message

    def _note(self, event: str, params: dict[str, Any]) -> None:
        if event == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif event == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(params["exceptionDetails"]))
            self.complaints.append(self.errors[-1])
        elif event == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.complaints.append(json.dumps(params["args"]))
        elif event == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.complaints.append(params["entry"]["text"])


@contextmanager
def opened() -> Iterator[Page]:
    """A browser with an empty page; nothing of it stays."""
    assert CHROMIUM is not None
    to_browser, from_page = os.pipe(), os.pipe()
    with tempfile.TemporaryDirectory() as profile:
        flags = (
            "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--hide-scrollbars",
            "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
            "--remote-debugging-pipe",
        )  # fmt: skip
        command = [CHROMIUM, *flags, f"--user-data-dir={profile}"]
        # the browser reads its descriptor 3 and writes its descriptor 4
        shell = f'exec "$0" "$@" 3<&{to_browser[0]} 4>&{from_page[1]}'
        process = subprocess.Popen(
            ["bash", "-c", shell, *command], pass_fds=(to_browser[0], from_page[1]), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_browser[0])
        os.close(from_page[1])
        try:
            yield Page(to_browser[1], from_page[0])
        finally:
            os.close(to_browser[1])  # at which the browser ends
            os.close(from_page[0])
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
