"""The library of a study in one scene: bytes that any worker can load, its requirements on the machine, and its results."""

import ctypes
import os
import platform
import shlex
import subprocess
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np

from cutjoint.package.errors import ToolchainError
from cutjoint.run.settings import StepSettings
from cutjoint.sweeps.records import Array, Counts
from cutjoint.toolchain.compiler import find_compiler, processor
from cutjoint.toolchain.temporary import temporary_folder

# Machines

#: The features of x86 and ARM that a compiler may use beyond those that all such processors have: its macros, and how Linux names them.
_FEATURES = {
    "__SSE3__": "pni", "__SSSE3__": "ssse3", "__SSE4_1__": "sse4_1", "__SSE4_2__": "sse4_2", "__POPCNT__": "popcnt", "__AVX__": "avx",
    "__AVX2__": "avx2", "__FMA__": "fma", "__F16C__": "f16c", "__BMI__": "bmi1", "__BMI2__": "bmi2", "__LZCNT__": "abm",
    "__MOVBE__": "movbe", "__AVX512F__": "avx512f", "__AVX512DQ__": "avx512dq", "__AVX512CD__": "avx512cd", "__AVX512BW__": "avx512bw",
    "__AVX512VL__": "avx512vl", "__AVX512VNNI__": "avx512_vnni", "__AVX512BF16__": "avx512_bf16", "__AVX512FP16__": "avx512_fp16",
    "__AVX512VBMI__": "avx512vbmi", "__AVX512VBMI2__": "avx512_vbmi2", "__AVX512IFMA__": "avx512ifma", "__AVXVNNI__": "avx_vnni",
    "__FMA4__": "fma4", "__XOP__": "xop", "__ARM_FEATURE_SVE": "sve", "__ARM_FEATURE_SVE2": "sve2", "__ARM_FEATURE_ATOMICS": "atomics",
}  # fmt: skip
#: The largest length of a failed run's message.
_TEXT = 400
_loaded: dict[str, tuple[Any, int]] = {}
_lock = threading.Lock()


@dataclass(frozen=True, kw_only=True)
class Target:
    """The machine type of a library: system, processor, processor features, and build flags."""

    system: str
    machine: str
    features: tuple[str, ...]
    compiler: str
    flags: tuple[str, ...]

    def fault(self) -> str:
        """The reason that this machine cannot run the library; "" if it can."""
        here = (platform.system(), platform.machine())
        if here != (self.system, self.machine):
            return f"the library is for {self.system} on {self.machine}, this is {here[0]} on {here[1]}"
        missing = [name for name in self.features if name not in _present()]
        return f"the processor has no {', '.join(missing)}" if missing else ""


def find_target(flags: Sequence[str]) -> Target:
    """The target of the compiler with flags. Raises ToolchainError: there is no compiler, or it does not take the flags."""
    compiler = find_compiler()
    words = (*compiler.command, *flags, "-x", "c++", "-dM", "-E", os.devnull)
    call = subprocess.run(words, capture_output=True, text=True, check=False, cwd=os.sep)
    if call.returncode:
        said = (call.stderr.strip().splitlines() or ["no reason given"])[0]
        raise ToolchainError(f"flags {shlex.join(flags)}: the compiler refuses them: {said}; write others")
    macros = {line.split()[1] for line in call.stdout.splitlines() if line.startswith("#define")}
    features = tuple(sorted(feature for macro, feature in _FEATURES.items() if macro in macros))
    return Target(system=platform.system(), machine=platform.machine(), features=features, compiler=compiler.name, flags=tuple(flags))


def _present() -> frozenset[str]:
    lines = [line.partition(":") for line in processor()]
    return frozenset(word for name, _, words in lines if name in ("flags", "Features") for word in words.split())


# Kernels


@dataclass(frozen=True, kw_only=True)
class KernelResults:
    """The results of runs: ``series`` (runs, series, rows), of which each run ``reached`` so many rows.

    ``failures`` have the reasons of failed runs by their places, ``times`` the time of each failure, s, NaN for none.
    """

    series: Array
    reached: Counts
    failures: dict[int, str]
    times: Array


@dataclass(frozen=True, kw_only=True)
class Kernel:
    """The runs of a study in one scene as a library.

    ``content`` is the library, in which so many ``lanes`` at most go side by side (1: one by one), or a part of that number. A run has
    ``rows`` rows, ``row_step`` (s) apart, and takes the ``steps`` of an integrator. ``starts``: numbers of a trim behind a run's values.
    """

    model: str
    scene: str
    source: str
    content: bytes
    target: Target
    lanes: int
    series: int
    rows: int
    row_step: float
    steps: StepSettings
    starts: tuple[str, ...] = ()

    @cached_property
    def digest(self) -> str:
        """The digest of the library."""
        return sha256(self.content).hexdigest()

    @property
    def times(self) -> Array:
        """The times of the rows, s."""
        return np.arange(self.rows, dtype=np.float64) * self.row_step

    def run(self, values: Array) -> KernelResults:
        """Runs with values (runs, variables). Raises OSError: the library cannot be loaded here."""
        values, runs = np.ascontiguousarray(values, dtype=np.float64), len(values)
        function, size = _functions(self)
        series, memory = np.empty((runs, self.series, self.rows)), np.zeros(size // 8)
        status, reached = np.zeros(runs, dtype=np.intc), np.zeros(runs, dtype=np.int64)
        times, texts = np.zeros(runs), np.zeros((runs, _TEXT), dtype=np.uint8)
        function(
            memory.ctypes.data, size, runs, self.rows, self.row_step, values.ctypes.data, series.ctypes.data, status.ctypes.data,
            reached.ctypes.data, times.ctypes.data, texts.ctypes.data, _TEXT,
        )  # fmt: skip
        times[status == 0] = np.nan
        failures = {int(run): bytes(texts[run]).partition(b"\0")[0].decode("utf-8", "replace") for run in np.flatnonzero(status)}
        return KernelResults(series=series, reached=reached, failures=failures, times=times)


def require_loadable(kernels: Sequence[Kernel]) -> str:
    """The reason that this machine cannot run libraries; "" if it can."""
    for kernel in kernels:
        if fault := kernel.target.fault():
            return fault
        try:
            _functions(kernel)
        except (OSError, AttributeError) as error:
            return f"the library cannot be loaded: {error}"
    return ""


def _functions(kernel: Kernel) -> tuple[Any, int]:
    """The function of a library that runs a study, and the bytes of memory that it takes.  The file is removed once it is loaded, or
    by the next process where a worker is killed meanwhile."""
    with _lock:
        if kernel.digest not in _loaded:
            with temporary_folder() as folder:
                file = folder / f"lib{kernel.digest[:16]}.so"
                file.write_bytes(kernel.content)
                library, name, pointer = ctypes.CDLL(os.fspath(file)), f"{kernel.model}_study", ctypes.c_void_p
                function, size = getattr(library, name), getattr(library, f"{name}_bytes")
                function.restype, size.restype, long = None, ctypes.c_size_t, ctypes.c_long
                function.argtypes = (pointer, ctypes.c_size_t, long, long, ctypes.c_double, *([pointer] * 6), ctypes.c_size_t)
                _loaded[kernel.digest] = function, size()
        return _loaded[kernel.digest]
