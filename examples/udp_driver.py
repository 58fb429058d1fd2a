"""The driver of udp_vehicle.c or paced_vehicle.c, in a process of its own: python examples/udp_driver.py PROGRAM [SECONDS]."""

import socket
import struct
import subprocess
import sys

LEFT, SPEED = 2.0, 7.0


def rack(t: float, y: float, yaw: float) -> float:
    """The rack's displacement (m), as in driver.h."""
    wanted = 0.0 if t < 2.0 else LEFT * (t - 2.0) / 3.0 if t < 5.0 else LEFT
    return min(max(0.01 * (y - wanted) + 0.05 * yaw, -0.03), 0.03)


def speed(t: float) -> float:
    """The speed to hold (m/s), as in driver.h."""
    return 5.0 if t < 1.0 else 5.0 + (SPEED - 5.0) * (t - 1.0) / 3.0 if t < 4.0 else SPEED


def drive(program: str, *words: str) -> int:
    """Answer the program, called with further words, until it ends; returns its exit status."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        line.settimeout(0.1)
        vehicle = subprocess.Popen([program, str(line.getsockname()[1]), *words])
        while vehicle.poll() is None:
            try:
                message, sender = line.recvfrom(64)
            except TimeoutError:
                continue
            t, y, yaw, _ = struct.unpack("4d", message)
            line.sendto(struct.pack("2d", rack(t, y, yaw), speed(t)), sender)
    return vehicle.returncode


if __name__ == "__main__":
    sys.exit(drive(*sys.argv[1:]))
