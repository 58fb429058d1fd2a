"""Files and commands of pages, written and run in their order in an empty folder; the output is what the pages say, "…" for any text."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from tests.conftest import ROOT, needs_cpp, with_heavy

pytestmark = needs_cpp

PAGES = (
    "start/first-run", "start/mechanism", "start/embed", "how-to/simulate", "how-to/initial-conditions", "how-to/hydraulics",
    "how-to/motors-and-control", "how-to/digital-controllers", "how-to/mechanism-recipes", "how-to/custom-laws", "how-to/troubleshooting",
    "how-to/simple-car", "how-to/suspension-kinematics", "how-to/view", "how-to/equilibrium-and-modes", "how-to/linear-models",
    "how-to/frequency-response", "how-to/rotating-machines", "how-to/gradients", "how-to/inverse-dynamics", "how-to/fit-torques",
    "how-to/fit", "how-to/design-an-experiment", "how-to/sweep", "how-to/tolerances", "how-to/batch", "how-to/loop-embedding",
    "how-to/many-simulations", "how-to/import", "how-to/export", "how-to/fmu", "how-to/roads-and-tyres", "how-to/prove-loops",
)
#: Pages that take longer.
LONG = ("start/vehicle", "start/robot", "how-to/choose-a-method", "how-to/embed-in-c", "how-to/model-to-controller")


@dataclass(frozen=True)
class Snippet:
    """A block of a page: its language, the file that it is written to, if any, and its text."""

    language: str
    title: str
    text: str


def snippets(page: str) -> list[Snippet]:
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    found = re.findall(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    return [Snippet(*parts) for parts in found]


def squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def run(snippet: Snippet, folder: Path) -> str:
    """The output of a shell or of Python."""
    bin_folder = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": bin_folder, "COLUMNS": "200"}
    command = ["bash", "-e", "-c", snippet.text] if snippet.language == "sh" else [sys.executable, "-c", snippet.text]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{snippet.text}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout + done.stderr


@pytest.mark.parametrize("page", with_heavy([*PAGES, *LONG], *LONG))
def test_a_page_does_what_it_says(page: str, tmp_path: Path) -> None:
    if page == "start/robot":
        pytest.importorskip("mujoco")
    for folder in ("models", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    printed = ""
    for snippet in snippets(page):
        match snippet.language:
            case "sh" | "python":
                printed += run(snippet, tmp_path)
            case "text":
                for line in re.split(r"\n|…", snippet.text):  # an ellipsis stands for what a page leaves out
                    assert squeezed(line) in squeezed(printed), (line, printed[-3000:])
                printed = ""
            case "yaml" if not snippet.title:
                assert yaml.safe_load(snippet.text), snippet.text
            case "csv" | "cpp" if not snippet.title:
                continue
            case _:
                assert snippet.title, snippet.text
                (tmp_path / snippet.title).write_text(snippet.text, encoding="utf-8")


def test_a_car_of_parts_has_sixty_lines() -> None:
    (car,) = (snippet for snippet in snippets("start/vehicle") if snippet.title == "my_car.yaml")
    assert len(car.text.splitlines()) <= 60
