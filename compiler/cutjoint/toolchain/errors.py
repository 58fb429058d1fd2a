"""The errors of the toolchain."""

from __future__ import annotations

from cutjoint.package.errors import CutjointError


class ToolchainError(CutjointError, RuntimeError):
    """The C++ side is missing something or refused the code, or the cache cannot be written."""


class MissingToolsError(ToolchainError):
    """A tool that makes code is not installed."""
