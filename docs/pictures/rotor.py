"""Draws docs/pictures/campbell.png and waterfall.png by the commands of docs/how-to/rotating-machines.md.

Run it as `.venv/bin/python -m docs.pictures.rotor`.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER.parent / "how-to" / "rotating-machines.md"
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


def main() -> None:
    """Run the page in an empty folder and keep its pictures."""
    with TemporaryDirectory() as folder:
        for language, title, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
            if title:
                Path(folder, title).write_text(text, encoding="utf-8")
            elif language == "python":
                subprocess.run([sys.executable, "-c", text], cwd=folder, check=True)
            elif language == "sh":
                subprocess.run([f"PATH={Path(sys.executable).parent}:$PATH; {text}"], shell=True, cwd=folder, check=True)
        for picture in Path(folder).glob("*.png"):
            copy(picture, FOLDER / picture.name)


if __name__ == "__main__":
    main()
