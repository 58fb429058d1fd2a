"""`cutjoint bench`."""

from __future__ import annotations

from typing import Any

import click

from cutjoint.bench.command import bench_options, run_bench
from cutjoint.commands import options


@click.command("bench")
@bench_options
@options.changes
@options.links
@options.reports_errors
def command(changes: tuple[str, ...], links: tuple[str, ...], **how: Any) -> None:
    """Measure speed and accuracy of all methods on MODELS against a reference, and write a report."""
    for path in run_bench(parameters=options.read_parameters(changes), link_masses=options.read_parameters(links, "--link-mass"), **how):
        options.out.print(str(path), markup=False)
