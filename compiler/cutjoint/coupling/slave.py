"""The process in which an FMU runs: `python -c "from cutjoint.coupling.slave import main; main()" SOCKET FOLDER`.

Each request is a line of JSON, the name of a method of `Slave` and its arguments; each answer is one too, with a ``value`` or an ``error``.
What the FMU prints goes to standard error.  The process ends when its standard input does, whatever the FMU is doing.
"""

import json
import os
import socket
import sys
from _thread import start_new_thread
from collections.abc import Sequence
from typing import Any

from fmpy import read_model_description
from fmpy.simulation import instantiate_fmu

from cutjoint.model.text import printable
from cutjoint.toolchain.supervisor import end_session


class Slave:
    """The one instance of the FMU in a folder; errors are raised by FMPy, without a class of their own, and by the loader."""

    def __init__(self, folder: str) -> None:
        self._folder, self._is_2 = folder, True
        self._instance: Any = None
        self.said = ""

    def instantiate(self) -> None:
        """Make a new instance."""
        description = read_model_description(self._folder)
        self._is_2 = str(description.fmiVersion)[0] == "2"
        self._instance = instantiate_fmu(self._folder, description, "CoSimulation", logger=self._note, debug_logging=True)

    def _note(self, *message: Any) -> None:
        """Keep a message of the FMU; the last three arguments are status, category and text in both versions."""
        status, _, text = message[-3:]
        if status >= 2:  # discard, error or fatal
            self.said = printable(text.decode(errors="replace") if isinstance(text, bytes) else str(text))

    def begin(self, end: float) -> None:
        """Initialise for a run from time 0 to ``end`` (s)."""
        if self._is_2:
            self._instance.setupExperiment(startTime=0.0, stopTime=end)
            self._instance.enterInitializationMode()
        else:
            self._instance.enterInitializationMode(startTime=0.0, stopTime=end)

    def start(self) -> None:
        """End the initialisation."""
        self._instance.exitInitializationMode()

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set inputs."""
        (self._instance.setReal if self._is_2 else self._instance.setFloat64)(references, values)

    def get(self, references: Sequence[int]) -> list[float]:
        """The values of outputs."""
        return list((self._instance.getReal if self._is_2 else self._instance.getFloat64)(references))

    def step(self, time: float, size: float) -> bool:
        """A communication step (s) from a time (s); whether the FMU ends the simulation."""
        ended = self._instance.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        return not self._is_2 and bool(ended[1])

    def close(self) -> None:
        """End the instance."""
        self._instance.terminate()
        self._instance.freeInstance()


def answer(slave: Any, request: Sequence[Any]) -> dict[str, Any]:
    """Return the answer to a request."""
    name, *arguments = request
    try:
        return {"value": getattr(slave, name)(*arguments)}
    except Exception as error:
        return {"error": slave.said or printable(str(error))}


def _watch() -> None:
    while os.read(0, 1):
        pass
    end_session(os.getpid())
    os._exit(1)


def main() -> None:
    """Answer requests until there are no more, after a first answer, which says that there may be some."""
    os.dup2(2, 1)
    start_new_thread(_watch, ())
    slave = Slave(sys.argv[2])
    with socket.socket(fileno=int(sys.argv[1])) as connection, connection.makefile("rw", encoding="utf-8") as lines:
        lines.write("{}\n")
        lines.flush()
        for line in lines:
            lines.write(json.dumps(answer(slave, json.loads(line))) + "\n")
            lines.flush()
