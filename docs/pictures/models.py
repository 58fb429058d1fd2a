"""Draws docs/pictures/models/*.png, each everyday model at a time of its run, docs/pictures/iltis.gif, the vehicle on a ramp, and
docs/pictures/drive.png, a page in which it is driven, and drive-phone.png, the same on a phone.

Run it as `.venv/bin/python -m docs.pictures.models` in the repository; it needs Chromium.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from PIL import Image
from tests.view.browser import Page, tunable

from cutjoint.cli import main as cutjoint

FOLDER = Path(__file__).resolve().parent
MODELS = FOLDER.parent.parent / "models"
SIZE, MOVING_SIZE = (640, 400), (560, 250)  # pixels
COLOURS = 64

#: What of the page is no mechanism.
HIDE = """{ const style = document.createElement("style");
  style.textContent = "header, aside, footer, #labels { display: none !important } main { display: block !important; height: 100vh }"
    + " #picture { position: fixed !important; inset: 0; width: 100vw; height: 100vh }";
  document.head.append(style); window.dispatchEvent(new Event("resize")); 1 }"""


@dataclass(frozen=True)
class Shot:
    """A model at a time (s) of a scene."""

    model: str
    scene: str
    time: float


SHOTS = (
    Shot("press", "turn", 0.25), Shot("axle", "bump", 0.3), Shot("car", "drop", 0.15), Shot("excavator", "hold", 1.2),
    Shot("stewart", "step", 0.6), Shot("delta", "circle", 0.35), Shot("six_bar", "turn", 0.2), Shot("leg", "drop", 0.5),
    Shot("gantry", "carry", 3.0),
)  # fmt: skip

#: The moving picture: its beginning, end and time between frames, s.
MOVING = (0.6, 4.6, 0.08)


@contextmanager
def page_of(model: str, scene: str, size: tuple[int, int]) -> Iterator[Page]:
    """A run on screen, nothing but the mechanism."""
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "run.html"
        command = ["simulate", MODELS / f"{model}.yaml", "--scene", scene, "--no-error", "--out", Path(name) / "run.csv", "--view", page]
        done = CliRunner().invoke(cutjoint, [str(word) for word in command], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        with tunable() as browser:
            browser.open(page, size=size)
            browser.run(HIDE)
            yield browser


def shoot(browser: Page, time: float) -> Image.Image:
    """What is shown at a time, in few colours."""
    browser.run(f"cutjoint.play(false); cutjoint.setTime({time}); 1")
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        browser.picture(Path(file.name))
        return Image.open(file.name).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)


def draw(shots: Sequence[Shot] = SHOTS) -> None:
    """Write the pictures of models."""
    (FOLDER / "models").mkdir(exist_ok=True)
    for shot in shots:
        with page_of(shot.model, shot.scene, SIZE) as browser:
            shoot(browser, shot.time).save(FOLDER / "models" / f"{shot.model}.png", optimize=True)


def draw_moving() -> None:
    """Write the moving picture."""
    begin, end, step = MOVING
    with page_of("iltis", "simul1", MOVING_SIZE) as browser:
        first, *others = [shoot(browser, time) for time in np.arange(begin, end, step)]
    first.save(FOLDER / "iltis.gif", save_all=True, append_images=others, duration=round(1e3 * step), loop=0, optimize=True)


#: Sizes of a screen and of a phone's, pixels; a drive by scripted keys over a number of steps.
SCREENS = {"drive.png": (1280, 800), "drive-phone.png": (390, 844)}
KEYS = [
    [0, "down", "ArrowUp"], [1500, "down", "ArrowLeft"], [1900, "up", "ArrowLeft"], [2500, "down", "ArrowRight"],
    [2900, "up", "ArrowRight"],
]  # fmt: skip
STEPS = 5200


def draw_drive() -> None:
    """Write the pictures of a drive over hills and steps."""
    with tempfile.TemporaryDirectory() as name, tunable() as browser:
        page = Path(name) / "drive.html"
        command = ["drive", MODELS / "iltis_driven.yaml", "--scene", "by_hand", "--steer", "steer=9,-9", "--out", page]
        done = CliRunner().invoke(cutjoint, [str(word) for word in command], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        for file, size in SCREENS.items():
            browser.open(page, size=size)
            browser.run("document.getElementById('kept').hidden = true")
            browser.run("cutjoint.drive.road('hills with steps', 1)")
            browser.run(f"cutjoint.drive.steps({STEPS}, {json.dumps(KEYS)})")
            browser.picture(FOLDER / file)


if __name__ == "__main__":
    draw()
    draw_moving()
    draw_drive()
