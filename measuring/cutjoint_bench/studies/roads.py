"""The time that a sample of a road takes: of a surface beside that of a profile, in turns, the least of nine rounds.  `make roads`."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from cutjoint.package.locations import runtime_folder
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.studies.provenance import provenance


def sample_times() -> dict[str, float]:
    """Nanoseconds by kind of sample."""
    with TemporaryDirectory() as folder:
        program = Path(folder) / "samples"
        source, headers = Path(__file__).with_name("road_samples.cpp"), runtime_folder() / "include"
        subprocess.run([*find_compiler().command, "-std=c++20", *FLAGS, f"-I{headers}", source, "-o", program], check=True)
        found: dict[str, float] = json.loads(subprocess.run([program], check=True, capture_output=True, text=True).stdout)
    return found


def main() -> None:
    """Print the table."""
    times = sample_times()
    first = next(iter(times.values()))
    table = Table("sample", "ns", "beside a profile")
    for name, each in times.items():
        table.add_row(name, f"{each:.1f}", f"{each / first:.2f}")
    console = Console()
    console.print(table)
    console.print(provenance(), markup=False)


if __name__ == "__main__":
    main()
