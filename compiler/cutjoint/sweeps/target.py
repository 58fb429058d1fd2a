"""The needs of a library on the machine that runs it, and a check that this one meets them."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from cutjoint.toolchain.compiler import find_compiler, processor
from cutjoint.toolchain.errors import ToolchainError

#: The features of x86 and ARM that a compiler may use beyond those that all such processors have: its macros, and how Linux names them.
_FEATURES = {
    "__SSE3__": "pni", "__SSSE3__": "ssse3", "__SSE4_1__": "sse4_1", "__SSE4_2__": "sse4_2", "__POPCNT__": "popcnt", "__AVX__": "avx",
    "__AVX2__": "avx2", "__FMA__": "fma", "__F16C__": "f16c", "__BMI__": "bmi1", "__BMI2__": "bmi2", "__LZCNT__": "abm",
    "__MOVBE__": "movbe", "__AVX512F__": "avx512f", "__AVX512DQ__": "avx512dq", "__AVX512CD__": "avx512cd", "__AVX512BW__": "avx512bw",
    "__AVX512VL__": "avx512vl", "__AVX512VNNI__": "avx512_vnni", "__AVX512BF16__": "avx512_bf16", "__AVX512FP16__": "avx512_fp16",
    "__AVX512VBMI__": "avx512vbmi", "__AVX512VBMI2__": "avx512_vbmi2", "__AVX512IFMA__": "avx512ifma", "__AVXVNNI__": "avx_vnni",
    "__FMA4__": "fma4", "__XOP__": "xop", "__ARM_FEATURE_SVE": "sve", "__ARM_FEATURE_SVE2": "sve2", "__ARM_FEATURE_ATOMICS": "atomics",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Target:
    """The kind of machine that a library is built for: system and processor, features of the latter, and how it was built."""

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
    """The target of the compiler with flags.

    Raises:
        ToolchainError: there is no compiler, or it does not take the flags.
    """
    compiler = find_compiler()
    call = subprocess.run([*compiler.command, *flags, "-x", "c++", "-dM", "-E", os.devnull], capture_output=True, text=True, check=False)
    if call.returncode:
        said = (call.stderr.strip().splitlines() or ["no reason given"])[0]
        raise ToolchainError(f"flags {shlex.join(flags)}: the compiler refuses them: {said}; write others")
    macros = {line.split()[1] for line in call.stdout.splitlines() if line.startswith("#define")}
    features = tuple(sorted(feature for macro, feature in _FEATURES.items() if macro in macros))
    return Target(
        system=platform.system(), machine=platform.machine(), features=features, compiler=compiler.name, flags=tuple(flags)
    )  # fmt: skip


def _present() -> frozenset[str]:
    """The features of this machine's processor, as Linux names them."""
    lines = [line.partition(":") for line in processor()]
    return frozenset(word for name, _, words in lines if name in ("flags", "Features") for word in words.split())
