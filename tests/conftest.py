"""Where the tests find models and data; generated code is compiled fast rather than made fast."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"
DATA = ROOT / "tests" / "data"

os.environ.setdefault("CUTJOINT_FLAGS", "-O1")
