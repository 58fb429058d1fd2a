"""Text of foreign origin made safe to print, and the notation of numbers in files, tables and on the command line."""

import re

# Text

MAX_MESSAGE = 300
#: A decimal number without a sign, with an optional exponent, in plain digits and without underscores.
UNSIGNED = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_NUMBER = re.compile(rf"[-+]?{UNSIGNED}", re.ASCII)
_WHOLE = re.compile(r"[-+]?[0-9]+", re.ASCII)


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


# Numbers


def is_number(text: str) -> bool:
    """Return whether a text is a plain decimal number; ``inf``, ``nan``, ``1_000`` and ``0x10`` are none."""
    return _NUMBER.fullmatch(text) is not None


def is_whole(text: str) -> bool:
    """Return whether a text is a whole number in plain digits."""
    return _WHOLE.fullmatch(text) is not None


def read_number(text: str) -> float:
    """The value of a plain decimal number, infinity where it is too large for a float; blanks around it do not count.
    Raises ValueError: the text is no such number."""
    text = text.strip(" \t")
    if not is_number(text):
        raise ValueError(f"'{text}' is not a plain decimal number")
    return float(text)
