"""`cutjoint warm`."""

from cutjoint.commands import options, table
from cutjoint.toolchain.build import FLAGS, warm
from cutjoint.toolchain.drivers import DRIVERS


@table.command("warm")
def command(drivers: tuple[str, ...]) -> None:
    """Compile the drivers, the parts that all models share: half a minute each.

    They are stored in the installation, or in the cache if it is not writable.  $CXX and $CUTJOINT_FLAGS name the compiler and its flags.
    """
    for driver in drivers or DRIVERS:
        with options.progress_bar(f"compiling the driver {driver}"):
            fresh = warm(driver)
        options.out.print(f"driver {driver}: {'compiled' if fresh else 'up to date'} ({' '.join(FLAGS)})")
