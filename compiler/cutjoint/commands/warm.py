"""`cutjoint warm`."""

import click

from cutjoint.commands import options, table
from cutjoint.methods import DEFAULT_PRECISION, SOLVERS
from cutjoint.toolchain.build import FLAGS, warm
from cutjoint.toolchain.drivers import DRIVERS, Kind


@table.command("warm")
def command(drivers: tuple[str, ...], precision: str, comparison: bool) -> None:
    """Compile the drivers, the parts that all models share: half a minute each.

    They are stored in the installation, or in the cache if it is not writable.  $CXX and $CUTJOINT_FLAGS name the compiler and its flags.
    """
    drivers = drivers or DRIVERS
    if "batch" in drivers and precision != DEFAULT_PRECISION:
        raise click.UsageError(f"batches have {DEFAULT_PRECISION} only; name the other drivers by --driver")
    solvers = tuple(SOLVERS.added.names()) if comparison else ()
    if precision != DEFAULT_PRECISION and any(SOLVERS[name].double_only for name in solvers):
        raise click.UsageError(f"solvers of other packages support {DEFAULT_PRECISION} only; omit --comparison")
    for driver in drivers:
        with options.progress_bar(f"compiling the driver {driver}"):
            fresh = warm(driver, kind=Kind(precision=precision, additions=solvers))
        options.out.print(f"driver {driver}: {'compiled' if fresh else 'up to date'} ({' '.join(FLAGS)})")
