"""Keeps a tool and all that it starts: they end when whoever asked for them has, by whatever means.

A program of its own, `python -I -S supervisor.py TOOL ARGUMENT...`, as the leader of a session.  Nobody writes to its standard input, which
ends with the last process that holds the other end.  Process groups do not do: Ninja gives each of its compilers another one.
"""

import os
import signal
import sys
from _thread import allocate_lock, start_new_thread
from time import sleep

#: Python ignores these signals, and what it starts would.
_IGNORED = tuple(getattr(signal, name) for name in ("SIGPIPE", "SIGXFSZ") if hasattr(signal, name))

#: The status if the tool cannot be started, as in shells.
_NOT_STARTED = 126

#: Held while the session is ended, since the tool may end before the others.
_ending = allocate_lock()


def end_session(session: int) -> None:
    """Kill all processes of a session but this one, and those that they start meanwhile."""
    while members := [pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if _is_member(pid, session)]:
        for pid in members:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        sleep(0.002)


def _is_member(pid: int, session: int) -> bool:
    """Return whether a process is another living one of a session."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as stream:
            state, _, _, its_session = stream.read().rpartition(b")")[2].split()[:4]
    except (OSError, ValueError):
        return False
    return pid != os.getpid() and int(its_session) == session and state not in (b"Z", b"X")


def _watch() -> None:
    while os.read(0, 1):
        pass
    with _ending:
        end_session(os.getpid())


def main() -> None:
    """Run a tool, whose status is that of this program, 128 and the signal where one ended it."""
    nothing = (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0)
    try:
        tool = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ, file_actions=[nothing], setsigdef=_IGNORED)
    except OSError as error:
        print(f"{sys.argv[1]}: error: {error.strerror}")
        sys.exit(_NOT_STARTED)
    start_new_thread(_watch, ())
    status = os.waitstatus_to_exitcode(os.waitpid(tool, 0)[1])
    with _ending:
        os._exit(status if status >= 0 else 128 - status)


if __name__ == "__main__":
    main()
