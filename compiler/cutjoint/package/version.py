"""The version of this package, and the mark of a model file in what is generated from it."""

import re
from hashlib import sha256
from importlib.metadata import version

__version__ = version("cutjoint")

_MARK = re.compile(r"( from model '\w+') \(sha256 [0-9a-f]{12}\)")


def origin_of(name: str, text: str) -> str:
    """The version and the model, by its name and the first digits of the digest of its file's text."""
    mark = f" (sha256 {sha256(text.encode()).hexdigest()[:12]})" if text else ""
    return f"cutjoint {__version__} from model '{name}'{mark}"


def without_mark(generated: str) -> str:
    """Generated text without the digest of the model file: models that differ elsewhere share what is compiled."""
    return _MARK.sub(r"\1", generated)
