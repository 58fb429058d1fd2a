"""Pages that follow from the code, and their prose in lines of at most 120 characters."""

import re
from textwrap import fill


def wrapped(page: str) -> str:
    """Markdown with its paragraphs and list items filled anew; code, formulas, tables and headings stay."""
    parts = re.split(r"(^```.*?^```$|^\$\$.*?^\$\$$)", page, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith(("```", "$$")) else _filled(part) for part in parts)


def _filled(text: str) -> str:
    blocks: list[str] = []
    is_open = False
    for line in text.split("\n"):
        is_prose = bool(line) and not line.startswith(("|", "#", "    ", "  - ", "- "))
        if is_prose and is_open and not line.startswith("* "):
            blocks[-1] += f" {line.strip()}"
        else:
            blocks.append(line)
        is_open = is_prose
    return "\n".join(_fill(block) for block in blocks)


def _fill(block: str) -> str:
    if len(block) <= 120 or block.startswith(("|", "#", "    ")):
        return block
    indent = "  " if block.startswith("* ") else ""
    return fill(block, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
