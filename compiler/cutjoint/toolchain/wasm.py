"""Folders of models -> modules of WebAssembly, by the compiler of the package ziglang, cached by content.

A module imports nothing: the C library's mathematics is inside.  It has no threads, and no instruction whose result a processor may choose:
products and sums are not contracted, and vectors are those of 128 bits whose operations are IEEE 754's.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from cutjoint.package.errors import MissingToolsError, ToolchainError
from cutjoint.package.locations import without_mark
from cutjoint.toolchain.build import write_text
from cutjoint.toolchain.cache import cache_folder, digest_of, find_or_make
from cutjoint.toolchain.children import tool
from cutjoint.toolchain.compiler import ask_version, find_zig

#: Flags of modules; those of $CUTJOINT_FLAGS are for processors.
WASM_FLAGS = ("-O2", "-msimd128")

_TARGET = ("-target", "wasm32-wasi")
_CXX = (
    "-std=c++20", "-ffp-contract=off", "-fno-math-errno", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-Wno-psabi",
    "-Wno-unknown-warning-option",
)  # fmt: skip

#: The bytes of a module's stack, many times what a step of any model has taken.
_STACK = 1 << 20

#: The name of the section of a module that has facts about its model.
SECTION = "cutjoint"


def build_module(name: str, files: Mapping[str, str], digest: str, flags: Sequence[str] = WASM_FLAGS) -> bytes:
    """The module of a folder that stands alone, with its C interface, whose functions have the ``name`` before their own; or that of the
    cache.

    Raises:
        MissingToolsError: ziglang is not installed.
        ToolchainError: it refused the code.
    """
    zig = find_zig()
    if zig is None:
        raise MissingToolsError("missing: ziglang, which compiles for WebAssembly; pip install 'cutjoint[compiler]'")
    sources = [file for file in files if file.endswith(".cpp")]
    headers = [file for file in files if file.endswith(".h")]
    parts = [without_mark(files[file]) for file in (*sources, *headers)]
    key = digest_of([digest, *parts, ask_version((zig, "c++")), *_CXX, *flags, str(_STACK)])
    cached = cache_folder() / f"wasm-{key}" / f"{name}.wasm"

    def make(folder: Path) -> Path:
        for file in (*sources, *headers):
            write_text(folder / file, files[file])
        (folder / "tmp").mkdir()
        for file in sources:
            _call([zig, "c++", *_TARGET, *_CXX, *flags, "-c", file, "-o", f"{file}.o"], folder)
        exports = (f"-Wl,--export={function}" for header in headers for function in _functions(name, files[header]))
        linked = ("-mexec-model=reactor", f"-Wl,-z,stack-size={_STACK}", "-s", *exports)
        _call([zig, "cc", *_TARGET, *(f"{file}.o" for file in sources), "-lm", *linked, "-o", f"{name}.wasm"], folder)
        return folder / f"{name}.wasm"

    find_or_make(cached, make)
    return cached.read_bytes()


def _functions(name: str, header: str) -> list[str]:
    """The functions that a C header declares."""
    declared = re.findall(rf"^[\w ]+[ *]+({name}_\w+)\([^;{{]*\);$", header, re.MULTILINE)
    return sorted(set(declared))


def _call(command: Sequence[str], folder: Path) -> None:
    with tool(command, {**os.environ, "TMPDIR": str(folder / "tmp")}, folder) as process:
        assert process.stdout is not None
        said = process.stdout.read()
        status = process.wait()
    if status:
        errors = [line.strip() for line in said.splitlines() if "error" in line]
        raise ToolchainError(f"zig failed: {'; '.join(errors[:5]) or said[-800:]} (please report this)")


def with_section(module: bytes, content: bytes) -> bytes:
    """A module with a section of ``content`` for its hosts (WebAssembly Core Specification, 5.5.3)."""
    name = SECTION.encode()
    body = _leb(len(name)) + name + content
    return module + b"\0" + _leb(len(body)) + body


def _leb(number: int) -> bytes:
    """A whole number in groups of seven bits, the lowest first."""
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + _leb(rest) if rest else bytes([low])
