"""The wheel: templates and runtime travel inside it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.conftest import MODELS, ROOT


def install(project: Path, folder: Path, **environment: str) -> Path:
    """The wheel of a project, installed into a folder of its own."""
    wheels, site = folder / "wheels", folder / "site"
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(wheels), str(project)]
    subprocess.run(build, check=True, capture_output=True, env={**os.environ, **environment})
    (wheel,) = wheels.glob("*.whl")
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), str(wheel)], check=True)
    return site


def test_the_installed_wheel_compiles_and_runs_a_model(tmp_path: Path) -> None:
    site = install(ROOT, tmp_path)
    assert (site / "cutjoint" / "templates" / "function.cpp.jinja").exists()
    assert (site / "cutjoint" / "templates" / "view" / "vendor" / "libraries.min.js").exists()
    assert (site / "cutjoint" / "runtime" / "include" / "cutjoint" / "generated.hpp").exists()
    script = (
        f"import sys; sys.path.insert(0, {str(site)!r})\n"
        "import cutjoint; from pathlib import Path\n"
        f"assert cutjoint.__file__.startswith({str(site)!r}), cutjoint.__file__\n"
        f"run = cutjoint.simulate(cutjoint.compile_model(Path({str(MODELS / 'four_bar.yaml')!r})), end=0.1)\n"
        "print(run.steps)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "100\n", done.stderr


def test_the_installed_wheel_of_measuring_adds_its_command(tmp_path: Path) -> None:
    """And has its page's template, what its exports are printed by and the C++ of its generic solver."""
    site = install(ROOT / "measuring", tmp_path)
    for folder in ("templates", "runtime"):
        there = {p.relative_to(ROOT / "measuring") for p in (ROOT / "measuring" / "cutjoint_bench" / folder).rglob("*") if p.is_file()}
        assert there
        assert all((site / path).is_file() for path in there if path.suffix != ".pyc"), folder
    script = (
        f"import sys; sys.path.insert(0, {str(site)!r})\n"
        "import cutjoint_bench; from cutjoint.cli import main; from cutjoint_bench.report.page import render_page\n"
        f"assert cutjoint_bench.__file__.startswith({str(site)!r}), cutjoint_bench.__file__\n"
        "assert 'Speed against accuracy' in render_page({})\n"
        "main(['bench', '--help'])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.startswith("Usage: -c bench [OPTIONS] MODELS..."), done.stdout + done.stderr
