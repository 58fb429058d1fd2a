"""Folders of a checkout of the repository that studies read and write."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MODELS = ROOT / "models"
DATA = ROOT / "tests" / "data"
#: The folders of measurements in git, and outside of it.
DOCS, RESULTS = ROOT / "docs" / "bench", ROOT / "results"
#: Of the report: `report.summary.summarise`.
SUMMARY = DOCS / "summary.json"
