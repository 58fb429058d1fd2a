"""The wheel: templates and runtime travel inside it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.conftest import MODELS, ROOT


def test_the_installed_wheel_compiles_and_runs_a_model(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(ROOT)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("cutjoint-*.whl")
    site = tmp_path / "site"
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), str(wheel)], check=True)
    assert (site / "cutjoint" / "templates" / "function.cpp.jinja").exists()
    assert (site / "cutjoint" / "runtime" / "include" / "cutjoint" / "mechanism.hpp").exists()
    script = (
        f"import sys; sys.path.insert(0, {str(site)!r})\n"
        "import cutjoint; from pathlib import Path\n"
        f"assert cutjoint.__file__.startswith({str(site)!r}), cutjoint.__file__\n"
        f"run = cutjoint.simulate(cutjoint.compile_model(Path({str(MODELS / 'four_bar.yaml')!r})), end=0.1)\n"
        "print(run.steps)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "100\n", done.stderr
