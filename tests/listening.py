"""Signals as in a terminal."""

from __future__ import annotations

import signal


def listen() -> None:
    """Ctrl-C and a hang-up count: the background jobs of a shell, or of nohup, and what they start ignore them."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
