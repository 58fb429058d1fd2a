"""The errors of the toolchain."""

from __future__ import annotations


class ToolchainError(RuntimeError):
    """The C++ side is missing something or refused the code, or the cache cannot be written."""
