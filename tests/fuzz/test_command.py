"""The processes in which inputs are tried."""

from __future__ import annotations

import os

from .command import processes


def test_a_signal_that_ends_the_fuzzing_reaches_no_input() -> None:
    """A call that it ended would be a finding; it goes to all processes of a group, as of `timeout` and of a terminal."""
    with processes(1) as pool:
        assert pool.submit(os.getpgrp).result() != os.getpgrp()
