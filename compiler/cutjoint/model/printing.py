"""Text of other people made safe to print."""

from __future__ import annotations

MAX_MESSAGE = 300


def escaped(text: str) -> str:
    """Text with control characters, and what no terminal shows, as Python writes them: ``\\x1b``."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def escaped_lines(text: str) -> str:
    """Make each line of a text safe to print; line breaks stay."""
    return "\n".join(map(escaped, text.split("\n")))


def printable(text: str) -> str:
    """Text from a file made safe to print: no control characters, no endless lines."""
    plain = escaped(text[: MAX_MESSAGE + 1])
    return plain if len(plain) <= MAX_MESSAGE else plain[: MAX_MESSAGE - 3] + "..."
