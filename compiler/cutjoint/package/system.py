"""The differences of operating systems, in one place: all other modules are written for Linux and ask here."""

import os
import signal
import sys
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

if sys.platform == "win32":
    import msvcrt
    from subprocess import STARTUPINFO
else:
    import fcntl

#: Windows has no owners and no permissions of files as POSIX has them, and renames no open file.
IS_WINDOWS = os.name == "nt"

#: The ending of programs.
PROGRAM = ".exe" if IS_WINDOWS else ""

#: The place of a lock in a file on Windows, where a locked byte is one that other processes cannot read or write: as far as C's offsets go.
_LOCKED = 2**31 - 2


def library_file(name: str) -> str:
    """The file of a shared library by the name that linkers take."""
    return {"win32": f"{name}.dll", "darwin": f"lib{name}.dylib"}.get(sys.platform, f"lib{name}.so")


def processors() -> int:
    """The number of processors that this process may use; where the system does not say, of those that there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def user() -> int:
    """The number of the user, as files have it."""
    return os.geteuid() if sys.platform != "win32" else 0


def lock(number: int) -> None:
    """Lock an open file for this process, by its descriptor, until it is closed. Raises BlockingIOError: another process has it."""
    if sys.platform == "win32":
        os.lseek(number, _LOCKED, os.SEEK_SET)
        try:
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError(*error.args) from None
        finally:
            os.lseek(number, 0, os.SEEK_SET)
    else:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)


def open_flags(*names: str) -> int:
    """The flags of `os.open` with these names, without those that the system does not have; bytes are written as they are."""
    return sum({getattr(os, name, 0) for name in (*names, "O_BINARY")})


def set_mode(number: int, mode: int) -> None:
    """Give an open file permissions, where the system has them."""
    if not IS_WINDOWS:
        os.fchmod(number, mode)


def number_for_child(file: BinaryIO) -> int:
    """The number by which a program finds an open file that `passing` hands over: a descriptor, on Windows a handle."""
    if sys.platform == "win32":
        handle = msvcrt.get_osfhandle(file.fileno())
        os.set_handle_inheritable(handle, True)
        return handle
    return file.fileno()


def path_for_child(number: int) -> str:
    """The word by which a simulator reads an open file of such a number."""
    return f"handle:{number}" if IS_WINDOWS else f"/dev/fd/{number}"


def passing(numbers: Sequence[int]) -> Mapping[str, Any]:
    """The arguments of `subprocess.Popen` that hand open files over, by such numbers."""
    if sys.platform == "win32":
        return {"startupinfo": STARTUPINFO(lpAttributeList={"handle_list": list(numbers)})}
    return {"pass_fds": numbers}


def signal_self(number: int) -> None:
    """Send this process a signal."""
    if IS_WINDOWS:
        signal.raise_signal(number)  # `os.kill` ends a process there
    else:
        os.kill(os.getpid(), number)
