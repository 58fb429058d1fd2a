"""The program `cutjoint`: a signal while Python still imports ends it without a traceback."""

import _signal as signal  # type: ignore[import-not-found]  # signal imports other modules
import os


def main() -> None:
    """Call the command line; until all that it imports at once is there, SIGINT ends the process as the system does."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    for library in ("OPENBLAS", "MKL"):  # whose threads take longer than they save with matrices of a mechanism's size
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from cutjoint.cli import main as command_line

    signal.signal(signal.SIGINT, usual)
    command_line()
