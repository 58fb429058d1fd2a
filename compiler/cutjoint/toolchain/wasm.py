"""Folders of models -> modules of WebAssembly, and libraries for this machine with the same bits, cached by content.

Both have the mathematical functions of runtime/libm, and no product and sum in one operation.  A module imports nothing.  It has no
threads, and no instruction whose result a processor may choose: its vectors of 128 bits have the operations of IEEE 754.
"""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from cutjoint.emit.standalone import Mathematics
from cutjoint.package.errors import MissingToolsError, ToolchainError
from cutjoint.package.locations import runtime_folder, without_mark
from cutjoint.toolchain.build import write_text
from cutjoint.toolchain.cache import cache_folder, digest_of, find_or_make, tree_digest
from cutjoint.toolchain.children import call
from cutjoint.toolchain.compiler import ask_version, find_compiler, find_zig

#: The functions of the mathematical library that programs and the runtime call.  No compiler may know values of theirs, and no pair of them
#: be one call.  Square roots, absolute values and whole numbers are exact in any library.
MATHEMATICS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log10", "pow")

_EXACT = ("-ffp-contract=off", *(f"-fno-builtin-{name}" for name in MATHEMATICS))
_CXX = (
    "-std=c++20", "-O2", *_EXACT, "-fno-math-errno", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics",
    "-DCUTJOINT_WITHOUT_LIBMVEC", "-Wno-psabi",
)  # fmt: skip
_LIBM = ("-std=c99", *_EXACT, "-U__FP_FAST_FMA", "-fvisibility=hidden", "-w")
_C = ("-O2", *_LIBM)

#: Vectors are those that the code has: with those that the compiler finds in it modules are larger, and no faster .
_WASM = ("-target", "wasm32-wasi", "-msimd128", "-fno-slp-vectorize", "-fno-vectorize")

#: The size of a module's stack, bytes: many times the need of a step of any model.
_STACK = 1 << 20

#: The name of the section of a module that has facts about its model.
SECTION = "cutjoint"


def require_zig() -> str:
    """The compiler for WebAssembly. Raises MissingToolsError: ziglang is not installed."""
    if zig := find_zig():
        return zig
    raise MissingToolsError("missing: ziglang, which compiles for WebAssembly; pip install 'cutjoint[compiler]'")


def build_module(name: str, files: Mapping[str, str], digest: str) -> bytes:
    """The WebAssembly module of a C export, cached; functions of its C interface begin with ``name``.

    Raises:
        MissingToolsError: ziglang is not installed.
        ToolchainError: it refused the code.
    """
    zig = require_zig()
    headers, declared = (text for file, text in files.items() if file.endswith(".h")), rf"^[\w ]+[ *]+({name}_\w+)\([^;{{]*\);$"
    exports = [f"-Wl,--export={f}" for header in headers for f in sorted({*re.findall(declared, header, re.MULTILINE)})]
    linked = ("-mexec-model=reactor", f"-Wl,-z,stack-size={_STACK}", "-s", *exports)
    return _build(f"{name}.wasm", files, digest, (zig, "c++"), (zig, "cc"), _WASM, linked).read_bytes()


def build_matching_library(name: str, files: Mapping[str, str], digest: str) -> Path:
    """The shared library of a C export whose results are those of its module to the last bit; or that of the cache.
    Raises ToolchainError: there is no compiler, or it refused the code."""
    command = find_compiler().command
    return _build(f"lib{name}.so", files, digest, command, command, ("-fPIC",), ("-shared",))


def _build(
    made: str, files: Mapping[str, str], digest: str, cxx: Sequence[str], cc: Sequence[str], flags: Sequence[str], linked: Sequence[str]
) -> Path:  # fmt: skip
    """Compile the C++ among files, and the mathematical library, and link both."""
    sources, library = [file for file in files if file.endswith(".cpp")], runtime_folder() / "libm"
    named = ("-include", str(library / "names.h"))
    used = {file: text for file, text in files.items() if file.endswith((".cpp", ".h"))}
    parts = [*map(without_mark, used.values()), tree_digest(library), ask_version(tuple(cxx)), *cxx[1:]]
    cached = cache_folder() / f"portable-{digest_of([digest, *parts, *_CXX, *_C, *flags, *linked])}" / made

    def make(folder: Path) -> Path:
        for file, text in used.items():
            write_text(folder / file, text)
        (folder / "tmp").mkdir()
        calls = {file: (*_CXX, *named, "-c", file) for file in sources}
        calls |= {file.name: (*_C, *named, "-x", "c", "-c", str(file)) for file in sorted(library.glob("*.c"))}
        for file, words in calls.items():
            _call([*cxx, *flags, *words, "-o", f"{file}.o"], folder, folder / "tmp")
        objects = [f"{file}.o" for file in calls]
        _call([*cc, *flags, *objects, "-lm", *linked, "-o", made], folder, folder / "tmp")
        return folder / made

    find_or_make(cached, make)
    return cached


def mathematics() -> Mathematics:
    """The library for folders, with the flags of a project that compiles it."""
    files = {f"libm/{file.name}": file.read_text(encoding="utf-8") for file in sorted((runtime_folder() / "libm").iterdir())}
    return Mathematics(files=files, cxx=_EXACT, c=_LIBM)


def _call(command: Sequence[str], folder: Path, scratch: Path) -> None:
    status, said = call(command, {**os.environ, "TMPDIR": str(scratch)}, folder)
    if status:
        errors = [line.strip() for line in said.splitlines() if "error" in line]
        raise ToolchainError(f"{' '.join(command[:2])} failed: {'; '.join(errors[:5]) or said[-800:]} (please report this)")


def with_section(module: bytes, content: bytes) -> bytes:
    """A module with a section of ``content`` for its hosts (WebAssembly Core Specification, 5.5.3)."""
    name = SECTION.encode()
    body = _leb(len(name)) + name + content
    return module + b"\0" + _leb(len(body)) + body


def _leb(number: int) -> bytes:
    """A whole number in groups of seven bits, the lowest first."""
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + _leb(rest) if rest else bytes([low])
